//! `raven-calibrate cameras`: two cameras from pictures of a checkerboard.

use std::fmt::Write as _;
use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use raven::camera::{Cameras, Quality};
use raven::cli::{self, Outcome};
use raven::{Error, Result};
use serde::Serialize;

use crate::board::{Board, BoardSize};
use crate::calibration::{self, Calibration};
use crate::linear::{CAMERA, PAIR};
use crate::pictures::{self, Pictures};
use crate::{glob, uncertainty, verdict};

/// Calibrate both cameras and the pose between them from pictures of a checkerboard.
///
/// Example: raven-calibrate cameras board.mcap --board 9x6 --square 0.012 -o cameras.yaml
#[derive(Debug, Clone, Args)]
pub struct CamerasArgs {
    /// A recording of the board by both cameras.
    #[arg(required_unless_present = "left")]
    pub log: Option<PathBuf>,
    /// Pictures of the left camera instead of a recording; `*` and `?` stand for any characters.
    #[arg(long, num_args = 1.., value_name = "FILES", requires = "right", conflicts_with = "log")]
    pub left: Vec<String>,
    /// Pictures of the right camera, in the same order of names.
    #[arg(long, num_args = 1.., value_name = "FILES", requires = "left")]
    pub right: Vec<String>,
    /// Inner corners of the board: one less than squares, each way.
    #[arg(long, value_name = "COLUMNSxROWS")]
    pub board: BoardSize,
    /// Length of a square [m]; with 1 all lengths are in squares.
    #[arg(long, value_name = "M", value_parser = square)]
    pub square: f64,
    /// Solve for the sixth-order radial distortion too.
    #[arg(long)]
    pub k3: bool,
    /// Where to write the cameras.
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Write the result as JSON; `-` is standard output.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

fn square(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| format!("`{text}` is no number"))?;
    if (1e-4..=1.0).contains(&value) { Ok(value) } else { Err(format!("{value} is not between 0.0001 and 1 m; is it in millimetres?")) }
}

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
}

/// Runs the command; the result goes to `out`.
///
/// # Errors
/// A sentence for the user: what is wrong with the pictures, or why they do not determine the cameras.
pub fn run(args: &CamerasArgs, out: &mut dyn Write) -> Result<Outcome> {
    let started = Instant::now();
    let board = Board { size: args.board, square_m: args.square };
    let pictures = match &args.log {
        Some(log) => pictures::from_log(log, args.board)?,
        None => pictures::from_files(&glob::files(&args.left)?, &glob::files(&args.right)?, args.board)?,
    };
    if pictures.boards_seen == [0, 0] {
        let (columns, rows) = (args.board.columns, args.board.rows);
        return Err(Error::Data(format!(
            "no board with {columns} x {rows} inner corners was found in {} left and {} right pictures; --board counts inner corners, one less \
             than squares.",
            pictures.pictures[0], pictures.pictures[1]
        )));
    }
    let calibration = calibration::calibrate(&pictures.shots, pictures.sizes_px, &board, args.k3)?;
    if let Some(output) = &args.output {
        cameras(&calibration).write(output)?;
    }
    let report = report(&calibration, &pictures, started.elapsed().as_secs_f64());
    let sentences = verdict::sentences(&calibration, &pictures.shots, &board);
    let mut text = table(&report, calibration.mono.iter().map(|m| m.poses.iter().flatten().count()).min().unwrap_or(0));
    sentences.iter().for_each(|s| text += &format!("{}\n", s.text));
    out.write_all(text.as_bytes()).map_err(|e| Error::io("-".as_ref(), "write", e))?;
    sentences.iter().filter(|s| s.warning).for_each(|s| cli::warn(&s.text));
    if let Some(json) = &args.json {
        cli::write_json(json, &report)?;
    }
    if pictures.undecodable > 0 {
        cli::warn(&format!("{} pictures were cut off or could not be decoded.", pictures.undecodable));
        return Ok(Outcome::DataLost);
    }
    Ok(Outcome::Done)
}

/// What goes to `cameras.yaml`.
fn cameras(calibration: &Calibration) -> Cameras {
    let std = |at: usize| calibration.covariance.map(|c| std::array::from_fn(|i| c[(at + i, at + i)].sqrt()));
    Cameras {
        quality: Quality {
            left_rms_px: Some(calibration.mono[0].rms_px),
            right_rms_px: Some(calibration.mono[1].rms_px),
            stereo_rms_px: Some(calibration.rms_px),
            left_std: std(0),
            right_std: std(CAMERA),
            baseline_std_m: baseline_std_m(calibration),
            ..Quality::default()
        },
        ..uncertainty::cameras_of(&calibration.rig)
    }
}

fn baseline_std_m(calibration: &Calibration) -> Option<f64> {
    let direction = calibration.rig.right_from_left.translation.vector.normalize();
    let covariance = calibration.covariance?.fixed_view::<3, 3>(PAIR + 3, PAIR + 3).into_owned();
    Some((direction.transpose() * covariance * direction)[0].sqrt())
}

fn report(calibration: &Calibration, pictures: &Pictures, seconds: f64) -> Report {
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
    };
    Report { left: camera(0), right: camera(1), stereo, seconds }
}

/// The result as people read it, with 95 % intervals.
fn table(report: &Report, boards: usize) -> String {
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
