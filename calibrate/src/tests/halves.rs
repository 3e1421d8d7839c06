//! Printed standard deviations against real pictures: calibrations of two disjoint halves of them differ by what both deviations say.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use raven::camera::Pinhole;
use raven_tests::shared;
use rayon::prelude::*;

use crate::board::{Board, BoardSize};
use crate::calibration::{Calibration, Options, Shot, calibrate};
use crate::linear::{CAMERA, PAIR};
use crate::{glob, pictures};

const SPLITS: u64 = 60;

/// Differences of the left camera's numbers, the right one's, and those of the pose between them, in standard deviations.
fn differences(one: &Calibration, other: &Calibration) -> Option<[Vec<f64>; 3]> {
    let (here, there) = (one.deviations.as_ref()?.covariance, other.deviations.as_ref()?.covariance);
    let z = |index: usize, difference: f64| difference / (here[(index, index)] + there[(index, index)]).sqrt();
    let numbers = |c: &Pinhole| [c.fx, c.fy, c.cx, c.cy, c.distortion[0], c.distortion[1], c.distortion[2], c.distortion[3]];
    let camera = |c: usize| -> Vec<f64> {
        let pairs = numbers(&one.rig.cameras[c]).into_iter().zip(numbers(&other.rig.cameras[c]));
        pairs.enumerate().map(|(i, (a, b))| z(CAMERA * c + i, a - b)).collect()
    };
    let (a, b) = (one.rig.right_from_left, other.rig.right_from_left);
    let turn = (a.rotation * b.rotation.inverse()).scaled_axis();
    let shift = a.translation.vector - b.translation.vector;
    let pair = (0..6).map(|i| z(PAIR + i, if i < 3 { turn[i] } else { shift[i - 3] })).collect();
    Some([camera(0), camera(1), pair])
}

#[test]
fn halves_of_the_pictures_differ_by_what_the_deviations_say() {
    for (folder, extension, square_m) in [("data/checkerboard/opencv", "jpg", 0.03), ("data/checkerboard/webcam", "png", 1.0)] {
        let Some(path) = shared(folder) else { continue };
        let board = Board { size: BoardSize { columns: 9, rows: 6 }, square_m };
        let files = |name: &str| glob::files(&[path.join(format!("{name}*.{extension}")).display().to_string()]).unwrap();
        let pictures = pictures::from_files(&files("left"), &files("right"), board.size).unwrap();
        let split = |seed: u64| {
            let mut shots = pictures.shots.clone();
            shots.shuffle(&mut ChaCha8Rng::seed_from_u64(seed));
            let (one, other) = shots.split_at(shots.len() / 2);
            let of = |shots: &[Shot]| calibrate(shots, pictures.sizes_px, &board, Options::default()).ok();
            differences(&of(one)?, &of(other)?)
        };
        let splits: Vec<[Vec<f64>; 3]> = (0..SPLITS).into_par_iter().filter_map(split).collect();
        println!("{folder}: {} of {SPLITS} splits", splits.len());
        assert!(10 * splits.len() as u64 >= 9 * SPLITS, "{folder}: {} of {SPLITS} splits could be calibrated", splits.len());
        for (part, name) in ["left", "right", "pair"].into_iter().enumerate() {
            let sizes: Vec<f64> = splits.iter().flat_map(|s| s[part].iter().map(|z| z.abs())).collect();
            // The median of a normal deviate's size is 0.6745 standard deviations.
            let rms = raven::stats::median(&sizes).unwrap() / 0.6745;
            println!("{folder}, {name}: halves differ by {rms:.2} printed standard deviations");
            assert!((0.8..1.4).contains(&rms), "{folder}, {name}: {rms}");
        }
    }
}
