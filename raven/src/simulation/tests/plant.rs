use approx::assert_relative_eq;

use super::*;
use crate::robot::LinkModel;

#[test]
fn at_rest_it_sticks_without_any_drift() {
    let path = Trajectory::rest(pose(40.0, 90.0, 0.35));
    let trace = session(&nominal::gold(), &[], &path, 10.0);
    let (first, last) = (trace.samples()[0], trace.samples()[9999]);
    assert_eq!(first.joint, last.joint);
    assert_eq!(last.joint_rate, Vector3::zeros());
    assert_eq!(first.cycle, last.cycle);
}

/// Without friction, drives or cables the links fall: what gravity does shows up as motion, to the second order of the step.
#[test]
fn falling_links_gain_what_gravity_gives() {
    let miss = |step_s: f64| {
        let mut robot = nominal::gold();
        for joint in &mut robot.joints {
            joint.cable = Some(crate::robot::Cable::new(0.0, 0.0));
            joint.link_friction = Some(crate::robot::ViscousCoulomb::default());
        }
        let dynamics = robot.arm().unwrap().dynamics;
        let mut plant = Plant::at_hard_stop(Machine::new(&robot, &[]).unwrap());
        plant.hold_links(false);
        let kinetic = |s: &PlantState| 0.5 * s.joint_rate.dot(&(dynamics.mass_matrix(&s.joint) * s.joint_rate));
        let power = |s: &PlantState| -dynamics.bias(&s.joint, &Vector3::zeros()).dot(&s.joint_rate);
        let mut work = 0.0;
        for _ in 0..(0.3 / step_s).round() as usize {
            let before = power(plant.state());
            plant.advance(&Vector3::zeros(), step_s, step_s);
            work += 0.5 * (before + power(plant.state())) * step_s;
        }
        assert!(kinetic(plant.state()) > 0.1, "the links must fall for this to mean anything");
        (kinetic(plant.state()) - work).abs() / work
    };
    assert!(miss(1e-4) < 1e-6, "{}", miss(1e-4));
    assert!(miss(5e-5) < 0.3 * miss(1e-4));
}

#[test]
fn the_control_loop_keeps_up_with_its_set_points() {
    let robot = nominal::gold();
    for motion in [Motion::Sinusoid, Motion::Fls(0)] {
        let limits = robot.arm().unwrap().limits;
        let path = Trajectory::of(motion, 20.0, &limits, Vector3::zeros(), &mut rng(5));
        let trace = session(&robot, &[], &path, 20.0);
        let worst = trace.samples().iter().fold(Vector3::zeros(), |w: Vector3<f64>, s| w.sup(&(s.joint - s.joint_wanted).abs()));
        assert!(worst[0] < 0.02 && worst[1] < 0.02 && worst[2] < 0.003, "{motion}: {worst}");
    }
}

#[test]
fn resting_joints_are_where_the_static_model_has_them() {
    let robot = nominal::gold();
    let model = LinkModel::new(robot.arm().unwrap());
    for at in [pose(20.0, 60.0, 0.30), pose(45.0, 90.0, 0.35), pose(70.0, 120.0, 0.38)] {
        let trace = session(&robot, &[], &Trajectory::rest(at), 0.1);
        let last = trace.samples()[99];
        // Friction of any directions bounds where the links can come to rest.
        let corners: Vec<_> =
            (0..8).map(|c| model.settled(&last.cycle.motor, &Vector3::from_fn(|j, _| if c >> j & 1 == 1 { 1.0 } else { -1.0 }))).collect();
        // The encoder's step, at the joint, is what the controller's own reading leaves open.
        let step = 0.51 * std::f64::consts::TAU / 4000.0;
        for j in 0..3 {
            let slack = step / model.arm().transmission.ratio[j] + 1e-9;
            let low = corners.iter().map(|c| c[j]).fold(f64::INFINITY, f64::min) - slack;
            let high = corners.iter().map(|c| c[j]).fold(f64::NEG_INFINITY, f64::max) + slack;
            assert!(last.joint[j] >= low && last.joint[j] <= high, "joint {j}: {} not in {low}..{high}", last.joint[j]);
        }
    }
}

/// The lab lets friction choose among velocities, the model bends bristles; play in what drives the links swings on soft cables for seconds.
#[test]
fn links_that_friction_grips_go_where_the_labs_do() {
    use crate::robot::MotorTrack;
    for (name, factor) in [("elbow", 1.0), ("elbow", 0.1), ("shoulder", 0.05), ("insertion", 0.05)] {
        let mut robot = nominal::gold();
        let path = Trajectory::of(Motion::Fls(0), 20.0, &robot.arm().unwrap().limits, Vector3::zeros(), &mut rng(5));
        let trace = session(&robot, &[&format!("cable-stretch:{name}={factor}")], &path, 20.0);
        let samples = trace.samples();
        let every = || (0..samples.len()).step_by(2);
        let motor =
            MotorTrack { time_s: every().map(|k| k as f64 * 1e-3).collect(), angle: every().map(|k| samples[k].cycle.motor).collect() };
        // Once all have moved: what held them before the recording began is not known.
        let seen: Vec<usize> = (40..198).map(|k| k * 100).collect();
        let times: Vec<f64> = seen.iter().map(|&k| k as f64 * 1e-3).collect();
        let j = robot.joint_index(name).unwrap();
        if let Some(cable) = &mut robot.joints[j].cable {
            cable.stiffness *= factor;
        }
        robot.joints.iter_mut().filter_map(|joint| joint.link_friction.as_mut()).for_each(|friction| friction.held_part = 1.0);
        let arm = robot.arm().unwrap();
        let links = LinkModel::new(arm.clone());
        let miss = |states: Vec<Option<crate::robot::LinkState>>| {
            let miss = states.iter().zip(&seen).map(|(state, &k)| state.unwrap().position[j] - samples[k].joint[j]);
            crate::stats::rms(&miss.collect::<Vec<_>>()).unwrap()
        };
        let (gripped, played) = (miss(links.rollout_gripped(&motor, &times)), miss(links.rollout(&arm.driving(&motor), &times)));
        assert!(gripped < 0.2 * played, "{name} {factor}: {gripped} of {played}");
    }
}

/// What torques near rest hang on: cables are wound one way and the other while links hardly move.
#[test]
fn cables_of_links_that_hardly_move_pull_as_the_labs_do() {
    use crate::effects::{Command, Model, Shaft, TipModel, TorqueModel};
    use crate::robot::MotorTrack;
    const HALF: usize = 30;
    let mut robot = nominal::gold();
    let path = Trajectory::of(Motion::Fls(0), 20.0, &robot.arm().unwrap().limits, Vector3::zeros(), &mut rng(5));
    let trace = session(&robot, &[], &path, 20.0);
    let samples = trace.samples();
    let motors = MotorTrack {
        time_s: (0..samples.len()).map(|k| k as f64 * 1e-3).collect(),
        angle: samples.iter().map(|s| s.cycle.motor).collect(),
    };
    robot.joints.iter_mut().filter_map(|joint| joint.link_friction.as_mut()).for_each(|friction| friction.held_part = 1.0);
    let model = Model::new(&robot, None).unwrap();
    let at: Vec<usize> = (4000..samples.len() - HALF).step_by(20).collect();
    let shaft = |&k: &usize| {
        let (before, now, after) = (samples[k - HALF].cycle.motor, samples[k].cycle.motor, samples[k + HALF].cycle.motor);
        let h_s = HALF as f64 * 1e-3;
        Shaft {
            time_s: motors.time_s[k],
            angle: now,
            rate: (after - before) / (2.0 * h_s),
            acceleration: (after - now * 2.0 + before) / (h_s * h_s),
            commanded: Command::steady(Vector3::zeros()),
            window_s: 2.0 * h_s,
        }
    };
    let shafts: Vec<Shaft> = at.iter().map(shaft).collect();
    let tip = TipModel::new(&model, &motors).unwrap();
    let (torque, dragged) = (TorqueModel::new(&model).unwrap(), tip.dragged());
    let rolled_out = tip.rolled_out(&[], &shafts).1;
    let mut squares = [[0.0; 3]; 3];
    for ((&k, shaft), rolled_out) in at.iter().zip(&shafts).zip(rolled_out) {
        let weight = |i: usize| Shaft::weight(i as f64 / HALF as f64 - 1.0);
        let weights: f64 = (0..2 * HALF).map(weight).sum();
        let pulled = (0..2 * HALF).map(|i| samples[k + i - HALF].tension * weight(i)).sum::<Vector3<f64>>() / weights;
        let settled = torque.dragged_n(shaft, &dragged.drag_about(shaft.time_s, 0.5 * shaft.window_s).unwrap());
        for (squares, found) in squares.iter_mut().zip([rolled_out.unwrap(), settled, torque.rigid_n(shaft)]) {
            for j in (0..3).filter(|&j| shaft.rate[j].abs() < 6.0) {
                squares[j] += (found[j] - pulled[j]).powi(2);
            }
        }
    }
    let [rolled_out, settled, rigid] = squares.map(|of| of.map(f64::sqrt));
    for j in 0..3 {
        assert!(rolled_out[j] < 0.2 * rigid[j] && settled[j] < 0.5 * rigid[j], "joint {j}: {rolled_out:?} and {settled:?} of {rigid:?}");
    }
}

#[test]
fn stiff_cables_make_encoders_and_joints_agree() {
    let robot = stiff();
    let limits = robot.arm().unwrap().limits;
    let path = Trajectory::of(Motion::Fls(0), 10.0, &limits, Vector3::zeros(), &mut rng(2));
    for sample in session(&robot, &[], &path, 10.0).samples() {
        let miss = (believed(&robot, sample) - sample.joint).abs();
        assert!(miss[0] < 3e-5 && miss[1] < 3e-5 && miss[2] < 5e-6, "{miss}");
    }
}

/// Halving the step quarters the error while nothing sticks, and never changes the joints by what an encoder could see.
#[test]
fn halving_the_step_converges() {
    let robot = nominal::gold();
    let swing = |step_s: f64| {
        let mut plant = Plant::at_hard_stop(
            Machine::new(&robot, &effects(&["link-coulomb-friction:shoulder=0", "motor-coulomb-friction:shoulder=0"])).unwrap(),
        );
        plant.hold_links(false);
        plant.advance(&Vector3::new(0.15, -0.2, -0.2), 0.2, step_s);
        plant.state().joint
    };
    let (coarse, middle, fine) = (swing(2e-4), swing(1e-4), swing(5e-5));
    let (first, second) = ((coarse - middle).amax(), (middle - fine).amax());
    assert!(second < 0.6 * first && second < 1e-6, "{first} {second}");

    let limits = robot.arm().unwrap().limits;
    let run = |step_s: f64| {
        let path = Trajectory::of(Motion::Rich, 5.0, &limits, Vector3::zeros(), &mut rng(1));
        let mut recorder = Recorder::at_hard_stop(&robot, Machine::new(&robot, &[]).unwrap(), [0; 3]).unwrap().with_step(step_s);
        recorder.approach(path.start());
        recorder.record(&path, 5.0, || {})
    };
    let (usual, fine) = (run(STEP_S), run(0.25 * STEP_S));
    let worst = usual.samples().iter().zip(fine.samples()).fold(0.0_f64, |w, (a, b)| {
        let stretch = |s: &Sample| believed(&robot, s) - s.joint;
        w.max((stretch(a) - stretch(b)).amax())
    });
    assert!(worst < 2e-4, "{worst}");
}

#[test]
fn a_soft_light_variant_stays_stable() {
    let mut robot = nominal::gold();
    for joint in &mut robot.joints {
        let cable = joint.cable.as_mut().unwrap();
        cable.stiffness *= 0.02;
        cable.damping *= 20.0;
    }
    for link in &mut robot.links {
        link.mass *= 0.2;
        link.inertia = link.inertia.map(|i| 0.2 * i);
    }
    let limits = robot.arm().unwrap().limits;
    let path = Trajectory::of(Motion::Rich, 5.0, &limits, Vector3::zeros(), &mut rng(1));
    let trace = session(&robot, &[], &path, 5.0);
    assert!(trace.samples().iter().all(|s| s.joint_rate.amax() < 3.0));
}

#[test]
fn between_samples_the_joints_move_smoothly() {
    let robot = nominal::gold();
    let limits = robot.arm().unwrap().limits;
    let path = Trajectory::of(Motion::Sinusoid, 3.0, &limits, Vector3::zeros(), &mut rng(1));
    let trace = session(&robot, &[], &path, 3.0);
    assert_relative_eq!(trace.joint_at(1.234), trace.samples()[1234].joint, epsilon = 1e-12);
    let middle = 0.5 * (trace.samples()[1234].joint + trace.samples()[1235].joint);
    assert_relative_eq!(trace.joint_at(1.2345), middle, epsilon = 1e-6);
    assert_eq!(trace.joint_at(-1.0), trace.samples()[0].joint);
}
