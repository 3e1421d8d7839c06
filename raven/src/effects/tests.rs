use nalgebra::{Matrix2, Matrix3, Point3, Vector3};

use super::*;
use crate::robot::{Hysteresis, MotorTrack, nominal};
use crate::simulation::{Options, Session};

/// Motors of joints that swing for two seconds.
fn swinging(robot: &Robot) -> MotorTrack {
    let transmission = robot.arm().unwrap().transmission;
    let joint = |t: f64| Vector3::new(0.8 + 0.1 * (9.0 * t).sin(), 1.6 + 0.1 * (8.0 * t).cos(), 0.35 + 0.01 * (10.0 * t).sin());
    let time_s: Vec<f64> = (0..2000).map(|k| 1e-3 * f64::from(k)).collect();
    MotorTrack { angle: time_s.iter().map(|&t| transmission.motor_from_joint(&joint(t))).collect(), time_s }
}

/// Where a model has the tip in images with these stamps [s], in the base frame [m].
fn seen(model: &Model, motors: &MotorTrack, stamps_s: &[f64], rows: [f64; 2]) -> Vec<Vector3<f64>> {
    let sight = |&stamp_s: &f64| Sight { stamp_s, position_m: Vector3::zeros(), covariance_m2: Matrix3::identity(), rows };
    let sights: Vec<Sight> = stamps_s.iter().map(sight).collect();
    TipModel::new(model, motors).unwrap().rolled_out(&sights, &[]).0.into_iter().map(Option::unwrap).collect()
}

#[test]
fn identifiers_are_unique_and_ties_are_known() {
    for effect in ALL {
        assert_eq!(Effect::named(effect.id).unwrap().id, effect.id);
        assert_eq!(ALL.iter().filter(|other| other.id == effect.id).count(), 1);
        for tie in effect.ties {
            assert!(tie.exact.is_some() || Effect::named(tie.id).is_ok(), "{} is tied to {}", effect.id, tie.id);
        }
    }
    assert_eq!(ALL.len(), 34);
}

#[test]
fn a_tools_length_is_the_offset_of_the_joint_that_slides() {
    let robot = nominal::gold();
    let [length, shoulder, insertion] = [("tool-length", None), ("joint-offset", Some("shoulder")), ("joint-offset", Some("insertion"))]
        .map(|(id, place)| Sited::at(&robot, id, place).unwrap());
    assert!(length.is_exactly(&insertion) && insertion.is_exactly(&length));
    assert!(!length.is_exactly(&shoulder) && !shoulder.is_exactly(&length) && !shoulder.is_exactly(&insertion));
    assert!(!length.is_exactly(&length));
}

/// Of a cable that slips no more, and moves no other joint's.
#[test]
fn what_slipped_before_is_the_offset_that_the_library_ties_to_it() {
    let mut robot = nominal::gold();
    robot.cable_coupling.clear();
    let motors = swinging(&robot);
    let stamps_s: Vec<f64> = (1..9).map(|k| 0.1 * f64::from(k)).collect();
    let tips = |model: &Model| seen(model, &motors, &stamps_s, [0.0; 2]);
    let with = |sited: &Sited, values: &[f64]| {
        let mut model = Model::new(&robot, None).unwrap();
        (sited.effect.act)(&mut model, sited.place, values);
        tips(&model)
    };
    let nominal = tips(&Model::new(&robot, None).unwrap());
    for name in ["shoulder", "elbow", "insertion"] {
        let [slip, offset] = ["cable-slip", "joint-offset"].map(|id| Sited::at(&robot, id, Some(name)).unwrap());
        let values = [1e6, 0.01, 0.05, 0.1];
        let alike = slip.effect.ties.iter().find(|tie| tie.id == "joint-offset").and_then(|tie| tie.values).unwrap();
        let [slipped, moved] = [with(&slip, &values), with(&offset, &alike(&robot, slip.place, &values))];
        for ((slipped_m, moved_m), nominal_m) in slipped.iter().zip(&moved).zip(&nominal) {
            let shift_m = (slipped_m - nominal_m).norm();
            assert!(shift_m > 5e-4 && (slipped_m - moved_m).norm() < 0.02 * shift_m, "{name}: {slipped_m} {moved_m} {nominal_m}");
        }
    }
}

#[test]
fn values_range_to_the_very_most_that_there_is() {
    for sited in Sited::all(&nominal::gold()) {
        for parameter in sited.effect.parameters {
            let [low, high] = parameter.range(sited.measure);
            let ends = match parameter.scale {
                Scale::Factor { above: Above::UpTo(most), .. } => [low, most],
                Scale::State { most, .. } if most.is_finite() => [-most, most],
                Scale::Part | Scale::Moment => [0.0, 1.0],
                Scale::Whole { most } => [1.0, f64::from(most)],
                Scale::Magnitude(_) => [0.0, high],
                Scale::Offset(_) | Scale::State { .. } => [-high, high],
                Scale::Factor { .. } | Scale::Shape { .. } => [low.abs(), high],
            };
            assert_eq!([low, high], ends, "{} {}", sited.effect.id, parameter.name);
            assert!(parameter.usual(sited.measure).is_none_or(|usual| (low..=high).contains(&usual)) && low < high);
        }
    }
}

#[test]
fn values_and_their_units_of_a_slab_are_the_same_thing() {
    for sited in Sited::all(&nominal::gold()) {
        for parameter in sited.effect.parameters {
            for u in [0.3, 1.0] {
                let value = parameter.value(u, sited.measure);
                let again = parameter.value(parameter.u(value, sited.measure), sited.measure);
                approx::assert_relative_eq!(again, value, max_relative = 1e-12);
            }
        }
    }
}

#[test]
fn no_effect_is_no_change() {
    let robot = nominal::gold();
    for sited in Sited::all(&robot) {
        let neutral = sited.effect.parameters.iter().all(|p| p.scale.is_size());
        if neutral {
            let u = vec![0.0; sited.effect.parameters.len()];
            let model = Model::new(&robot, None).unwrap().with(&sited, &u);
            assert_eq!(model.robot, Model::new(&robot, None).unwrap().robot, "{}", sited.effect.id);
        }
    }
}

#[test]
fn a_loop_that_hardly_adds_to_the_files_leaves_its_shape() {
    let mut robot = nominal::gold();
    let own = Hysteresis { half_loop: 0.96e-3, length: 0.8e-3, straight_part: 0.2, lag_at_start: -0.4 };
    robot.joints[2].hysteresis = own;
    let sited = Sited::at(&robot, "hysteresis", Some("insertion")).unwrap();
    let with = |u: [f64; 4]| Model::new(&robot, None).unwrap().with(&sited, &u).robot.joints[2].hysteresis;
    let [little, much] = [with([1e-6, 0.0, 0.0, 1.0]), with([1e3, 0.0, 0.0, 1.0])];
    approx::assert_relative_eq!(little.half_loop, own.half_loop, max_relative = 1e-5);
    approx::assert_relative_eq!(little.length, own.length, max_relative = 1e-5);
    approx::assert_relative_eq!(little.straight_part, own.straight_part, max_relative = 1e-5);
    // Where in it a recording begins is a number of both.
    approx::assert_relative_eq!(little.lag_at_start, own.lag_at_start + 0.7, max_relative = 1e-5);
    // Its own shape where it is nearly all there is.
    approx::assert_relative_eq!(much.length, 1.5 * much.half_loop, max_relative = 0.01);
    assert_eq!(Model::new(&robot, None).unwrap().with(&sited, &[0.0; 4]).robot.joints[2].hysteresis, own);
}

#[test]
fn what_the_file_has_stays_beside_an_effect() {
    let mut robot = nominal::gold();
    let cable = robot.joints[1].cable.as_mut().unwrap();
    (cable.slack, cable.fresh_part) = (1e-4, 0.3);
    let friction = robot.joints[1].link_friction.as_mut().unwrap();
    (friction.held_part, friction.lag_at_start) = (0.4, -0.5);
    for id in ["backlash", "cable-stretch", "link-coulomb-friction"] {
        let sited = Sited::at(&robot, id, Some("elbow")).unwrap();
        let mut u = vec![0.0; sited.effect.parameters.len()];
        u[0] = 1e-9;
        let joint = &Model::new(&robot, None).unwrap().with(&sited, &u).robot.joints[1];
        let (cable, friction) = (joint.cable.unwrap(), joint.link_friction.unwrap());
        approx::assert_relative_eq!(cable.slack, 1e-4, max_relative = 1e-3);
        approx::assert_relative_eq!(cable.fresh_part, 0.3, max_relative = 1e-6);
        approx::assert_relative_eq!(friction.held_part, 0.4, max_relative = 1e-6);
        approx::assert_relative_eq!(friction.lag_at_start, -0.5, max_relative = 1e-6);
    }
}

/// Between the images the tip speeds up and slows down.
#[test]
fn a_late_image_shows_the_tip_where_it_was() {
    const LATE_S: f64 = 0.03;
    const READOUT_S: f64 = 0.02;
    let robot = nominal::gold();
    let cameras = Session::new(&robot, Options::default()).unwrap().cameras().unwrap().clone();
    let base_from_left = cameras.base_from_left.unwrap();
    let motors = swinging(&robot);
    let seen = |model: &Model, stamps_s: &[f64], rows: [f64; 2]| seen(model, &motors, stamps_s, rows);
    let mut late = Model::new(&robot, Some(&cameras)).unwrap();
    (late.view.right_minus_left_s, late.view.readout_s) = (LATE_S, READOUT_S);
    let on_time = Model::new(&robot, Some(&cameras)).unwrap();
    let rows = [0.2, -0.3];
    let stamps_s: Vec<f64> = (0..30).map(|k| 0.3 + 0.05 * f64::from(k)).collect();
    let at = |after_s: f64| seen(&on_time, &stamps_s.iter().map(|t| t + after_s).collect::<Vec<_>>(), [0.0; 2]);
    let (left_m, right_m) = (at(READOUT_S * rows[0]), at(READOUT_S * rows[1] - LATE_S));
    for ((left_m, right_m), seen_m) in left_m.iter().zip(&right_m).zip(seen(&late, &stamps_s, rows)) {
        let from_left = |tip_m: &Vector3<f64>| base_from_left.inverse_transform_point(&Point3::from(*tip_m));
        let pixels = [
            cameras.left.project(&from_left(left_m).coords).unwrap(),
            cameras.right.project(&(cameras.right_from_left * from_left(right_m)).coords).unwrap(),
        ];
        let triangulated = cameras.triangulate(&pixels, &[Matrix2::identity(); 2]).unwrap().point_left;
        let expected_m = base_from_left * Point3::from(triangulated);
        assert!((seen_m - expected_m.coords).norm() < 1e-5, "{seen_m} for {expected_m}");
        assert!((seen_m - left_m).norm() > 1e-5);
    }
}
