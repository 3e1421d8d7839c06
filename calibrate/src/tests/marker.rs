//! The marker's place from drawn discs.

use image::{Rgb, RgbImage};
use nalgebra::{Isometry3, Point3, Vector2, Vector3};
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use raven::camera::{Cameras, Pinhole, Quality};
use raven_track::colour::MarkerColour;
use raven_track::look::Marker;
use raven_track::marker::Centre;

use raven_track::marker_position::Gathered;

const MARKER: Vector3<f64> = Vector3::new(0.04, -0.03, 0.38);
const RADIUS_M: f64 = 0.005;

fn cameras() -> Cameras {
    let left = Pinhole { width: 640, height: 480, fx: 600.0, fy: 600.0, cx: 322.0, cy: 236.0, distortion: [-0.1, 0.03, 0.0, 0.0, 0.0] };
    Cameras {
        left,
        right: Pinhole { fx: 608.0, fy: 608.0, cx: 312.0, cy: 247.0, ..left },
        right_from_left: Isometry3::new(Vector3::new(-0.0481, 0.0, 0.0), Vector3::new(0.0005, -0.004, 0.001)),
        base_from_left: None,
        latency_s: 0.0,
        right_minus_left_s: 0.0,
        quality: Quality::default(),
    }
}

fn marker() -> Marker {
    Marker { colour: MarkerColour::default(), radius_m: RADIUS_M, shaft_radius_m: 0.0, centre: Centre::Ball }
}

/// Green discs on grey, with noise.
fn picture(discs: &[(Vector2<f64>, f64)], rng: &mut impl Rng) -> RgbImage {
    RgbImage::from_fn(640, 480, |x, y| {
        let at = Vector2::new(f64::from(x), f64::from(y));
        let cover = discs.iter().map(|(centre, radius)| (radius + 0.5 - (at - centre).norm()).clamp(0.0, 1.0)).fold(0.0, f64::max);
        let grey = |green: f64, noise: f64| (130.0 * (1.0 - cover) + green * cover + noise).round() as u8;
        Rgb([40.0, 170.0, 60.0].map(|green| grey(green, rng.random_range(-4.0..4.0))))
    })
}

/// A ball in both images.
fn ball(cameras: &Cameras, at: Vector3<f64>) -> [(Vector2<f64>, f64); 2] {
    let [left, right] = cameras.project(&at).unwrap();
    let right_depth = (cameras.right_from_left * Point3::from(at)).z;
    [(left, cameras.left.fx * RADIUS_M / at.z), (right, cameras.right.fx * RADIUS_M / right_depth)]
}

fn gathered(balls: &[[(Vector2<f64>, f64); 2]]) -> Gathered {
    let cameras = cameras();
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut gathered = Gathered::default();
    for _ in 0..6 {
        let images = [0, 1].map(|c| picture(&balls.iter().map(|b| b[c]).collect::<Vec<_>>(), &mut rng));
        gathered.add(&cameras, &marker(), [&images[0], &images[1]]);
    }
    gathered
}

#[test]
fn a_marker_before_a_distant_patch_of_its_colour_is_found() {
    let cameras = cameras();
    let far = cameras.project(&Vector3::new(-20.0, 8.0, 100.0)).unwrap();
    let found = gathered(&[ball(&cameras, MARKER), [(far[0], 9.0), (far[1], 9.0)]]);
    let places = found.places();
    assert_eq!((found.frames(), places.len(), places[0].frames), (6, 1, 6));
    let error = places[0].point_left - MARKER;
    assert!(error.xy().norm() < 2e-4 && error.z.abs() < 1e-3, "{error}");
    assert!(places[0].covariance.trace() > 0.0);
}

#[test]
fn two_markers_are_two_places() {
    let cameras = cameras();
    let found = gathered(&[ball(&cameras, MARKER), ball(&cameras, Vector3::new(-0.05, 0.06, 0.45))]);
    assert_eq!(found.places().len(), 2);
}

#[test]
fn no_marker_is_no_place() {
    assert!(gathered(&[]).places().is_empty());
}
