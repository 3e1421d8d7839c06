//! A recording as other people's libraries decode it: images, joint states and the robot's own message, value for value.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command as Program;
use std::thread;

use crate::lab::film::{PICTURES, Webcam, pictures};
use crate::lab::readers::run;
use crate::lab::{JOINT_STATE, JOINTS, Master, Publisher, aloud, joint_state, wait_for};
use clap::Parser;
use raven::cli::Outcome;
use raven::log::{Item, RAVEN_STATE_DEFINITION, RAVEN_STATE_TYPE, Side, Walker, topics};
use raven_capture::{Args, Command, record};
use serde::Deserialize;

const MEASURED: &str = "/arm/measured_js";
const MESSAGES: u32 = 200;

/// Decodes a recording with PyPI's `mcap-protobuf-support` and `mcap-ros1-support`; pictures too, where Pillow is installed.
const DECODE: &str = "import io, json, sys, zlib\n\
    from mcap.reader import make_reader\n\
    from mcap_protobuf.decoder import DecoderFactory as Protobuf\n\
    from mcap_ros1.decoder import DecoderFactory as Ros1\n\
    try: from PIL import Image\n\
    except ImportError: Image = None\n\
    found = dict(images={}, sizes=[], joints=[], encoders=[], sequences=[])\n\
    with open(sys.argv[1], 'rb') as file:\n\
    \x20   reader = make_reader(file, decoder_factories=[Protobuf(), Ros1()])\n\
    \x20   for schema, channel, message, decoded in reader.iter_decoded_messages():\n\
    \x20       if schema.name == 'foxglove.CompressedImage':\n\
    \x20           assert decoded.format == 'jpeg' and decoded.timestamp.ToNanoseconds() == message.publish_time\n\
    \x20           found['images'].setdefault(channel.topic, []).append([message.sequence, zlib.adler32(decoded.data)])\n\
    \x20           if Image: found['sizes'].append(Image.open(io.BytesIO(decoded.data)).convert('RGB').size)\n\
    \x20       elif schema.name == 'sensor_msgs/JointState':\n\
    \x20           assert decoded.header.stamp.to_nsec() == message.publish_time\n\
    \x20           found['joints'].append([decoded.name, decoded.position, decoded.effort])\n\
    \x20       elif schema.name == 'raven_2/raven_state': found['encoders'].append(decoded.encVals)\n\
    \x20       elif schema.name == 'raven_cal.FrameMeta': found['sequences'].append(decoded.sequence)\n\
    print(json.dumps(found))\n";

/// What was decoded.
#[derive(Deserialize)]
struct Decoded {
    images: BTreeMap<String, Vec<(usize, u32)>>,
    sizes: Vec<[u32; 2]>,
    joints: Vec<(Vec<String>, Vec<f64>, Vec<f64>)>,
    encoders: Vec<Vec<i32>>,
    sequences: Vec<usize>,
}

/// Opens recordings with Rerun's own reader, if it is installed, and returns what its table of each says.
fn opened_by_rerun(files: &[&Path]) -> Option<Vec<String>> {
    let rerun = |words: &[&str]| {
        let output = Program::new("rerun").args(words).env("NO_COLOR", "1").output().ok()?;
        assert!(output.status.success(), "{words:?}: {}", String::from_utf8_lossy(&output.stderr));
        Some(String::from_utf8_lossy(&output.stdout).into_owned())
    };
    if rerun(&["--version"]).is_none() {
        aloud("SKIPPED: Rerun is not installed (pip install rerun-sdk): recordings are not opened by its reader");
        return None;
    }
    let open = |file: &&Path| {
        let converted = file.with_extension("rrd");
        let converted = converted.to_str().unwrap();
        rerun(&["mcap", "convert", file.to_str().unwrap(), "-o", converted])?;
        rerun(&["rrd", "print", "-vv", converted])
    };
    files.iter().map(open).collect()
}

/// Adler's check sum, of RFC 1950.
fn adler32(bytes: &[u8]) -> u32 {
    let (a, b) =
        bytes.iter().fold((1, 0), |(a, b), byte| ((a + u32::from(*byte)) % 65_521, (b + (a + u32::from(*byte)) % 65_521) % 65_521));
    b << 16 | a
}

/// The robot's messages of a simulated second.
fn states(folder: &Path) -> Vec<Vec<u8>> {
    let log = folder.join("simulated.mcap");
    let words = ["raven-capture", "simulate", "--motion", "sinusoid", "--duration", "1", "-o", log.to_str().unwrap()];
    raven_capture::run(Args::parse_from(words), &mut Vec::new()).unwrap();
    let mut states = Vec::new();
    let take = |item: Item<'_>| {
        if let Item::Message(message) = item
            && message.channel.topic == topics::RAVEN_STATE
        {
            states.push(message.data.to_vec());
        }
        Ok(())
    };
    Walker::open(&log).unwrap().run(take).unwrap();
    states
}

#[test]
fn images_joint_states_and_the_robots_message_are_decoded_by_pypis_libraries() {
    let folder = tempfile::tempdir().unwrap();
    let states = states(folder.path());
    let (file, master) = (folder.path().join("session.mcap"), Master::start(0));
    let robot = Publisher::of(&master.at(), "/ravenstate", RAVEN_STATE_TYPE, RAVEN_STATE_DEFINITION);
    let joints = Publisher::of(&master.at(), MEASURED, "sensor_msgs/JointState", JOINT_STATE);
    let at = master.at();
    let words =
        ["raven-capture", "record", "--left", "serial:L1", "--right", "serial:R1", "--duration", "2", "--min-space", "1", "--robot"];
    let (address, uri) = (format!("ros://{}/ravenstate", at.authority()), at.to_string());
    let more = [&address, "--ros-master", &uri, "--topic", MEASURED, "-o", file.to_str().unwrap()];
    let Command::Record(args) = Args::parse_from(words.iter().chain(&more)).command else { unreachable!() };
    let outcome = thread::scope(|scope| {
        let cameras = Side::BOTH.map(|side| (side, Webcam::driver(side))).into();
        let recording = scope.spawn(move || record::record(&args, cameras, &mut Vec::new()).unwrap());
        wait_for("the subscribers", || robot.subscribers() == 1 && joints.subscribers() == 1);
        states.iter().for_each(|data| robot.publish_bytes(data));
        (0..MESSAGES).for_each(|i| joints.publish_bytes(&joint_state(i)));
        recording.join().unwrap()
    });
    assert_eq!(outcome, Outcome::Done);

    // Rerun decodes Foxglove's schemas, which computed joint states have; of ROS 1 it keeps the bytes.
    if let Some(tables) = opened_by_rerun(&[&file, &folder.path().join("simulated.mcap")]) {
        assert!(tables[0].contains("EncodedImage:blob") && tables[0].contains(topics::LEFT_COMPRESSED), "{}", tables[0].len());
        assert!(tables[1].contains("foxglove.JointStates:message") && tables[1].contains(topics::JOINT_ENCODERS), "{}", tables[1].len());
    }
    let hint = "pip install mcap-ros1-support mcap-protobuf-support";
    let Some(json) = run("mcap_ros1, mcap_protobuf", hint, DECODE, &[file.display().to_string()]) else { return };
    let decoded: Decoded = serde_json::from_slice(&json).unwrap();
    for side in Side::BOTH {
        let sums: Vec<u32> = pictures(side).iter().map(|picture| adler32(picture)).collect();
        let images = &decoded.images[topics::compressed(side)];
        assert!(images.len() > 30 && images.iter().all(|(sequence, sum)| sums[sequence % PICTURES] == *sum), "{}", images.len());
    }
    assert!(decoded.sizes.iter().all(|size| *size == [640, 480]));
    assert_eq!(decoded.sequences.len(), decoded.images.values().map(Vec::len).sum::<usize>());
    assert_eq!(decoded.joints.len(), MESSAGES as usize);
    for (at, (names, position, effort)) in (0..MESSAGES).map(f64::from).zip(&decoded.joints) {
        assert_eq!(names, &JOINTS);
        // JSON on the way costs the last digit.
        let expected = [at, -at, 1e-3 * at, 0.1 * at, 0.2, 0.3];
        assert!(position.iter().chain(effort).zip(expected).all(|(have, want)| (have - want).abs() < 1e-9), "{position:?} {effort:?}");
        assert_eq!((position.len(), effort.len()), (3, 3));
    }
    // The encoders are the 16 numbers that follow 4 words of the header, 5 of the levels, 6 + 18 + 18 + 6 of the tip and the duration.
    let encoders = |data: &Vec<u8>| -> Vec<i32> {
        let words = data.as_chunks::<4>().0.iter().map(|word| i32::from_le_bytes(*word));
        words.skip(4 + 5 + 6 + 18 + 18 + 6 + 2).take(16).collect()
    };
    assert!(decoded.encoders == states.iter().map(encoders).collect::<Vec<_>>(), "{:?}", decoded.encoders.first());
}
