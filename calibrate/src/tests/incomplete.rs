//! Logs at the hard stop that lack a camera or the motors: what they lack is named, and only motors that were never recorded may be missing.

use std::path::Path;

use raven::log::{Item, LogWriter, RavenState, RawMessage, Walker, topics};
use raven::robot::nominal;
use raven::simulation::{Motion, Options};

use super::anywhere::session;
use super::real::calibrate;

/// Copies the messages of a log as `change` has them, and leaves out those of which it makes nothing.
fn copy(from: &Path, to: &Path, change: &dyn Fn(&RawMessage<'_>) -> Option<Vec<u8>>) {
    let mut log = LogWriter::create(to).unwrap();
    let copied = Walker::open(from).unwrap().run(|item| {
        let Item::Message(message) = item else { return Ok(()) };
        let Some(data) = change(&message) else { return Ok(()) };
        let channel = log.copy_channel(message.channel)?;
        log.copy_message(channel, &RawMessage { data: &data, ..message })
    });
    copied.and_then(|()| log.finish()).unwrap();
}

/// An image whose end is lost.
fn cut(image: &[u8]) -> Vec<u8> {
    let end = image.windows(2).rposition(|pair| pair == b"\xff\xd9").unwrap();
    [&image[..end], &[0, 0], &image[end + 2..]].concat()
}

#[test]
fn what_a_log_at_the_hard_stop_lacks_is_named() {
    let options = Options { images: true, hidden_part: 0.0, ..Options::default() };
    let start = options.start;
    let (folder, _) = session(options, &[(Motion::Hardstop, 0.4)]);
    let at = |name: &str| folder.path().join(name);
    let elsewhere =
        nominal::GOLD_YAML.replace("topic: /ravenstate", "topic: /motor/joint_states").replace(": raven_state ", ": joint_state ");
    std::fs::write(at("elsewhere.yaml"), elsewhere).unwrap();
    let register = |log: &str, robot: &str| {
        let [log, robot, cameras] = [log, robot, "cameras.yaml"].map(|name| at(name).display().to_string());
        calibrate(&["register", &log, "--robot", &robot, "--cameras", &cameras]).map_err(|error| error.to_string())
    };
    let refused = |log: &str, robot: &str, must_say: &[&str]| {
        let said = register(log, robot).unwrap_err();
        assert!(said.contains(log) && must_say.iter().all(|words| said.contains(words)) && !said.contains("at the nearest"), "{said}");
    };
    let whole = |message: &RawMessage<'_>| Some(message.data.to_vec());
    let is_on = |message: &RawMessage<'_>, topic: &str| message.channel.topic == topic;
    let copied = |name: &str, change: &dyn Fn(&RawMessage<'_>) -> Option<Vec<u8>>| copy(&at("0.mcap"), &at(name), change);

    copied("no-left.mcap", &|message| if is_on(message, topics::LEFT_COMPRESSED) { None } else { whole(message) });
    refused("no-left.mcap", "robot.yaml", &["left camera", topics::LEFT_COMPRESSED]);
    copied("cut.mcap", &|message| if is_on(message, topics::RIGHT_COMPRESSED) { Some(cut(message.data)) } else { whole(message) });
    refused("cut.mcap", "robot.yaml", &["none of the", "right camera", topics::RIGHT_COMPRESSED]);

    let lost = RavenState { mpos_deg: [f32::NAN; 16], ..RavenState::default() };
    let state = |message: &RawMessage<'_>| Some(lost.encode(message.publish_time));
    copied("nan.mcap", &|message| if is_on(message, topics::RAVEN_STATE) { state(message) } else { whole(message) });
    refused("nan.mcap", "robot.yaml", &["`/ravenstate`", "finite position"]);
    refused("0.mcap", "elsewhere.yaml", &["`/motor/joint_states`", "`/ravenstate`", "source:"]);
    // The motors before the images.
    copied("apart.mcap", &|message| {
        let time_s = message.publish_time.seconds_since(start);
        let is_kept = if topics::camera_of(&message.channel.topic).is_some() { time_s > 0.2 } else { time_s < 0.1 };
        if is_kept { whole(message) } else { None }
    });
    refused("apart.mcap", "robot.yaml", &["while the robot was at its hard stop"]);

    copied("no-motors.mcap", &|message| if is_on(message, topics::RAVEN_STATE) { None } else { whole(message) });
    for (log, robot) in [("0.mcap", "robot.yaml"), ("no-motors.mcap", "robot.yaml"), ("no-motors.mcap", "elsewhere.yaml")] {
        let (said, json) = register(log, robot).unwrap();
        assert!(json["frames"].as_u64().unwrap() > 2, "{log} {robot}: {said}");
    }
}
