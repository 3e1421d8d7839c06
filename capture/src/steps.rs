//! Which later step a log is ready for, and what the others lack.

use raven::log::{Side, Survey, TopicSurvey, topics};
use raven::robot::SourceFormat;
use serde::Serialize;

/// Images and motors that lie farther apart than this [s] are of different clocks, and not of a camera that began late.
const APART_S: f64 = 1.0;

/// One program and whether a log has what it needs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Step {
    /// Program, with its subcommand.
    pub program: &'static str,
    /// Whether the log has the topics it needs.
    pub ready: bool,
    /// What is missing, or what the log cannot give although it is ready.
    pub note: String,
}

/// All later steps in their order.
#[must_use]
pub fn steps(survey: &Survey) -> Vec<Step> {
    let has = |topic: &str| survey.topic(topic).is_some();
    let [left, right] = Side::BOTH.map(|side| survey.topic(topics::compressed(side)).or_else(|| survey.topic(topics::raw(side))));
    let (bench, tip) = (has(topics::MOTOR_JOINT_STATES), has(topics::TIP));
    let source = survey.motor_source();
    let recorded = source.as_ref().and_then(|source| survey.topic(&source.topic));
    // The numbers of a damaged log are not looked into.
    let none_usable = survey.damage.is_none() && survey.torque_recorded.is_none();
    let no_motor = match recorded {
        None => Some("motor positions on /ravenstate or /motor/joint_states".to_owned()),
        Some(TopicSurvey { topic, quality, .. }) if none_usable => {
            Some(format!("motor positions: none of the {} messages on {topic} holds finite ones", quality.messages))
        }
        Some(_) => None,
    };
    let no_motor = no_motor.as_deref();
    let motors = recorded.filter(|_| no_motor.is_none());
    // Joint states may be of the joints or of the motors; only whoever recorded them knows.
    let own_topic = source.filter(|source| source.format == SourceFormat::JointState && source.topic != topics::MOTOR_JOINT_STATES);
    let own_topic = own_topic
        .filter(|_| motors.is_some())
        .map(|source| format!("if {0} has the motors, with `source: {{topic: {0}, format: joint_state}}` in the robot file", source.topic));
    let no_images = match (left, right) {
        (Some(_), Some(_)) => None,
        (Some(_), None) => Some("images of the right camera"),
        (None, Some(_)) => Some("images of the left camera"),
        (None, None) => Some("images of both cameras"),
    };
    let apart = |images: Option<&TopicSurvey>| how_far_apart(images?, motors?);
    let out_of_time = match (apart(left), apart(right)) {
        (Some(how), Some(_)) => Some(("no image", how)),
        (Some(how), None) => Some(("no image of the left camera", how)),
        (None, Some(how)) => Some(("no image of the right camera", how)),
        (None, None) => None,
    };
    let out_of_time = out_of_time.map(|(whose, how)| {
        format!("images within the time of the motors: {whose} falls within it, {how}; map the cameras' stamps to the robot's clock")
    });
    let out_of_time = out_of_time.as_deref();
    // A bench measures its joint directly: its robot file asks for no tip.
    let on_bench = bench && !tip && left.is_none() && right.is_none();
    let no_tip = if on_bench {
        Some("an arm with a tip, and /tip or images to track it in; for a bench there is raven-diagnose, with a robot file of a bench")
    } else {
        (!tip).then_some(if no_images.is_none() { "/tip: run raven-track" } else { "/tip, or images to track it in" })
    };
    // What a damaged log has of it is not known.
    let torque = survey.torque_recorded.unwrap_or(survey.damage.is_some());
    let without_tip = match (on_bench, tip) {
        (true, _) => "as a bench, with `kinematics: {kind: bench}` in the robot file",
        (false, true) => "",
        (false, false) => "without /tip: by torque alone",
    };
    let validation = if has(topics::JOINT_ENCODERS) { "" } else { "without /joint_encoders there is no error to report" };
    let mut steps = vec![
        step("raven-calibrate cameras", &[no_images], ""),
        step("raven-calibrate register", &[no_images, no_motor, out_of_time], ""),
        step("raven-track", &[no_images, no_motor, out_of_time], ""),
        step("raven-identify", &[no_motor, no_tip], ""),
        step("raven-replay", &[no_motor, no_tip], validation),
        step("raven-diagnose", &[no_motor, no_tip.filter(|_| !on_bench && !torque)], without_tip),
    ];
    if let Some(how) = own_topic {
        let with_motors = ["raven-calibrate register", "raven-track", "raven-identify", "raven-replay", "raven-diagnose"];
        for step in steps.iter_mut().filter(|step| with_motors.contains(&step.program)) {
            let note = std::mem::take(&mut step.note);
            step.note = [how.as_str(), note.as_str()].into_iter().filter(|words| !words.is_empty()).collect::<Vec<_>>().join("; ");
        }
    }
    steps
}

fn step(program: &'static str, missing: &[Option<&str>], note: &str) -> Step {
    let missing: Vec<&str> = missing.iter().copied().flatten().collect();
    let ready = missing.is_empty();
    Step { program, ready, note: if ready { note.to_owned() } else { format!("needs {}", missing.join(" and ")) } }
}

/// How far all images of a camera lie from all motor positions; `None` if they meet, or nearly so.
fn how_far_apart(images: &TopicSurvey, motors: &TopicSurvey) -> Option<String> {
    let (images, motors) = (&images.quality, &motors.quality);
    let after_s = images.first?.seconds_since(motors.last?);
    let before_s = motors.first?.seconds_since(images.last?);
    if after_s > APART_S {
        return Some(format!("the first comes {after_s:.3} s after the last motor position"));
    }
    (before_s > APART_S).then(|| format!("the last comes {before_s:.3} s before the first motor position"))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use raven::log::{LogWriter, RAVEN_STATE_DEFINITION, RAVEN_STATE_TYPE, RavenState, SchemaRef, Stamp};

    use super::*;

    fn note_of(steps: &[Step], program: &str) -> (bool, String) {
        let step = steps.iter().find(|step| step.program == program).unwrap();
        (step.ready, step.note.clone())
    }

    fn of_log(write: impl FnOnce(&mut LogWriter)) -> Vec<Step> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.mcap");
        let mut log = LogWriter::create(&path).unwrap();
        write(&mut log);
        log.finish().unwrap();
        steps(&Survey::of(&path).unwrap())
    }

    /// Ten seconds of the robot and of the cameras, each with its own start [s].
    fn of_session(state: &RavenState, [robot, left, right]: [u64; 3]) -> Vec<Step> {
        of_log(|log| {
            let at = |start: u64, i: u64| Stamp(1_000_000_000 * (start + i));
            for i in 0..=10 {
                log.robot_state(at(robot, i), state).unwrap();
                log.compressed_image(Side::Left, at(left, i), i as u32, &[0xff, 0xd8, 0xff, 0xd9]).unwrap();
                log.compressed_image(Side::Right, at(right, i), i as u32, &[0xff, 0xd8, 0xff, 0xd9]).unwrap();
            }
        })
    }

    #[test]
    fn a_bench_is_diagnosed_without_tip_and_nothing_else() {
        let steps = of_log(|log| log.joint_states(topics::MOTOR_JOINT_STATES, Stamp(1), &["carriage"], &[0.0], Some(&[1.0])).unwrap());
        let diagnosed = (true, "as a bench, with `kinematics: {kind: bench}` in the robot file".to_owned());
        assert_eq!(note_of(&steps, "raven-diagnose"), diagnosed);
        for program in ["raven-identify", "raven-replay"] {
            let (ready, note) = note_of(&steps, program);
            assert!(
                !ready && note.starts_with("needs an arm with a tip") && note.contains("for a bench there is raven-diagnose"),
                "{note}"
            );
        }
        assert_eq!(note_of(&steps, "raven-track"), (false, "needs images of both cameras".to_owned()));
    }

    #[test]
    fn motors_of_which_no_message_can_be_used_are_none() {
        let all_nan = RavenState { mpos_deg: [f32::NAN; 16], ..RavenState::default() };
        let steps = of_session(&all_nan, [100; 3]);
        assert!(note_of(&steps, "raven-calibrate cameras").0);
        let why = "motor positions: none of the 11 messages on /ravenstate holds finite ones";
        for program in ["raven-calibrate register", "raven-track"] {
            assert_eq!(note_of(&steps, program), (false, format!("needs {why}")));
        }
        let definition = RAVEN_STATE_DEFINITION.as_bytes();
        let schema = SchemaRef { message_encoding: "ros1", name: RAVEN_STATE_TYPE, encoding: "ros1msg", data: definition };
        let steps = of_log(|log| {
            let channel = log.add_channel(topics::RAVEN_STATE, schema, &BTreeMap::new()).unwrap();
            (0..11).for_each(|i| log.write(channel, Stamp(1 + i), 0, b"too short").unwrap());
        });
        assert_eq!(note_of(&steps, "raven-identify"), (false, format!("needs {why} and /tip, or images to track it in")));
        let nan = f64::NAN;
        let steps = of_log(|log| log.joint_states(topics::MOTOR_JOINT_STATES, Stamp(1), &["carriage"], &[nan], Some(&[1.0])).unwrap());
        let why = "needs motor positions: none of the 1 messages on /motor/joint_states holds finite ones";
        assert_eq!(note_of(&steps, "raven-diagnose"), (false, why.to_owned()));
    }

    #[test]
    fn images_of_another_time_than_the_motors_are_named_with_how_far_they_are() {
        let state = RavenState::default();
        // Recorded together, and one after the other within a second.
        for starts in [[100; 3], [100, 105, 95], [100, 111, 89]] {
            let steps = of_session(&state, starts);
            assert!(note_of(&steps, "raven-calibrate register").0 && note_of(&steps, "raven-track").0, "{starts:?}");
        }
        for (starts, must_say) in [
            ([100, 1100, 1100], "no image falls within it, the first comes 990.000 s after the last motor position"),
            ([1100, 100, 100], "no image falls within it, the last comes 990.000 s before the first motor position"),
            ([100, 112, 100], "no image of the left camera falls within it, the first comes 2.000 s after"),
            ([100, 100, 88], "no image of the right camera falls within it, the last comes 2.000 s before"),
        ] {
            let steps = of_session(&state, starts);
            assert!(note_of(&steps, "raven-calibrate cameras").0);
            for program in ["raven-calibrate register", "raven-track"] {
                let (ready, note) = note_of(&steps, program);
                assert!(!ready && note.starts_with("needs images within the time of the motors") && note.contains(must_say), "{note}");
            }
        }
    }

    #[test]
    fn joint_states_on_another_topic_are_motors_if_the_robot_file_says_so() {
        let steps = of_log(|log| {
            log.joint_states("/arm/measured_js", Stamp(1), &["shoulder"], &[0.0], None).unwrap();
            log.joint_states(topics::JOINT_ENCODERS, Stamp(1), &["shoulder"], &[0.0], None).unwrap();
        });
        let (ready, note) = note_of(&steps, "raven-identify");
        assert!(!ready && note.ends_with("needs /tip, or images to track it in"), "{note}");
        assert!(
            note.starts_with("if /arm/measured_js has the motors, with `source: {topic: /arm/measured_js, format: joint_state}`"),
            "{note}"
        );
        let steps = of_log(|log| log.joint_states(topics::JOINT_ENCODERS, Stamp(1), &["shoulder"], &[0.0], None).unwrap());
        assert_eq!(
            note_of(&steps, "raven-diagnose").1,
            "needs motor positions on /ravenstate or /motor/joint_states and /tip, or images to track it in"
        );
    }

    #[test]
    fn an_arm_without_tip_is_diagnosed_by_torque_only() {
        let steps = of_log(|log| log.robot_state(Stamp(1), &RavenState::default()).unwrap());
        assert_eq!(note_of(&steps, "raven-diagnose"), (true, "without /tip: by torque alone".to_owned()));
        assert_eq!(note_of(&steps, "raven-identify"), (false, "needs /tip, or images to track it in".to_owned()));
    }
}
