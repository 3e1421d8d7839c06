//! How close the centres come to the Cramer-Rao bound on balls by the renderer of [`super::exact`].

use image::RgbImage;
use jpeg_encoder::{ChromaSubsamplingMethod, ColorType, Encoder, SamplingFactor};
use nalgebra::{Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use raven::log::Sampling;
use raven::stats::rms;
use rayon::prelude::*;

use super::decoded;
use super::exact::{Drawn, SIDE};
use crate::centre::Ball;
use crate::colour::MarkerColour;
use crate::marker::{Blobs, Centre};

const TRIALS: u64 = 100;

/// RMS error per axis [px] of a kind of centre over many places in the pixel grid.
fn rms_px(drawn: Drawn, noise: f64, kinds: &[Centre], sent: impl Fn(RgbImage) -> (RgbImage, Option<Sampling>) + Sync) -> Vec<f64> {
    let one = |seed| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let shift = Vector2::new(rng.random_range(-8.0..8.0), rng.random_range(-8.0..8.0));
        let here = Drawn { centre: drawn.centre + shift, ..drawn };
        let (image, sampling) = sent(here.photograph(1.0, noise, &mut rng));
        let blobs = Blobs::find(&image, None, &MarkerColour::default()).sampled(sampling.as_ref());
        kinds.iter().map(|kind| (blobs.centre(&blobs.found[0], *kind).centre_px - here.centre).norm_squared()).collect::<Vec<f64>>()
    };
    let squares: Vec<Vec<f64>> = (0..TRIALS).into_par_iter().map(one).collect();
    (0..kinds.len()).map(|k| (squares.iter().map(|s| s[k]).sum::<f64>() / (2.0 * TRIALS as f64)).sqrt()).collect()
}

/// Through a webcam's JPEG file; a sample of chroma is the mean of its pixels.
fn compressed(image: &RgbImage, quality: u8, sampling: SamplingFactor) -> (RgbImage, Option<Sampling>) {
    let mut jpeg = Vec::new();
    let mut encoder = Encoder::new(&mut jpeg, quality);
    encoder.set_sampling_factor(sampling);
    encoder.set_chroma_subsampling_method(ChromaSubsamplingMethod::Average);
    encoder.encode(image.as_raw(), SIDE as u16, SIDE as u16, ColorType::Rgb).unwrap();
    decoded(jpeg)
}

const KINDS: [Centre; 3] = [Centre::Contour, Centre::Ball, Centre::Refined];

#[test]
fn raw_frames_come_near_the_bound() {
    let mut beyond = Vec::new();
    for light in [Vector3::zeros(), Vector3::new(-0.2, -0.5, -0.4)] {
        for (radius_px, noise) in [(5.0, 2.0), (5.0, 5.0), (8.0, 2.0), (8.0, 5.0), (12.0, 2.0), (12.0, 5.0)] {
            let drawn = Drawn { light, ..Drawn::disc(radius_px) };
            // Of all places in the pixel grid, as the errors are.
            let at = |x: f64, y: f64| Drawn { centre: drawn.centre + Vector2::new(x, y), ..drawn }.bound_px(noise);
            let bound = rms(&[at(0.0, 0.0), at(0.0, 0.5), at(0.5, 0.0), at(0.5, 0.5)]).unwrap();
            let [contour, ball, refined] = rms_px(drawn, noise, &KINDS, |image| (image, None)).try_into().unwrap();
            let case = format!(
                "light {:.1}, radius {radius_px} px, noise {noise}: bound {bound:.4} px, contour {contour:.4} ({:.1}), ball {ball:.4} ({:.2}), \
                 refined {refined:.4} ({:.2})",
                light.norm(),
                contour / bound,
                ball / bound,
                refined / bound
            );
            eprintln!("{case}");
            if ball > 1.8 * bound || refined > 1.2 * bound {
                beyond.push(case);
            }
        }
    }
    assert!(beyond.is_empty(), "{beyond:#?}");
}

#[test]
fn compressed_frames_cost_little() {
    let mut beyond = Vec::new();
    // Chroma for every second column, as webcams send it, and for every second row as well: there a small ball is only a few samples wide,
    // and of each the high frequencies, which tell its edge, are rounded to nothing.
    for sampling in [SamplingFactor::F_2_1, SamplingFactor::F_2_2] {
        for radius_px in [5.0, 8.0, 12.0] {
            let all = rms_px(Drawn::disc(radius_px), 3.0, &KINDS, |image| compressed(&image, 85, sampling));
            let [contour, ball, refined] = all.try_into().unwrap();
            let case = format!("{sampling:?}, radius {radius_px} px: contour {contour:.4}, ball {ball:.4}, refined {refined:.4} px");
            eprintln!("{case}");
            let limit_px = if sampling == SamplingFactor::F_2_2 && radius_px < 6.0 { 0.036 } else { 0.03 };
            if ball > limit_px || refined > limit_px {
                beyond.push(case);
            }
        }
    }
    assert!(beyond.is_empty(), "{beyond:#?}");
}

const LIGHTS: [Vector3<f64>; 3] = [Vector3::new(0.0, 0.0, 0.0), Vector3::new(-0.2, -0.5, -0.4), Vector3::new(0.4, -0.1, -0.2)];

/// Mean squared error over the variance `of` a centre in each case of lights, sizes and ways of sending.
fn square_over_variance(lights: &[Vector3<f64>], gamma: f64, of: impl Fn(&Ball) -> f64 + Sync) -> Vec<f64> {
    let trials = 40;
    let mut cases = Vec::new();
    for &light in lights {
        for sampling in [None, Some(SamplingFactor::F_2_1), Some(SamplingFactor::F_2_2)] {
            cases.extend([6.0, 9.0, 12.0].map(|radius_px| (Drawn { light, ..Drawn::disc(radius_px) }, sampling)));
        }
    }
    let one = |&(drawn, sampling): &(Drawn, Option<SamplingFactor>)| {
        let (mut ratio, mut mean_px) = (0.0, Vector2::zeros());
        for seed in 0..trials {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let shift = Vector2::new(rng.random_range(-8.0..8.0), rng.random_range(-8.0..8.0));
            let here = Drawn { centre: drawn.centre + shift, ..drawn };
            let image = here.photograph(gamma, 3.0, &mut rng);
            let (image, sampling) = sampling.map_or((image.clone(), None), |sampling| compressed(&image, 85, sampling));
            let blobs = Blobs::find(&image, None, &MarkerColour::default()).sampled(sampling.as_ref());
            let ball = blobs.centre(&blobs.found[0], Centre::Ball);
            let off_px = ball.centre_px - here.centre;
            ratio += off_px.norm_squared() / (2.0 * of(&ball)) / trials as f64;
            mean_px += off_px / trials as f64;
        }
        let [x, y, z] = drawn.light.into();
        eprintln!(
            "gamma {gamma}, light {x:.1} {y:.1} {z:.1}, {sampling:?}, radius {} px: mean {:.3} {:.3} px, squares {ratio:.2} of the variance",
            drawn.radius_px, mean_px.x, mean_px.y
        );
        ratio
    };
    cases.par_iter().map(one).collect()
}

/// Whether claims hold on average and in each case. Of 40 balls' two axes a case's ratio scatters by 16 % of itself.
fn hold(ratios: &[f64]) -> bool {
    let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
    eprintln!("squared error over claimed variance: mean {mean:.2}, cases {ratios:.2?}");
    (0.6..1.4).contains(&mean) && ratios.iter().all(|ratio| (0.25..2.0).contains(ratio))
}

#[test]
fn centres_scatter_as_they_claim_raw_and_compressed() {
    let ratios = square_over_variance(&LIGHTS, 1.0, |ball| 0.5 * ball.noise_px2.trace());
    assert!(hold(&ratios), "{ratios:?}");
}

#[test]
fn a_cameras_response_moves_balls_that_are_lit_from_one_side_as_claimed() {
    let ratios = square_over_variance(&LIGHTS[1..], 2.2, |ball| 0.5 * ball.covariance_px2().trace());
    assert!(hold(&ratios), "{ratios:?}");
}
