//! A calibration as scripts read it and as people read it.

use std::fmt::Write as _;

use serde::Serialize;

use crate::calibration::Calibration;
use crate::linear::{BOW, CAMERA, PAIR};
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
    let direction = calibration.rig.right_from_left.translation.vector.normalize();
    let covariance = calibration.covariance?.fixed_view::<3, 3>(PAIR + 3, PAIR + 3).into_owned();
    Some((direction.transpose() * covariance * direction)[0].sqrt())
}

/// The result as scripts read it.
#[must_use]
pub fn report(calibration: &Calibration, pictures: &Pictures, seconds: Seconds) -> Report {
    let std = |at: usize| calibration.covariance.map(|c| c[(at, at)].sqrt());
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
    Report { left: camera(0), right: camera(1), stereo, seconds: seconds.all, solve_seconds: seconds.solve }
}

/// The result as people read it, with 95 % intervals.
#[must_use]
pub fn table(report: &Report, boards: usize) -> String {
    let t = uncertainty::t95(boards);
    let mut text = format!("{:16}{:>24}{:>24}   (+- is 95 %)\n", "", "left", "right");
    let cell = |value: f64, std: Option<f64>, digits: usize| match std {
        Some(std) => format!("{value:.digits$} +- {:.digits$}", t * std),
        None => format!("{value:.digits$}"),
    };
    let mut row = |name: &str, cells: [String; 2]| {
        let _ = writeln!(text, "{name:16}{:>24}{:>24}", cells[0], cells[1]);
    };
    let both = [&report.left, &report.right];
    row("boards", both.map(|c| format!("{} of {}", c.boards_used, c.pictures)));
    row("RMS alone [px]", both.map(|c| format!("{:.4}", c.rms_px)));
    row("fx [px]", both.map(|c| cell(c.fx, c.std.as_ref().map(|s| s.fx), 3)));
    row("fy [px]", both.map(|c| cell(c.fy, c.std.as_ref().map(|s| s.fy), 3)));
    row("cx [px]", both.map(|c| cell(c.cx, c.std.as_ref().map(|s| s.cx), 3)));
    row("cy [px]", both.map(|c| cell(c.cy, c.std.as_ref().map(|s| s.cy), 3)));
    for (i, name) in ["k1", "k2", "p1", "p2", "k3"].into_iter().enumerate() {
        row(name, both.map(|c| cell(c.distortion[i], c.std.as_ref().map(|s| s.distortion[i]), 5)));
    }
    let stereo = &report.stereo;
    let interval =
        |std: Option<f64>, scale: f64, digits: usize| std.map_or_else(String::new, |s| format!(" +- {:.digits$}", t * s * scale));
    let _ = writeln!(text, "RMS together [px]   {:.4} in {} pairs", stereo.rms_px, stereo.pairs);
    let _ = writeln!(text, "baseline [mm]       {:.4}{}", 1e3 * stereo.baseline_m, interval(stereo.baseline_std_m, 1e3, 4));
    let [x, y, z] = stereo.rotation_vector_rad.map(f64::to_degrees);
    let [sx, sy, sz] = [0, 1, 2].map(|i| interval(stereo.rotation_std_rad.map(|s| s[i].to_degrees()), 1.0, 4));
    let _ = writeln!(text, "rotation [deg]      {x:.4}{sx}, {y:.4}{sy}, {z:.4}{sz}");
    text
}
