//! `raven-capture import`: bags that the test writes, bags that ROS's own `rosbag` writes, damaged ones, and folders of pictures.

use std::io::Write;
use std::path::Path;
use std::process::Command;

use crate::lab::{DEFINITION, TYPE, in_memory, md5sum, message, numbers, python};
use clap::Parser;
use proptest::prelude::*;
use raven::Error;
use raven::cli::Outcome;
use raven::log::{FrameData, Side, Stamp, Survey, frames};
use raven_capture::import::bag::{BagFault, MAGIC, read_record};

const TOPIC: &str = "/numbers";

fn import(input: &Path, output: &Path, more: &[&str]) -> raven::Result<Outcome> {
    let words = ["raven-capture", "import", input.to_str().unwrap(), "-o", output.to_str().unwrap()];
    raven_capture::run(raven_capture::Args::parse_from(words.iter().chain(more)), &mut Vec::new())
}

fn sized(bytes: &[u8]) -> Vec<u8> {
    [&(bytes.len() as u32).to_le_bytes(), bytes].concat()
}

fn record(fields: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    let header: Vec<u8> = fields.iter().flat_map(|(name, value)| sized(&[name.as_bytes(), b"=", value].concat())).collect();
    [sized(&header), sized(data)].concat()
}

/// A bag with these numbers, ten to a chunk.
fn bag(numbers: std::ops::Range<u64>, compression: &str) -> Vec<u8> {
    bag_of(numbers, compression, DEFINITION, message)
}

/// A bag whose messages are said to have another definition, or are others.
fn bag_of(numbers: std::ops::Range<u64>, compression: &str, definition: &str, message: impl Fn(u64) -> Vec<u8>) -> Vec<u8> {
    let sum = md5sum();
    let said = [("topic", TOPIC), ("type", TYPE), ("md5sum", &sum), ("message_definition", definition), ("callerid", "/robot")];
    let said: Vec<u8> = said.iter().flat_map(|(name, value)| sized(format!("{name}={value}").as_bytes())).collect();
    let connection = record(&[("op", &[7]), ("conn", &0_u32.to_le_bytes()), ("topic", TOPIC.as_bytes())], &said);
    let mut bag =
        [MAGIC, &record(&[("op", &[3]), ("index_pos", &[0; 8]), ("conn_count", &[0; 4]), ("chunk_count", &[0; 4])], &[b' '; 4000])]
            .concat();
    for from in numbers.clone().step_by(10) {
        let mut chunk = connection.clone();
        for number in from..(from + 10).min(numbers.end) {
            let time = [100 + number as u32, 5].map(u32::to_le_bytes).concat();
            chunk.extend(record(&[("op", &[2]), ("conn", &0_u32.to_le_bytes()), ("time", &time)], &message(number)));
        }
        let packed = match compression {
            "bz2" => {
                let mut packer = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::fast());
                packer.write_all(&chunk).unwrap();
                packer.finish().unwrap()
            }
            "lz4" => {
                let mut packer = lz4_flex::frame::FrameEncoder::new(Vec::new());
                packer.write_all(&chunk).unwrap();
                packer.finish().unwrap()
            }
            _ => chunk.clone(),
        };
        let size = (chunk.len() as u32).to_le_bytes();
        bag.extend(record(&[("op", &[5]), ("compression", compression.as_bytes()), ("size", &size)], &packed));
        bag.extend(record(&[("op", &[4]), ("ver", &1_u32.to_le_bytes()), ("conn", &[0; 4]), ("count", &[0; 4])], &[]));
    }
    bag.extend(connection);
    bag
}

#[test]
fn bags_of_every_compression_are_imported_byte_for_byte() {
    let folder = tempfile::tempdir().unwrap();
    for compression in ["none", "bz2", "lz4"] {
        let (input, output) = (folder.path().join("session.bag"), folder.path().join(format!("{compression}.mcap")));
        std::fs::write(&input, bag(0..95, compression)).unwrap();
        assert_eq!(import(&input, &output, &["--rename", "/numbers=/ravenstate"]).unwrap(), Outcome::Done, "{compression}");
        assert_eq!(numbers(&output, "/ravenstate"), ((0..95).collect(), true), "{compression}");
        let survey = Survey::of(&output).unwrap();
        let topic = survey.topic("/ravenstate").unwrap();
        assert_eq!((topic.schema.as_str(), topic.quality.without_stamp), (TYPE, 0));
        assert_eq!(survey.session["imported from"], "session.bag");
        assert!(import(&input, &output, &[]).unwrap_err().to_string().contains("never written over"));
    }
}

#[test]
fn a_damaged_bag_is_imported_up_to_the_damage_and_what_is_none_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (input, output) = (folder.path().join("cut.bag"), folder.path().join("saved.mcap"));
    let whole = bag(0..95, "bz2");
    std::fs::write(&input, &whole[..whole.len() * 2 / 3]).unwrap();
    assert_eq!(import(&input, &output, &[]).unwrap(), Outcome::DataLost);
    let (read, whole_log) = numbers(&output, TOPIC);
    assert!(whole_log && read.len() >= 40 && read.len() < 70 && read == (0..read.len() as u64).collect::<Vec<_>>(), "{read:?}");
    for (bytes, must_say) in [
        (&b""[..], "the file is empty."),
        (&b"#ROSBAG"[..], "does not begin as a bag"),
        (&b"no bag at all"[..], "does not begin as a bag"),
        (&whole[..4100], "nothing to import"),
    ] {
        std::fs::write(&input, bytes).unwrap();
        let output = folder.path().join("none.mcap");
        let said = import(&input, &output, &[]).unwrap_err().to_string();
        assert!(said.contains(must_say), "{said}");
        assert!(!output.exists());
    }
}

/// Cuts and changed bits at places from a fixed seed (splitmix64), of bags of every compression.
#[test]
fn a_bag_cut_at_any_length_or_with_any_bit_changed_is_imported_or_refused() {
    let folder = in_memory();
    let (input, output) = (folder.path().join("bad.bag"), folder.path().join("out.mcap"));
    let (mut state, mut lost) = (7_u64, 0);
    let mut below = |limit: usize| {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((mixed ^ (mixed >> 31)) % limit as u64) as usize
    };
    for number in 0..400 {
        let mut bytes = bag(0..25, ["none", "bz2", "lz4"][number % 3]);
        let at = below(bytes.len());
        if number < 200 {
            bytes.truncate(at);
        } else {
            bytes[at] ^= 1 << below(8);
        }
        std::fs::write(&input, &bytes).unwrap();
        match import(&input, &output, &[]) {
            Ok(outcome) => {
                assert_eq!(Survey::of(&output).unwrap().damage, None, "{number}");
                lost += usize::from(outcome == Outcome::DataLost);
                std::fs::remove_file(&output).unwrap();
            }
            Err(_) => assert!(!output.exists(), "{number}"),
        }
    }
    assert!(lost > 100, "{lost}");
}

#[test]
fn bags_of_rosbag_itself_are_imported() {
    const SCRIPT: &str = "import sys, genpy, rosbag\n\
        path, compression, kind, md5, definition, messages = sys.argv[1:]\n\
        pytype = type('Numbered', (), dict(_type=kind, _md5sum=md5, _full_text=open(definition).read()))\n\
        data = open(messages, 'rb').read()\n\
        with rosbag.Bag(path, 'w', compression=compression, chunk_threshold=20000) as bag:\n\
        \x20   for i in range(len(data) // 980):\n\
        \x20       bag.write('/numbers', (kind, data[980*i:980*i+980], md5, pytype), t=genpy.Time(100 + i, 5), raw=True)\n";
    let Some(python) = python("rosbag", "Debian: python3-rosbag") else { return };
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    std::fs::write(file("definition"), DEFINITION).unwrap();
    std::fs::write(file("messages"), (0..500).flat_map(message).collect::<Vec<u8>>()).unwrap();
    for compression in ["none", "bz2", "lz4"] {
        let (bag, log) = (file(&format!("{compression}.bag")), file(&format!("{compression}.mcap")));
        let written = Command::new(python)
            .args(["-c", SCRIPT, &bag, compression, TYPE, &md5sum(), &file("definition"), &file("messages")])
            .output()
            .unwrap();
        assert!(written.status.success(), "{}", String::from_utf8_lossy(&written.stderr));
        assert_eq!(import(bag.as_ref(), log.as_ref(), &[]).unwrap(), Outcome::Done, "{compression}");
        assert_eq!(numbers(log.as_ref(), TOPIC), ((0..500).collect(), true), "{compression}");
    }
}

#[test]
fn a_name_that_is_given_to_no_topic_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (input, output) = (folder.path().join("session.bag"), folder.path().join("session.mcap"));
    std::fs::write(&input, bag(0..25, "none")).unwrap();
    let said = import(&input, &output, &["--rename", "/number=/ravenstate"]).unwrap_err();
    assert!(matches!(said, raven::Error::Argument(_)), "{said}");
    assert!(said.to_string().contains("--rename /number=/ravenstate: ") && said.to_string().contains("has /numbers"), "{said}");
    assert!(!output.exists());
    let pictures = folder.path().join("boards");
    std::fs::create_dir(&pictures).unwrap();
    ["left1.png", "right1.png"].iter().for_each(|name| image::RgbImage::new(8, 8).save(pictures.join(name)).unwrap());
    let said = import(&pictures, &output, &["--rename", "/numbers=/ravenstate"]).unwrap_err();
    assert!(matches!(said, raven::Error::Argument(_)) && said.to_string().contains("a folder has no topics"), "{said}");
    assert!(!output.exists());
}

/// Their arrival stands in for the time of measurement, as it does in a recording.
#[test]
fn messages_whose_stamps_cannot_be_read_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let (input, json) = (folder.path().join("session.bag"), folder.path().join("import.json"));
    let imported = |name: &str, bytes: &[u8]| {
        std::fs::write(&input, bytes).unwrap();
        let output = folder.path().join(name);
        let outcome = import(&input, &output, &["--json", json.to_str().unwrap()]).unwrap();
        let said: serde_json::Value = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
        (outcome, said)
    };
    let short = |number: u64| if number == 7 { vec![0; 5] } else { message(number) };
    let (outcome, said) = imported("misfits.mcap", &bag_of(0..25, "none", DEFINITION, short));
    assert_eq!((outcome, said["messages"].as_u64()), (Outcome::DataLost, Some(25)), "{said}");
    assert_eq!(said["lost"][0], "/numbers: 1 messages that do not fit their definition; they are recorded as they came.");
    let (outcome, said) = imported("unknown.mcap", &bag_of(0..25, "none", "no definition at all", message));
    assert_eq!((outcome, said["messages"].as_u64()), (Outcome::Done, Some(25)), "{said}");
    let notice = said["notices"][0].as_str().unwrap();
    assert!(notice.starts_with("/numbers: the definition of /robot cannot be used: "), "{notice}");
    let (outcome, said) = imported("whole.mcap", &bag(0..25, "none"));
    assert_eq!((outcome, &said["lost"], &said["notices"]), (Outcome::Done, &serde_json::json!([]), &serde_json::json!([])));
}

#[test]
fn pictures_are_paired_by_their_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let picture = |name: &str, bytes: &[u8]| {
        let path = folder.path().join("boards").join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    };
    let jpeg = |number: u8| vec![0xff, 0xd8, number, 0xff, 0xd9];
    (0..12).for_each(|number| picture(&format!("left{number}.jpg"), &jpeg(number)));
    (0..12).filter(|number| *number != 5).for_each(|number| picture(&format!("right/{number:03}.JPG"), &jpeg(100 + number)));
    picture("notes.txt", b"");
    let (input, output) = (folder.path().join("boards"), folder.path().join("boards.mcap"));
    assert_eq!(import(&input, &output, &["--fps", "2"]).unwrap(), Outcome::DataLost);
    let read: Vec<_> = frames(&output).unwrap().map(Result::unwrap).map(|frame| (frame.side, frame.stamp, frame.data)).collect();
    let expected: Vec<_> = (0..12_u8)
        .filter(|number| *number != 5)
        .flat_map(|number| {
            let stamp = Stamp(1_000_000_000 + 500_000_000 * u64::from(number));
            [(Side::Left, stamp, FrameData::Jpeg(jpeg(number))), (Side::Right, stamp, FrameData::Jpeg(jpeg(100 + number)))]
        })
        .collect();
    assert_eq!(read, expected);
    assert_eq!(Survey::of(&output).unwrap().session["imported from"], "boards");
    picture("left0005.png", b"");
    let said = import(&input, &folder.path().join("twice.mcap"), &[]).unwrap_err().to_string();
    assert!(said.contains("are both number 5 of the left camera"), "{said}");
}

#[test]
fn pictures_that_are_none_are_counted_and_the_first_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let (input, json) = (folder.path().join("boards"), folder.path().join("said.json"));
    std::fs::create_dir(&input).unwrap();
    for name in ["left1.png", "right1.png", "left2.png"] {
        image::RgbImage::new(8, 8).save(input.join(name)).unwrap();
    }
    std::fs::write(input.join("right2.png"), "garbage").unwrap();
    let said = |name: &str| {
        let outcome = import(&input, &folder.path().join(name), &["--json", json.to_str().unwrap()]).unwrap();
        let said: serde_json::Value = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
        (outcome, said["lost"].to_string())
    };
    let (outcome, lost) = said("some.mcap");
    assert_eq!(outcome, Outcome::DataLost);
    assert!(lost.contains("1 of 4 pictures") && lost.contains("right2.png"), "{lost}");
    let whole = std::fs::read(input.join("left2.png")).unwrap();
    std::fs::write(input.join("right2.png"), &whole[..whole.len() - 5]).unwrap();
    let (outcome, lost) = said("cut.mcap");
    assert_eq!(outcome, Outcome::DataLost);
    assert!(lost.contains("1 of 4 pictures are cut off") && lost.contains("right2.png"), "{lost}");
    ["left2.png", "right2.png"].iter().for_each(|name| std::fs::remove_file(input.join(name)).unwrap());
    assert_eq!(said("whole.mcap"), (Outcome::Done, "[]".to_owned()));
    for name in ["cam0_1.jpg", "left.png"] {
        std::fs::write(input.join(name), &whole).unwrap();
    }
    let (outcome, lost) = said("neither.mcap");
    assert_eq!(outcome, Outcome::DataLost);
    assert!(lost.contains("2 pictures are left out") && lost.contains("cam0_1.jpg, ") && lost.contains("left.png"), "{lost}");
}

#[test]
fn no_picture_that_is_read_is_written_over() {
    let folder = tempfile::tempdir().unwrap();
    let (input, output) = (folder.path().join("boards"), folder.path().join("boards.mcap"));
    std::fs::create_dir_all(input.join("right")).unwrap();
    let (left, right) = (input.join("left1.png"), input.join("right").join("1.png"));
    [&left, &right].iter().for_each(|picture| image::RgbImage::new(8, 8).save(picture).unwrap());
    let before = std::fs::read(&left).unwrap();
    for picture in [&left, &right, &input] {
        let said = import(&input, &output, &["--json", picture.to_str().unwrap()]).unwrap_err().to_string();
        assert!(said.contains("nothing that is read is written over"), "{said}");
        assert!(!output.exists());
    }
    let said = import(&input, &output, &["--json", output.to_str().unwrap()]).unwrap_err().to_string();
    assert!(said.contains("-o and --json both name") && !output.exists(), "{said}");
    assert_eq!(std::fs::read(&left).unwrap(), before);
    assert_eq!(import(&input, &output, &["--json", input.join("said.json").to_str().unwrap()]).unwrap(), Outcome::Done);
}

#[test]
fn a_recording_does_not_go_to_standard_output() {
    let folder = tempfile::tempdir().unwrap();
    let said = import(folder.path(), Path::new("-"), &[]).unwrap_err();
    assert!(matches!(&said, Error::Argument(s) if s.contains("`-` is standard output")), "{said}");
    let record = raven_capture::Args::parse_from(["raven-capture", "record", "--robot", "ros://127.0.0.1:1/ravenstate", "-o", "-"]);
    let said = raven_capture::run(record, &mut Vec::new()).unwrap_err();
    assert!(matches!(&said, Error::Argument(s) if s.contains("`-` is standard output")), "{said}");
}

proptest! {
    #[test]
    fn no_bytes_break_the_reader(cut in 0_usize..6000, at in 0_usize..6000, byte in any::<u8>()) {
        let mut bytes = bag(0..3, "none")[MAGIC.len()..].to_vec();
        if let Some(place) = bytes.get_mut(at) {
            *place = byte;
        }
        let mut input = bytes.get(cut % bytes.len()..).unwrap();
        let mut take = |_| Ok::<(), BagFault>(());
        while let Ok(true) = read_record(&mut input, &mut take) {}
    }
}
