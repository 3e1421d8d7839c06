//! The check values of the robot model, and properties that hold for every arm.

use approx::assert_relative_eq;
use nalgebra::{Matrix3, Matrix6, Vector3};
use proptest::prelude::*;

use super::*;

/// The nominal gold arm, as the public controller and dynamic model have it.
fn nominal() -> Robot {
    crate::robot::nominal::gold()
}

fn green() -> Robot {
    let mut robot = nominal();
    if let KinematicsKind::Raven(k) = &mut robot.kinematics {
        k.arm = ArmSide::Green;
    }
    robot
}

fn joint(shoulder_deg: f64, elbow_deg: f64, insertion_m: f64) -> Vector3<f64> {
    Vector3::new(shoulder_deg.to_radians(), elbow_deg.to_radians(), insertion_m)
}

#[test]
fn tip_at_hard_stop_and_home() {
    let k = nominal().arm().unwrap().kinematics;
    assert_relative_eq!(k.forward(&joint(0.0, 137.5, 0.562)) * 1e3, Vector3::new(61.665, -16.348, -66.289), epsilon = 1e-3);
    assert_relative_eq!(k.forward(&joint(30.0, 90.0, 0.40)) * 1e3, Vector3::new(-65.738, -21.308, 11.154), epsilon = 1e-3);
}

#[test]
fn motors_at_home() {
    let t = nominal().arm().unwrap().transmission;
    let motors = t.motor_from_joint(&joint(30.0, 90.0, 0.40));
    assert_relative_eq!(motors, Vector3::new(71.3122, 200.1414, 899.6370), epsilon = 1e-4);
}

#[test]
fn transmission_ratios_are_the_public_controllers() {
    let t = nominal().arm().unwrap().transmission;
    assert_relative_eq!(t.ratio, Vector3::new(136.1963, 121.5221, 2158.5903), epsilon = 1e-3);
}

#[test]
fn bias_forces_of_another_rigid_body_engine() {
    let dynamics = nominal().arm().unwrap().dynamics;
    let q = joint(45.0, 90.0, 0.35);
    assert_relative_eq!(dynamics.bias(&q, &Vector3::zeros()), Vector3::new(-1.13046, -0.55510, 3.30727), epsilon = 1e-5);
    let moving = dynamics.bias(&q, &Vector3::new(0.3, -0.2, 0.05));
    assert_relative_eq!(moving, Vector3::new(-1.12686, -0.55578, 3.29405), epsilon = 1e-5);
    let mass = Matrix3::new(0.201528, 0.023559, 0.007343, 0.023559, 0.091293, -0.000048, 0.007343, -0.000048, 0.407);
    assert_relative_eq!(dynamics.mass_matrix(&q), mass, epsilon = 1e-6);
}

#[test]
fn the_depth_noise_of_one_millimetre_seen_at_the_shoulder() {
    let k = nominal().arm().unwrap().kinematics;
    for (insertion_m, expected_deg) in [(0.26, 0.28), (0.35, 0.49), (0.40, 0.85)] {
        let inverse = k.jacobian(&joint(30.0, 90.0, insertion_m)).try_inverse().unwrap();
        let shoulder_deg = (inverse.row(0).norm() * 1e-3).to_degrees();
        assert_relative_eq!(shoulder_deg, expected_deg, epsilon = 0.006);
    }
}

#[test]
fn a_wrong_radius_is_no_error_at_the_hard_stop() {
    let right = nominal().arm().unwrap();
    let mut wrong = nominal();
    for (j, joint) in wrong.joints.iter_mut().enumerate() {
        joint.motor_at_hard_stop = Some(right.transmission.motor_at_hard_stop[j]);
        joint.link_pulley_radius *= 0.95;
    }
    let wrong = wrong.arm().unwrap();
    let at_stop = wrong.transmission.joint_from_motor(&right.transmission.motor_at_hard_stop);
    assert_relative_eq!(at_stop, right.hard_stop, epsilon = 1e-12);
    let home = joint(30.0, 90.0, 0.40);
    let error = wrong.transmission.joint_from_motor(&right.transmission.motor_from_joint(&home)) - home;
    assert_relative_eq!(error[0], home[0] * (1.0 / 0.95 - 1.0), epsilon = 1e-12);
}

#[test]
fn the_cable_law_is_linear_at_millimetres() {
    let cable = Cable::new(720_000.0, 4000.0);
    assert_relative_eq!(cable.force(1e-3, 0.0), 2.0 * 720_000.0 * 1e-3, max_relative = 1e-6);
    assert_relative_eq!(cable.static_stretch_m(cable.force(2e-3, 0.0)), 2e-3, max_relative = 1e-12);
}

#[test]
fn links_settle_where_the_cables_hold_them() {
    let model = LinkModel::new(nominal().arm().unwrap());
    let motor = model.arm().transmission.motor_from_joint(&joint(45.0, 90.0, 0.35));
    let settled = model.settled(&motor, &Vector3::zeros());
    let state = LinkState::new(settled, Vector3::zeros());
    assert_relative_eq!(model.acceleration(&state, &motor, &Vector3::zeros()), Vector3::zeros(), epsilon = 1e-3);
}

/// Rolls links out along a path for half a second by a model's own steps, and by such as are given; neither may be off by more than `within`.
fn own_steps_are_short_enough(model: &LinkModel, path: impl Fn(f64) -> Vector3<f64>, way: f64, fine_s: f64, within: f64) {
    let transmission = &model.arm().transmission;
    let start = LinkState::new(model.settled(&transmission.motor_from_joint(&path(0.0)), &Vector3::repeat(way)), Vector3::zeros());
    let (mut coarse, mut fine) = (start, start);
    let sample_s = 1e-3;
    for k in 0..500 {
        let (now, next) = [k, k + 1].map(|k| transmission.motor_from_joint(&path(f64::from(k) * sample_s))).into();
        let rate = (next - now) / sample_s;
        coarse = model.advance(coarse, &now, &rate, sample_s);
        for i in 0..(sample_s / fine_s).round() as u32 {
            fine = model.step(&fine, &(now + rate * (f64::from(i) * fine_s)), &rate, fine_s);
        }
        assert_relative_eq!(coarse.position, fine.position, epsilon = within);
    }
}

#[test]
fn a_coarse_step_is_as_good_as_twenty_fine_ones() {
    let model = LinkModel::new(nominal().arm().unwrap());
    let path = |t: f64| joint(45.0, 90.0, 0.35) + Vector3::new(0.3 * (6.0 * t).sin(), 0.2 * (9.0 * t).sin(), 0.02 * (12.0 * t).sin());
    // One count of the motor's encoder is 1.2e-5 rad at the shoulder.
    own_steps_are_short_enough(&model, path, 1.0, 5e-5, 1e-5);
}

#[test]
fn steps_are_short_enough_for_friction_that_grows_with_the_load() {
    for per_load in [0.2, 0.4, 1.0] {
        let mut robot = nominal();
        for joint in &mut robot.joints {
            joint.link_friction.as_mut().unwrap().per_load = per_load;
        }
        // So slow that no joint gets out of the speeds at which friction at rest gives way.
        let path = |t: f64| joint(45.0, 90.0, 0.35) + Vector3::new(0.001, 0.001, 0.0005) * t;
        own_steps_are_short_enough(&LinkModel::new(robot.arm().unwrap()), path, 0.0, 2e-5, 1e-6);
    }
}

#[test]
fn no_number_of_a_file_makes_a_step_take_for_ever() {
    let mut robot = nominal();
    for joint in &mut robot.joints {
        joint.cable = Some(Cable { slack: 1e-4, ..Cable::new(1e12, 1e12) });
    }
    let model = LinkModel::new(robot.arm().unwrap());
    let motor = model.arm().transmission.motor_from_joint(&joint(45.0, 90.0, 0.35));
    let state = LinkState::new(joint(46.0, 91.0, 0.36), Vector3::repeat(1.0));
    // It does not stay finite, and says so at once.
    let reached = model.advance(state, &motor, &Vector3::zeros(), 1e-3);
    assert!(!reached.position.iter().all(|v| v.is_finite()));
}

#[test]
fn energy_is_conserved_without_friction_and_cables() {
    let mut robot = nominal();
    for joint in &mut robot.joints {
        joint.link_friction = Some(ViscousCoulomb::default());
        joint.cable = Some(Cable::new(0.0, 0.0));
    }
    let model = LinkModel::new(robot.arm().unwrap());
    let mut state = LinkState::new(joint(45.0, 90.0, 0.35), Vector3::new(0.3, -0.2, 0.05));
    let kinetic = |s: &LinkState| 0.5 * s.rate.dot(&(model.arm().dynamics.mass_matrix(&s.position) * s.rate));
    let before = kinetic(&state);
    let mut gravity_work = 0.0;
    let step_s = 1e-5;
    for _ in 0..20_000 {
        let power = |s: &LinkState| -model.arm().dynamics.gravity(&s.position).dot(&s.rate);
        let start = power(&state);
        state = model.step(&state, &Vector3::zeros(), &Vector3::zeros(), step_s);
        gravity_work += 0.5 * (start + power(&state)) * step_s;
    }
    assert!((kinetic(&state) - before).abs() > 1e-2, "the links must fall for this to mean anything");
    // The rigid-body terms are held over a step, so the balance closes with the first power of it.
    assert_relative_eq!(kinetic(&state), before + gravity_work, epsilon = 5e-6);
}

#[test]
fn a_slow_rollout_follows_the_settled_links_and_restarts_after_pauses() {
    let model = LinkModel::new(nominal().arm().unwrap());
    let transmission = &model.arm().transmission;
    let path = |t: f64| joint(45.0, 90.0, 0.35) + Vector3::new(0.02, -0.02, 0.004) * t;
    let samples = (0..2000).map(|k| f64::from(k) * 1e-3 + if k < 1000 { 0.0 } else { 3.0 });
    let time_s: Vec<f64> = samples.collect();
    let track = MotorTrack { angle: time_s.iter().map(|&t| transmission.motor_from_joint(&path(t))).collect(), time_s };
    let states = model.rollout(&track, &[-1.0, 0.9, 2.5, 4.9, 9.0]);
    assert!(states[0].is_none() && states[2].is_none() && states[4].is_none());
    for (state, t) in [(states[1], 0.9), (states[3], 4.9)] {
        let settled = model.settled(&transmission.motor_from_joint(&path(t)), &Vector3::new(1.0, -1.0, 1.0));
        assert_relative_eq!(state.unwrap().position, settled, epsilon = 1e-5);
        assert_relative_eq!(state.unwrap().rate, Vector3::new(0.02, -0.02, 0.004), epsilon = 1e-4);
    }
}

#[test]
fn the_file_reads_back_as_it_was_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("robot.yaml");
    let mut robot = nominal();
    let [rotation, translation] = [[1e-3, -2e-7, 0.0], [0.001, 0.0, -0.002]];
    let spread = Matrix6::from_fn(|i, j| 1e-4 * (i as f64 - 0.7 * j as f64).sin());
    robot.observation = Observation { latency: 0.0156, rotation, translation, covariance: None }
        .with_pose_covariance(&(spread * spread.transpose() + Matrix6::identity() * 1e-9));
    robot.joints[0].motor_at_hard_stop = Some(0.0);
    robot.calibration.push(Provenance {
        parameter: "r_l1".to_owned(),
        key: "joints.shoulder.link_pulley_radius".to_owned(),
        unit: "m".to_owned(),
        value: 0.0598,
        std: 1e-5,
        prior: 0.063095,
        prior_std: 0.0063,
        identified: true,
        method: "batch".to_owned(),
        logs: vec!["a log, with: signs.mcap".to_owned()],
        sha256: vec!["00ff".to_owned()],
    });
    robot.joints[0].link_pulley_radius = 0.0598;
    robot.write(&path).unwrap();
    assert_eq!(Robot::read(&path).unwrap(), robot);
    assert_eq!(robot.before_calibration().joints[0].link_pulley_radius, 0.063095);
    let text = std::fs::read_to_string(&path).unwrap();
    for (was, is, sentence) in [
        ("prior: 0.063095", "prior: .nan", "calibration of joints.shoulder.link_pulley_radius: prior is NaN"),
        ("prior: 0.063095", "prior: 0.0", "as it was before its calibration, by prior: joints.shoulder.link_pulley_radius is 0"),
        (
            "key: joints.shoulder.",
            "key: joints.nobody.",
            "calibration has joints.nobody.link_pulley_radius, a number that the file does not have",
        ),
    ] {
        assert!(text.contains(was), "{text}");
        let said = Robot::parse(&path, &text.replace(was, is)).unwrap_err().to_string();
        assert!(said.contains(sentence), "{said}");
    }
}

#[test]
fn a_coupling_that_one_file_lacks_is_one_of_zero() {
    let with = nominal();
    let mut without = with.clone();
    without.cable_coupling.retain(|coupling| coupling.to != "elbow");
    let key = "cable_coupling.shoulder.elbow";
    for (one, other, [before, after]) in [(&without, &with, [0.0, 0.14545]), (&with, &without, [0.14545, 0.0])] {
        let change = Change { key: key.to_owned(), unit: "rad/rad", before: Some(before), after };
        assert_eq!(one.changes_to(other), [change]);
    }
    assert!(with.changes_to(&with).is_empty());
}

#[test]
fn a_wrong_unit_or_key_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("robot.yaml");
    let reads = |text: String| {
        std::fs::write(&path, text).unwrap();
        Robot::read(&path).unwrap_err().to_string()
    };
    let good = nominal().to_yaml();
    let millimetres = reads(good.replace("link_pulley_radius: 0.063095", "link_pulley_radius: 63.095"));
    assert!(millimetres.contains("joints.shoulder.link_pulley_radius is 63.095") && millimetres.contains("millimetres"), "{millimetres}");
    let degrees = reads(good.replace("hard_stop: 2.399827721492203", "hard_stop: 137.5"));
    assert!(degrees.contains("joints.elbow.hard_stop is 137.5") && degrees.contains("degrees"), "{degrees}");
    let key = reads(good.replace("gear_ratio", "gear_ration"));
    assert!(key.contains("gear_ration") && key.contains("line"), "{key}");
    assert!(!key.contains('\n'), "{key}");
}

#[test]
fn a_number_that_no_robot_has_is_named() {
    let path = std::path::Path::new("robot.yaml");
    let refused = |old: &str, new: &str, about: &str| {
        let good = nominal().to_yaml();
        assert!(good.contains(old), "{old}");
        let error = Robot::parse(path, &good.replacen(old, new, 1)).expect_err(new).to_string();
        assert!(error.starts_with("robot.yaml: ") && error.contains(about), "{error}");
    };
    refused("coefficient: 0.14545", "coefficient: .nan", "cable_coupling.shoulder.elbow is NaN, expected -10 to 10");
    for (value, shown) in [("0.0", "0"), ("-0.001", "-0.001"), (".nan", "NaN")] {
        let shown = format!("stiction_speed is {shown}, expected");
        refused(
            "viscous: 0.00505",
            &format!("viscous: 0.00505, stiction_speed: {value}"),
            &format!("joints.shoulder.link_friction.{shown}"),
        );
    }
    refused("    hard_stop: 0.0", "    motor_at_hard_stop: .inf\n    hard_stop: 0.0", "joints.shoulder.motor_at_hard_stop is inf");
    for value in ["0.0", "-4000.0", ".nan"] {
        refused("revolution: 4000.0", &format!("revolution: {value}"), "encoder.counts_per_revolution is ");
    }
    for key in ["latency: .nan", "rotation: [0.0, 57.0, 0.0]", "translation: [0.0, 0.0, .inf]"] {
        let field = format!("observation.{} is ", key.split(':').next().unwrap());
        refused("tolerances:", &format!("observation: {{{key}}}\ntolerances:"), &field);
    }
    for wrong in [".nan", "-1.0e-8", "0.0"] {
        let covariance: Vec<&str> = (0..21)
            .map(|k| {
                if k == 9 {
                    wrong
                } else if [0, 2, 5, 14, 20].contains(&k) {
                    "1.0e-8"
                } else {
                    "0.0"
                }
            })
            .collect();
        let observation = format!("observation: {{covariance: [{}]}}\ntolerances:", covariance.join(", "));
        refused("tolerances:", &observation, "observation.covariance is that of no pose");
    }
    for (key, value, _) in nominal().tolerances.numbers() {
        for wrong in ["0.0", "-0.1", ".nan"] {
            refused(&format!("\n  {key}: {}", crate::yaml::float(value)), &format!("\n  {key}: {wrong}"), &format!("tolerances.{key} is "));
        }
    }
    let inertia = "inertia: [0.004649472, 0.008798247, 0.012981742, 0.000299691, -0.000027919, -0.000346185]";
    for wrong in ["[0.001, 0.001, 0.001, 0.005, 0.0, 0.0]", "[0.0, 0.001, 0.001, 0.0, 0.0, 0.0]", "[.nan, 0.001, 0.001, 0.0, 0.0, 0.0]"] {
        refused(inertia, &format!("inertia: {wrong}"), "links[0].inertia is [");
    }
    refused("center_of_mass: [0.00718", "center_of_mass: [.nan", "links[0].center_of_mass is NaN");
    refused("name: elbow", "name: shoulder", "the name `shoulder` twice");
}

#[test]
fn joints_that_no_arm_has_are_named() {
    let path = std::path::Path::new("robot.yaml");
    let refused = |change: &dyn Fn(&mut Robot), about: &str| {
        let mut robot = nominal();
        change(&mut robot);
        let error = Robot::parse(path, &robot.to_yaml()).expect_err(about).to_string();
        assert!(error.starts_with("robot.yaml: ") && error.contains(about), "{error}");
    };
    refused(&|robot| robot.joints[2].kind = JointType::Revolute, "joints.insertion.type is revolute, expected prismatic");
    refused(&|robot| robot.joints[1].kind = JointType::Prismatic, "joints.elbow.type is prismatic, expected revolute");
    refused(&|robot| robot.joints.truncate(2), "joints has 2 entries, expected 3");
    refused(&|robot| robot.joints.push(Joint { name: "roll".to_owned(), ..robot.joints[0].clone() }), "joints has 4 entries, expected 3");
}

#[test]
fn a_joint_is_named_so_that_keys_can_hold_its_name() {
    let path = std::path::Path::new("robot.yaml");
    let named = |name: &str| {
        let mut robot = nominal();
        robot.cable_coupling.clear();
        robot.joints[0].name = name.to_owned();
        Robot::parse(path, &robot.to_yaml())
    };
    for (name, about) in [("arm.shoulder", "`.`"), ("arm:shoulder", "`:`"), ("a->b", "`->`"), ("a=b", "`=`")] {
        let error = named(name).expect_err(name).to_string();
        assert!(error.contains(&format!("joints has the name `{name}`, and {about}")), "{error}");
    }
    let error = named("").unwrap_err().to_string();
    assert!(error.contains("joints[0].name is empty"), "{error}");
    for name in ["gold/shoulder_joint", "joint-1", "Schulter links"] {
        assert!(named(name).unwrap().value_mut(&format!("joints.{name}.hard_stop")).is_some());
    }
}

proptest! {
    #[test]
    fn mass_matrix_and_bias_are_what_the_recursion_says(
        shoulder in 0.0..1.57_f64, elbow in 0.2..2.9_f64, insertion in 0.23..0.60_f64, payload in 0.0..0.5_f64, gold: bool,
        rate in prop::array::uniform3(-2.0..2.0_f64),
    ) {
        let dynamics = if gold { nominal() } else { green() }.arm().unwrap().dynamics.with_payload(payload);
        let q = Vector3::new(shoulder, elbow, insertion);
        let rest = dynamics.inverse(&q, &Vector3::zeros(), &Vector3::zeros());
        prop_assert!((dynamics.gravity(&q) - rest).amax() < 1e-12);
        let rate = Vector3::from(rate);
        prop_assert!((dynamics.bias(&q, &rate) - dynamics.inverse(&q, &rate, &Vector3::zeros())).amax() < 1e-12);
        let mass = dynamics.mass_matrix(&q);
        for j in 0..3 {
            let unit = Vector3::from_fn(|i, _| f64::from(u8::from(i == j)));
            let column = dynamics.inverse(&q, &Vector3::zeros(), &unit) - rest;
            prop_assert!((mass.column(j) - column).amax() < 1e-12);
        }
    }

    #[test]
    fn inverse_undoes_forward(
        shoulder in 0.0..1.57_f64, elbow in 0.2..2.9_f64, insertion in prop_oneof![0.23..0.46_f64, 0.48..0.60_f64], gold: bool,
    ) {
        let k = if gold { nominal() } else { green() }.arm().unwrap().kinematics;
        let q = Vector3::new(shoulder, elbow, insertion);
        let back = k.inverse(&k.forward(&q), k.branch(&q)).unwrap();
        prop_assert!((back - q).amax() < 1e-10, "{q} came back as {back}");
    }

    #[test]
    fn closed_form_equals_the_chain(shoulder in 0.0..1.57_f64, elbow in 0.2..2.9_f64, insertion in 0.23..0.60_f64) {
        let k = nominal().arm().unwrap().kinematics;
        let (g1, g2) = 75.0_f64.to_radians().sin_cos();
        let (g3, g4) = 52.0_f64.to_radians().sin_cos();
        let (t1, t2) = (shoulder + 205.0_f64.to_radians(), elbow + 180.0_f64.to_radians());
        let rho = insertion - 0.47;
        let (b1, b2) = (g3 * t2.sin(), g2 * g3 * t2.cos() - g1 * g4);
        let expected = Vector3::new(
            rho * (b1 * t1.cos() + b2 * t1.sin()),
            rho * (-b2 * t1.cos() + b1 * t1.sin()),
            -rho * (g1 * g3 * t2.cos() + g2 * g4),
        );
        prop_assert!((k.forward(&Vector3::new(shoulder, elbow, insertion)) - expected).amax() < 1e-12);
    }

    #[test]
    fn jacobian_is_the_slope(shoulder in 0.0..1.57_f64, elbow in 0.2..2.9_f64, insertion in 0.23..0.60_f64, gold: bool) {
        let k = if gold { nominal() } else { green() }.arm().unwrap().kinematics;
        let q = Vector3::new(shoulder, elbow, insertion);
        let jacobian = k.jacobian(&q);
        for j in 0..3 {
            let mut step = Vector3::zeros();
            step[j] = 1e-6;
            let slope = (k.forward(&(q + step)) - k.forward(&(q - step))) / 2e-6;
            prop_assert!((slope - jacobian.column(j)).amax() < 1e-8);
        }
    }

    #[test]
    fn work_is_the_same_on_both_sides_of_the_cables(force in prop::array::uniform3(-5.0..5.0_f64), rate in prop::array::uniform3(-1.0..1.0_f64)) {
        let t = nominal().arm().unwrap().transmission;
        let (tension, rate) = (Vector3::from(force), Vector3::from(rate));
        let stretch_rate = t.stretch_rate_m_s(&Vector3::zeros(), &rate);
        prop_assert!((t.joint_force(&tension).dot(&rate) + tension.dot(&stretch_rate)).abs() < 1e-12);
        prop_assert!((t.tension_n(&t.joint_force(&tension)) - tension).amax() < 1e-12);
    }

    #[test]
    fn any_text_is_read_or_refused(text in "\\PC{0,200}") {
        let _ = crate::yaml::parse::<Robot>(std::path::Path::new("x.yaml"), &text);
    }
}
