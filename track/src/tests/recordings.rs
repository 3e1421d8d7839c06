//! Recordings as they come: what is wrong with one is named and counted, and the rest is tracked.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use clap::Parser;
use raven::cli::Outcome;
use raven::log::{Item, LogWriter, RawMessage, Walker, topics};
use raven::robot::nominal;
use raven::simulation::{Motion, Options, Session};

use crate::{Args, run};

const SECONDS: f64 = 8.0;

/// A session with images, simulated once, with its files.
static LAB: LazyLock<tempfile::TempDir> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("robot.yaml"), nominal::GOLD_YAML).unwrap();
    let session = Session::new(&nominal::gold(), Options { images: true, ..Options::default() }).unwrap();
    session.record(Motion::Sinusoid, SECONDS, &at.join("log.mcap"), |_| {}).unwrap();
    session.cameras().unwrap().write(&at.join("cameras.yaml")).unwrap();
    folder
});

/// What the program says, its JSON, and how it ends.
fn track(log: &Path, cameras: &Path, more: &[&str]) -> Result<(String, serde_json::Value, Outcome), String> {
    let folder = tempfile::tempdir().unwrap();
    let (output, json) = (folder.path().join("tracked.mcap"), folder.path().join("track.json"));
    let name = |path: &Path| path.display().to_string();
    let robot = name(&LAB.path().join("robot.yaml"));
    let fixed = ["raven-track", &name(log), "--robot", &robot, "--cameras", &name(cameras), "-o", &name(&output), "--json", &name(&json)];
    let args = Args::try_parse_from(fixed.into_iter().chain(more.iter().copied())).map_err(|e| e.to_string())?;
    let mut said = Vec::new();
    let outcome = run(args, &mut said).map_err(|e| {
        assert!(!output.exists(), "an output of a run that failed");
        e.to_string()
    })?;
    let json = serde_json::from_slice(&std::fs::read(json).unwrap()).unwrap();
    Ok((String::from_utf8(said).unwrap(), json, outcome))
}

/// The recording with its frames changed: by camera and by number of the frame, with the time in seconds; `false` leaves the frame out.
fn changed(change: impl Fn(usize, usize, f64, &mut Vec<u8>) -> bool) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("changed.mcap");
    let mut log = LogWriter::create(&path).unwrap();
    let (mut channels, mut counts, mut first) = (std::collections::HashMap::new(), [0; 2], None);
    Walker::open(&LAB.path().join("log.mcap"))
        .unwrap()
        .run(|item| {
            match item {
                Item::Channel(channel) => {
                    channels.insert(channel.id, log.copy_channel(channel)?);
                }
                Item::Message(message) => {
                    let mut data = message.data.to_vec();
                    let kept = topics::camera_of(&message.channel.topic).is_none_or(|side| {
                        let k = side as usize;
                        counts[k] += 1;
                        let start = *first.get_or_insert(message.publish_time);
                        change(k, counts[k] - 1, message.publish_time.seconds_since(start), &mut data)
                    });
                    if kept {
                        log.copy_message(channels[&message.channel.id], &RawMessage { data: &data, ..message })?;
                    }
                }
                _ => {}
            }
            Ok(())
        })
        .unwrap();
    log.finish().unwrap();
    (folder, path)
}

fn number(json: &serde_json::Value, key: &str) -> f64 {
    json.pointer(key).and_then(serde_json::Value::as_f64).unwrap_or_else(|| panic!("no {key} in {json}"))
}

fn cameras() -> PathBuf {
    LAB.path().join("cameras.yaml")
}

/// Place of the bytes in a message.
fn find(data: &[u8], bytes: &[u8]) -> usize {
    data.windows(bytes.len()).position(|window| window == bytes).unwrap()
}

#[test]
fn a_whole_recording_is_tracked_by_every_centre() {
    for more in [&["--centre", "ball"], &["--centre", "contour"], &["--refine"] as &[&str]] {
        let (said, json, outcome) = track(&LAB.path().join("log.mcap"), &cameras(), more).unwrap();
        assert_eq!(outcome, Outcome::Done, "{said}");
        assert!(number(&json, "/seen") > 0.7 * number(&json, "/pairs") && json["missing"].as_array().unwrap().is_empty(), "{said}");
    }
    assert!(track(&LAB.path().join("log.mcap"), &cameras(), &["--refine", "--centre", "contour"]).is_err());
}

#[test]
fn a_colour_learned_at_the_hard_stop_finds_the_marker_in_motion() {
    let hardstop = LAB.path().join("hardstop.mcap");
    let session = Session::new(&nominal::gold(), Options { images: true, ..Options::default() }).unwrap();
    session.record(Motion::Hardstop, 2.0, &hardstop, |_| {}).unwrap();
    let json = LAB.path().join("colour.json");
    let name = |path: &Path| path.display().to_string();
    let words = ["raven-track", "colour", &name(&hardstop), "--cameras", &name(&cameras()), "--json", &name(&json)];
    let mut said = Vec::new();
    run(Args::try_parse_from(words).unwrap(), &mut said).unwrap();
    let said = String::from_utf8(said).unwrap();
    let learned: serde_json::Value = serde_json::from_slice(&std::fs::read(json).unwrap()).unwrap();
    assert_eq!(learned["pairs_seen"], learned["pairs"], "{said}");
    let options: Vec<&str> = said.lines().find(|line| line.starts_with("track with")).unwrap().split_whitespace().skip(2).collect();
    let (_, default, _) = track(&LAB.path().join("log.mcap"), &cameras(), &[]).unwrap();
    let (_, tracked, _) = track(&LAB.path().join("log.mcap"), &cameras(), &options).unwrap();
    assert!(number(&tracked, "/seen") > 0.97 * number(&default, "/seen"), "{said}{tracked}");
}

#[test]
fn a_colour_needs_a_marker_at_rest() {
    let board = LAB.path().join("board-alone.mcap");
    let session = Session::new(&nominal::gold(), Options { images: true, ..Options::default() }).unwrap();
    session.record(Motion::Board, 1.0, &board, |_| {}).unwrap();
    let text = |path: &Path| path.display().to_string();
    let args = Args::try_parse_from(["raven-track", "colour", &text(&board), "--cameras", &text(&cameras())]).unwrap();
    let none = run(args, &mut Vec::new()).unwrap_err().to_string();
    assert!(none.contains("no coloured ball of 5.0 mm radius"), "{none}");
}

#[test]
fn truncated_frames_are_counted() {
    let (_folder, log) = changed(|side, i, _, data| {
        if side == 0 && i % 20 == 7 {
            let end = data.windows(2).rposition(|pair| pair == [0xFF, 0xD9]).unwrap();
            data[end - 400..=end + 1].fill(0);
        }
        true
    });
    let (said, json, outcome) = track(&log, &cameras(), &[]).unwrap();
    let expected = (0..(number(&json, "/pairs") + number(&json, "/frames_undecodable")) as usize).filter(|i| i % 20 == 7).count();
    assert_eq!((number(&json, "/frames_undecodable") as usize, outcome), (expected, Outcome::DataLost), "{said}");
    assert!(said.contains("undecodable") && number(&json, "/seen") > 0.6 * number(&json, "/pairs"), "{said}");
}

#[test]
fn frames_of_another_size_in_the_middle_are_counted() {
    let (_folder, log) = changed(|side, i, _, data| {
        if side == 1 && (30..33).contains(&i) {
            // The height in the frame header.
            let at = find(data, &[0xFF, 0xC0]) + 5;
            data[at..at + 2].copy_from_slice(&240_u16.to_be_bytes());
        }
        true
    });
    let (said, json, outcome) = track(&log, &cameras(), &[]).unwrap();
    assert_eq!((number(&json, "/frames_other_size"), outcome), (3.0, Outcome::DataLost), "{said}");
    assert!(said.contains("another size") && number(&json, "/seen") > 0.6 * number(&json, "/pairs"), "{said}");
}

#[test]
fn a_camera_missing_for_five_seconds_is_named() {
    let (_folder, log) = changed(|side, _, time_s, _| side == 0 || !(1.5..6.5).contains(&time_s));
    let (said, json, outcome) = track(&log, &cameras(), &[]).unwrap();
    assert_eq!(outcome, Outcome::Done, "{said}");
    assert_eq!(json.pointer("/missing/0/camera").unwrap(), "right");
    let (from_s, seconds) = (number(&json, "/missing/0/from_s"), number(&json, "/missing/0/seconds"));
    assert!((from_s - 1.5).abs() < 0.1 && (seconds - 5.0).abs() < 0.2, "{said}");
    assert!(said.contains("no right frames") && number(&json, "/seen") > 0.2 * number(&json, "/pairs"), "{said}");
}

#[test]
fn what_cannot_be_tracked_is_said_in_a_sentence() {
    let log = LAB.path().join("log.mcap");
    let never = track(&log, &cameras(), &["--hue", "200..250"]).unwrap_err();
    assert!(never.contains("never seen") && never.contains("--hue 200..250"), "{never}");

    let folder = tempfile::tempdir().unwrap();
    let other = folder.path().join("other.yaml");
    let text = std::fs::read_to_string(cameras()).unwrap();
    std::fs::write(&other, text.replace("image_width: 640", "image_width: 1280").replace("image_height: 480", "image_height: 960"))
        .unwrap();
    let resolution = track(&log, &other, &[]).unwrap_err();
    assert!(resolution.contains("640 x 480") && resolution.contains("calibrated at 1280 x 960"), "{resolution}");

    let board = folder.path().join("board.mcap");
    let session = Session::new(&nominal::gold(), Options { images: true, ..Options::default() }).unwrap();
    session.record(Motion::Board, 1.0, &board, |_| {}).unwrap();
    let board = track(&board, &cameras(), &[]).unwrap_err();
    assert!(board.contains("no motor positions"), "{board}");
}
