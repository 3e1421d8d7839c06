#!/usr/bin/env python3
"""Hides effects in recordings of another plant, as a sealed folder for the blind check.

    python3 benches/hide_effects.py ../shared/data/practice hidden/ --seed 1
    raven-diagnose check hidden/

Needs NumPy's, mcap's and PyYAML's Python modules. The practice recordings lie in a folder `shared` beside the repository and are
no part of it. They have `raven_2/raven_state` and `/tip`, by any plant but this project's; their labels say what they hold already. Each effect goes into one without any, into one with one, and some causes that are in no library into others. What
is written here shares nothing with the simulator or the models of the diagnosis: kinematics are rotations by the DH table, and an effect is what it
changes of stamps, pixels, counts or torque. Where it moves the tip, torque is taken out, as the joint's load would have moved with it, and the joint
is where tips show it, not where the nominal model has it.
"""

import argparse
import hashlib
import json
import math
import struct
from pathlib import Path

import numpy as np
import yaml
from mcap.reader import make_reader
from mcap.writer import Writer

JOINTS = ["shoulder", "elbow", "insertion"]
GEAR, CAPSTAN_M = 12.25, 5.675e-3
PULLEY_M = np.array([63.095e-3, 56.2970e-3, 1.0])
HARD_STOP = np.array([0.0, 2.399827721492203, 0.562])
CABLES = np.array([[1.0, 0.0, 0.0], [0.14545, 1.0, 0.0], [0.0077973826, 0.008077387, 1.0]])
ALPHA_12, ALPHA_23, WRIST_M = math.radians(75), math.radians(128), -0.47
MOTORS = [(2.6e-5, 4.0e-3, 1.0e-4), (2.0e-5, 6.8e-3, 1.9e-4), (1.6e-5, 5.9e-3, 2.1e-4)]  # inertia, Coulomb, viscous
COUNTS, TORQUE_PER_STEP = 4000, -2.7057e-4
MOTOR_AT_HARD_STOP = CABLES @ HARD_STOP * GEAR * PULLEY_M / CAPSTAN_M

# ---------------------------------------------------------------------------------------------------------------- kinematics


def turned(axis, angle, points):
    """Points turned about a coordinate axis."""
    a, b = [(1, 2), (2, 0), (0, 1)][axis]
    out = points.copy()
    out[:, a] = np.cos(angle) * points[:, a] - np.sin(angle) * points[:, b]
    out[:, b] = np.sin(angle) * points[:, a] + np.cos(angle) * points[:, b]
    return out


def tip(q, longer_m=0.0, twisted=(0.0, 0.0)):
    """Tips [m, frame 0] of joint positions, one per row."""
    points = np.zeros((len(q), 3))
    points[:, 2] = q[:, 2] + WRIST_M + longer_m
    points = turned(0, ALPHA_23 - twisted[1], turned(2, math.pi / 2, points))
    points = turned(0, ALPHA_12 + twisted[0], turned(2, q[:, 1] + math.pi, points))
    return turned(2, q[:, 0] + math.radians(205), points)


def joints(motors, cables=CABLES, radius=(1.0, 1.0, 1.0), wound_m=0.0):
    """Joint positions of motor angles: rigid cables, `wound_m` more of them taken up than a round capstan takes."""
    travel = ((motors - MOTOR_AT_HARD_STOP) * CAPSTAN_M / GEAR + wound_m) / (PULLEY_M * np.array(radius))
    return HARD_STOP + np.linalg.solve(cables, travel.T).T


def joints_of_tips(points, guess):
    """Joint positions by Newton's steps; not a number where that fails."""
    q = guess.copy()
    for _ in range(8):
        at = tip(q)
        slopes = np.stack([(tip(q + 1e-6 * np.eye(3)[k]) - at) / 1e-6 for k in range(3)], 2)
        q = q + np.linalg.solve(slopes, (points - at)[:, :, None])[:, :, 0]
    q[~(np.abs(q - guess) < 0.2).all(1)] = np.nan
    return q


# ------------------------------------------------------------------------------------------------------------------- cameras


class Rig:
    """Two cameras side by side, as they are believed to be."""

    def __init__(self, path):
        told = yaml.safe_load(path.read_text())
        lens = lambda side: (told[side]["camera_matrix"]["data"], told[side]["distortion_coefficients"]["data"][0])
        self.focal_px = {side: lens(side)[0][0] for side in ("left", "right")}
        self.middle_px = {side: np.array([lens(side)[0][2], lens(side)[0][5]]) for side in ("left", "right")}
        self.k1 = {side: lens(side)[1] for side in ("left", "right")}
        self.height_px = told["left"]["image_height"]
        self.baseline_m = -told["right_from_left"]["translation"][0]
        self.base_from_left = np.array(told["base_from_left"]["rotation"]).reshape(3, 3)
        self.left_in_base = np.array(told["base_from_left"]["translation"])

    def in_left(self, points):
        return (points - self.left_in_base) @ self.base_from_left

    def in_base(self, points):
        return points @ self.base_from_left.T + self.left_in_base

    def pixels(self, side, points):
        """Pixels of points in the left camera's frame."""
        seen = points - np.array([self.baseline_m, 0, 0]) * (side == "right")
        return self.distorted(side, seen[:, :2] / seen[:, 2:])

    def distorted(self, side, rays, k1=0.0):
        """Pixels of rays, with so much more distortion."""
        return rays * (1 + (self.k1[side] + k1) * (rays**2).sum(1, keepdims=True)) * self.focal_px[side] + self.middle_px[side]

    def rays(self, side, pixels):
        distorted = (pixels - self.middle_px[side]) / self.focal_px[side]
        rays = distorted
        for _ in range(30):
            rays = distorted / (1 + self.k1[side] * (rays**2).sum(1, keepdims=True))
        return rays

    def tips(self, left_px, right_px):
        left, right = self.rays("left", left_px), self.rays("right", right_px)
        depth = self.baseline_m / (left[:, 0] - right[:, 0])
        return self.in_base(np.stack([left[:, 0] * depth, (left[:, 1] + right[:, 1]) / 2 * depth, depth], 1))


# ---------------------------------------------------------------------------------------------------------------- recordings


class Recording:
    """Messages of a log, and what effects change of them. Field offsets are those of the definition that log-format.md gives."""

    def __init__(self, path):
        reader = make_reader(path.open("rb"))
        self.summary = reader.get_summary()
        self.messages = [
            [channel.id, m.log_time, m.publish_time, m.sequence, bytearray(m.data), channel.topic] for _, channel, m in reader.iter_messages()
        ]
        self.attachments, self.metadata = list(reader.iter_attachments()), list(reader.iter_metadata())
        self.states = [m for m in self.messages if m[5] == "/ravenstate"]
        self.sights = [m for m in self.messages if m[5] == "/tip"]
        after = lambda data: 16 + struct.unpack_from("<I", data, 12)[0]
        counts = after(self.states[0][4]) + 20 + 24 + 72 + 72 + 24 + 8
        self.at = {"counts": counts, "steps": counts + 64, "torque": counts + 128, "motors": counts + 192, "tip": after(self.sights[0][4]) + 1}
        fields = lambda messages, form, at: np.array([struct.unpack_from(form, m[4], at) for m in messages])
        self.time_s = fields(self.states, "<II", 4) @ [1.0, 1e-9]
        self.counts = fields(self.states, "<3i", self.at["counts"])
        self.steps = fields(self.states, "<3i", self.at["steps"])
        self.torque = fields(self.states, "<3f", self.at["torque"])
        self.motors = np.radians(fields(self.states, "<3f", self.at["motors"]))
        self.seen_s = fields(self.sights, "<II", 4) @ [1.0, 1e-9]
        told = fields(self.sights, "<7d", self.at["tip"])
        self.left_px, self.right_px, self.tips = told[:, :2].copy(), told[:, 2:4].copy(), told[:, 4:].copy()
        self.delay_s = np.zeros(len(self.sights))

    def drive(self, joint, shaft_torque):
        """Asks a motor for more [N m at the shaft]; the message has it after the gear box, and as steps of the converter."""
        self.torque[:, joint] += GEAR * shaft_torque
        self.steps[:, joint] += np.round(GEAR * shaft_torque / TORQUE_PER_STEP).astype(int)

    def write(self, path):
        for k, message in enumerate(self.states):
            struct.pack_into("<3i", message[4], self.at["counts"], *map(int, self.counts[k]))
            struct.pack_into("<3i", message[4], self.at["steps"], *map(int, self.steps[k]))
            struct.pack_into("<3f", message[4], self.at["torque"], *self.torque[k])
            struct.pack_into("<3f", message[4], self.at["motors"], *np.degrees(self.motors[k]))
        for k, message in enumerate(self.sights):
            later = round(1e9 * self.delay_s[k])
            seconds, nanoseconds = struct.unpack_from("<II", message[4], 4)
            struct.pack_into("<II", message[4], 4, *divmod(seconds * 10**9 + nanoseconds + later, 10**9))
            struct.pack_into("<7d", message[4], self.at["tip"], *self.left_px[k], *self.right_px[k], *self.tips[k])
            message[1] += later
            message[2] += later
        with path.open("wb") as file:
            writer = Writer(file)
            writer.start(profile="ros1")
            schemas = {i: writer.register_schema(s.name, s.encoding, s.data) for i, s in self.summary.schemas.items()}
            channels = {
                i: writer.register_channel(c.topic, c.message_encoding, schemas[c.schema_id], c.metadata) for i, c in self.summary.channels.items()
            }
            for channel, log_time, publish_time, sequence, data, _ in sorted(self.messages, key=lambda m: m[1]):
                writer.add_message(channels[channel], log_time, bytes(data), publish_time, sequence)
            for a in self.attachments:
                writer.add_attachment(a.create_time, a.log_time, a.name, a.media_type, a.data)
            for m in self.metadata:
                writer.add_metadata(m.name, m.metadata)
            writer.finish()


class Scene:
    """A recording, late by so much already, with what is needed to change it: by how much tips show the joints off [rad, rad, m], speeds and
    accelerations of the motors [rad/s, rad/s^2]."""

    def __init__(self, recording, rig, late_s):
        self.log, self.rig, self.late_s = recording, rig, late_s
        rigid = joints(self.motors())
        off = joints_of_tips(recording.tips, rigid) - rigid
        about = rigid - rigid.mean(0)
        smooth = np.column_stack([np.ones(len(rigid)), about, about**2, about[:, 0] * about[:, 1]])
        known = np.isfinite(off).all(1)
        self.off = smooth @ np.linalg.lstsq(smooth[known], off[known], rcond=None)[0]
        window = np.hanning(23)[1:-1] / np.hanning(23)[1:-1].sum()
        rate = lambda x: np.gradient(np.stack([np.convolve(np.pad(c, 10, "edge"), window, "valid") for c in x.T], 1), recording.time_s, axis=0)
        self.speed = rate(recording.motors)
        self.acceleration = rate(self.speed)

    def motors(self, later_s=0.0):
        """Motor angles when tips were where they are seen, or later."""
        log = self.log
        return np.stack([np.interp(log.seen_s - self.late_s + later_s, log.time_s, log.motors[:, j]) for j in range(3)], 1)

    def here(self, later_s=0.0):
        """Where tips are seen but for noise, or later [m, left camera]."""
        return self.rig.in_left(tip(joints(self.motors(later_s)) + self.off))

    def moved(self, q, **tool):
        """The joints are elsewhere than a rigid cable has them, and the load with them."""
        self.seen(self.rig.in_left(tip(q + self.off, **tool)) - self.here())
        self.log.torque[:] = np.nan

    def seen(self, by):
        """Tips are seen elsewhere [m, left camera]."""
        here = self.here()
        self.log.left_px += self.rig.pixels("left", here + by) - self.rig.pixels("left", here)
        self.log.right_px += self.rig.pixels("right", here + by) - self.rig.pixels("right", here)
        self.log.tips += by @ self.rig.base_from_left.T

    def pictured(self, left_px=0.0, right_px=0.0):
        """Pixels are elsewhere, and tips where the believed cameras then see them."""
        before = self.rig.tips(self.log.left_px, self.log.right_px)
        self.log.left_px += left_px
        self.log.right_px += right_px
        self.log.tips += self.rig.tips(self.log.left_px, self.log.right_px) - before

    def pixels_later(self, side, later_s):
        """What pixels change within a time."""
        return self.rig.pixels(side, self.here(later_s)) - self.rig.pixels(side, self.here())


# ------------------------------------------------------------------------------------------------------------------- effects
# Each changes a scene by a size that it draws, and tells the joint and the size as effects.md orders its numbers.


def log_uniform(rng, least, most):
    return float(np.exp(rng.uniform(np.log(least), np.log(most))))


def either_sign(rng, least, most):
    return float(rng.choice([-1, 1])) * log_uniform(rng, least, most)


def vector(rng, least, most):
    direction = rng.normal(size=3)
    return log_uniform(rng, least, most) * direction / np.linalg.norm(direction)


def at_joint(rng, revolute, prismatic, draw=either_sign):
    joint = int(rng.integers(3))
    return joint, draw(rng, *(prismatic if joint == 2 else revolute))


def pulley_radius(scene, rng):
    joint, error = at_joint(rng, (0.01, 0.07), (0.01, 0.07))
    radius = np.ones(3)
    radius[joint] += error
    scene.moved(joints(scene.motors(), radius=radius))
    return JOINTS[joint], error


def joint_offset(scene, rng):
    joint, offset = at_joint(rng, (math.radians(0.3), math.radians(2.5)), (1e-3, 4e-3))
    scene.moved(joints(scene.motors()) + offset * np.eye(3)[joint])
    return JOINTS[joint], offset


def cable_coupling(scene, rng):
    by, of = [(0, 1), (0, 2), (1, 2)][rng.integers(3)]
    cables = CABLES.copy()
    error = either_sign(rng, *((0.002, 0.01) if of == 2 else (0.01, 0.05)))
    cables[of, by] += error
    scene.moved(joints(scene.motors(), cables=cables))
    return f"{JOINTS[by]}->{JOINTS[of]}", error


def hysteresis(scene, rng):
    """Bouc and Wen's loop with n = 1, between capstan and cable: the joints that other cables are led over move with this one."""
    joint, half = at_joint(rng, (math.radians(0.2), math.radians(1.5)), (0.5e-3, 2e-3), log_uniform)
    length = 1.5 * half
    lag = np.zeros(len(scene.log.time_s))
    travel = (joints(scene.log.motors) - HARD_STOP) @ CABLES[joint]
    for k, step in enumerate(np.diff(travel)):
        lag[k + 1] = np.clip(lag[k] + half / length * (step - lag[k] / half * abs(step)), -half, half)
    lag = np.interp(scene.log.seen_s - scene.late_s, scene.log.time_s, lag)
    scene.moved(joints(scene.motors()) - np.outer(lag, np.linalg.inv(CABLES)[:, joint]))
    return JOINTS[joint], [half, length]


def pulley_eccentricity(scene, rng):
    """r_mc + e sin(q_mc + p): what it winds is the integral of it."""
    joint, size, phase = int(rng.integers(3)), log_uniform(rng, 0.05e-3, 1e-3), float(rng.uniform(0, math.tau))
    wound = lambda motors: -size * np.cos(motors[..., joint] / GEAR + phase)
    scene.moved(joints(scene.motors(), wound_m=np.outer(wound(scene.motors()) - wound(MOTOR_AT_HARD_STOP), np.eye(3)[joint])))
    return JOINTS[joint], [size, phase]


def tool_length(scene, rng):
    longer = either_sign(rng, 1e-3, 6e-3)
    scene.moved(joints(scene.motors()), longer_m=longer)
    return None, longer


def link_angle(scene, rng):
    which, error = int(rng.integers(2)), either_sign(rng, math.radians(0.5), math.radians(2))
    scene.moved(joints(scene.motors()), twisted=error * np.eye(2)[which])
    return ["12", "23"][which], error


def missed_counts(scene, rng):
    joint, counts, at = int(rng.integers(3)), round(either_sign(rng, 500, 5000)), float(rng.uniform(0.15, 0.85))
    after = slice(int(at * len(scene.log.time_s)), None)
    scene.log.motors[after, joint] += math.tau * counts / COUNTS
    scene.log.counts[after, joint] -= counts
    return JOINTS[joint], [counts, at]


def time_offset(scene, rng):
    delay = either_sign(rng, 5e-3, 150e-3)
    scene.log.delay_s += delay
    return None, delay


def clock_drift(scene, rng):
    rate = either_sign(rng, 50e-6, 1000e-6)
    scene.log.delay_s += rate * (scene.log.seen_s - scene.log.seen_s[0])
    return None, rate


def stereo_desync(scene, rng):
    delay = either_sign(rng, 2e-3, 16.6e-3)
    scene.pictured(right_px=scene.pixels_later("right", -delay))
    return None, delay


def rolling_shutter(scene, rng):
    readout = log_uniform(rng, 10e-3, 60e-3)
    later = lambda pixels: readout * ((pixels[:, 1] + 0.5) / scene.rig.height_px - 0.5)
    left, right = (scene.pixels_later(side, later(px)) for side, px in (("left", scene.log.left_px), ("right", scene.log.right_px)))
    scene.pictured(left, right)
    return None, readout


def camera_rotation(scene, rng):
    """The rig turned about the tip at the hard stop."""
    turn = vector(rng, math.radians(0.5), math.radians(2))
    angle, axis = np.linalg.norm(turn), turn / np.linalg.norm(turn)
    cross = np.cross(np.eye(3), axis)
    rotation = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
    pivot = scene.rig.in_left(tip(HARD_STOP[None]))
    from_pivot = scene.here() - pivot
    scene.seen(from_pivot @ rotation - from_pivot)
    return None, turn.tolist()


def camera_translation(scene, rng):
    """The rig shifted: what it sees is shifted the other way."""
    shift = vector(rng, 1e-3, 6e-3)
    scene.seen(np.tile(shift, (len(scene.log.tips), 1)))
    return None, (-shift).tolist()


def stereo_scale(scene, rng):
    error = either_sign(rng, 0.005, 0.03)
    here = scene.here()
    scene.seen(here / (1 + error) - here)
    return None, error


def lens_distortion(scene, rng):
    k1 = either_sign(rng, 0.02, 0.15)
    more = lambda side, pixels: scene.rig.distorted(side, scene.rig.rays(side, pixels), k1) - pixels
    scene.pictured(more("left", scene.log.left_px), more("right", scene.log.right_px))
    return None, k1


def torque_constant(scene, rng):
    joint, factor = int(rng.integers(3)), 1 + either_sign(rng, 0.05, 0.25)
    scene.log.drive(joint, scene.log.torque[:, joint] / GEAR * (1 / factor - 1))
    return JOINTS[joint], factor


def torque_ripple(scene, rng):
    joint, size, per_turn = int(rng.integers(3)), either_sign(rng, 0.5e-3, 4e-3), int(rng.integers(1, 13))
    scene.log.drive(joint, -size * np.sin(per_turn * scene.log.motors[:, joint]))
    return JOINTS[joint], [size, per_turn]


def motor_coulomb_friction(scene, rng):
    joint, factor = int(rng.integers(3)), log_uniform(rng, 1.4, 3)
    scene.log.drive(joint, (factor - 1) * MOTORS[joint][1] * np.tanh(scene.speed[:, joint] / 0.3))
    return JOINTS[joint], factor


def motor_viscous_friction(scene, rng):
    joint, factor = int(rng.integers(3)), log_uniform(rng, 2, 8)
    scene.log.drive(joint, (factor - 1) * MOTORS[joint][2] * scene.speed[:, joint])
    return JOINTS[joint], factor


def motor_inertia(scene, rng):
    joint, factor = int(rng.integers(3)), log_uniform(rng, 2, 4)
    scene.log.drive(joint, (factor - 1) * MOTORS[joint][0] * scene.acceleration[:, joint])
    return JOINTS[joint], factor


def stribeck_friction(scene, rng):
    joint, depth, speed = int(rng.integers(3)), log_uniform(rng, 0.2, 1), scene.speed
    scene.log.drive(joint, MOTORS[joint][1] * depth * np.exp(-((speed[:, joint] / 5.0) ** 2)) * np.tanh(speed[:, joint] / 0.3))
    return JOINTS[joint], [depth, 5.0]


def bumped_cameras(scene, rng):
    """Outside the library: the rig is pushed once, and stays there."""
    after = scene.log.seen_s > scene.log.seen_s[0] + float(rng.uniform(0.3, 0.7)) * np.ptp(scene.log.seen_s)
    shift = vector(rng, 2e-3, 6e-3)
    scene.seen(np.outer(after, shift))
    return None, shift.tolist()


def swaying_cameras(scene, rng):
    """Outside the library: the rig's post sways."""
    shift, period_s = vector(rng, 0.7e-3, 3e-3), float(rng.uniform(2, 9))
    scene.seen(np.outer(np.sin(math.tau * scene.log.seen_s / period_s), shift))
    return None, [*shift.tolist(), period_s]


def wandering_torque(scene, rng):
    """Outside the library: a drive's zero wanders."""
    joint, size, period_s = int(rng.integers(3)), log_uniform(rng, 2e-3, 6e-3), float(rng.uniform(4, 12))
    scene.log.drive(joint, size * np.sin(math.tau * scene.log.time_s / period_s))
    return JOINTS[joint], [size, period_s]


IN_LIBRARY = [
    pulley_radius, joint_offset, cable_coupling, hysteresis, pulley_eccentricity, tool_length, link_angle, missed_counts, time_offset, clock_drift,
    stereo_desync, rolling_shutter, camera_rotation, camera_translation, stereo_scale, lens_distortion, torque_constant, torque_ripple,
    motor_coulomb_friction, motor_viscous_friction, motor_inertia, stribeck_friction,
]  # fmt: skip
OUTSIDE = [bumped_cameras, swaying_cameras, wandering_torque]
MOVES_JOINTS = IN_LIBRARY[:7]
ONLY_TORQUE = {"motor-coulomb-friction"}


def name_of(effect):
    return effect.__name__.replace("_", "-")


def hide(practice, folder, seed):
    rng = np.random.default_rng(seed)
    known = json.loads((practice / "labels.json").read_text())
    empty, single = ([case for case, label in known.items() if len(label["effects"]) == count] for count in (0, 1))
    rig = Rig(practice / "cameras.yaml")
    # An effect beside itself, or beside one that only the torque shows where torque is taken out, is none.
    ids = lambda case: {effect["id"] for effect in known[case]["effects"]}
    fits = lambda effect, case: name_of(effect) not in ids(case) and not (effect in MOVES_JOINTS and ids(case) & ONLY_TORQUE)
    cases = [(str(rng.choice(empty)), effect) for effect in IN_LIBRARY + OUTSIDE]
    cases += [(str(rng.choice([case for case in single if fits(effect, case)])), effect) for effect in IN_LIBRARY]
    labels = {}
    folder.mkdir(parents=True)
    for number, k in enumerate(rng.permutation(len(cases)), 1):
        base, effect = cases[k]
        recording = Recording(practice / f"{base}.mcap")
        late_s = sum(known_effect["magnitude"] for known_effect in known[base]["effects"] if known_effect["id"] == "time-offset")
        joint, magnitude = effect(Scene(recording, rig, late_s), rng)
        name = f"h{number:02d}"
        recording.write(folder / f"{name}.mcap")
        labels[name] = {"case": name, "effects": [*known[base]["effects"], {"id": name_of(effect), "joint": joint, "magnitude": magnitude}]}
    text = json.dumps(labels, indent=1)
    (folder / "labels.json").write_text(text)
    (folder / "labels.sha256").write_text(f"{hashlib.sha256(text.encode()).hexdigest()}  labels.json\n")
    (folder / "cameras.yaml").write_bytes((practice / "cameras.yaml").read_bytes())


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("practice", type=Path, help="folder with recordings, labels.json and cameras.yaml")
    parser.add_argument("folder", type=Path, help="folder to make")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    hide(arguments.practice, arguments.folder, arguments.seed)
