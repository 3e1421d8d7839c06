//! Recordings as they come: what is wrong with one is named and counted, and the rest is tracked.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use clap::Parser;
use nalgebra::{UnitQuaternion, Vector3};
use raven::camera::Cameras;
use raven::cli::Outcome;
use raven::log::{Item, LogWriter, MotorSource, RawMessage, Recording, Side, Stamp, Walker, topics};
use raven::robot::nominal;
use raven::simulation::{Motion, Options, Session};

use crate::{Args, batches, learn, run};

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
    track_to(&folder.path().join("tracked.mcap"), log, cameras, more)
}

fn track_to(output: &Path, log: &Path, cameras: &Path, more: &[&str]) -> Result<(String, serde_json::Value, Outcome), String> {
    let json = output.with_extension("json");
    let name = |path: &Path| path.display().to_string();
    let robot = name(&LAB.path().join("robot.yaml"));
    let fixed = ["raven-track", &name(log), "--robot", &robot, "--cameras", &name(cameras), "-o", &name(output), "--json", &name(&json)];
    let args = Args::try_parse_from(fixed.into_iter().chain(more.iter().copied())).map_err(|e| e.to_string())?;
    let mut said = Vec::new();
    let outcome = run(args, &mut said).map_err(|e| {
        assert!(!output.exists(), "an output of a run that failed");
        e.to_string()
    })?;
    let json = serde_json::from_slice(&std::fs::read(json).unwrap()).unwrap();
    Ok((String::from_utf8(said).unwrap(), json, outcome))
}

/// The recording with its messages changed; `false` leaves one out.
fn copied(change: impl FnMut(&RawMessage<'_>, &mut Vec<u8>) -> bool) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("changed.mcap");
    let mut log = LogWriter::create(&path).unwrap();
    copy(&LAB.path().join("log.mcap"), &mut log, change);
    log.finish().unwrap();
    (folder, path)
}

fn copy(from: &Path, log: &mut LogWriter, mut change: impl FnMut(&RawMessage<'_>, &mut Vec<u8>) -> bool) {
    let mut channels = std::collections::HashMap::new();
    Walker::open(from)
        .unwrap()
        .run(|item| {
            match item {
                Item::Channel(channel) => {
                    channels.insert(channel.id, log.copy_channel(channel)?);
                }
                Item::Message(message) => {
                    let mut data = message.data.to_vec();
                    if change(&message, &mut data) {
                        log.copy_message(channels[&message.channel.id], &RawMessage { data: &data, ..message })?;
                    }
                }
                _ => {}
            }
            Ok(())
        })
        .unwrap();
}

/// The recording with its frames changed: by camera and by number of the frame, with the time in seconds; `false` leaves the frame out.
fn changed(change: impl Fn(usize, usize, f64, &mut Vec<u8>) -> bool) -> (tempfile::TempDir, PathBuf) {
    let (mut counts, mut first) = ([0; 2], None);
    copied(|message, data| {
        topics::camera_of(&message.channel.topic).is_none_or(|side| {
            let k = side as usize;
            counts[k] += 1;
            let start = *first.get_or_insert(message.publish_time);
            change(k, counts[k] - 1, message.publish_time.seconds_since(start), data)
        })
    })
}

fn number(json: &serde_json::Value, key: &str) -> f64 {
    json.pointer(key).and_then(serde_json::Value::as_f64).unwrap_or_else(|| panic!("no {key} in {json}"))
}

fn cameras() -> PathBuf {
    LAB.path().join("cameras.yaml")
}

/// The cameras file with something changed.
fn cameras_with(path: PathBuf, change: impl Fn(&mut Cameras)) -> PathBuf {
    let mut cameras = Cameras::read(&cameras()).unwrap();
    change(&mut cameras);
    cameras.write(&path).unwrap();
    path
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

/// Messages of each topic.
fn topics_of(log: &Path) -> BTreeMap<String, u64> {
    Recording::read(log, &MotorSource::default()).unwrap().topics
}

#[test]
fn what_is_tracked_again_has_the_cameras_and_the_drawings_once() {
    let folder = tempfile::tempdir().unwrap();
    let (first, again) = (folder.path().join("first.mcap"), folder.path().join("again.mcap"));
    let log = LAB.path().join("log.mcap");
    let (_, json, _) = track_to(&first, &log, &cameras(), &[]).unwrap();
    let written = topics_of(&first);
    for side in Side::BOTH {
        assert_eq!(written.get(topics::camera_info(side)), Some(&1), "{written:?}");
        assert!(written[topics::annotations(side)] as f64 >= number(&json, "/seen"), "{written:?}");
    }
    let topics_of_lab = topics_of(&log);
    // A log that has images beside what tracking wrote, as of a converter that merges both.
    let both = folder.path().join("both.mcap");
    let mut merged = LogWriter::create(&both).unwrap();
    copy(&log, &mut merged, |_, _| true);
    copy(&first, &mut merged, |message, _| !topics_of_lab.contains_key(&message.channel.topic));
    merged.finish().unwrap();
    track_to(&again, &both, &cameras(), &[]).unwrap();
    assert_eq!(topics_of(&again)[topics::LEFT_CAMERA_INFO], 1);
    assert_eq!(topics_of(&again)[topics::LEFT_ANNOTATIONS], written[topics::LEFT_ANNOTATIONS]);
    assert_eq!(topics_of(&again)[topics::TIP], written[topics::TIP]);
}

/// Text between two others.
fn between<'t>(text: &'t str, before: &str, after: &str) -> &'t str {
    text.split(before).nth(1).and_then(|rest| rest.split(after).next()).unwrap_or_else(|| panic!("no {before} in the page"))
}

#[test]
fn the_page_says_what_became_of_the_marker_and_shows_it() {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("tracking.html");
    let (log, option) = (LAB.path().join("log.mcap"), ["--html", page.to_str().unwrap()]);
    let (said, json, _) = track(&log, &cameras(), &option).unwrap();
    let page = std::fs::read_to_string(&page).unwrap();
    let html = without_pictures(&page);
    let (seen, pairs) = (number(&json, "/seen"), number(&json, "/pairs"));
    let heading = between(&html, "<h1>", "</h1>");
    assert!(heading.starts_with(&format!("The tip was seen in {seen} of {pairs} frames")), "{heading}");
    // Without the page the very same is found.
    let (plain, _, _) = track(&log, &cameras(), &[]).unwrap();
    let found = |said: &str| said.lines().filter(|line| !line.starts_with("time")).map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(found(&said), found(&plain));
    for side in ["left", "right"] {
        assert!(html.contains(&format!("What the {side} camera saw")) && html.contains(&format!("id=\"tile-{side}-0-23-t\"")), "{side}");
    }
    assert!(html.matches("data:image/png;base64,").count() >= 48 && page.len() < 8_000_000, "{} bytes", page.len());
    // Nothing from elsewhere; the name spaces of SVG are names, not places.
    let elsewhere = html.replace("http://www.w3.org/2000/svg", "");
    assert!(!elsewhere.contains("http") && !elsewhere.contains("url(") && !html.contains("<script") && !html.contains("NaN"));
    let ids: Vec<&str> = html.split(" id=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect();
    let distinct: std::collections::BTreeSet<&str> = ids.iter().copied().collect();
    assert_eq!(ids.len(), distinct.len());
    // What is drawn as found has the marker's colour in the picture under it.
    let tile = between(&page, "id=\"tile-left-3-0-d\"", "</svg>");
    let png = base64(between(tile, "base64,", "\""));
    let picture = image::load_from_memory(&png).unwrap().to_rgb8();
    // A large region is shown smaller.
    let number = |name: &str| between(tile, &format!("{name}=\""), "\"").parse::<f64>().unwrap();
    let scale = f64::from(picture.width()) / number("<image width");
    let [x, y] = ["cx", "cy"].map(|name| (scale * number(name)) as u32);
    let [red, green, blue] = picture.get_pixel(x, y).0;
    assert!(green > red && green > blue, "{:?}", [red, green, blue]);
}

#[test]
fn a_marker_that_is_never_seen_has_a_page_that_shows_why() {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("never.html");
    let never = track(&LAB.path().join("log.mcap"), &cameras(), &["--hue", "200..250", "--html", page.to_str().unwrap()]).unwrap_err();
    let html = without_pictures(&std::fs::read_to_string(&page).unwrap());
    assert!(never.contains("never seen"), "{never}");
    assert!(between(&html, "<h1>", "</h1>").starts_with("The tip was never seen") && html.contains("hidden: nothing of its colour"));
    assert!(html.contains("data:image/png") && !html.contains("NaN"));
}

/// A page whose pictures are empty: their letters may spell anything.
fn without_pictures(page: &str) -> String {
    let mut parts = page.split("base64,");
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |text, part| text + "base64," + &part[part.find('"').unwrap()..])
}

/// Bytes from base 64.
fn base64(text: &str) -> Vec<u8> {
    let digit = |c: u8| match c {
        b'A'..=b'Z' => c - b'A',
        b'a'..=b'z' => c - b'a' + 26,
        b'0'..=b'9' => c - b'0' + 52,
        b'+' => 62,
        _ => 63,
    };
    let bits = |four: &[u8]| four.iter().filter(|&&c| c != b'=').fold((0_u32, 0), |(bits, n), &c| (bits << 6 | u32::from(digit(c)), n + 6));
    text.as_bytes()
        .chunks(4)
        .flat_map(|four| {
            let (bits, n) = bits(four);
            (0..n / 8).map(move |i| (bits >> (n - 8 * (i + 1))) as u8).collect::<Vec<u8>>()
        })
        .collect()
}

#[test]
fn a_colour_learned_at_the_hard_stop_finds_the_marker_in_motion() {
    let hardstop = LAB.path().join("hardstop.mcap");
    let session = Session::new(&nominal::gold(), Options { images: true, ..Options::default() }).unwrap();
    session.record(Motion::Hardstop, 2.0, &hardstop, |_| {}).unwrap();
    let json = LAB.path().join("colour.json");
    let name = |path: &Path| path.display().to_string();
    let fixed = ["raven-track", "colour", &name(&hardstop), "--cameras", &name(&cameras()), "--json", &name(&json)];
    let words = fixed.into_iter().chain(["--marker-radius", "0.0055"]);
    let mut said = Vec::new();
    run(Args::try_parse_from(words).unwrap(), &mut said).unwrap();
    let said = String::from_utf8(said).unwrap();
    let learned: serde_json::Value = serde_json::from_slice(&std::fs::read(json).unwrap()).unwrap();
    assert_eq!(learned["pairs_seen"], learned["pairs"], "{said}");
    let options: Vec<&str> = said.lines().find(|line| line.starts_with("track with")).unwrap().split_whitespace().skip(2).collect();
    assert_eq!(options[options.len() - 2..], ["--marker-radius", "0.0055"], "{said}");
    let (_, default, _) = track(&LAB.path().join("log.mcap"), &cameras(), &[]).unwrap();
    let (_, tracked, _) = track(&LAB.path().join("log.mcap"), &cameras(), &options).unwrap();
    assert!(number(&tracked, "/seen") > 0.97 * number(&default, "/seen"), "{said}{tracked}");
}

#[test]
fn a_colour_is_learned_from_the_beginning_of_a_recording() {
    let long = LAB.path().join("long-stop.mcap");
    let session = Session::new(&nominal::gold(), Options { images: true, ..Options::default() }).unwrap();
    session.record(Motion::Hardstop, 12.0, &long, |_| {}).unwrap();
    // What is damaged behind the pairs that are looked at is not read.
    let mut bytes = std::fs::read(&long).unwrap();
    let late = bytes.len() * 7 / 10;
    bytes[late..late + 64].fill(0x55);
    std::fs::write(&long, bytes).unwrap();
    let learned = learn::learn(&long, &Cameras::read(&cameras()).unwrap(), 0.005).unwrap();
    assert_eq!((learned.pairs, learned.pairs_seen), (60, 60));
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
fn motors_that_cannot_be_decoded_are_counted() {
    let mut of_motors = 0;
    let (_folder, log) = copied(|message, data| {
        if message.channel.topic == MotorSource::from(&nominal::gold()).topic {
            of_motors += 1;
            if of_motors % 1000 == 500 {
                data.truncate(20);
            }
        }
        true
    });
    let (said, json, outcome) = track(&log, &cameras(), &[]).unwrap();
    assert_eq!(outcome, Outcome::DataLost, "{said}");
    let cut = (of_motors + 500) / 1000;
    assert_eq!(json["unusable"], format!("changed.mcap: {cut} messages that could not be decoded were left out."), "{said}");
}

#[test]
fn where_nothing_can_be_written_nothing_is_tracked() {
    let (_folder, other) = changed(|_, _, _, _| true);
    let name = |file: &str| LAB.path().join(file).display().to_string();
    let [log, robot, cameras] = ["log.mcap", "robot.yaml", "cameras.yaml"].map(name);
    for output in [other.as_path(), &other.with_file_name("none").join("tracked.mcap")] {
        // Tracked, it would never be seen.
        let typed = ["raven-track", &log, "--robot", &robot, "--cameras", &cameras, "--hue", "200..250", "-o"];
        let args = Args::try_parse_from(typed.map(str::to_owned).into_iter().chain([output.display().to_string()])).unwrap();
        let said = run(args, &mut Vec::new()).unwrap_err().to_string();
        assert!(said.contains("choose another name") || said.contains("folder"), "{said}");
    }
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

#[test]
fn a_tip_out_of_view_is_no_lack_of_motors() {
    let (log, folder) = (LAB.path().join("log.mcap"), tempfile::tempdir().unwrap());
    let about = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), std::f64::consts::PI);
    let at = |name: &str| folder.path().join(name);
    for (turned, words) in [
        (cameras_with(at("both.yaml"), |c| c.base_from_left = c.base_from_left.map(|base| base * about)), ["the left camera", "both.yaml"]),
        (cameras_with(at("right.yaml"), |c| c.right_from_left = about * c.right_from_left), ["the right camera", "right.yaml"]),
    ] {
        let never = track(&log, &turned, &[]).unwrap_err();
        assert!(words.iter().all(|word| never.contains(word)) && !never.contains("clock"), "{never}");
    }
    // The motors begin late: their frames are counted as such, and no other.
    let mut first = None;
    let (_folder, late) = copied(|message, _| {
        let start = *first.get_or_insert(message.publish_time);
        message.channel.topic != topics::RAVEN_STATE || message.publish_time.seconds_since(start) > 2.0
    });
    let (said, json, _) = track(&late, &cameras(), &[]).unwrap();
    let [motor, view] = ["/frames_without_motor", "/frames_out_of_view"].map(|key| number(&json, key));
    assert!((50.0..70.0).contains(&motor) && view == 0.0 && said.contains("without motors"), "{said}");
}

#[test]
fn frames_are_paired_by_their_own_interval_however_long_the_motors_were_recorded() {
    let mut first = None;
    let (_folder, short) = copied(|message, _| {
        let start = *first.get_or_insert(message.publish_time);
        topics::camera_of(&message.channel.topic).is_some() || message.publish_time.seconds_since(start) < 1.0
    });
    for log in [LAB.path().join("log.mcap"), short] {
        let recording = Recording::read(&log, &MotorSource::default()).unwrap();
        let within_s = batches::pair_within_s(&recording);
        assert!((15.0 * within_s - 0.55).abs() < 0.02, "{within_s} s of {} s", recording.duration_s);
    }
}

#[test]
fn frames_that_belong_together_come_together_from_batch_to_batch() {
    let log = LAB.path().join("log.mcap");
    let recording = Recording::read(&log, &MotorSource::default()).unwrap();
    let cameras = Cameras::read(&cameras()).unwrap();
    let (mut pairs, mut alone) = (0, 0);
    batches::for_each_encoded(&log, &cameras, batches::pair_within_s(&recording), |step| {
        *(if step.iter().all(Option::is_some) { &mut pairs } else { &mut alone }) += 1;
    })
    .unwrap();
    let [left, right] = Side::BOTH.map(|side| recording.require_images(side).unwrap().1);
    assert!(pairs > 60 && pairs + 1 >= left.min(right), "{pairs} pairs, {alone} alone, of {left} and {right}");
}

#[test]
fn frames_that_are_in_the_log_twice_count_once() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("twice.mcap");
    let cameras = Cameras::read(&cameras()).unwrap();
    let mut pictures = Vec::new();
    image::RgbImage::new(cameras.left.width, cameras.left.height)
        .write_to(&mut std::io::Cursor::new(&mut pictures), image::ImageFormat::Png)
        .unwrap();
    let at = |ms: u64| Stamp(1_700_000_000_000_000_000 + 1_000_000 * ms);
    let mut writer = LogWriter::create(&log).unwrap();
    for k in 0..40 {
        for (side, late_ms) in [(Side::Left, 0), (Side::Left, 0), (Side::Right, 5), (Side::Right, 5)] {
            writer.compressed_image(side, at(66 * k + late_ms), 0, &pictures).unwrap();
        }
    }
    writer.finish().unwrap();
    let (mut pairs, mut alone) = (0, 0);
    let counts = batches::for_each_encoded(&log, &cameras, 0.02, |step| {
        *(if step.iter().all(Option::is_some) { &mut pairs } else { &mut alone }) += 1;
    })
    .unwrap();
    assert_eq!((pairs, alone, counts.out_of_order, counts.lost()), (40, 0, 80, 0));
}
