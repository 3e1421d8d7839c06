#!/usr/bin/env python3
"""Holds the sizes that would have shown (`minimum_detectable`) against simulations of these sizes.

    cargo build --release --workspace
    python3 benches/smallest_sizes.py raven/robots/raven2-gold.yaml FOLDER [--seed 901] [EFFECT[:JOINT]...]

Diagnoses a recording without an effect, and the same with each effect at the size that it says would have shown, at 1.5 and at 2 times that; factors
to that power, and limits, which do more the smaller they are, over it. Without effects named here, those of the table in docs/diagnosis.md.
"""

import argparse
import json
import pathlib
import subprocess

EFFECTS = [
    "cable-stretch:shoulder", "cable-stretch:insertion", "backlash:shoulder", "backlash:elbow", "hysteresis:shoulder", "hysteresis:elbow",
    "hysteresis:insertion", "creep:elbow", "missed-counts:elbow",
]  # fmt: skip
FACTORS = {
    "cable-stretch", "cable-damping", "link-coulomb-friction", "link-viscous-friction", "link-inertia", "motor-coulomb-friction",
    "motor-viscous-friction", "motor-inertia", "torque-constant",
}  # fmt: skip
LIMITS = {"torque-saturation", "cable-stiffening"}
TIMES = [1.0, 1.5, 2.0]


def run(program, *arguments):
    subprocess.run([f"target/release/{program}", *map(str, arguments)], check=True, stdout=subprocess.DEVNULL)


def diagnosed(folder, robot, seed, effect=None):
    log, report, cameras = (folder / name for name in ("recording.mcap", "report.json", "cameras.yaml"))
    hidden = ["--effect", effect] if effect else []
    motion = ["--motion", "rich", "--duration", 50, "--off-nominal", 0.7, "--seed", seed]
    run("raven-capture", "simulate", *motion, "--robot", robot, "--cameras-out", cameras, *hidden, "-o", log)
    run("raven-diagnose", log, "--robot", robot, "--cameras", cameras, "--json", report)
    return json.loads(report.read_text())


def at_times(name, size, times):
    if name in FACTORS:
        return size**times
    return size / times if name in LIMITS else size * times


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("robot", type=pathlib.Path)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("effects", nargs="*")
    parser.add_argument("--seed", type=int, default=901)
    told = parser.parse_args()
    told.folder.mkdir(parents=True, exist_ok=True)
    smallest = {}
    for least in diagnosed(told.folder, told.robot, told.seed)["minimum_detectable"]:
        place = f":{least['joint']}" if least["joint"] else ""
        smallest[least["id"] + place] = least["size"]
    for effect in told.effects or EFFECTS:
        name = effect.partition(":")[0]
        for times in TIMES:
            size = at_times(name, smallest[effect], times)
            report = diagnosed(told.folder, told.robot, told.seed, f"{effect}={size!r}")
            found = [f"{of['id']}:{of['joint']} {of['probability']:.2f}" for of in report["effects"]]
            print(f"{effect:<28} {times:3.1f} {size:10.4g}  {report['verdict']:<17} {', '.join(found)}", flush=True)


if __name__ == "__main__":
    main()
