//! Poses from sightings among which many are false.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::align::{Glimpse, Unaligned, align, extents_m, latency_s, rigid};

/// A pose turned anywhere.
fn pose() -> impl Strategy<Value = Isometry3<f64>> {
    (prop::array::uniform3(-3.0..3.0_f64), prop::array::uniform3(-0.5..0.5_f64))
        .prop_map(|(turn, shift)| Isometry3::new(Vector3::from(shift), Vector3::from(turn)))
}

/// The tip of a robot that swings all joints, `size` of the third dimension [m].
fn tip(time_s: f64, size: [f64; 3]) -> Vector3<f64> {
    Vector3::new(size[0] * (0.9 * time_s).sin(), size[1] * (1.3 * time_s).cos(), size[2] * (0.7 * time_s + 0.4).sin())
        + Vector3::repeat(0.1)
}

/// Sightings 60 ms late with 2 mm of noise, a thing of the marker's colour that rests, and others here and there.
fn glimpses(left_from_base: &Isometry3<f64>, size: [f64; 3], seed: u64) -> Vec<Glimpse> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let one = |i: u32| {
        let time_s = f64::from(i) / 15.0;
        let mut about = |size: f64| Vector3::from_fn(|_, _| random.random_range(-size..size));
        let noise = about(0.0035);
        let mut seen = vec![(left_from_base * Point3::from(tip(time_s - 0.06, size) + noise)).coords, Vector3::new(0.1, 0.05, 0.4)];
        if i.is_multiple_of(4) {
            // Hidden.
            seen.remove(0);
        }
        if i.is_multiple_of(3) {
            seen.push(Vector3::new(0.0, 0.0, 0.4) + about(0.1));
        }
        Glimpse::new(seen, |latency_s| Some(tip(time_s - latency_s, size)))
    };
    (0..300).filter_map(one).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn a_pose_is_found_whatever_it_is(base_from_left in pose(), seed in 0_u64..1000) {
        let found = align(&glimpses(&base_from_left.inverse(), [0.05, 0.04, 0.03], seed)).unwrap();
        let turned = found.base_from_left.rotation.angle_to(&base_from_left.rotation);
        let middle = base_from_left.inverse() * Point3::from(tip(0.0, [0.0; 3]));
        let off = (found.base_from_left * middle - base_from_left * middle).norm();
        prop_assert!(turned < 0.03 && off < 1.5e-3, "{turned} rad, {off} m");
        let rms_m = raven::stats::rms(&found.near_m).unwrap();
        prop_assert!((found.latency_s - 0.06).abs() < 0.0151 && found.near_m.len() >= 220 && rms_m < 0.006, "{found:?}");
    }

    #[test]
    fn points_without_noise_give_their_pose(base_from_left in pose(), points in prop::collection::vec(prop::array::uniform3(-1.0..1.0_f64), 3..12)) {
        let points: Vec<Vector3<f64>> = points.into_iter().map(Vector3::from).collect();
        prop_assume!(extents_m(&points)[1] > 0.05);
        let pairs: Vec<_> = points.iter().map(|p| (*p, (base_from_left * Point3::from(*p)).coords, 0.5 + p.x.abs())).collect();
        let found = rigid(&pairs).unwrap();
        prop_assert!((found.to_homogeneous() - base_from_left.to_homogeneous()).abs().max() < 1e-9);
    }
}

#[test]
fn a_motion_in_a_plane_will_do_and_one_along_a_line_will_not() {
    let turned = Isometry3::new(Vector3::new(0.1, -0.4, 0.0), Vector3::new(0.3, 1.2, -0.5));
    let flat = align(&glimpses(&turned.inverse(), [0.05, 0.04, 0.0], 1)).unwrap();
    assert!(flat.base_from_left.rotation.angle_to(&turned.rotation) < 0.04);
    let Err(Unaligned::Line(extents)) = align(&glimpses(&turned.inverse(), [0.05, 0.004, 0.003], 1)) else { panic!("a line") };
    // Root mean square of a sine.
    assert!((extents[0] - 0.05 / 2.0_f64.sqrt()).abs() < 2e-3 && extents[1] < 5e-3, "{extents:?}");
}

#[test]
fn sightings_of_something_else_have_no_pose() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let rests = |i: u32| {
        let time_s = f64::from(i) / 15.0;
        Glimpse::new(vec![Vector3::new(0.1, 0.0, 0.4)], |latency_s| Some(tip(time_s - latency_s, [0.05, 0.04, 0.03])))
    };
    assert!(matches!(align(&(0..200).filter_map(rests).collect::<Vec<_>>()), Err(Unaligned::NoPose(_))));
    let anywhere = |i: u32| {
        let time_s = f64::from(i) / 15.0;
        let seen = Vector3::from_fn(|_, _| random.random_range(-0.15..0.15)) + Vector3::z() * 0.4;
        Glimpse::new(vec![seen], |latency_s| Some(tip(time_s - latency_s, [0.05, 0.04, 0.03])))
    };
    assert!(matches!(align(&(0..200).filter_map(anywhere).collect::<Vec<_>>()), Err(Unaligned::NoPose(_))));
    assert_eq!(align(&[]).unwrap_err(), Unaligned::Few(0));
    assert!(Glimpse::new(vec![Vector3::zeros()], |late| (late < 0.1).then(Vector3::zeros)).is_none());
    assert!((latency_s(11) - 0.06).abs() < 1e-12);
    let axes = UnitQuaternion::from_scaled_axis(Vector3::new(0.2, 0.4, 0.1));
    let crosses: Vec<Vector3<f64>> = (0..4).map(|i| axes * Vector3::ith(i % 2, if i < 2 { 0.1 } else { -0.1 })).collect();
    let [a, b, c] = extents_m(&crosses);
    assert!((a - b).abs() < 1e-9 && (a - 0.1 / 2.0_f64.sqrt()).abs() < 1e-9 && c < 1e-6, "{a} {b} {c}");
}
