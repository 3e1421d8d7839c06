//! Registration from motion: pose, latency and the cameras' offset with the robot's own numbers free within what is known of them.
//!
//! The tip that the cameras see is that of the robot's kinematics, `p = fk(q)`, up to the pose of the cameras. But a robot's radii are off by
//! percents, its cables stretch, its friction lags: a pose fitted to nominal kinematics turns to make up for them, by degrees with 5 % on
//! one radius, and claims a quarter of one. So everything that moves the tip as a pose would is estimated along, each with its prior:
//!
//! ```text
//! radii            10 %                      cables, friction   a factor of three
//! hysteresis       0.5 deg, 1 mm             latency            0.1 s
//! hard stops       the robot file's tolerance, and what homing may stretch
//! couplings, and every other number of the robot file that moves the tip      the robot file's tolerances
//! rotation         how well the mount is set         translation   the hard stop's registration
//! disparity        what the calibration leaves unknown, constant over the image; scale likewise; the offset as the epipolar lines have it
//! ```
//!
//! What a motion cannot tell apart stays as wide as the prior: a shoulder's hard stop and a turn of the cameras about the same axis are one.
//! Solver, misfit of each joint and blocks of alike residuals are those of `raven-identify`.

use nalgebra::{DMatrix, Isometry3, Matrix3, Rotation3, SMatrix, Translation3, UnitQuaternion, Vector3};
use raven::camera::{Cameras, Quality};
use raven::robot::{Observation, Robot};
use raven::{Error, Result};
use raven_identify::parameters::{Quantity, Selection};
use raven_identify::priors::{self, Unknown};
use raven_identify::problem::{Flaw, Problem};
use raven_identify::session::Session;
use raven_identify::systematic::Systematic;

use crate::desync::{Desync, desync};
use crate::hard_stop::HOMING_STRETCH;
use crate::moving::{Moving, Taken};

/// Fewest sightings to register from.
const FEWEST: usize = 60;
/// Standard deviation of the offset between the cameras where nothing shows it [s].
const OFFSET_STD_S: f64 = 0.03;

/// What is known before the motion.
#[derive(Debug, Clone, Copy)]
pub struct Before {
    /// `x_0 = R x_left + t`, roughly.
    pub base_from_left: Isometry3<f64>,
    /// Standard deviations of the rotation about the axes of frame 0 [rad].
    pub rotation_std_rad: [f64; 3],
    /// Of where the tip at the hard stop is seen, frame 0 [m].
    pub translation_std_m: [f64; 3],
}

/// What the motion says.
#[derive(Debug, Clone)]
pub struct FromMotion {
    /// `x_0 = R x_left + t`.
    pub base_from_left: Isometry3<f64>,
    /// Covariance of rotation [rad] and shift [m] about the tip at the hard stop, frame 0.
    pub covariance: SMatrix<f64, 6, 6>,
    /// Latency and its standard deviation [s].
    pub latency_s: [f64; 2],
    /// By how much more a right image shows the past than a left one, and its standard deviation [s].
    pub right_minus_left_s: [f64; 2],
    /// By how much the motion moves the tip at the hard stop from where it was registered before, frame 0 [m].
    pub moved_m: Vector3<f64>,
    /// Mean of the tips seen, frame 0 [m].
    pub middle_m: Vector3<f64>,
    /// The robot's numbers along the way: name, value, standard deviation, value before.
    pub robot: Vec<(String, f64, f64, f64)>,
    /// Standard deviation of what each joint does beyond the model [rad, rad, m].
    pub misfit: Vector3<f64>,
    /// Sightings used.
    pub sightings: usize,
}

impl FromMotion {
    /// Standard deviations of where the tip at `point_m` is seen, frame 0 [m].
    #[must_use]
    pub fn std_at(&self, point_m: &Vector3<f64>, hard_stop_m: &Vector3<f64>) -> [f64; 3] {
        let mut slope = SMatrix::<f64, 3, 6>::zeros();
        slope.fixed_view_mut::<3, 3>(0, 0).copy_from(&-(point_m - hard_stop_m).cross_matrix());
        slope.fixed_view_mut::<3, 3>(0, 3).copy_from(&Matrix3::identity());
        let covariance = slope * self.covariance * slope.transpose();
        [0, 1, 2].map(|i| covariance[(i, i)].sqrt())
    }

    /// Standard deviations of the rotation about the axes of frame 0 [rad].
    #[must_use]
    pub fn rotation_std_rad(&self) -> [f64; 3] {
        [0, 1, 2].map(|i| self.covariance[(i, i)].sqrt())
    }
}

/// Registers cameras from moving recordings.
///
/// # Errors
/// If the marker was seen too rarely, a recording has no motors, or the estimation does not settle.
pub fn register(robot: &Robot, cameras: &Cameras, before: &Before, recordings: &[Moving]) -> Result<FromMotion> {
    let offset = offset(cameras, recordings);
    let taken: Vec<Taken> =
        recordings.iter().map(|moving| moving.take(cameras, &before.base_from_left, offset.right_minus_left_s)).collect::<Result<_>>()?;
    let sightings: usize = taken.iter().map(|taken| taken.session.sightings.len()).sum();
    if sightings < FEWEST {
        let frames: usize = recordings.iter().map(|moving| moving.frames).sum();
        return Err(Error::Data(format!(
            "both cameras saw the marker in {sightings} of {frames} frames of the motion, and a registration needs {FEWEST}; check --hue and \
             --marker-radius, and that the mount is that of --rotation."
        )));
    }
    let by_offset = |taken: &Taken| taken.moved_by(cameras, &before.base_from_left, |right| -offset.std_s * right.velocity);
    let by_offset: Flaw = taken.iter().flat_map(by_offset).collect();
    let roughly = Cameras { base_from_left: Some(before.base_from_left), ..cameras.clone() };
    let sessions: Vec<Session> = taken.into_iter().map(|taken| taken.session).collect();
    // What an identification found out about the cameras before is found out anew.
    let mut robot = robot.clone();
    robot.observation = Observation::default();
    let solve = |unknowns: &[Unknown]| {
        let systematic = Systematic::of(vec![Some(roughly.clone()); sessions.len()]);
        let mut problem = Problem::new(&robot, unknowns, &sessions)?
            .with_flaws(vec![by_offset.clone()])
            .with_systematic(systematic)?
            .with_tolerances()?;
        let estimate = problem.estimate_all()?;
        let found = problem.robot(&estimate.z).observation;
        Ok((estimate, found, problem.misfit()))
    };
    let all = unknowns(&robot, before)?;
    let (unknowns, (estimate, found, misfit)) = match solve(&all) {
        Ok(solved) => (all, solved),
        // Motion that hardly reverses does not tell hysteresis from stretch; what a joint then does beyond the model is its misfit.
        Err(Error::Data(_) | Error::Unsettled { .. }) => {
            let fewer: Vec<Unknown> = all.into_iter().filter(|u| !matches!(u.quantity, Quantity::Hysteresis(_))).collect();
            let solved = solve(&fewer)?;
            (fewer, solved)
        }
        Err(error) => return Err(error),
    };
    let arm = robot.arm()?;
    let pivot = arm.kinematics.forward(&arm.hard_stop);
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::new(Vector3::from(found.rotation)));
    let moved_m = Vector3::from(found.translation);
    let about_pivot = Isometry3::from_parts(Translation3::from(pivot - turn * pivot + moved_m), turn);
    let at = |quantity: Quantity| unknowns.iter().position(|unknown| unknown.quantity == quantity);
    let pose: Vec<usize> = (0..3).map(Quantity::Rotation).chain((0..3).map(Quantity::Translation)).filter_map(at).collect();
    let latency = at(Quantity::Latency).map_or(0.0, |k| unknowns[k].std(found.latency, estimate.std[k]));
    let row = |(k, unknown): (usize, &Unknown)| {
        let value = unknown.value(estimate.z[k]);
        (unknown.quantity.name(), value, unknown.std(value, estimate.std[k]), unknown.prior)
    };
    // The flaw that is given comes first.
    let of_offset = unknowns.len();
    let middle = sessions.iter().flat_map(|s| &s.sightings).map(|s| s.position_m).sum::<Vector3<f64>>() / sightings as f64;
    Ok(FromMotion {
        base_from_left: about_pivot * before.base_from_left,
        covariance: scaled(&estimate.covariance, &pose, &unknowns),
        latency_s: [found.latency, latency],
        right_minus_left_s: [offset.right_minus_left_s + offset.std_s * estimate.z[of_offset], offset.std_s * estimate.std[of_offset]],
        moved_m,
        middle_m: (about_pivot * nalgebra::Point3::from(middle)).coords,
        robot: unknowns
            .iter()
            .enumerate()
            .filter(|(_, u)| !u.quantity.is_registration() && u.quantity != Quantity::Latency)
            .map(row)
            .collect(),
        misfit,
        sightings,
    })
}

/// The offset by the epipolar lines of all recordings.
#[must_use]
pub fn offset(cameras: &Cameras, recordings: &[Moving]) -> Desync {
    // Recordings follow one another far apart, so that none shares a block with the next.
    let mut start_s = 0.0;
    let mut all = Vec::new();
    for moving in recordings {
        let mut seen = moving.seen(0.0);
        let end_s = seen.last().map_or(0.0, |last| last.time_s);
        seen.iter_mut().for_each(|seen| seen.time_s += start_s);
        all.extend(seen);
        start_s += end_s + 60.0;
    }
    desync(cameras, &all).unwrap_or(Desync { right_minus_left_s: 0.0, std_s: OFFSET_STD_S })
}

/// The robot's numbers that move the tip, latency and registration, with their priors.
fn unknowns(robot: &Robot, before: &Before) -> Result<Vec<Unknown>> {
    let mut quantities: Vec<Quantity> = (0..3).map(Quantity::PulleyRadius).chain((0..3).map(Quantity::HardStop)).collect();
    quantities.extend((0..3).map(Quantity::Stiffness));
    quantities.extend((0..3).map(Quantity::Hysteresis));
    quantities.extend([Quantity::Coupling(0, 1), Quantity::Coupling(0, 2), Quantity::Coupling(1, 2), Quantity::Latency]);
    // Only what the file has can be estimated.
    let mut numbers = robot.clone();
    quantities.retain(|quantity| numbers.value_mut(&quantity.key(robot)).is_some());
    let quality = Quality {
        registration_rotation_std_rad: Some(before.rotation_std_rad),
        registration_translation_std_m: Some(before.translation_std_m),
        ..Quality::default()
    };
    let mut unknowns = priors::unknowns(robot, &Selection { quantities, named: false }, &quality)?;
    for unknown in &mut unknowns {
        match unknown.quantity {
            Quantity::HardStop(j) => unknown.spread = unknown.spread.hypot(HOMING_STRETCH[j] / 3.0_f64.sqrt()),
            // In m/rad a third, as of hard stops.
            Quantity::Coupling(_, to) => unknown.spread = robot.tolerances.cable_coupling / if to == 2 { 3.0 } else { 1.0 },
            _ => {}
        }
    }
    Ok(unknowns)
}

/// The covariance of some unknowns, from prior deviations to SI.
fn scaled(covariance: &DMatrix<f64>, which: &[usize], unknowns: &[Unknown]) -> SMatrix<f64, 6, 6> {
    SMatrix::from_fn(|i, j| match (which.get(i), which.get(j)) {
        (Some(&k), Some(&l)) => covariance[(k, l)] * unknowns[k].spread * unknowns[l].spread,
        _ => 0.0,
    })
}
