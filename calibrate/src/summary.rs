//! A calibration as scripts read it and as people read it.

use std::fmt::Write as _;

use nalgebra::{SVector, Vector3};
use serde::Serialize;

use crate::board::Board;
use crate::calibration::Calibration;
use crate::folds::Folds;
use crate::linear::{BOW, CAMERA, PAIR, SHARED};
use crate::pictures::Pictures;
use crate::{uncertainty, verdict};

/// The result as scripts read it.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// Left camera.
    pub left: CameraReport,
    /// Right camera.
    pub right: CameraReport,
    /// Both.
    pub stereo: StereoReport,
    /// Boards left out; `None` with too few.
    pub cross_validation: Option<Folds>,
    /// Time from start to end [s].
    pub seconds: f64,
    /// Of it from corners to cameras [s].
    pub solve_seconds: f64,
}

/// Where the time went [s].
#[derive(Debug, Clone, Copy)]
pub struct Seconds {
    /// From start to end.
    pub all: f64,
    /// From corners to cameras.
    pub solve: f64,
}

/// One camera.
#[derive(Debug, Clone, Serialize)]
pub struct CameraReport {
    /// Reprojection RMS of this camera alone [px].
    pub rms_px: f64,
    /// Focal length along u [px].
    pub fx: f64,
    /// Focal length along v [px].
    pub fy: f64,
    /// Principal point, u [px].
    pub cx: f64,
    /// Principal point, v [px].
    pub cy: f64,
    /// `k1, k2, p1, p2, k3`.
    pub distortion: [f64; 5],
    /// Standard deviations; `None` where too few boards leave them open.
    pub std: Option<CameraStd>,
    /// Boards in the solution.
    pub boards_used: usize,
    /// Pictures in which the board was found.
    pub boards_seen: usize,
    /// Pictures.
    pub pictures: usize,
}

/// Standard deviations of one camera.
#[derive(Debug, Clone, Serialize)]
pub struct CameraStd {
    /// [px].
    pub fx: f64,
    /// [px].
    pub fy: f64,
    /// [px].
    pub cx: f64,
    /// [px].
    pub cy: f64,
    /// `k1, k2, p1, p2, k3`.
    pub distortion: [f64; 5],
}

/// The pose between the cameras.
#[derive(Debug, Clone, Serialize)]
pub struct StereoReport {
    /// Reprojection RMS of both cameras with one pose per board [px].
    pub rms_px: f64,
    /// Distance between the cameras [m].
    pub baseline_m: f64,
    /// Angle of the rotation between the cameras [deg].
    pub rotation_deg: f64,
    /// `x_right = R x_left + t`: rotation vector of `R` [rad].
    pub rotation_vector_rad: [f64; 3],
    /// `t` [m].
    pub translation_m: [f64; 3],
    /// Standard deviation of the distance [m].
    pub baseline_std_m: Option<f64>,
    /// Standard deviations of the rotation about the right camera's axes [rad].
    pub rotation_std_rad: Option<[f64; 3]>,
    /// Standard deviations of `t` [m].
    pub translation_std_m: Option<[f64; 3]>,
    /// Pairs of pictures with the board in both.
    pub pairs: usize,
    /// Stereo RMS over mono RMS.
    pub synchronisation: f64,
    /// Largest cosine between the residuals and a column of their Jacobian: 0 at the optimum.
    pub gradient: f64,
    /// The board's bow along x and y, if it was solved for [m].
    pub bow_m: Option<[f64; 2]>,
    /// Its standard deviations [m].
    pub bow_std_m: Option<[f64; 2]>,
}

/// Standard deviation of the distance between the cameras [m].
#[must_use]
pub fn baseline_std_m(calibration: &Calibration) -> Option<f64> {
    let direction = along_baseline(calibration);
    Some((direction.transpose() * calibration.deviations.as_ref()?.covariance * direction)[0].sqrt())
}

/// Standard deviation of the disparity at the boards' mean distance, in the middle of the left image [px]: that of the depth there, seen by
/// two cameras side by side.
#[must_use]
pub fn disparity_std_px(calibration: &Calibration, board: &Board) -> Option<f64> {
    let distance_m = verdict::mean_distance_m(&calibration.rig, board);
    let point = Vector3::new(0.0, 0.0, distance_m);
    let covariance = uncertainty::point_covariance(&calibration.rig, &calibration.deviations.as_ref()?.covariance, &point)?;
    let [left, _] = calibration.rig.cameras;
    let px_per_m = left.fx * calibration.rig.right_from_left.translation.vector.norm() / (distance_m * distance_m);
    Some(px_per_m * covariance[(2, 2)].sqrt())
}

/// Slope of the distance between the cameras with the shared parameters.
fn along_baseline(calibration: &Calibration) -> SVector<f64, SHARED> {
    let mut direction = SVector::<f64, SHARED>::zeros();
    direction.fixed_rows_mut::<3>(PAIR + 3).copy_from(&calibration.rig.right_from_left.translation.vector.normalize());
    direction
}

/// The result as scripts read it.
#[must_use]
pub fn report(calibration: &Calibration, cross_validation: Option<Folds>, pictures: &Pictures, seconds: Seconds) -> Report {
    let std = |at: usize| calibration.std(at);
    let three = |at: usize| Some([std(at)?, std(at + 1)?, std(at + 2)?]);
    let camera = |camera: usize| {
        let (c, at) = (&calibration.rig.cameras[camera], CAMERA * camera);
        let of = |i: usize| std(at + i);
        let distortion_std = || Some([of(4)?, of(5)?, of(6)?, of(7)?, of(8)?]);
        let std = || Some(CameraStd { fx: of(0)?, fy: of(1)?, cx: of(2)?, cy: of(3)?, distortion: distortion_std()? });
        CameraReport {
            rms_px: calibration.mono[camera].rms_px,
            fx: c.fx,
            fy: c.fy,
            cx: c.cx,
            cy: c.cy,
            distortion: c.distortion,
            std: std(),
            boards_used: calibration.mono[camera].poses.iter().flatten().count(),
            boards_seen: pictures.boards_seen[camera],
            pictures: pictures.pictures[camera],
        }
    };
    let pose = &calibration.rig.right_from_left;
    let bowed = calibration.free.bow;
    let stereo = StereoReport {
        rms_px: calibration.rms_px,
        baseline_m: pose.translation.vector.norm(),
        rotation_deg: pose.rotation.angle().to_degrees(),
        rotation_vector_rad: pose.rotation.scaled_axis().into(),
        translation_m: pose.translation.vector.into(),
        baseline_std_m: baseline_std_m(calibration),
        rotation_std_rad: three(PAIR),
        translation_std_m: three(PAIR + 3),
        pairs: calibration.pairs.len(),
        synchronisation: verdict::synchronisation(calibration),
        gradient: calibration.gradient,
        bow_m: bowed.then(|| calibration.rig.bow_m.into()),
        bow_std_m: (|| Some([std(BOW)?, std(BOW + 1)?]).filter(|_| bowed))(),
    };
    Report { left: camera(0), right: camera(1), stereo, cross_validation, seconds: seconds.all, solve_seconds: seconds.solve }
}

/// The result as people read it, with 95 % intervals.
#[must_use]
pub fn table(report: &Report, calibration: &Calibration) -> String {
    let mut text = format!("{:16}{:>24}{:>24}   (+- is 95 %)\n", "", "left", "right");
    let mut row = |name: &str, cells: [String; 2]| {
        let _ = writeln!(text, "{name:16}{:>24}{:>24}", cells[0], cells[1]);
    };
    let both = [&report.left, &report.right];
    row("boards", both.map(|c| format!("{} of {}", c.boards_used, c.pictures)));
    row("RMS alone [px]", both.map(|c| format!("{:.4}", c.rms_px)));
    for (i, (name, digits)) in NAMES.into_iter().enumerate() {
        let cell = |camera: usize| {
            let free = calibration.free.parameter(CAMERA * camera + i);
            let reach = reach(calibration, CAMERA * camera + i, 1.0, digits);
            if free { format!("{:.digits$}{reach}", both[camera].parameter(i)) } else { "0 (fixed)".to_owned() }
        };
        row(name, [cell(0), cell(1)]);
    }
    let stereo = &report.stereo;
    let _ = writeln!(text, "RMS together [px]   {:.4} in {} pairs", stereo.rms_px, stereo.pairs);
    let along = baseline_std_m(calibration).zip(calibration.deviations.as_ref());
    let along = along.map_or_else(String::new, |(std, d)| format!(" +- {:.4}", 1e3 * std * d.t95(&along_baseline(calibration))));
    let _ = writeln!(text, "baseline [mm]       {:.4}{along}", 1e3 * stereo.baseline_m);
    let [x, y, z] = stereo.rotation_vector_rad.map(f64::to_degrees);
    let [sx, sy, sz] = [0, 1, 2].map(|i| reach(calibration, PAIR + i, 1_f64.to_degrees(), 4));
    let _ = writeln!(text, "rotation [deg]      {x:.4}{sx}, {y:.4}{sy}, {z:.4}{sz}");
    if let Some([x, y]) = stereo.bow_m {
        let [sx, sy] = [0, 1].map(|i| reach(calibration, BOW + i, 1e3, 3));
        let _ = writeln!(text, "bow of board [mm]   {:.3}{sx} along x, {:.3}{sy} along y", 1e3 * x, 1e3 * y);
    }
    text
}

/// Names of a camera's parameters, and digits after the point.
const NAMES: [(&str, usize); CAMERA] =
    [("fx [px]", 3), ("fy [px]", 3), ("cx [px]", 3), ("cy [px]", 3), ("k1", 5), ("k2", 5), ("p1", 5), ("p2", 5), ("k3", 5)];

impl CameraReport {
    fn parameter(&self, index: usize) -> f64 {
        let [k1, k2, p1, p2, k3] = self.distortion;
        [self.fx, self.fy, self.cx, self.cy, k1, k2, p1, p2, k3].get(index).copied().unwrap_or(f64::NAN)
    }
}

/// How far 95 % reaches about a parameter, as ` +- 0.123`; nothing where that is not known.
fn reach(calibration: &Calibration, parameter: usize, scale: f64, digits: usize) -> String {
    let known = calibration.std(parameter).zip(calibration.deviations.as_ref());
    known.map_or_else(String::new, |(std, d)| format!(" +- {:.digits$}", scale * std * d.t95_of(parameter)))
}
