//! What a session hides, drawn from its seed alone, and the file that tells it afterwards.

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use serde_json::{Value, json};

use super::effect::{Effect, EffectKind};
use super::listed::listed;
use super::machine::Machine;
use super::off_nominal::deviations;
use super::options::Options;
use super::outside::Outside;
use super::rig::Rig;
use super::shutter::Delays;
use crate::camera::Pinhole;
use crate::observation::TipCorrection;
use crate::robot::{KinematicsKind, Robot};
use crate::{Error, Result};

/// Radius of the marker [m].
pub const MARKER_RADIUS_M: f64 = 0.005;

/// What is hidden beyond the effects asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Hidden {
    /// Nothing but noise.
    #[default]
    None,
    /// What a lab finds: a shoulder pulley off by several percent, soft cables, hysteresis, late images.
    Lab,
}

impl std::str::FromStr for Hidden {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "none" => Ok(Self::None),
            "lab" => Ok(Self::Lab),
            _ => Err(Error::Argument(format!("--hidden `{text}` is not known; there are none and lab."))),
        }
    }
}

/// What is true of a session.
#[derive(Debug, Clone)]
pub struct Truth {
    /// Everything follows from it.
    pub seed: u64,
    /// Preset.
    pub hidden: Hidden,
    /// The preset's effects and those asked for.
    pub effects: Vec<Effect>,
    /// How far the numbers of the robot file and the rig are off within their tolerances.
    pub deviations: Vec<Effect>,
    /// A cause outside the library of effects.
    pub outside: Option<Outside>,
    /// The robot as it is.
    pub machine: Machine,
    /// The cameras as they are, and as they are believed to be; `None` on a bench.
    pub rig: Option<Rig>,
    /// Delays of the images.
    pub delays: Delays,
    /// What the encoders read at the hard stop.
    pub zero_counts: [i32; 3],
}

/// A stream of random numbers of its own for every purpose: what one part draws does not move the others.
#[must_use]
pub fn stream(seed: u64, purpose: &str) -> ChaCha8Rng {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    // FNV-1a, 64 bits.
    let stream = purpose.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |h, byte| (h ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3));
    rng.set_stream(stream);
    rng
}

impl Truth {
    /// Draws what is true of a robot's session.
    ///
    /// # Errors
    /// If an effect does not fit the robot.
    pub fn draw(robot: &Robot, options: &Options) -> Result<Self> {
        let Options { seed, hidden, .. } = *options;
        let mut effects = match hidden {
            Hidden::None => Vec::new(),
            Hidden::Lab => lab_effects(robot, &mut stream(seed, "lab"))?,
        };
        effects.extend_from_slice(&options.effects);
        let deviations = deviations(robot, options.off_nominal, &effects, &mut stream(seed, "off nominal"));
        let departures = [&listed(robot)?[..], &effects[..], &deviations[..]].concat();
        let mut machine = Machine::new(robot, &departures)?;
        if let Some(outside) = &options.outside {
            machine = machine.with_outside(robot, outside)?;
        }
        let rig = match &robot.kinematics {
            KinematicsKind::Raven(kinematics) => {
                let arm = robot.arm()?;
                let hard_stop_m = kinematics.forward(&arm.hard_stop);
                let drawn = || Rig::draw(kinematics.arm, &mut stream(seed, "rig"));
                let believed = options.cameras.clone().unwrap_or_else(drawn);
                Some(Rig::bent(believed, &hard_stop_m, &TipCorrection::new(&arm, &robot.observation), &departures))
            }
            KinematicsKind::Bench => None,
        };
        let mut encoders = stream(seed, "encoders");
        let zero_counts = std::array::from_fn(|_| encoders.random_range(-50_000..50_000));
        let delays = Delays::of(&robot.observation, &departures);
        Ok(Self { seed, hidden, effects, deviations, outside: options.outside.clone(), machine, rig, delays, zero_counts })
    }

    /// The truth as a file tells it. Lengths in m, angles in rad, times in s.
    #[must_use]
    pub fn to_json(&self, robot: &Robot) -> Value {
        let per_joint = |value: &dyn Fn(usize) -> f64| -> Value {
            robot
                .joints
                .iter()
                .take(3)
                .enumerate()
                .map(|(j, joint)| (joint.name.clone(), json!(value(j))))
                .collect::<serde_json::Map<_, _>>()
                .into()
        };
        let drives = &self.machine.drives;
        let motor_at_hard_stop = match &robot.kinematics {
            KinematicsKind::Raven(_) => robot.arm().map(|arm| arm.transmission.motor_at_hard_stop),
            KinematicsKind::Bench => robot.bench_transmission().map(|transmission| transmission.motor_at_hard_stop),
        };
        let mut truth = json!({
            "format": "raven-truth/1",
            "seed": self.seed,
            "hidden": self.hidden,
            "effects": self.effects,
            "off_nominal": self.deviations,
            "outside": self.outside.as_ref().map(Outside::to_json),
            "link_pulley_radius_m": per_joint(&|j| drives[j].pulley_m),
            "cable_stiffness_n": per_joint(&|j| drives[j].stiffness_n),
            "hysteresis_half": per_joint(&|j| (drives[j].hysteresis_m.half_loop + drives[j].play_half_m) / drives[j].pulley_m),
            "hard_stop": per_joint(&|j| self.machine.hard_stop[j]),
            "motor_at_hard_stop_rad": per_joint(&|j| motor_at_hard_stop.as_ref().map_or(0.0, |motor| motor[j])),
            "latency_s": self.delays.latency_s,
            "right_minus_left_s": self.delays.right_minus_left_s,
            "marker_radius_m": MARKER_RADIUS_M,
        });
        if let Some(rig) = &self.rig {
            let pose = |pose: &nalgebra::Isometry3<f64>| {
                let rotation = pose.rotation.to_rotation_matrix().into_inner().transpose();
                json!({"rotation": rotation.as_slice(), "translation": pose.translation.vector.as_slice()})
            };
            let lens = |c: &Pinhole| json!({"fx": c.fx, "fy": c.fy, "cx": c.cx, "cy": c.cy, "distortion": c.distortion});
            truth["cameras"] = json!({
                "left": lens(&rig.actual.left),
                "right": lens(&rig.actual.right),
                "right_from_left": pose(&rig.actual.right_from_left),
                "base_from_left": rig.actual.base_from_left.as_ref().map(pose),
            });
        }
        truth
    }
}

/// The preset `lab`.
fn lab_effects(robot: &Robot, rng: &mut impl Rng) -> Result<Vec<Effect>> {
    let [shoulder, elbow, insertion] = robot.joints.as_slice() else {
        return Err(Error::Argument(format!("--hidden lab is a Raven's; robot `{}` has {} joints.", robot.name, robot.joints.len())));
    };
    let mut draw = |low: f64, high: f64| rng.random_range(low..high);
    let radius = -draw(0.03, 0.07);
    Ok(vec![
        Effect::new(EffectKind::PulleyRadius, Some(&shoulder.name), &[radius])?,
        Effect::new(EffectKind::CableStretch, Some(&elbow.name), &[draw(0.12, 0.35)])?,
        Effect::new(EffectKind::CableStretch, Some(&insertion.name), &[draw(0.12, 0.35)])?,
        Effect::new(EffectKind::Hysteresis, Some(&insertion.name), &[draw(0.0008, 0.0015)])?,
        Effect::new(EffectKind::TimeOffset, None, &[draw(0.010, 0.020)])?,
        Effect::new(EffectKind::StereoDesync, None, &[draw(0.001, 0.002)])?,
    ])
}
