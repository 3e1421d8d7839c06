//! Which later step a log is ready for, and what the others lack.

use raven::log::{Survey, topics};
use raven::robot::SourceFormat;
use serde::Serialize;

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
    let camera = |compressed, raw| has(compressed) || has(raw);
    let (left, right) = (camera(topics::LEFT_COMPRESSED, topics::LEFT_RAW), camera(topics::RIGHT_COMPRESSED, topics::RIGHT_RAW));
    let (bench, tip) = (has(topics::MOTOR_JOINT_STATES), has(topics::TIP));
    let source = survey.motor_source();
    let motor = source.is_some();
    // Joint states may be of the joints or of the motors; only whoever recorded them knows.
    let own_topic = source.filter(|source| source.format == SourceFormat::JointState && source.topic != topics::MOTOR_JOINT_STATES);
    let own_topic = own_topic
        .map(|source| format!("if {0} has the motors, with `source: {{topic: {0}, format: joint_state}}` in the robot file", source.topic));
    let no_images = match (left, right) {
        (true, true) => None,
        (true, false) => Some("images of the right camera"),
        (false, true) => Some("images of the left camera"),
        (false, false) => Some("images of both cameras"),
    };
    let no_motor = (!motor).then_some("motor positions on /ravenstate or /motor/joint_states");
    let no_tip = (!tip).then_some(if left && right { "/tip: run raven-track" } else { "/tip, or images to track it in" });
    // A bench measures its joint directly: its robot file asks for no tip.
    let on_bench = bench && !tip && !left && !right;
    let (no_tip_at_all, no_tip) = (no_tip, no_tip.filter(|_| !on_bench));
    let torque = survey.torque_recorded == Some(true);
    let torque_only = if tip { "" } else { "without /tip: by torque alone" };
    let bench_only = if on_bench { "as a bench, with a robot file of that kind" } else { "" };
    let validation = if has(topics::JOINT_ENCODERS) { "" } else { "without /joint_encoders there is no error to report" };
    let no_torque = if motor && !torque { "without torque: nothing about stiffness or friction" } else { "" };
    let mut steps = vec![
        step("raven-calibrate cameras", &[no_images], ""),
        step("raven-calibrate register", &[no_images, no_motor], ""),
        step("raven-track", &[no_images, no_motor], ""),
        step("raven-identify", &[no_motor, no_tip], if bench_only.is_empty() { no_torque } else { bench_only }),
        step("raven-replay", &[no_motor, no_tip_at_all], validation),
        step("raven-diagnose", &[no_motor, no_tip.filter(|_| !torque)], if bench_only.is_empty() { torque_only } else { bench_only }),
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

#[cfg(test)]
mod tests {
    use raven::log::{LogWriter, RavenState, Stamp};

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

    #[test]
    fn a_bench_needs_no_tip() {
        let steps = of_log(|log| log.joint_states(topics::MOTOR_JOINT_STATES, Stamp(1), &["carriage"], &[0.0], Some(&[1.0])).unwrap());
        assert!(note_of(&steps, "raven-identify").0);
        assert!(!note_of(&steps, "raven-replay").0);
        assert_eq!(note_of(&steps, "raven-track"), (false, "needs images of both cameras".to_owned()));
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
