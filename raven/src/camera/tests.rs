//! Projection against hand-computed values, slopes against differences, and the claimed covariance by sampling.

use approx::assert_relative_eq;
use nalgebra::{Isometry3, Matrix2, Matrix3, Vector2, Vector3};
use proptest::prelude::*;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

use super::*;

fn webcam() -> Pinhole {
    Pinhole { width: 640, height: 480, fx: 600.0, fy: 602.0, cx: 322.0, cy: 236.0, distortion: [-0.29, 0.1, 1e-3, -5e-4, 0.02] }
}

pub(super) fn pair() -> Cameras {
    Cameras {
        left: webcam(),
        right: Pinhole { cx: 316.0, ..webcam() },
        right_from_left: Isometry3::new(Vector3::new(-0.048, 0.0, 0.0), Vector3::new(0.001, 0.004, -0.002)),
        base_from_left: Some(Isometry3::new(Vector3::new(-0.05, -0.4, 0.01), Vector3::new(1.2, 1.2, -1.2))),
        latency_s: 0.02,
        right_minus_left_s: 0.0015,
        quality: Quality { left_rms_px: Some(0.19), left_std: Some([0.5, 0.5, 1.0, 1.0]), ..Quality::default() },
    }
}

#[test]
fn a_projection_worked_out_by_hand() {
    let camera = Pinhole { distortion: [-0.2, 0.1, 0.01, -0.02, 0.0], ..webcam() };
    // x = 0.5, y = -0.25, r2 = 0.3125, radial = 1 - 0.0625 + 0.009765625 = 0.947265625.
    let pixel = camera.project(&Vector3::new(1.0, -0.5, 2.0)).unwrap();
    let x = 0.5 * 0.947265625 + 2.0 * 0.01 * 0.5 * -0.25 + -0.02 * (0.3125 + 0.5);
    let y = -0.25 * 0.947265625 + 0.01 * (0.3125 + 0.125) + 2.0 * -0.02 * 0.5 * -0.25;
    assert_relative_eq!(pixel, Vector2::new(600.0 * x + 322.0, 602.0 * y + 236.0), epsilon = 1e-9);
    assert!(camera.project(&Vector3::new(0.0, 0.0, -1.0)).is_none());
}

#[test]
fn the_file_reads_back_as_it_was_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cameras.yaml");
    pair().write(&path).unwrap();
    let back = Cameras::read(&path).unwrap();
    assert_eq!((back.left, back.right, back.latency_s, back.quality), (pair().left, pair().right, 0.02, pair().quality));
    assert_relative_eq!(back.right_from_left, pair().right_from_left, epsilon = 1e-12);
    assert_relative_eq!(back.base_from_left.unwrap(), pair().base_from_left.unwrap(), epsilon = 1e-12);
}

/// With everything that is known of a calibration.
fn full() -> Quality {
    Quality {
        left_rms_px: Some(0.19),
        right_rms_px: Some(0.2),
        stereo_rms_px: Some(0.22),
        left_std: Some([0.5, 0.5, 1.0, 1.0]),
        right_std: Some([0.6, 0.6, 1.1, 1.1]),
        baseline_std_m: Some(2e-6),
        registration_rotation_std_rad: Some([0.01, 0.02, 0.0]),
        registration_translation_std_m: Some([1e-3, 2e-3, 3e-3]),
        latency_std_s: Some(1e-3),
        right_minus_left_std_s: Some(2e-4),
        disparity_std_px: Some(0.03),
    }
}

fn parse(text: &str) -> crate::Result<Cameras> {
    Cameras::parse(std::path::Path::new("cameras.yaml"), text)
}

#[test]
fn every_key_that_is_written_is_read() {
    let cameras = Cameras { quality: full(), ..pair() };
    assert_eq!(parse(&cameras.to_yaml()).unwrap().quality, full());
    // Of ROS's keys, those that nothing is computed with may be missing.
    let unused = ["camera_name", "rectification_matrix", "projection_matrix"];
    let text = cameras.to_yaml().replace("rows: 3, cols: 3, ", "");
    let used: Vec<&str> = text.lines().filter(|line| !unused.iter().any(|key| line.contains(key))).collect();
    assert_eq!(parse(&used.join("\n")).unwrap().left, webcam());
}

#[test]
fn a_mistyped_key_is_named_and_another_programs_is_not() {
    let good = Cameras { quality: full(), ..pair() }.to_yaml();
    for (key, wrong) in [
        ("latency:", "latncy"),
        ("right_minus_left:", "right_minus_lft"),
        ("base_from_left:", "base_from_lft"),
        ("registration_translation_std_m:", "registraton_translation_std_m"),
        ("translation:", "translaton"),
    ] {
        assert!(good.contains(key), "{key}");
        let error = parse(&good.replacen(key, &format!("{wrong}:"), 1)).expect_err(wrong).to_string();
        assert!(error.starts_with("cameras.yaml: ") && error.contains(&format!("`{wrong}`")) && !error.contains('\n'), "{error}");
    }
    assert!(parse(&format!("{good}  rms: 0.2\nroom: 12\n")).is_ok());
}

#[test]
fn a_quality_that_is_no_deviation_is_named() {
    let good = Cameras { quality: full(), ..pair() }.to_yaml();
    let (before, quality) = good.split_once("quality:\n").unwrap();
    assert_eq!(quality.lines().count(), 11);
    for line in quality.lines() {
        let (key, value) = line.trim().split_once(": ").unwrap();
        for (wrong, shown) in [("-1.0", "-1"), (".nan", "NaN"), (".inf", "inf")] {
            let (value, place) = match value.rsplit_once(", ") {
                Some((first, _)) => (format!("{first}, {wrong}]"), format!("[{}]", first.matches(',').count() + 1)),
                None => (wrong.to_owned(), String::new()),
            };
            let error = parse(&format!("{before}quality: {{{key}: {value}}}\n")).expect_err(key).to_string();
            assert!(error.contains(&format!("cameras.yaml: quality.{key}{place} is {shown}, expected")), "{error}");
        }
    }
}

#[test]
fn millimetres_and_mirrors_are_named() {
    let good = pair().to_yaml();
    let fails = |text: &str| parse(text).unwrap_err().to_string();
    assert!(fails(&good.replace("translation: [-0.048", "translation: [-48.0")).contains("millimetres"));
    assert!(fails(&good.replace("plumb_bob", "equidistant")).contains("equidistant"));
    for pixels in ["0", "4294967295"] {
        let refused = fails(&good.replacen("image_height: 480", &format!("image_height: {pixels}"), 1));
        assert!(refused.contains(&format!("left.image_height is {pixels}")), "{refused}");
    }
    let start = good.find("right_from_left").unwrap();
    let end = start + good[start..].find('\n').unwrap();
    let mirror = "right_from_left: {rotation: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0], translation: [-0.048, 0.0, 0.0]}";
    assert!(fails(&good.replace(&good[start..end], mirror)).contains("no rotation"));
}

#[test]
fn triangulation_scatters_as_its_covariance_says() {
    let cameras = pair();
    let truth = Vector3::new(0.03, -0.02, 0.42);
    let pixels = cameras.project(&truth).unwrap();
    let noise = [Matrix2::new(0.04, 0.01, 0.01, 0.09), Matrix2::identity() * 0.0225];
    let factor = noise.map(|c| c.cholesky().unwrap().l());
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let (mut scatter, mut chi2, samples) = (Matrix3::zeros(), 0.0, 4000);
    let claimed = cameras.triangulate(&pixels, &noise).unwrap().covariance;
    for _ in 0..samples {
        let noisy = [0, 1].map(|i| pixels[i] + factor[i] * Vector2::new(normal(), normal()));
        let seen = cameras.triangulate(&noisy, &noise).unwrap();
        let error = seen.point_left - truth;
        scatter += error * error.transpose() / f64::from(samples);
        chi2 += seen.chi2 / f64::from(samples);
    }
    let ratio = claimed.try_inverse().unwrap() * scatter;
    // 4000 samples: the trace of three unit variances has a standard deviation of sqrt(2 * 3 / 4000) = 0.039.
    assert_relative_eq!(ratio.trace(), 3.0, epsilon = 0.16);
    assert_relative_eq!(chi2, 1.0, epsilon = 0.1);
}

proptest! {
    #[test]
    fn undistort_undoes_distort(u in 0.0..640.0_f64, v in 0.0..480.0_f64) {
        let pixel = Vector2::new(u, v);
        let normal = webcam().undistort(&pixel).unwrap();
        prop_assert!((webcam().pixel(&normal) - pixel).amax() < 1e-9);
    }

    #[test]
    fn slope_is_the_difference(x in -0.2..0.2_f64, y in -0.15..0.15_f64, z in 0.2..1.0_f64) {
        let point = Vector3::new(x, y, z);
        let (_, slope) = webcam().project_with_slope(&point).unwrap();
        for axis in 0..3 {
            let mut step = Vector3::zeros();
            step[axis] = 1e-6;
            let difference = (webcam().project(&(point + step)).unwrap() - webcam().project(&(point - step)).unwrap()) / 2e-6;
            prop_assert!((difference - slope.column(axis)).amax() < 1e-3 * slope.amax());
        }
    }

    #[test]
    fn triangulation_finds_the_point(x in -0.1..0.1_f64, y in -0.1..0.1_f64, z in 0.2..1.0_f64) {
        let point = Vector3::new(x, y, z);
        let pixels = pair().project(&point).unwrap();
        let seen = pair().triangulate(&pixels, &[Matrix2::identity(); 2]).unwrap();
        prop_assert!((seen.point_left - point).norm() < 1e-9);
    }
}
