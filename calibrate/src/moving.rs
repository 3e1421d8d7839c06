//! Registration from a moving recording: which blob moves as the motors say, then [`crate::hand_eye`].

use std::path::Path;

use nalgebra::{Isometry3, SMatrix, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use raven::camera::Cameras;
use raven::{Error, Result};
use raven_track::batches;
use raven_track::look::Marker;

use crate::hand_eye::{HandEye, Seen, Solved, align, solve};
use crate::marker_position::{Disc, candidate, discs};
use crate::register::Registration;
use crate::tip_path::TipPath;

/// The round blobs of one instant, left and right, with their stamps since the start [s].
#[derive(Debug, Clone, Default)]
pub struct Look {
    /// Stamps.
    pub time_s: [Option<f64>; 2],
    /// Blobs.
    pub discs: [Vec<Disc>; 2],
}

/// A pose is tried by three sightings, so often.
const TRIALS: usize = 2000;
/// So many pairs of frames vote on it.
const VOTERS: usize = 300;
/// A sighting agrees with a pose if it is nearer than this to where the motors say [m]: cables, radii and cameras half a period apart.
const AGREES_M: f64 = 0.03;
/// Sightings this much farther from the expected pixel than the usual one are something else.
const GATE_SIGMAS: f64 = 5.0;
/// The tip must have moved by so much in two directions [m], or its path does not fix a rotation.
const LEAST_SPREAD_M: f64 = 0.01;
/// Rays of free-running cameras to a moving marker pass each other: no test of whether they meet, the size must do.
const ANY_CHI2: f64 = 1e4;

/// Registers the cameras from a moving recording.
///
/// # Errors
/// If the motors are missing, or no blob moves as they say, or the motion is too small.
pub fn register(log: &Path, cameras: &Cameras, path: &TipPath<'_>, marker: &Marker) -> Result<Registration> {
    let motor = path.recording.require_motor()?;
    let mut looks: Vec<Look> = Vec::new();
    let half_period_s = 0.5 * motor.time_s.last().map_or(0.0, |t| t - motor.time_s[0]) / raven::log::frame_stamps(log)?.len() as f64 * 2.0;
    let counts = batches::for_each(log, cameras, half_period_s, |frames| {
        let mut look = Look::default();
        for (side, frame) in frames.into_iter().enumerate().filter_map(|(side, frame)| Some((side, frame?))) {
            look.time_s[side] = Some(frame.stamp.seconds_since(path.recording.start));
            look.discs[side] = discs(&frame.image, [&cameras.left, &cameras.right][side], marker);
        }
        looks.push(look);
    })?;
    let (solved, seen) = estimate(cameras, path, marker, &looks).map_err(|message| Error::file(log, message))?;
    let base_from_left = solved.hand_eye.left_from_base.inverse();
    let (rotation_std_rad, translation_std_m) = standard_deviations(&solved, &path.at_hard_stop());
    Ok(Registration {
        base_from_left,
        translation_std_m,
        rotation_std_rad,
        latency_s: Some((solved.hand_eye.latency_s, solved.covariance[(6, 6)].sqrt())),
        frames_seen: seen,
        frames: looks.len(),
        undecodable: counts.undecodable,
    })
}

/// The pose and latency that explain the blobs, and in how many looks the marker was.
///
/// # Errors
/// A sentence, if no blob moves as the motors say or the motion is too small.
pub fn estimate(cameras: &Cameras, path: &TipPath<'_>, marker: &Marker, looks: &[Look]) -> Result<(Solved, usize), String> {
    let start = rough(cameras, path, marker, looks)?;
    let mut hand_eye = HandEye { left_from_base: start, latency_s: 0.0 };
    // The first gate is wide, for the latency is not known yet: what the rough pose was found with, at the marker's distance.
    let depth = (start * nalgebra::Point3::from(path.at_hard_stop())).z.abs().max(0.1);
    let mut gate_px = 2.0 * AGREES_M * cameras.left.fx / depth;
    let undetermined = "the marker's motion does not determine the cameras' pose; record one that moves all three joints.".to_owned();
    let mut best = None;
    for _ in 0..4 {
        let seen = nearest(&hand_eye, cameras, path, looks, gate_px);
        let solved = solve(hand_eye, cameras, path, &seen).ok_or_else(|| undetermined.clone())?;
        hand_eye = solved.hand_eye;
        gate_px = (GATE_SIGMAS * solved.rms_px).clamp(3.0, gate_px);
        best = Some((solved, seen.len().div_ceil(2)));
    }
    best.ok_or(undetermined)
}

/// The blob nearest to where each camera should see the tip, if it is within the gate.
fn nearest(hand_eye: &HandEye, cameras: &Cameras, path: &TipPath<'_>, looks: &[Look], gate_px: f64) -> Vec<Seen> {
    let of = |look: &Look, camera: usize| {
        let time_s = look.time_s[camera]?;
        let expected = hand_eye.expected(cameras, path, camera, time_s)?;
        let distance = |disc: &Disc| (disc.centre_px - expected).norm();
        let disc = look.discs[camera].iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
        (distance(disc) < gate_px).then_some(Seen { camera, time_s, pixel: disc.centre_px })
    };
    looks.iter().flat_map(|look| [of(look, 0), of(look, 1)]).flatten().collect()
}

/// A first pose: three sightings give one, the others vote (Fischler and Bolles 1981).
fn rough(cameras: &Cameras, path: &TipPath<'_>, marker: &Marker, looks: &[Look]) -> Result<Isometry3<f64>, String> {
    let stride = looks.len().div_ceil(VOTERS).max(1);
    let mut voters: Vec<(Vector3<f64>, Vec<Vector3<f64>>)> = Vec::new();
    for look in looks.iter().step_by(stride) {
        let Some(tip) = look.time_s[0].and_then(|t| path.at(t)) else { continue };
        let pairs = look.discs[0].iter().flat_map(|l| look.discs[1].iter().map(move |r| [l, r]));
        let points: Vec<Vector3<f64>> = pairs.filter_map(|pair| Some(candidate(cameras, marker, pair, ANY_CHI2)?.1)).collect();
        if !points.is_empty() {
            voters.push((tip, points));
        }
    }
    if voters.len() < 10 {
        return Err(format!("the marker was seen by both cameras in only {} of {} looks at it.", voters.len(), looks.len() / stride));
    }
    let count = voters.len() as f64;
    let middle = voters.iter().map(|v| v.0).sum::<Vector3<f64>>() / count;
    let scatter: SMatrix<f64, 3, 3> =
        voters.iter().map(|v| (v.0 - middle) * (v.0 - middle).transpose()).sum::<SMatrix<f64, 3, 3>>() / count;
    let mut spread: Vec<f64> = scatter.symmetric_eigenvalues().iter().map(|v| v.max(0.0).sqrt()).collect();
    spread.sort_by(f64::total_cmp);
    if spread[1] < LEAST_SPREAD_M {
        let millimetres = 1e3 * spread[1];
        return Err(format!(
            "the tip moves by {millimetres:.1} mm in its second direction, too little to fix a rotation; move all joints."
        ));
    }
    let miss = |pose: &Isometry3<f64>, (tip, points): &(Vector3<f64>, Vec<Vector3<f64>>)| {
        let expected = (pose * nalgebra::Point3::from(*tip)).coords;
        points.iter().map(|p| ((p - expected).norm(), *p)).min_by(|a, b| a.0.total_cmp(&b.0))
    };
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut best: Option<(f64, Isometry3<f64>)> = None;
    for _ in 0..TRIALS {
        let three: [_; 3] = std::array::from_fn(|_| {
            let (tip, points) = &voters[rng.random_range(0..voters.len())];
            (*tip, points[rng.random_range(0..points.len())])
        });
        let Some(pose) = align(&three) else { continue };
        let score: f64 = voters.iter().filter_map(|v| miss(&pose, v)).map(|(d, _)| (d / AGREES_M).min(1.0)).sum();
        if best.as_ref().is_none_or(|(least, _)| score < *least) {
            best = Some((score, pose));
        }
    }
    let Some((_, mut pose)) = best else { return Err("no blob moves as the motors say the tip does.".to_owned()) };
    for _ in 0..5 {
        let agreeing = voters.iter().filter_map(|v| miss(&pose, v).filter(|(d, _)| *d < AGREES_M).map(|(_, p)| (v.0, p)));
        let agreeing: Vec<_> = agreeing.collect();
        if 2 * agreeing.len() < voters.len() {
            let (some, all) = (agreeing.len(), voters.len());
            return Err(format!(
                "no blob moves as the motors say the tip does: the best pose explains {some} of {all} looks. Check the robot file, and that the \
                 marker is in view."
            ));
        }
        pose = align(&agreeing).unwrap_or(pose);
    }
    Ok(pose)
}

/// Of the rotation about the axes of frame 0 [rad], and of where the cameras put a tip at the hard stop [m].
fn standard_deviations(solved: &Solved, hard_stop: &Vector3<f64>) -> ([f64; 3], [f64; 3]) {
    let into_base = solved.hand_eye.left_from_base.rotation.inverse().to_rotation_matrix();
    let pose = solved.covariance.fixed_view::<6, 6>(0, 0);
    let rotation = into_base.matrix() * solved.covariance.fixed_view::<3, 3>(0, 0) * into_base.matrix().transpose();
    let arm = solved.hand_eye.left_from_base.rotation * hard_stop;
    let mut slope = SMatrix::<f64, 3, 6>::zeros();
    slope.fixed_view_mut::<3, 3>(0, 0).copy_from(&(into_base.matrix() * arm.cross_matrix()));
    slope.fixed_view_mut::<3, 3>(0, 3).copy_from(&-into_base.matrix());
    let shift = slope * pose * slope.transpose();
    ([0, 1, 2].map(|i| rotation[(i, i)].sqrt()), [0, 1, 2].map(|i| shift[(i, i)].sqrt()))
}
