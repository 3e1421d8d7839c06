//! `raven-calibrate cameras`: two cameras from pictures of a checkerboard.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::Args;
use nalgebra::Vector3;
use raven::camera::{Cameras, Quality};
use raven::cli::{self, Outcome};
use raven::{Error, Result, files};

use crate::board::{Board, BoardSize};
use crate::calibration::{self, Calibration, Options};
use crate::desync::Desync;
use crate::linear::CAMERA;
use crate::pictures::Pictures;
use crate::summary::{Seconds, baseline_std_m, disparity_std_px, report, table};
use crate::{export, film, folds, glob, page, pictures, stills, uncertainty, verdict};

/// Calibrate both cameras and the pose between them from pictures of a checkerboard.
#[derive(Debug, Clone, Args)]
#[command(after_help = "Examples:\n  raven-calibrate cameras board.mcap --board 9x6 --square 0.012 -o cameras.yaml\n  \
                        raven-calibrate cameras --left 'boards/left*.png' --right 'boards/right*.png' --board 9x6 --square 0.012 -o cameras.yaml")]
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
    #[arg(long, value_name = "M", value_parser = square, allow_negative_numbers = true)]
    pub square: f64,
    /// Solve for the sixth-order radial distortion too.
    #[arg(long)]
    pub k3: bool,
    /// Solve for the board's bow too: a paper board is seldom flat.
    #[arg(long)]
    pub bow: bool,
    /// Where to write the cameras.
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Write a ROS camera_info of each camera, left.yaml and right.yaml, into this folder.
    #[arg(long, value_name = "DIR")]
    pub export_ros: Option<PathBuf>,
    /// Write a Kalibr camera chain, which has no place for the distortion of `--k3`.
    #[arg(long, value_name = "FILE", conflicts_with = "k3")]
    pub export_kalibr: Option<PathBuf>,
    /// Write stereo parameters for OpenCV's FileStorage.
    #[arg(long, value_name = "FILE")]
    pub export_opencv: Option<PathBuf>,
    /// Write the report as one HTML page, with residuals and maps of what is known how well.
    #[arg(long, value_name = "FILE")]
    pub html: Option<PathBuf>,
    /// Write the result as JSON; `-` is standard output.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

fn square(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| format!("`{text}` is no number"))?;
    if (1e-4..=1.0).contains(&value) { Ok(value) } else { Err(format!("{value} is not between 0.0001 and 1 m; is it in millimetres?")) }
}

type Export = fn(&Cameras, &Path) -> Result<()>;

/// Runs the command; the result goes to `out`.
///
/// # Errors
/// A sentence for the user: what is wrong with the pictures, or why they do not determine the cameras.
pub fn run(args: &CamerasArgs, out: &mut dyn Write) -> Result<Outcome> {
    let started = Instant::now();
    let board = Board { size: args.board, square_m: args.square };
    let (left, right) = (glob::files(&args.left)?, glob::files(&args.right)?);
    // Where the folder is yet to be made, nothing else can be in it.
    let ros = args.export_ros.as_deref().filter(|folder| folder.is_dir()).map(export::ros_files);
    let [ros_left, ros_right] = [0, 1].map(|camera| ros.as_ref().map(|files| files[camera].as_path()));
    let outputs = [
        ("-o", args.output.as_deref()),
        ("--json", args.json.as_deref()),
        ("--html", args.html.as_deref()),
        ("--export-ros", ros_left),
        ("--export-ros", ros_right),
        ("--export-kalibr", args.export_kalibr.as_deref()),
        ("--export-opencv", args.export_opencv.as_deref()),
    ];
    files::apart(left.iter().chain(&right).chain(&args.log), &outputs)?;
    let mut pictures = match &args.log {
        Some(log) => pictures::from_log(log, args.board)?,
        None => pictures::from_files(&left, &right, args.board)?,
    };
    if pictures.boards_seen == [0, 0] {
        let (columns, rows) = (args.board.columns, args.board.rows);
        return Err(Error::Data(format!(
            "no board with {columns} x {rows} inner corners was found in {} left and {} right pictures; --board counts inner corners, one less \
             than squares. {}",
            pictures.pictures[0],
            pictures.pictures[1],
            pictures.glimpses.nearest()
        )));
    }
    if let Some((columns, rows)) = pictures.glimpses.other_size(args.board) {
        let told = args.board;
        cli::warn(&format!(
            "most pictures show a grid of {columns} x {rows} inner corners, not {} x {}; is --board right?",
            told.columns, told.rows
        ));
    }
    let found = Instant::now();
    let options = Options { k3: args.k3, bow: args.bow };
    let (calibration, offset) = calibrate(&mut pictures, &board, options)?;
    verdict::require_apart(&calibration.rig, &board)?;
    let solve = found.elapsed().as_secs_f64();
    let cameras = cameras(&calibration, &board, offset);
    if let Some(output) = &args.output {
        cameras.write(output)?;
    }
    for (path, write) in
        [(&args.export_ros, export::ros as Export), (&args.export_kalibr, export::kalibr), (&args.export_opencv, export::opencv)]
    {
        path.as_ref().map_or(Ok(()), |path| write(&cameras, path))?;
    }
    let middle = Vector3::z() * verdict::mean_distance_m(&calibration.rig, &board);
    let folds = folds::cross_validate(&calibration, &middle);
    let report = report(&calibration, folds.as_ref().ok().copied(), &pictures, Seconds { all: started.elapsed().as_secs_f64(), solve });
    let sentences = verdict::sentences(&calibration, folds.as_ref(), &pictures.shots, &board);
    let mut text = table(&report, &calibration);
    if let Some(path) = &args.html {
        let page = page::html(&calibration, &pictures.shots, &board, &text, &sentences);
        files::write_atomic(path, page.as_bytes())?;
    }
    if let Some(Desync { right_minus_left_s, std_s }) = offset {
        text += &format!(
            "The board's motion shows right images to be {:.2} +- {:.2} ms later than their stamps say against the left ones (1 sigma).\n",
            1e3 * right_minus_left_s,
            1e3 * std_s
        );
    }
    sentences.iter().for_each(|s| text += &format!("{}\n", s.text));
    cli::results(out, &text, args.json.as_deref(), &report)?;
    sentences.iter().filter(|s| s.warning).for_each(|s| cli::warn(&s.text));
    if pictures.repeated > 0 {
        cli::warn(&format!("{} pictures have the stamp of another one of their camera and were left out.", pictures.repeated));
    }
    if pictures.undecodable > 0 {
        cli::warn(&format!("{} pictures were cut off or could not be decoded.", pictures.undecodable));
        return Ok(Outcome::DataLost);
    }
    Ok(Outcome::Done)
}

/// Rounds of cameras and offset, of which each needs the other.
const ROUNDS: usize = 3;
/// Deviations by which an offset must differ from what was taken to be worth another round.
const DIFFERS: f64 = 2.0;

/// The cameras, and the offset between them where a moving board shows one that matters.
///
/// # Errors
/// As [`calibration::calibrate`].
pub fn calibrate(pictures: &mut Pictures, board: &Board, options: Options) -> Result<(Calibration, Option<Desync>)> {
    let mut calibration = calibration::calibrate(&pictures.shots, pictures.sizes_px, board, options)?;
    let mut known: Option<Desync> = None;
    for _ in 0..ROUNDS {
        let Some(films) = &pictures.films else { break };
        let Some(found) = film::offset(films, &uncertainty::cameras_of(&calibration.rig)) else { break };
        let taken_s = known.map_or(0.0, |known| known.right_minus_left_s);
        if (found.right_minus_left_s - taken_s).abs() <= DIFFERS * found.std_s {
            break;
        }
        pictures.shots = stills::shots(films, found.right_minus_left_s);
        calibration = calibration::calibrate(&pictures.shots, pictures.sizes_px, board, options)?;
        known = Some(found);
    }
    Ok((calibration, known))
}

/// What goes to `cameras.yaml`.
fn cameras(calibration: &Calibration, board: &Board, offset: Option<Desync>) -> Cameras {
    let std = |at: usize| Some([calibration.std(at)?, calibration.std(at + 1)?, calibration.std(at + 2)?, calibration.std(at + 3)?]);
    Cameras {
        quality: Quality {
            left_rms_px: Some(calibration.mono[0].rms_px),
            right_rms_px: Some(calibration.mono[1].rms_px),
            stereo_rms_px: Some(calibration.rms_px),
            left_std: std(0),
            right_std: std(CAMERA),
            baseline_std_m: baseline_std_m(calibration),
            disparity_std_px: disparity_std_px(calibration, board),
            right_minus_left_std_s: offset.map(|offset| offset.std_s),
            ..Quality::default()
        },
        right_minus_left_s: offset.map_or(0.0, |offset| offset.right_minus_left_s),
        ..uncertainty::cameras_of(&calibration.rig)
    }
}
