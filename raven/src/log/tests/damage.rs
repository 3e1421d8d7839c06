//! Logs that were cut off, changed, or are something else.

use mcap::records::MessageHeader;
use mcap::{Compression, WriteOptions, Writer};
use proptest::prelude::*;

use super::*;

/// The bytes of a log of robot states in chunks of 50 kB.
fn log_bytes(options: WriteOptions, messages: u64) -> Vec<u8> {
    let mut writer = options.chunk_size(Some(50_000)).compression_threads(0).create(std::io::Cursor::new(Vec::new())).unwrap();
    let schema = writer.add_schema(RAVEN_STATE_TYPE, "ros1msg", RAVEN_STATE_DEFINITION.as_bytes()).unwrap();
    let channel = writer.add_channel(schema, topics::RAVEN_STATE, "ros1", &BTreeMap::new()).unwrap();
    write_states(&mut writer, channel, messages);
    writer.finish().unwrap();
    writer.into_inner().into_inner()
}

fn write_states<W: std::io::Write + std::io::Seek>(writer: &mut Writer<W>, channel_id: u16, messages: u64) {
    for i in 0..messages {
        let header = MessageHeader { channel_id, sequence: 0, log_time: ms(i).0, publish_time: ms(i).0 };
        writer.write_to_known_channel(&header, &state(i as f32 * 0.1).encode(ms(i))).unwrap();
    }
}

fn read(path: &Path) -> crate::Result<Recording> {
    Recording::read(path, &MotorSource::default())
}

/// Where to recover a log to: recordings are never written over.
fn unused(folder: &Path) -> PathBuf {
    let saved = folder.join("saved.mcap");
    let _ = std::fs::remove_file(&saved);
    saved
}

/// Recovers the log at `path`; the new one must be whole and hold as many messages as was said.
fn recovered(folder: &Path, path: &Path) -> Option<u64> {
    let saved = unused(folder);
    let recovery = recover(path, &saved).ok()?;
    let recording = read(&saved).unwrap();
    assert_eq!(recording.topics[topics::RAVEN_STATE], recovery.messages);
    assert_eq!(recording.motor.unwrap().len() as u64, recovery.messages);
    Some(recovery.messages)
}

#[test]
fn every_compression_reads() {
    let (_folder, path) = place();
    let options = [
        WriteOptions::new().compression(Some(Compression::Zstd)),
        WriteOptions::new().compression(Some(Compression::Lz4)),
        WriteOptions::new().compression(None),
        WriteOptions::new().compression(None).use_chunks(false),
        WriteOptions::new().emit_summary_records(false).emit_summary_offsets(false).calculate_chunk_crcs(false),
    ];
    for options in options {
        std::fs::write(&path, log_bytes(options, 300)).unwrap();
        let motor = read(&path).unwrap().motor.unwrap();
        assert_eq!(motor.len(), 300);
        approx::assert_relative_eq!(motor.position[0][299], 29.9_f64.to_radians(), epsilon = 1e-6);
    }
}

#[test]
fn other_files_are_refused_in_one_sentence() {
    let (_folder, path) = place();
    for (contents, expected) in [(&b""[..], "empty"), (b"#ROSBAG V2.0\n", "raven-capture import"), (b"hello", "no MCAP file")] {
        std::fs::write(&path, contents).unwrap();
        let error = read(&path).unwrap_err().to_string();
        assert!(error.contains(expected) && error.contains("log.mcap"), "{error}");
        assert!(frames(&path).is_err() && Survey::of(&path).is_err());
    }
    assert!(read(&path.join("missing")).unwrap_err().to_string().contains("cannot read"));
}

#[test]
fn a_cut_off_log_is_refused_and_saved() {
    let (folder, path) = place();
    robot_log(&path);
    let whole = std::fs::read(&path).unwrap();
    std::fs::write(&path, &whole[..whole.len() * 3 / 4]).unwrap();
    let error = read(&path).unwrap_err().to_string();
    assert!(error.contains("breaks off") && error.contains("messages are readable") && error.contains("--recover"), "{error}");
    let last = frames(&path).unwrap().last().unwrap().unwrap_err().to_string();
    assert!(last.contains("--recover"), "{last}");

    let saved = folder.path().join("saved.mcap");
    let recovery = recover(&path, &saved).unwrap();
    assert!(recovery.messages > 1000 && recovery.messages < 3000, "{recovery:?}");
    assert!(recovery.damage.is_some() && recovery.attachments == 1);
    let recording = read(&saved).unwrap();
    assert_eq!((recording.session["robot"].as_str(), recording.attachments.len()), ("raven2-gold", 1));
    let survey = Survey::of(&path).unwrap();
    assert_eq!((survey.messages, survey.damage.is_some()), (recovery.messages, true));
    assert!(recover(&path, &path).is_err(), "the damaged log is never overwritten");
}

/// A recorder that is killed leaves an open chunk, whose length is not yet known.
#[test]
fn the_open_chunk_of_a_killed_recorder_is_read() {
    let (folder, path) = place();
    for compression in [None, Some(Compression::Zstd), Some(Compression::Lz4)] {
        let file = std::fs::File::create(&path).unwrap();
        let mut writer = WriteOptions::new().compression(compression).compression_threads(0).create(file).unwrap();
        let schema = writer.add_schema(RAVEN_STATE_TYPE, "ros1msg", RAVEN_STATE_DEFINITION.as_bytes()).unwrap();
        let channel = writer.add_channel(schema, topics::RAVEN_STATE, "ros1", &BTreeMap::new()).unwrap();
        write_states(&mut writer, channel, 1500);
        // Chunks of 1 MiB hold 1000 of these messages: the second one is open.
        std::mem::forget(writer);
        let messages = recovered(folder.path(), &path).unwrap();
        assert!(messages > 1000, "{compression:?}: {messages}");
    }
}

/// Where the chunks lie.
fn chunks(bytes: &[u8]) -> Vec<std::ops::Range<usize>> {
    let mut start = mcap::MAGIC.len();
    let mut found = Vec::new();
    while start + 9 < bytes.len() {
        let end = start + 9 + u64::from_le_bytes(bytes[start + 1..start + 9].try_into().unwrap()) as usize;
        if bytes[start] == mcap::records::op::CHUNK {
            found.push(start..end);
        }
        start = end;
    }
    found
}

#[test]
fn a_changed_chunk_is_left_out_and_the_others_stay() {
    let (folder, path) = place();
    for options in [WriteOptions::new(), WriteOptions::new().compression(None)] {
        let mut bytes = log_bytes(options, 1000);
        let chunks = chunks(&bytes);
        let chunk = &chunks[chunks.len() / 2];
        bytes[(chunk.start + chunk.end) / 2] ^= 0x55;
        std::fs::write(&path, &bytes).unwrap();
        let survey = Survey::of(&path).unwrap();
        let damage = survey.damage.unwrap();
        assert_eq!((damage.cut_off_at, damage.bad_records), (None, 1), "{damage:?}");
        assert!(survey.messages > 900 && survey.messages < 1000, "{}", survey.messages);
        let recovery = recover(&path, &unused(folder.path())).unwrap();
        assert_eq!((recovery.messages, recovery.expected_messages), (survey.messages, Some(1000)));
    }
}

#[test]
fn an_incomplete_attachment_is_damage() {
    let (_folder, path) = place();
    let mut bytes = mcap::MAGIC.to_vec();
    let body = [vec![0; 16], vec![4, 0, 0, 0], b"name".to_vec(), vec![0; 4], vec![9, 0, 0, 0, 0, 0, 0, 0], vec![0; 3]].concat();
    bytes.push(mcap::records::op::ATTACHMENT);
    bytes.extend((body.len() as u64).to_le_bytes());
    bytes.extend(body);
    std::fs::write(&path, &bytes).unwrap();
    assert_eq!(Survey::of(&path).unwrap().damage.unwrap().bad_records, 1);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Cut anywhere, what stands before the cut is saved, chunk by chunk.
    #[test]
    fn a_log_cut_anywhere_is_saved_up_to_the_cut(cut in 0.0..1.0_f64, lz4 in any::<bool>()) {
        let (folder, path) = place();
        let compression = if lz4 { Compression::Lz4 } else { Compression::Zstd };
        let whole = log_bytes(WriteOptions::new().compression(Some(compression)), 500);
        let kept = (whole.len() as f64 * cut) as usize;
        std::fs::write(&path, &whole[..kept]).unwrap();
        prop_assert!(read(&path).is_err());
        if let Some(messages) = recovered(folder.path(), &path) {
            prop_assert!(messages <= 500);
            // The index at the end takes some of the file.
            prop_assert!(messages as f64 >= 500.0 * (cut - 0.2), "{messages} of 500 from the first {cut}");
        }
    }

    #[test]
    fn no_bytes_panic(tail in prop::collection::vec(any::<u8>(), 0..300), opcode in 0_u8..16, length in 0_u64..320) {
        let (_folder, path) = place();
        std::fs::write(&path, [mcap::MAGIC, &[opcode], &length.to_le_bytes(), &tail].concat()).unwrap();
        let _ = read(&path);
        let _ = Survey::of(&path);
        if let Ok(frames) = frames(&path) {
            let _ = frames.count();
        }
    }

    #[test]
    fn no_changed_log_panics(changes in prop::collection::vec((0.0..1.0_f64, any::<u8>()), 1..6), chunks in any::<bool>()) {
        let (folder, path) = place();
        let options = WriteOptions::new().compression(None).use_chunks(chunks).calculate_chunk_crcs(false);
        let mut bytes = log_bytes(options, 60);
        for (place, value) in changes {
            let at = (bytes.len() as f64 * place) as usize;
            bytes[at] = value;
        }
        std::fs::write(&path, &bytes).unwrap();
        let _ = read(&path);
        let _ = Survey::of(&path);
        let _ = recover(&path, &unused(folder.path()));
    }
}
