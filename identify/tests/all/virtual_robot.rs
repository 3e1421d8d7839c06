//! Robots whose numbers are known, and what cameras would see of them.

use nalgebra::{DVector, Matrix3, Rotation3, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use raven::camera::Quality;
use raven::observation::TipCorrection;
use raven::robot::{LinkModel, MotorTrack, Robot, nominal};
use raven_identify::batch::Estimate;
use raven_identify::motion::Motion;
use raven_identify::parameters::Selection;
use raven_identify::priors::{self, Unknown};
use raven_identify::problem::Problem;
use raven_identify::session::{Session, Sighting};

const RATE_HZ: f64 = 200.0;
const CAMERA_HZ: f64 = 10.0;
const BLOCK_S: f64 = 2.0;

/// The motors of a controller with the nominal numbers, on slow sines about `centre`.
pub fn motion(duration_s: f64, centre: Vector3<f64>, amplitude: Vector3<f64>) -> Motion {
    along(duration_s, centre, amplitude, |t| t)
}

/// The same, standing still for two of every four seconds.
pub fn halting(duration_s: f64, centre: Vector3<f64>, amplitude: Vector3<f64>) -> Motion {
    along(duration_s, centre, amplitude, |t| 2.0 * (t / 4.0).floor() + (t % 4.0).min(2.0))
}

/// On sines whose time is `path_s` [s] of the recording's.
fn along(duration_s: f64, centre: Vector3<f64>, amplitude: Vector3<f64>, path_s: impl Fn(f64) -> f64) -> Motion {
    let transmission = nominal::gold().arm().unwrap().transmission;
    let time_s: Vec<f64> = (0..(duration_s * RATE_HZ) as usize).map(|i| i as f64 / RATE_HZ).collect();
    let swing = |t: f64| Vector3::new((0.9 * t).sin(), (0.7 * t).sin(), (0.5 * t).sin());
    let joint = |t: f64| centre + amplitude.component_mul(&swing(path_s(t)));
    let angle = time_s.iter().map(|&t| transmission.motor_from_joint(&joint(t))).collect();
    Motion::new(MotorTrack { time_s, angle }, 0.02).unwrap()
}

pub const MIDDLE: Vector3<f64> = Vector3::new(0.8, 1.6, 0.33);
pub const WIDE: Vector3<f64> = Vector3::new(0.45, 0.4, 0.06);

/// A tip seen along frame 0's y axis: 0.1 mm across, 1.5 mm in depth.
pub fn covariance() -> Matrix3<f64> {
    let tilted = Rotation3::from_euler_angles(0.1, 0.0, 0.2);
    tilted * Matrix3::from_diagonal(&Vector3::new(1e-8, 2.25e-6, 1e-8)) * tilted.inverse()
}

/// What the cameras see of a robot, with white noise and, in every block, `alike` of it that is common.
pub fn session(truth: &Robot, motion: &Motion, random: &mut ChaCha8Rng, alike: f64) -> Session {
    let arm = truth.arm().unwrap();
    let (kinematics, correction) = (arm.kinematics, TipCorrection::new(&arm, &truth.observation));
    let factor = covariance().cholesky().unwrap().l();
    let [start, end] = motion.span_s();
    let stamps = (0..((end - start) * CAMERA_HZ) as usize).map(|i| start + (i as f64 + 0.5) / CAMERA_HZ);
    let stamps: Vec<f64> = stamps.filter(|t| motion.covers(t - 0.1, t + 0.1)).collect();
    let shown: Vec<f64> = stamps.iter().map(|&t| correction.shown_at_s(t)).collect();
    let winding = arm.winding(motion.track()).into_owned();
    let links = LinkModel::new(arm).rollout_gripped(&winding, &shown);
    let mut normal = || factor * Vector3::from_fn(|_, _| StandardNormal.sample(random));
    let mut common = normal();
    let mut sightings = Vec::new();
    for (i, (&time_s, state)) in stamps.iter().zip(links).enumerate() {
        if i % (BLOCK_S * CAMERA_HZ) as usize == 0 {
            common = normal();
        }
        let Some(state) = state else { continue };
        let seen = correction.seen_m(&kinematics.forward(&state.position)) + normal() + alike * common;
        sightings.push(Sighting::new(time_s, seen, &covariance()).unwrap());
    }
    Session { name: "simulated.mcap".to_owned(), sha256: "00".to_owned(), motion: motion.clone(), sightings }
}

pub struct Case {
    pub robot: Robot,
    pub unknowns: Vec<Unknown>,
}

impl Case {
    pub fn new(parameters: &[&str]) -> Self {
        let robot = nominal::gold();
        let names: Vec<String> = parameters.iter().map(|s| (*s).to_owned()).collect();
        let selection = if names.is_empty() { Selection::default() } else { Selection::named(&names).unwrap() };
        let unknowns = priors::unknowns(&robot, &selection, &Quality::default()).unwrap();
        Self { robot, unknowns }
    }

    /// The robot at `z`; its encoders were set by the nominal numbers.
    pub fn truth(&self, z: &DVector<f64>) -> Robot {
        Problem::new(&self.robot, &self.unknowns, &[]).unwrap().robot(z)
    }

    /// The same with every number of the file that moves the tip, and that nobody asked for, off within its tolerance.
    pub fn within_tolerances(&self, truth: &Robot, random: &mut ChaCha8Rng) -> Robot {
        let mut robot = truth.clone();
        let t = &self.robot.tolerances;
        let factor = |key: &str, tolerance: f64| (key.to_owned(), true, tolerance);
        let offset = |key: &str, tolerance: f64| (key.to_owned(), false, tolerance);
        let mut numbers = vec![
            offset("kinematics.link_angle_12", t.link_angle_rad),
            offset("kinematics.link_angle_23", t.link_angle_rad),
            offset("kinematics.wrist_offset", t.tool_length_m),
            offset("cable_coupling.shoulder.elbow", t.cable_coupling),
            offset("cable_coupling.shoulder.insertion", t.cable_coupling / 3.0),
            offset("cable_coupling.elbow.insertion", t.cable_coupling / 3.0),
        ];
        for joint in &self.robot.joints {
            let key = |number: &str| format!("joints.{}.{number}", joint.name);
            numbers.extend([
                factor(&key("link_pulley_radius"), t.radius),
                offset(&key("hard_stop"), t.hard_stop_of(joint.kind)),
                factor(&key("cable.stiffness"), t.stiffness),
                factor(&key("cable.damping"), t.damping),
                factor(&key("link_friction.coulomb"), t.link_friction),
                factor(&key("link_friction.viscous"), t.link_friction),
            ]);
        }
        numbers.retain(|(key, ..)| self.unknowns.iter().all(|unknown| unknown.key != *key));
        for (key, is_factor, tolerance) in numbers {
            let normal: f64 = StandardNormal.sample(random);
            let number = robot.value_mut(&key).unwrap();
            *number = if is_factor { *number * (tolerance * normal).exp() } else { *number + tolerance * normal };
        }
        robot
    }

    pub fn estimate(&self, sessions: &[Session]) -> Estimate {
        Problem::new(&self.robot, &self.unknowns, sessions).unwrap().estimate().unwrap()
    }

    pub fn index(&self, name: &str) -> usize {
        self.unknowns.iter().position(|u| u.quantity.name() == name).unwrap()
    }

    pub fn at(&self, values: &[(&str, f64)]) -> DVector<f64> {
        let mut z = DVector::zeros(self.unknowns.len());
        for &(name, value) in values {
            let k = self.index(name);
            z[k] = self.unknowns[k].z(value);
        }
        z
    }
}

/// Whether the truth of robots drawn from the prior lies within one and two deviations that `estimate` claims as often as it should: three
/// binomial deviations.
pub fn assert_covered(case: &Case, names: &[&str], samples: u64, estimate: impl Fn(&Robot, &mut ChaCha8Rng) -> Estimate) {
    let mut inside = vec![[0_u32; 2]; names.len()];
    for seed in 0..samples {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let z = DVector::from_fn(case.unknowns.len(), |_, _| StandardNormal.sample(&mut random));
        // A latency of several tenths of a second would leave the log.
        let z = z.map_with_location(|k, _, v: f64| if k == case.index("latency") { 0.3 * v } else { v });
        let estimate = estimate(&case.truth(&z), &mut random);
        for (name, counts) in names.iter().zip(&mut inside) {
            let k = case.index(name);
            let off = (estimate.z[k] - z[k]).abs() / estimate.std[k];
            counts[0] += u32::from(off < 1.0);
            counts[1] += u32::from(off < 2.0);
        }
    }
    for (name, counts) in names.iter().zip(inside) {
        for (count, nominal) in counts.into_iter().zip([0.6827, 0.9545]) {
            let (expected, deviation) = (nominal * samples as f64, (nominal * (1.0 - nominal) * samples as f64).sqrt());
            assert!((f64::from(count) - expected).abs() < 3.0 * deviation, "{name}: {count} of {samples} inside, expected {expected:.0}");
        }
    }
}
