//! `raven-capture record` on Linux's own camera drivers, vivid and uvcvideo, in a virtual machine; skipped with a line where there can be none.

mod lab;
mod machine;

use lab::numbers;
use machine::{PICTURES, machine};
use raven::log::{Side, topics};

const DONE: i32 = 0;
const FAILED: i32 = 1;
const DATA_LOST: i32 = 3;

#[test]
fn two_raw_cameras_deliver_100_frames_each_without_a_gap() {
    let Some(machine) = machine() else { return };
    let (status, json) = machine.recording("clean");
    let survey = machine.survey("clean");
    for side in Side::BOTH {
        let losses = survey.losses[&side];
        assert!(machine.is_enough(losses.frames, 100) && machine.is_clean(&losses), "{losses:?}");
        assert_eq!(status == DONE, survey.losses.values().all(|losses| losses.total() == 0), "{json} {}", machine.text("clean.err"));
        let quality = &survey.topic(topics::raw(side)).unwrap().quality;
        assert!(machine.is_rate(1.0 / quality.median_interval_s.unwrap(), 25.0), "{quality:?}");
        // vivid stamps the end of a frame, which lies after the moment at which it hands the frame over.
        assert_eq!(survey.records[&format!("camera.{}", side.name())]["stamps"], "monotonic, end of the frame");
    }
}

#[test]
fn a_mode_that_the_camera_silently_replaces_is_refused() {
    let Some(machine) = machine() else { return };
    assert_eq!(machine.recording("other").0, FAILED);
    let said = machine.text("other.err");
    assert!(said.contains("asked for MJPG 640x480 at 30 frames/s, but the camera gives YUYV 640x480"), "{said}");
    assert!(!machine.file("other").exists());
}

#[test]
fn errors_of_buffers_queues_and_streams_are_survived_and_the_other_camera_sees_none_of_them() {
    let Some(machine) = machine() else { return };
    let (status, json) = machine.recording("errors");
    assert_eq!(machine.text("set_control.err"), "");
    assert_eq!(status, DATA_LOST, "{json}");
    let survey = machine.survey("errors");
    let (left, right) = (survey.losses[&Side::Left], survey.losses[&Side::Right]);
    assert_eq!((left.damaged, left.truncated, left.repeated), (1, 0, 0), "{left:?}");
    // 1.2 s at 25 frames per second, of which vivid loses 30 in 100.
    assert!(left.missed >= 1 && machine.is_enough(left.frames, left.missed), "{left:?}");
    assert_eq!(json["topics"][0]["interruptions"], 2, "the queue's error and the stream's: {json}");
    assert!(machine.is_enough(right.frames, 150) && machine.is_clean(&right), "{right:?}");
    assert_eq!(json["topics"][1]["interruptions"], 0);
}

#[test]
fn webcams_deliver_mjpg_at_30_and_60_frames_per_second_byte_for_byte() {
    let Some(machine) = machine() else { return };
    for (name, rate_hz, least) in [("mjpg30", 30.0, 115), ("mjpg60", 60.0, 185)] {
        let (status, json) = machine.recording(name);
        let survey = machine.survey(name);
        for side in Side::BOTH {
            let (losses, pictures) = (survey.losses[&side], machine.pictures(name, side));
            assert!(machine.is_enough(losses.frames, least) && machine.is_clean(&losses), "{name}: {losses:?} {}", json["topics"]);
            let rate = survey.topic(topics::compressed(side)).unwrap().rate_hz.unwrap();
            assert!(machine.is_rate(rate, rate_hz), "{name}: {rate}");
            // Pictures and sequence numbers go on together: nothing is missing that the driver did not count.
            for pair in pictures.windows(2) {
                let [(before, first), (after, second)] = [pair[0], pair[1]];
                assert_eq!(second.unwrap(), (first.unwrap() + (after - before) as usize) % PICTURES, "{name}: {pair:?}");
            }
        }
        assert_eq!(status == DONE, survey.losses.values().all(|losses| losses.total() == 0), "{json}");
        assert_eq!(survey.records["camera.left"]["stamps"], "monotonic, start of the frame");
    }
    let yuyv = machine.survey("yuyv");
    assert!(machine.is_enough(yuyv.losses[&Side::Right].frames, 16) && yuyv.losses[&Side::Right].truncated == 0);
}

#[test]
fn exposure_focus_and_white_balance_are_locked_recorded_and_put_back() {
    let Some(machine) = machine() else { return };
    let record = &machine.survey("mjpg30").records["camera.left"];
    let control = |name: &str| record[&format!("control {name}")].as_str();
    assert_eq!(control("exposure_auto"), "1 (found at 3)");
    assert_eq!(control("exposure_dynamic_framerate"), "0 (found at 1)");
    assert_eq!([control("exposure_time_100us"), control("white_balance_temperature"), control("focus_absolute")], ["500", "4000", "30"]);
    let sets = machine.text("left-locked.log");
    let last = |name: &str| sets.lines().rev().find_map(|line| line.strip_prefix(&format!("set {name} "))).map(str::to_owned);
    for (name, found) in [("exposure_mode", "8"), ("exposure_priority", "1"), ("focus_auto", "1"), ("white_balance_auto", "1")] {
        assert!(
            sets.lines().any(|line| line.starts_with(&format!("set {name} ")) && !line.ends_with(found)),
            "{name} was never switched off: {sets}"
        );
        assert_eq!(last(name).as_deref(), Some(found), "{name}: {sets}");
    }
    assert_eq!(record["serial"], "L1");
    assert!(machine.text("busy.err").contains("another program is using it"), "{}", machine.text("busy.err"));
}

/// A webcam whose log said first that its controls were locked, and then what they had been found at.
fn assert_put_back(before: &str, after: &str) {
    let last = |log: &str, name: &str| log.lines().rev().find_map(|line| line.strip_prefix(&format!("set {name} "))).map(str::to_owned);
    for (name, locked, found) in
        [("exposure_mode", "1", "8"), ("exposure_priority", "0", "1"), ("focus_auto", "0", "1"), ("white_balance_auto", "0", "1")]
    {
        assert_eq!(last(before, name).as_deref(), Some(locked), "{name}: {before}");
        assert_eq!(last(after, name).as_deref(), Some(found), "{name}: {after}");
    }
}

#[test]
fn a_webcam_that_a_killed_recording_left_locked_is_put_back_by_the_next() {
    let Some(machine) = machine() else { return };
    assert_put_back(&machine.text("left-killed.log"), &machine.text("left-put-back.log"));
    let said = machine.text("after.err");
    assert!(said.contains("left camera: a recording that was killed had left its exposure, focus or white balance locked"), "{said}");
    let survey = machine.survey_killed("killed");
    assert!(machine.is_enough(survey.losses[&Side::Left].frames, 15), "{:?}", survey.losses);
}

#[test]
fn a_webcam_is_put_back_by_a_preflight_that_is_stopped() {
    let Some(machine) = machine() else { return };
    assert_put_back(&machine.text("left-tried.log"), &machine.text("left-stopped.log"));
    assert_eq!(machine.recording("stopped").0, FAILED, "{}", machine.text("stopped.err"));
}

#[test]
fn the_preflight_lists_the_webcams_and_says_what_they_achieve() {
    let Some(machine) = machine() else { return };
    let said = machine.text("devices.out");
    assert!(said.contains("serial:L1  left: left") && said.contains("MJPG 640x480 at 15, 30, 60 frames/s"), "{said}");
    let json: serde_json::Value = serde_json::from_str(&machine.text("devices.json")).unwrap();
    let camera = &json["cameras"][0];
    assert!(machine.is_rate(camera["achieved_hz"].as_f64().unwrap(), 30.0), "{camera}");
    // The webcam exposes for 50 ms, which 30 frames per second have no time for.
    assert!(machine.text("devices.err").contains("it exposes for 50.0 ms of 33.3 ms between frames"), "{}", machine.text("devices.err"));
}

#[test]
fn an_unplugged_webcam_comes_back_under_another_number_while_the_other_and_the_robot_go_on() {
    let Some(machine) = machine() else { return };
    let (status, json) = machine.recording("unplugged");
    assert_eq!(status, DATA_LOST);
    let survey = machine.survey("unplugged");
    let (left, right) = (survey.losses[&Side::Left], survey.losses[&Side::Right]);
    assert!(machine.is_enough(right.frames, 260) && machine.is_clean(&right), "{right:?}");
    // Away for at least 1.5 s of 9.5 s.
    assert!(machine.is_enough(left.frames, 120) && left.frames < right.frames * 9 / 10, "{left:?} {right:?} {json}");
    let interruptions = [0, 1].map(|camera| json["topics"][camera]["interruptions"].as_u64().unwrap());
    assert!(interruptions == [1, 0] || !machine.quiet && interruptions[0] > 0, "{json}");
    // A webcam that was away has its own values again, and is locked at the old ones.
    assert_eq!(machine.text("left-unplugged.log").matches("set exposure_time 80\n").count(), 2);
    let said = machine.text("unplugged.err");
    assert!(said.contains("left camera: it is back."), "{said}");
    let (before, after) = (machine.text("devices"), machine.text("left-after"));
    assert!(!before.is_empty() && !after.is_empty(), "{before} {after}");
    let (robot, whole) = numbers(&machine.file("unplugged"), topics::RAVEN_STATE);
    assert!(whole && robot.len() > 1000, "{}", robot.len());
    assert!(robot.windows(2).all(|pair| pair[1] == pair[0] + 1), "a message of the robot is missing");
}

#[test]
fn what_webcams_should_not_send_is_counted_by_cause_and_silence_is_ended() {
    let Some(machine) = machine() else { return };
    let (status, json) = machine.recording("bad");
    assert_eq!(status, DATA_LOST);
    let survey = machine.survey("bad");
    let (left, right) = (survey.losses[&Side::Left], survey.losses[&Side::Right]);
    // Every 7th is cut off, every 11th has the error bit, which the driver drops, every 13th is left out, every 17th repeats the one before. The
    // first 45 went by while the camera settled, more or less.
    let numbers = 45..45 + left.frames + left.missed + left.skipped;
    let count = |is: &dyn Fn(u64) -> bool| numbers.clone().filter(|number| is(*number)).count() as u64;
    let faulty = |number: u64| [7, 11, 13].iter().any(|every| number.is_multiple_of(*every));
    let expected = [
        (left.truncated, count(&|n| n % 7 == 0 && n % 11 != 0 && n % 13 != 0)),
        (left.missed, count(&|n| n % 11 == 0 && n % 13 != 0)),
        (left.skipped, count(&|n| n % 13 == 0)),
        (left.repeated, count(&|n| n % 17 == 0 && !faulty(n) && !faulty(n - 1))),
    ];
    for (counted, sent) in expected {
        assert!(counted > 0 && (!machine.quiet || counted.abs_diff(sent) <= 3 + sent / 4), "{left:?} instead of {expected:?}");
    }
    assert_eq!(left.damaged, 0);
    // Silent after 90 frames, noticed after 2 s, opened again: once or twice in 6.5 s.
    let interruptions = json["topics"][1]["interruptions"].as_u64().unwrap();
    assert!((1..=2).contains(&interruptions) && machine.is_enough(right.frames, 100), "{right:?} {json}");
    assert!(machine.text("bad.err").contains("right camera: no frame came for 2."), "{}", machine.text("bad.err"));
}
