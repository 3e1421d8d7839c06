//! What a calibration is worth, in sentences.

use nalgebra::{Isometry3, Point3, Vector3};
use raven::{Error, Result};

use crate::board::Board;
use crate::calibration::{Calibration, Shot};
use crate::folds::{Folds, Unvalidated};
use crate::linear::Rig;
use crate::uncertainty;

/// One sentence about a calibration.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sentence {
    /// The sentence.
    pub text: String,
    /// Whether the user should do something about it.
    pub warning: bool,
}

/// Stereo RMS over mono RMS from which on the pairs were not taken at one instant. Pairs triggered by hardware have 1.07 to 1.10, webcams
/// with a board in the hand 1.5 to 5.
pub const SYNCHRONISED_BELOW: f64 = 1.3;
/// Cameras that are turned by less than this look the same way [rad], and of those this part of the way between them is sideways: one stands
/// to the left of the other.
const PARALLEL_RAD: f64 = 0.8;
const SIDEWAYS: f64 = 0.7;
/// Cameras nearer to each other than this part of the boards' distance, 0.8 mm at 0.4 m, stand at one place: their housings alone keep two
/// farther apart.
const AT_ONE_PLACE: f64 = 0.002;
/// The image is divided into so many columns and rows to see where corners were.
const CELLS: (usize, usize) = (8, 6);
/// Below this part of the image the distortion at its edges is extrapolated.
const LEAST_COVERAGE: f64 = 0.5;
/// A board face-on says nothing about the focal length; the tilt from which on it does well [rad].
const LEAST_TILT_RAD: f64 = 0.35;
/// Boards between whose nearest and farthest distance there is less than this ratio stand at one distance: only their tilt then tells the
/// focal length from the distance.
const LEAST_DEPTH_RATIO: f64 = 1.2;
/// A board whose RMS is this many times that of most boards disagrees with them. Of 54 corners with independent noise the RMS scatters by 7 %, so this
/// is no accident.
const DISAGREEING: f64 = 2.5;
/// Boards left out fit worse than boards used by this factor: the solution follows the boards that it has. Simulated, with noise of which
/// half is shared by the corners of a picture, it is 1.44 with six boards, 1.25 with ten and 1.13 with sixteen (medians).
const WORST_LEFT_OUT: f64 = 1.3;
/// Depth error worth a warning [m per m]: at 0.4 m a tracked tip's own noise is about 1 mm.
const LARGEST_DEPTH_ERROR: f64 = 0.0025;

/// Stereo RMS over the RMS that the cameras reach alone.
#[must_use]
pub fn synchronisation(calibration: &Calibration) -> f64 {
    let alone = calibration.mono.iter().map(|m| m.rms_px * m.rms_px).sum::<f64>() / 2.0;
    // Exact corners leave rounding, whose ratio says nothing.
    (calibration.rms_px.powi(2) + 1e-12).sqrt() / (alone + 1e-12).sqrt()
}

/// Refuses cameras that stand at one place, as where the pictures of one are given for both.
///
/// # Errors
/// If next to no distance is between them.
pub fn require_apart(rig: &Rig, board: &Board) -> Result<()> {
    let (baseline_m, distance_m) = (rig.right_from_left.translation.vector.norm(), mean_distance_m(rig, board));
    if baseline_m >= AT_ONE_PLACE * distance_m {
        return Ok(());
    }
    Err(Error::Data(format!(
        "both cameras stand at one place, {:.3} mm apart with the boards {distance_m:.3} m away; are the pictures of both sides the same? Give \
         each side those of its own camera.",
        1e3 * baseline_m
    )))
}

/// All sentences about a calibration.
#[must_use]
pub fn sentences(calibration: &Calibration, folds: Result<&Folds, &Unvalidated>, shots: &[Shot], board: &Board) -> Vec<Sentence> {
    let mut all = vec![seeing(calibration, shots)];
    all.extend(in_squares(board));
    all.extend(unmatched(calibration, shots));
    all.extend(swapped(&calibration.rig.right_from_left));
    for (camera, name) in ["left", "right"].into_iter().enumerate() {
        all.push(coverage(calibration, shots, camera, name));
        all.push(tilt(calibration, board, camera, name));
    }
    all.extend(distances(calibration, board));
    all.extend(disagreeing(calibration, shots));
    all.extend(bow(calibration));
    all.push(timing(calibration, shots));
    let (depth, std_m) = depth(calibration, board);
    all.push(depth);
    all.push(folds.map_or_else(|why| unvalidated(why, shots), |folds| left_out(calibration, folds, std_m)));
    all
}

fn seeing(calibration: &Calibration, shots: &[Shot]) -> Sentence {
    let seen = |camera: usize| shots.iter().filter(|s| s.sightings[camera].is_some()).count();
    let text = format!("Boards used: {} left, {} right, {} of them by both at once.", seen(0), seen(1), calibration.pairs.len());
    Sentence { text, warning: false }
}

fn in_squares(board: &Board) -> Option<Sentence> {
    let text = "The square has length 1: what is called a metre here is one square of the board.".to_owned();
    (board.square_m == 1.0).then_some(Sentence { text, warning: false })
}

fn unmatched(calibration: &Calibration, shots: &[Shot]) -> Option<Sentence> {
    let names: Vec<&str> = calibration.unmatched.iter().take(5).map(|&i| shots[i].name.as_str()).collect();
    (!names.is_empty()).then(|| Sentence {
        text: format!(
            "In {} pairs the two views do not fit together ({}): the board moved by half a square between them, or too little of it is \
             visible. They were used for each camera alone.",
            calibration.unmatched.len(),
            names.join(", ")
        ),
        warning: true,
    })
}

/// Whether cameras that look the same way stand the wrong way round.
fn swapped(right_from_left: &Isometry3<f64>) -> Option<Sentence> {
    let right_m = right_from_left.inverse().translation.vector;
    let is_parallel = right_from_left.rotation.angle() < PARALLEL_RAD;
    let text = format!(
        "The right camera stands {:.1} mm to the left of the left one, as the left one sees it: left and right are swapped, unless both hang upside \
         down. Swap --left and --right, or the cameras' topics, and calibrate again.",
        -1e3 * right_m.x
    );
    (is_parallel && right_m.x < -SIDEWAYS * right_m.norm()).then_some(Sentence { text, warning: true })
}

fn coverage(calibration: &Calibration, shots: &[Shot], camera: usize, name: &str) -> Sentence {
    let pinhole = &calibration.rig.cameras[camera];
    let mut seen = vec![false; CELLS.0 * CELLS.1];
    for pixel in shots.iter().filter_map(|s| s.sightings[camera].as_ref()).flat_map(|s| s.grid.corners.values()) {
        let cell = |at: f64, size: u32, cells: usize| ((at + 0.5) / f64::from(size) * cells as f64).clamp(0.0, cells as f64 - 1.0) as usize;
        seen[cell(pixel.y, pinhole.height, CELLS.1) * CELLS.0 + cell(pixel.x, pinhole.width, CELLS.0)] = true;
    }
    let part = seen.iter().filter(|&&s| s).count() as f64 / seen.len() as f64;
    let warning = part < LEAST_COVERAGE;
    let advice = if warning { "; show the board near the edges too" } else { "" };
    Sentence { text: format!("Corners cover {:.0} % of the {name} image{advice}.", 100.0 * part), warning }
}

fn tilt(calibration: &Calibration, board: &Board, camera: usize, name: &str) -> Sentence {
    let of = |pose: &Isometry3<f64>| {
        let sight = (pose * Point3::from(board.middle())).coords;
        let normal = pose.rotation * Vector3::z();
        normal.dot(&sight.normalize()).abs().min(1.0).acos()
    };
    let largest = calibration.mono[camera].poses.iter().flatten().map(of).fold(0.0, f64::max);
    let warning = largest < LEAST_TILT_RAD;
    let advice = if warning { "; tilt it by 30 to 45 deg, or its focal length is a guess" } else { "" };
    Sentence { text: format!("The board was tilted by up to {:.0} deg to the {name} camera{advice}.", largest.to_degrees()), warning }
}

fn distances(calibration: &Calibration, board: &Board) -> Option<Sentence> {
    let all = || calibration.rig.boards.iter().map(|pose| (pose * Point3::from(board.middle())).z);
    let (near, far) = (all().fold(f64::INFINITY, f64::min), all().fold(0.0, f64::max));
    let warning = far < LEAST_DEPTH_RATIO * near;
    let advice =
        if warning { ", nearly the same; show it near and far, or focal length and distance are told apart by tilt alone" } else { "" };
    Some(Sentence { text: format!("The boards stood at {near:.3} to {far:.3} m{advice}."), warning })
}

fn disagreeing(calibration: &Calibration, shots: &[Shot]) -> Option<Sentence> {
    let mut named = Vec::new();
    for (mono, side) in calibration.mono.iter().zip(["left", "right"]) {
        let all: Vec<f64> = mono.board_rms_px.iter().flatten().copied().collect();
        // Corners without noise have no scale.
        let usual = raven::stats::median(&all)?.max(1e-6);
        let worse = mono.board_rms_px.iter().zip(shots).filter_map(|(rms, shot)| Some(((*rms)?, shot)));
        named.extend(worse.filter(|(rms, _)| *rms > DISAGREEING * usual).map(|(rms, shot)| (rms / usual, rms, side, &shot.name)));
    }
    named.sort_by(|a, b| b.0.total_cmp(&a.0));
    let list: Vec<String> = named.iter().take(5).map(|(_, rms, side, name)| format!("{name} {side} {rms:.2} px")).collect();
    let text = format!(
        "{} boards disagree with the others: {}. Look at these pictures for blur, a hand over the board or a board that bends; single corners far off \
         count for less already, but leave out what is wrong.",
        named.len(),
        list.join(", ")
    );
    (!named.is_empty()).then_some(Sentence { text, warning: true })
}

fn bow(calibration: &Calibration) -> Option<Sentence> {
    let [x, y]: [f64; 2] = calibration.rig.bow_m.into();
    let place = match calibration.unplaced {
        0 => String::new(),
        count => format!(" {count} cut-off boards, whose place on it is not known, were taken for flat."),
    };
    let text = format!("The board's middle stands {:.2} mm (along x) and {:.2} mm (along y) behind its edges.{place}", 1e3 * x, 1e3 * y);
    calibration.free.bow.then_some(Sentence { text, warning: false })
}

fn unvalidated(why: &Unvalidated, shots: &[Shot]) -> Sentence {
    let text = match why {
        Unvalidated::FewBoards => "Too few boards for a cross-validation; show five or more to both cameras.".to_owned(),
        Unvalidated::Behind => {
            "No cross-validation: what stands as far before the left camera as the boards is behind the right one. Were \
                                they shown to both cameras at once?"
                .to_owned()
        }
        Unvalidated::Open(left_out) => {
            let names: Vec<&str> = left_out.iter().map(|&shot| shots[shot].name.as_str()).collect();
            format!(
                "No cross-validation: without {} the other boards do not determine the cameras; show more boards of every kind, whole, tilted, \
                 near and far.",
                names.join(", ")
            )
        }
    };
    Sentence { text, warning: true }
}

fn left_out(calibration: &Calibration, folds: &Folds, depth_std_m: Option<f64>) -> Sentence {
    let ratio = (folds.left_out_rms_px.powi(2) + 1e-12).sqrt() / (calibration.rms_px.powi(2) + 1e-12).sqrt();
    let warning = ratio > WORST_LEFT_OUT;
    let advice = if warning { ", much worse: the boards are too few, or what they show differs; show more of them" } else { "" };
    let depth = depth_std_m.map_or_else(String::new, |std| {
        format!(" Over the folds the depth scatters by {:.2} mm (1 sigma), against {:.2} mm above.", 1e3 * folds.depth_std_m, 1e3 * std)
    });
    let text = format!(
        "Cross-validation in {} folds: boards left out are met to {:.3} px RMS, boards used to {:.3} px{advice}.{depth}",
        folds.folds, folds.left_out_rms_px, calibration.rms_px
    );
    Sentence { text, warning }
}

fn timing(calibration: &Calibration, shots: &[Shot]) -> Sentence {
    let ratio = synchronisation(calibration);
    let alone = calibration.mono.iter().map(|m| m.rms_px).collect::<Vec<_>>();
    let measured =
        format!("Synchronisation: stereo RMS is {ratio:.2} times the RMS of each camera alone ({:.3}, {:.3} px)", alone[0], alone[1]);
    if ratio <= SYNCHRONISED_BELOW {
        return Sentence { text: format!("{measured}, as of pairs taken at one instant."), warning: false };
    }
    let mut worst = calibration.pairs.clone();
    worst.sort_by(|a, b| b.1.total_cmp(&a.1));
    let worst: Vec<String> = worst.iter().take(5).map(|&(shot, rms)| format!("{} {rms:.2} px", shots[shot].name)).collect();
    let text = format!(
        "{measured}: the pairs were probably not taken at one instant. Lay the board down for each pair. Worst: {}.",
        worst.join(", ")
    );
    Sentence { text, warning: true }
}

/// The sentence, and the standard deviation in it [m].
fn depth(calibration: &Calibration, board: &Board) -> (Sentence, Option<f64>) {
    let unknown = Sentence {
        text: "Too few boards: leaving one out leaves a parameter open, so no standard deviations are known. Show more boards.".to_owned(),
        warning: true,
    };
    let Some(deviations) = &calibration.deviations else { return (unknown, None) };
    let distance = mean_distance_m(&calibration.rig, board);
    let Some(point) = uncertainty::point_covariance(&calibration.rig, &deviations.covariance, &Vector3::new(0.0, 0.0, distance)) else {
        return (unknown, None);
    };
    let std = point[(2, 2)].sqrt();
    let warning = std > LARGEST_DEPTH_ERROR * distance;
    let advice = if warning { "; show more boards, tilted, near and far" } else { "" };
    let text = format!(
        "At the boards' mean distance, {distance:.3} m, depth is known to {:.2} mm (1 sigma) as far as the calibration goes{advice}.",
        1e3 * std
    );
    (Sentence { text, warning }, Some(std))
}

/// Mean distance of the boards' middles along the left camera's axis [m].
#[must_use]
pub fn mean_distance_m(rig: &Rig, board: &Board) -> f64 {
    rig.boards.iter().map(|pose| (pose * Point3::from(board.middle())).z).sum::<f64>() / rig.boards.len() as f64
}
