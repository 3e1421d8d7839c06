use approx::assert_relative_eq;

use super::*;
use crate::robot::{Hysteresis, MotorTrack};

/// True joint minus the controller's belief, at rest, without the static stretch of the same machine without effects.
fn offset_at(at: Vector3<f64>, hidden: &[&str]) -> Vector3<f64> {
    let robot = stiff();
    let trace = session(&robot, hidden, &Trajectory::rest(at), 0.1);
    let last = trace.samples()[99];
    last.joint - believed(&robot, &last)
}

#[test]
fn a_radius_error_grows_from_the_hard_stop() {
    for (shoulder, elbow) in [(20.0, 110.0), (70.0, 60.0)] {
        let at = pose(shoulder, elbow, 0.35);
        let offset = offset_at(at, &["pulley-radius:shoulder=0.05"]);
        assert_relative_eq!(offset[0], at[0] * (1.0 / 1.05 - 1.0), epsilon = 2e-4);
        // The coupled joints follow the shoulder that is not where it is believed.
        assert_relative_eq!(offset[1], -0.14545 * offset[0], epsilon = 2e-4);
    }
}

#[test]
fn an_offset_is_the_same_everywhere() {
    for at in [pose(20.0, 110.0, 0.30), pose(70.0, 60.0, 0.38)] {
        let offset = offset_at(at, &["joint-offset:insertion=-0.0031"]);
        assert_relative_eq!(offset[2], -0.0031, epsilon = 2e-5);
        assert_relative_eq!(offset[0], 0.0, epsilon = 1e-4);
    }
}

#[test]
fn a_coupling_moves_the_other_joint() {
    let at = pose(60.0, 90.0, 0.35);
    let offset = offset_at(at, &["cable-coupling:shoulder->elbow=0.05"]);
    assert_relative_eq!(offset[1], -0.05 * at[0], epsilon = 5e-4);
    let offset = offset_at(at, &["cable-coupling:elbow->insertion=0.01"]);
    assert_relative_eq!(offset[2], -0.01 * (at[1] - 2.399827721492203), epsilon = 5e-5);
}

#[test]
fn a_softer_cable_hangs_lower() {
    let robot = nominal::gold();
    let at = pose(45.0, 60.0, 0.35);
    let sag = |hidden: &[&str]| {
        let trace = session(&robot, hidden, &Trajectory::rest(at), 0.1);
        let last = trace.samples()[99];
        (stretch_m(&robot, &last)[2], last.tension[2])
    };
    let (stiff, _) = sag(&[]);
    let (soft, tension) = sag(&["cable-stretch:insertion=0.2"]);
    assert_relative_eq!(soft, tension / (2.0 * 9250.0 * 0.2), epsilon = 1e-6);
    assert!(soft.abs() > 3.0 * stiff.abs());
}

/// Half the distance between going up and coming down through the middle of a swing.
fn half_loop(robot: &Robot, hidden: &[&str], j: usize, swing: f64) -> f64 {
    let middle = pose(45.0, 90.0, 0.35);
    let mut up = middle;
    up[j] += swing;
    let mut down = middle;
    down[j] -= swing;
    let path = Trajectory::rest(middle).then(0.1, 3.0, up).then(0.3, 4.0, down).then(0.3, 4.0, up);
    let trace = session(robot, hidden, &path, path.end_s());
    let mut lag = [0.0; 2];
    let mut count = [0.0; 2];
    // The first move only brings the play to one side.
    for sample in &trace.samples()[3400..] {
        let at = believed(robot, sample);
        let moving = sample.joint_rate[j].abs() > 0.2 * swing;
        if moving && (at[j] - middle[j]).abs() < 0.3 * swing {
            let way = usize::from(sample.joint_rate[j] > 0.0);
            lag[way] += at[j] - sample.joint[j];
            count[way] += 1.0;
        }
    }
    0.5 * (lag[1] / count[1] - lag[0] / count[0])
}

#[test]
fn hysteresis_opens_a_loop_of_its_width() {
    let robot = stiff();
    let bare = half_loop(&robot, &[], 1, 0.2);
    assert_relative_eq!(half_loop(&robot, &["hysteresis:elbow=0.012"], 1, 0.2) - bare, 0.012, epsilon = 2e-4);
    let bare = half_loop(&robot, &[], 2, 0.03);
    assert_relative_eq!(half_loop(&robot, &["hysteresis:insertion=0.0012"], 2, 0.03) - bare, 0.0012, epsilon = 1e-5);
}

/// What is wound is what the model makes of it: by its law, and by sharp play, which it ends in.
#[test]
fn a_hysteresis_of_the_file_lags_by_its_law() {
    let arm_with = |j: usize, hysteresis: Hysteresis| {
        let mut robot = stiff();
        robot.joints[j].hysteresis = hysteresis;
        robot
    };
    let (elbow, insertion) = (pose(45.0, 90.0, 0.35) - pose(45.0, 79.0, 0.35), pose(45.0, 90.0, 0.35) - pose(45.0, 90.0, 0.32));
    for (j, swing, hysteresis) in [
        (1, elbow, Hysteresis { half_loop: 0.012, length: 0.02, straight_part: 0.0, lag_at_start: 0.4 }),
        (1, elbow, Hysteresis { half_loop: 0.012, length: 0.02, straight_part: -1.0, lag_at_start: 0.0 }),
        (2, insertion, Hysteresis { half_loop: 0.002, length: 0.002, straight_part: 1.0 - 1e-9, lag_at_start: 0.0 }),
    ] {
        let middle = pose(45.0, 90.0, 0.35);
        let path =
            Trajectory::rest(middle).then(0.1, 3.0, middle + swing).then(0.3, 4.0, middle - swing).then(0.3, 4.0, middle + 0.3 * swing);
        let lag = |hysteresis: Hysteresis| {
            let robot = arm_with(j, hysteresis);
            let trace = session(&robot, &[], &path, path.end_s());
            let lags: Vec<f64> = trace.samples().iter().map(|sample| believed(&robot, sample)[j] - sample.joint[j]).collect();
            let motor = MotorTrack {
                time_s: (0..lags.len()).map(|k| 1e-3 * k as f64).collect(),
                angle: trace.samples().iter().map(|sample| sample.cycle.motor).collect(),
            };
            let (arm, winding) = (robot.arm().unwrap(), robot.arm().unwrap().winding(&motor).into_owned());
            let modelled: Vec<f64> = motor
                .angle
                .iter()
                .zip(&winding.angle)
                .map(|(a, b)| (arm.transmission.joint_from_motor(a) - arm.transmission.joint_from_motor(b))[j])
                .collect();
            (lags, modelled)
        };
        let ((bare, _), (lagging, modelled)) = (lag(Hysteresis::default()), lag(hysteresis));
        // From where a whole swing has brought the lag to one side.
        let off = (3000..bare.len()).map(|k| (lagging[k] - bare[k] - modelled[k]).abs()).fold(0.0, f64::max);
        assert!(off < 0.02 * hysteresis.half_loop, "{hysteresis:?}: {off}");
        let seen = modelled[3000..].iter().copied().fold(f64::INFINITY, f64::min);
        assert!(seen < -0.95 * hysteresis.half_loop, "{hysteresis:?}: {seen}");
    }
}

#[test]
fn backlash_opens_where_friction_turns_the_load_and_closes_under_gravity() {
    // Friction above gravity at the elbow: its cable's load turns with the motion, and the whole width is lost.
    let robot = stiff();
    let wide = half_loop(&robot, &["backlash:elbow=0.02", "link-coulomb-friction:elbow=6"], 1, 0.2);
    assert_relative_eq!(wide, 0.01, epsilon = 5e-4);
    // Gravity on the insertion exceeds its friction: the dead zone stays on one side.
    let closed = half_loop(&robot, &["backlash:insertion=0.002"], 2, 0.03);
    assert!(closed.abs() < 2e-5, "{closed}");
    let offset = offset_at(pose(45.0, 90.0, 0.35), &["backlash:insertion=0.002"]);
    assert_relative_eq!(offset[2].abs(), 0.001, epsilon = 2e-5);
}

#[test]
fn a_stiffening_cable_is_soft_near_zero_load() {
    let robot = nominal::gold();
    let at = pose(45.0, 90.0, 0.35);
    let trace = session(&robot, &["cable-stiffening:insertion=0.00005"], &Trajectory::rest(at), 0.1);
    let last = trace.samples()[99];
    let stretch = stretch_m(&robot, &last)[2];
    // 2 k x0 sinh(x / x0), against the linear law at the same force.
    assert_relative_eq!(2.0 * 9250.0 * 5e-5 * (stretch / 5e-5).sinh(), last.tension[2], max_relative = 0.05);
    assert!(stretch < 0.95 * last.tension[2] / (2.0 * 9250.0));
}

#[test]
fn creep_follows_the_load_in_time() {
    let robot = nominal::gold();
    let trace = session(&robot, &["creep:insertion=2.0,1.0"], &Trajectory::rest(pose(45.0, 90.0, 0.35)), 8.0);
    let stretch = |k: usize| {
        let sample = trace.samples()[k];
        stretch_m(&robot, &sample)[2]
    };
    let tension = trace.samples()[7999].tension[2];
    assert_relative_eq!(stretch(7999), 3.0 * tension / (2.0 * 9250.0), max_relative = 0.05);
}

/// Mean commanded torque [N m] of a joint while it moves steadily up and down.
fn torques(hidden: &[&str], j: usize) -> [f64; 2] {
    let middle = pose(45.0, 90.0, 0.35);
    let swing = [0.2, 0.2, 0.03][j];
    let (mut up, mut down) = (middle, middle);
    up[j] += swing;
    down[j] -= swing;
    let path = Trajectory::rest(middle).then(0.1, 1.5, down).then(0.3, 2.0, up).then(0.3, 2.0, down);
    let trace = session(&nominal::gold(), hidden, &path, path.end_s());
    let mut sum = [[0.0; 2]; 2];
    for sample in &trace.samples()[1900..] {
        if sample.joint_rate[j].abs() > 0.5 * swing && (sample.joint[j] - middle[j]).abs() < 0.4 * swing {
            let way = usize::from(sample.joint_rate[j] > 0.0);
            sum[way][0] += sample.cycle.torque[j];
            sum[way][1] += 1.0;
        }
    }
    [sum[0][0] / sum[0][1], sum[1][0] / sum[1][1]]
}

#[test]
fn friction_of_motor_and_link_shows_in_the_torque_both_ways() {
    let loop_of = |hidden: &[&str]| {
        let [down, up] = torques(hidden, 1);
        0.5 * (up - down)
    };
    let bare = loop_of(&[]);
    // Motor: 6.8e-3 N m on the shaft, 12.25 times that after the gear box.
    assert_relative_eq!(loop_of(&["motor-coulomb-friction:elbow=2"]) - bare, 6.8e-3 * 12.25, max_relative = 0.05);
    // Link: 0.49 N m through the pulleys, r_mc / r_l of it at the capstan.
    assert_relative_eq!(loop_of(&["link-coulomb-friction:elbow=3"]) - bare, 2.0 * 0.49 * 5.675 / 56.297, max_relative = 0.05);
    let viscous = loop_of(&["motor-viscous-friction:elbow=6"]) - bare;
    assert!(viscous > 0.02, "{viscous}");
    assert!(loop_of(&["link-viscous-friction:elbow=500"]) - bare > 0.02);
    assert!(loop_of(&["stribeck-friction:elbow=0.5,100"]) - bare > 0.02);
    assert!(loop_of(&["load-dependent-friction:elbow=0.3"]) - bare > 0.005);
}

#[test]
fn a_strong_motor_needs_less_command() {
    let bare = torques(&[], 0);
    let strong = torques(&["torque-constant:shoulder=1.25"], 0);
    for way in 0..2 {
        assert_relative_eq!(strong[way], bare[way] / 1.25, max_relative = 0.02);
    }
}

#[test]
fn a_payload_pulls_on_every_joint() {
    let robot = nominal::gold();
    let at = pose(45.0, 90.0, 0.30);
    let load = |hidden: &[&str]| session(&robot, hidden, &Trajectory::rest(at), 0.1).samples()[99].tension;
    let more = load(&["payload=0.2", "link-coulomb-friction:insertion=0"])[2] - load(&["link-coulomb-friction:insertion=0"])[2];
    // Weight along the tool: the mass times gravity times the tool axis.
    let axis = robot.arm().unwrap().kinematics.axes(&at).0[2];
    assert_relative_eq!(more, -0.2 * axis.dot(&Vector3::new(-9.81, 0.0, 0.0)), max_relative = 0.05);
}

#[test]
fn heavy_motors_lag_and_saturated_ones_fall_behind() {
    let robot = nominal::gold();
    let path = Trajectory::of(Motion::Rich, 6.0, &robot.arm().unwrap().limits, Vector3::zeros(), &mut rng(4));
    let miss = |hidden: &[&str]| {
        let trace = session(&robot, hidden, &path, 6.0);
        trace.samples().iter().map(|s| (s.joint - s.joint_wanted)[0].powi(2)).sum::<f64>().sqrt()
    };
    let bare = miss(&[]);
    assert!(miss(&["motor-inertia:shoulder=3"]) > 1.05 * bare);
    assert!(miss(&["torque-saturation:shoulder=0.08"]) > 1.5 * bare);
}

#[test]
fn missed_counts_are_a_step_between_encoder_and_joint() {
    let robot = stiff();
    let path = Trajectory::rest(pose(45.0, 90.0, 0.35));
    let trace = session(&robot, &["missed-counts:elbow=1500,0.5"], &path, 2.0);
    let gap = |k: usize| (believed(&robot, &trace.samples()[k]) - trace.samples()[k].joint)[1];
    let step = 1500.0 / 4000.0 * std::f64::consts::TAU / 121.5221;
    assert_relative_eq!(gap(1999) - gap(900), step, max_relative = 0.01);
    // The loop pulls the joint back to where the encoder reads the set-point.
    assert_relative_eq!(trace.samples()[1999].joint[1], path.start()[1] - step, epsilon = 2e-3);
}

#[test]
fn an_eccentric_capstan_is_periodic_in_its_angle() {
    let robot = stiff();
    let drive = Machine::new(&robot, &effects(&["pulley-eccentricity:elbow=0.0005,0.3"])).unwrap().drives[1];
    let turn = std::f64::consts::TAU;
    assert_relative_eq!(drive.wound_m(turn) - drive.wound_m(0.0), 5.675e-3 * turn, epsilon = 1e-12);
    let slope = (drive.wound_m(1.0 + 1e-6) - drive.wound_m(1.0 - 1e-6)) / 2e-6;
    assert_relative_eq!(slope, 5.675e-3 + 0.0005 * 1.3_f64.sin(), epsilon = 1e-9);
    assert_relative_eq!(drive.wound_slope_m(1.0), slope, epsilon = 1e-9);
}

#[test]
fn a_slipping_capstan_ratchets() {
    let robot = stiff();
    let (low, high) = (pose(45.0, 90.0, 0.33), pose(45.0, 90.0, 0.37));
    let path = Trajectory::rest(low).then(0.1, 1.0, high).then(0.1, 1.0, low).then(0.1, 1.0, high).then(0.1, 1.0, low);
    let trace = session(&robot, &["cable-slip:insertion=1,0.02"], &path, 4.6);
    let lag = |k: usize| (believed(&robot, &trace.samples()[k]) - trace.samples()[k].joint)[2];
    // Four travels of 40 mm under gravity, 2 % each.
    assert_relative_eq!((lag(4599) - lag(50)).abs(), 0.02 * 0.16, max_relative = 0.05);
}

#[test]
fn tool_and_link_angles_are_the_machines_alone() {
    let robot = nominal::gold();
    let machine = Machine::new(&robot, &effects(&["tool-length=0.004", "link-angle:12=0.01"])).unwrap();
    let actual = machine.kinematics().unwrap();
    let nominal = robot.arm().unwrap().kinematics;
    assert_relative_eq!(actual.wrist_offset, nominal.wrist_offset + 0.004);
    assert_relative_eq!(actual.link_angle_12, nominal.link_angle_12 + 0.01);
    assert_relative_eq!(actual.link_angle_23, nominal.link_angle_23);
}

#[test]
fn inertia_resists_acceleration_only() {
    let robot = nominal::gold();
    let at = pose(45.0, 90.0, 0.35);
    let machine = |hidden: &[&str]| Machine::new(&robot, &effects(hidden)).unwrap();
    let heavy = machine(&["link-inertia:elbow=1.2", "link-inertia:insertion=1.5"]);
    let (Load::Arm { dynamics: bare, .. }, Load::Arm { dynamics: heavier, .. }) = (machine(&[]).load, heavy.load) else {
        panic!("an arm has links");
    };
    let rest = Vector3::zeros();
    assert_relative_eq!(bare.bias(&at, &rest), heavier.bias(&at, &rest), epsilon = 1e-12);
    assert!(heavier.mass_matrix(&at)[(1, 1)] > 1.01 * bare.mass_matrix(&at)[(1, 1)]);
    assert_relative_eq!(heavy.extra_inertia[2], 0.5 * 0.407, epsilon = 1e-9);
}

#[test]
fn what_is_not_an_effect_is_refused_with_the_list() {
    let robot = nominal::gold();
    let fails = |text: &str| {
        let refused = text.parse::<Effect>().and_then(|e| e.check_target(&robot).map(|()| e));
        match refused.unwrap_err() {
            crate::Error::Argument(message) => message,
            other => panic!("{other}"),
        }
    };
    assert!(fails("pully-radius:shoulder=0.1").contains("pulley-radius:JOINT="));
    assert!(fails("pulley-radius=0.1").contains("belongs to a joint"));
    assert!(fails("pulley-radius:knee=0.1").contains("shoulder, elbow, insertion"));
    assert!(fails("pulley-radius:shoulder=five").contains("`five` is no number"));
    assert!(fails("pulley-radius:shoulder=5").contains("expected -0.3 to 0.3"));
    assert!(fails("pulley-radius:shoulder=nan").contains("no number"));
    assert!(fails("camera-rotation=0.1").contains("`y` is missing"));
    assert!(fails("cable-coupling:shoulder=0.1").contains("JOINT->JOINT"));
    assert!(fails("cable-coupling:elbow->elbow=0.1").contains("itself"));
    let against = fails("cable-coupling:elbow->shoulder=0.1");
    assert!(against.contains("write shoulder->elbow"), "{against}");
    assert!(fails("payload:shoulder=0.1").contains("not to a joint"));
    assert!(fails("link-angle:13=0.1").contains("12 or 23"));
    assert!(fails("payload").contains("no `=`"));
    for kind in EffectKind::all() {
        let target = match kind.scope() {
            Scope::Joint => ":shoulder",
            Scope::Pair => ":shoulder->elbow",
            Scope::LinkAngle => ":12",
            Scope::Whole => "",
        };
        let values: Vec<String> = kind.values().iter().map(|v| v.range[1].min(1.0).to_string()).collect();
        let text = format!("{}{target}={}", kind.id(), values.join(","));
        assert_eq!(text.parse::<Effect>().unwrap().to_string(), text);
        assert!(Machine::new(&robot, &effects(&[&text])).is_ok(), "{text}");
    }
}
