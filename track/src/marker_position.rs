//! Where a marker at rest is before the left camera, from all frames of a recording.
//!
//! Blobs of the marker's colour in the left and the right image are taken together if their rays meet and they have the size of the marker
//! at that distance. Something else of that colour far away fails the second test: it has next to no disparity. Candidates of all frames
//! are gathered by place; if more than one place remains, the recording does not say which is the marker.

use std::path::Path;

use image::RgbImage;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use raven::camera::{Cameras, Pinhole};
use raven::stats::{median, robust_std};
use raven::{Error, Result};

use crate::centre::Ball;
use crate::look::Marker;
use crate::marker::Blobs;
use crate::perspective::ball_centre;

/// A place where the marker may be, in the left camera's frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Place {
    /// Robust mean over the frames [m].
    pub point_left: Vector3<f64>,
    /// Covariance of that mean from its scatter [m^2].
    pub covariance: Matrix3<f64>,
    /// Frames in which it was seen.
    pub frames: usize,
}

/// A blob in one image.
#[derive(Debug, Clone, Copy)]
struct Disc {
    centre_px: Vector2<f64>,
    covariance_px2: Matrix2<f64>,
    radius_px: f64,
}

/// Candidates of all frames, gathered by place.
#[derive(Debug, Clone, Default)]
pub struct Gathered {
    frames: usize,
    places: Vec<Vec<Vector3<f64>>>,
}

/// Rays meet if chi-square, one degree of freedom, is below its 99.9 % quantile for noise three times as large as the blobs claim: shading
/// moves both centres.
const LARGEST_CHI2: f64 = 9.0 * 10.83;
/// The blob's radius over that of the marker at its distance: blur and threshold make it larger or smaller.
const RADIUS_RATIO: [f64; 2] = [0.6, 1.6];
/// Candidates nearer than this, relative to their distance, are one place.
const SAME_PLACE: f64 = 0.02;
/// A place must be seen in this part of the frames of the most seen one, else it is a passing reflection.
const LEAST_SHARE: f64 = 0.3;

impl Gathered {
    /// Adds the candidates of a pair of frames.
    pub fn add(&mut self, cameras: &Cameras, marker: &Marker, images: [&RgbImage; 2]) {
        self.frames += 1;
        let mut points = candidates(cameras, marker, images, 0.0);
        // A place gets one candidate per frame, the best.
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut taken: Vec<usize> = Vec::new();
        for (_, point) in points {
            let near = |place: &Vec<Vector3<f64>>| at_one_place(&place[place.len() - 1], &point);
            let index = self.places.iter().position(near).unwrap_or_else(|| {
                self.places.push(Vec::new());
                self.places.len() - 1
            });
            if !taken.contains(&index) {
                self.places[index].push(point);
                taken.push(index);
            }
        }
    }

    /// Pairs of frames added.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// The places that were seen often, the most seen first.
    #[must_use]
    pub fn places(&self) -> Vec<Place> {
        let most = self.places.iter().map(Vec::len).max().unwrap_or(0);
        let often = self.places.iter().filter(|p| p.len() as f64 >= LEAST_SHARE * most as f64);
        let mut places: Vec<Place> = often.filter_map(|points| robust_mean(points)).collect();
        places.sort_by_key(|p| std::cmp::Reverse(p.frames));
        places
    }
}

/// Whether two points before a camera [m] are too near each other to be two markers.
#[must_use]
pub fn at_one_place(one: &Vector3<f64>, other: &Vector3<f64>) -> bool {
    (one - other).norm() < SAME_PLACE * other.norm()
}

/// Chi-square and place, in the left camera's frame [m], of all that can be the marker in a pair of images.
///
/// `slack_px` is how far the marker may have moved between two images that were not taken at one time.
#[must_use]
pub fn candidates(cameras: &Cameras, marker: &Marker, images: [&RgbImage; 2], slack_px: f64) -> Vec<(f64, Vector3<f64>)> {
    let [left, right] = [(images[0], &cameras.left), (images[1], &cameras.right)].map(|(image, camera)| discs(image, camera, marker));
    let slack = slack_px * slack_px / LARGEST_CHI2;
    left.iter().flat_map(|left| right.iter().filter_map(move |right| candidate(cameras, marker, [left, right], slack))).collect()
}

/// The one place that can be the marker.
///
/// # Errors
/// A sentence if there are several, or with `none` if there is none.
pub fn the_only(log: &Path, places: &[Place], none: impl FnOnce() -> String) -> Result<Place> {
    let listed = |place: &Place| {
        let [x, y, z] = (place.point_left * 1e3).into();
        format!("({x:.0}, {y:.0}, {z:.0}) mm in {} frames", place.frames)
    };
    match places {
        [one] => Ok(one.clone()),
        [] => Err(Error::file(log, none())),
        several => {
            let list: Vec<String> = several.iter().map(listed).collect();
            let list = list.join(" and at ");
            let sentence = format!(
                "several balls of the marker's colour and size are in view, at {list} before the left camera. Cover all but the marker."
            );
            Err(Error::file(log, sentence))
        }
    }
}

fn discs(image: &RgbImage, camera: &Pinhole, marker: &Marker) -> Vec<Disc> {
    let blobs = Blobs::find(image, None, &marker.colour);
    let round = blobs.found.iter().filter(|blob| !blob.cut_off && blob.is_round());
    let disc = |ball: Ball| Disc {
        centre_px: ball_centre(camera, &ball.centre_px, ball.radius_px),
        covariance_px2: ball.covariance_px2(),
        radius_px: ball.radius_px,
    };
    round.map(|blob| disc(blobs.centre(blob, marker.centre))).collect()
}

/// Chi-square and place of two discs, if they can be the marker; `slack` is added to the variance of their centres [px^2].
fn candidate(cameras: &Cameras, marker: &Marker, [left, right]: [&Disc; 2], slack: f64) -> Option<(f64, Vector3<f64>)> {
    let noise = [left, right].map(|d| d.covariance_px2 + Matrix2::identity() * (0.5 * slack));
    let seen = cameras.triangulate(&[left.centre_px, right.centre_px], &noise)?;
    let fits = |disc: &Disc, camera: &Pinhole, depth: f64| {
        let ratio = disc.radius_px * depth / (marker.radius_m * (camera.fx * camera.fy).sqrt());
        (RADIUS_RATIO[0]..=RADIUS_RATIO[1]).contains(&ratio)
    };
    let right_depth = (cameras.right_from_left * nalgebra::Point3::from(seen.point_left)).z;
    let plausible = fits(left, &cameras.left, seen.point_left.z) && fits(right, &cameras.right, right_depth);
    (plausible && seen.chi2 < LARGEST_CHI2).then_some((seen.chi2, seen.point_left))
}

/// Mean of the points within three robust standard deviations of the median, and its covariance.
fn robust_mean(points: &[Vector3<f64>]) -> Option<Place> {
    let axis = |i: usize| points.iter().map(|p| p[i]).collect::<Vec<f64>>();
    let middle = Vector3::new(median(&axis(0))?, median(&axis(1))?, median(&axis(2))?);
    let spread = |i: usize| robust_std(&axis(i).iter().map(|v| v - middle[i]).collect::<Vec<f64>>());
    let sigma = Vector3::new(spread(0)?, spread(1)?, spread(2)?);
    let near: Vec<&Vector3<f64>> = points.iter().filter(|p| (0..3).all(|i| (p[i] - middle[i]).abs() <= 3.0 * sigma[i] + 1e-9)).collect();
    let count = near.len() as f64;
    let mean = near.iter().copied().sum::<Vector3<f64>>() / count;
    let scatter = near.iter().map(|p| (*p - mean) * (*p - mean).transpose()).sum::<Matrix3<f64>>();
    Some(Place { point_left: mean, covariance: scatter / (count * (count - 1.0).max(1.0)), frames: points.len() })
}
