//! Cuts a part out of a log.

use std::ops::Range;
use std::path::Path;

use super::Stamp;
use super::copy::Copy;
use crate::{Error, Result};

/// What was cut out.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Cut {
    /// Messages in the new file.
    pub messages: u64,
    /// Messages in the whole one.
    pub of: u64,
    /// From the first message of the whole file to its last [s].
    pub length_s: f64,
}

/// Copies the messages of `input` that arrived in a part of it, counted from its first message [s], with every topic, attachment and metadata
/// record into a new log. What was measured just before and arrived within belongs to it.
///
/// # Errors
/// If `input` cannot be read, is no MCAP file or is damaged, nothing arrived in that part, or `output` exists or cannot be written.
pub fn cut(input: &Path, output: &Path, part_s: &Range<f64>) -> Result<Cut> {
    let mut first: Option<Stamp> = None;
    let mut length_s = 0.0_f64;
    let copy = Copy::new(input, output, |message| {
        let since_s = message.log_time.seconds_since(*first.get_or_insert(message.log_time));
        length_s = length_s.max(since_s);
        part_s.contains(&since_s)
    })?;
    copy.walker.require_whole()?;
    let cut = Cut { messages: copy.messages, of: copy.walker.messages(), length_s };
    copy.finish(|| {
        let before = if part_s.end.is_finite() { format!(" and before {} s", part_s.end) } else { String::new() };
        let part = format!("no message in it arrived from {} s on{before}", part_s.start);
        Error::file(input, format!("{part}; from its first message to its last it is {length_s:.3} s long: name a part of that."))
    })?;
    Ok(cut)
}

#[cfg(test)]
mod tests {
    use crate::log::{Item, LogWriter, RavenState, Times, Walker, topics};

    use super::*;

    /// Ten seconds of a robot whose messages take 20 ms to arrive, with a stored file.
    fn session(path: &Path) {
        let mut log = LogWriter::create(path).unwrap();
        log.attachment("robot.yaml", "application/yaml", b"robot").unwrap();
        for k in 0..100 {
            let measured = Stamp(1_700_000_000_000_000_000).plus_seconds(0.1 * f64::from(k));
            log.robot_state(Times { measured, arrived: measured.plus_seconds(0.02) }, &RavenState::default()).unwrap();
        }
        log.finish().unwrap();
    }

    #[test]
    fn a_part_has_what_arrived_in_it_and_all_stored_files() {
        let folder = tempfile::tempdir().unwrap();
        let [log, part] = ["log.mcap", "part.mcap"].map(|name| folder.path().join(name));
        session(&log);
        let done = cut(&log, &part, &(2.05..5.0)).unwrap();
        assert_eq!((done.messages, done.of), (29, 100));
        approx::assert_relative_eq!(done.length_s, 9.9, epsilon = 1e-6);
        let (mut arrived, mut files) = (Vec::new(), 0);
        let mut walker = Walker::open(&part).unwrap();
        let visit = |item: Item<'_>| {
            match item {
                Item::Message(message) if message.channel.topic == topics::RAVEN_STATE => arrived.push(message.log_time),
                Item::Attachment(_) => files += 1,
                _ => {}
            }
            Ok(())
        };
        walker.run(visit).unwrap();
        assert_eq!((arrived.len(), files), (29, 1));
        approx::assert_relative_eq!(arrived[28].seconds_since(arrived[0]), 2.8, epsilon = 1e-6);
    }

    #[test]
    fn no_part_is_cut_where_nothing_arrived_or_out_of_a_damaged_log() {
        let folder = tempfile::tempdir().unwrap();
        let [log, part] = ["log.mcap", "part.mcap"].map(|name| folder.path().join(name));
        session(&log);
        let error = cut(&log, &part, &(60.0..f64::INFINITY)).unwrap_err().to_string();
        assert!(error.contains("it is 9.900 s long"), "{error}");
        let bytes = std::fs::read(&log).unwrap();
        std::fs::write(&log, &bytes[..bytes.len() / 2]).unwrap();
        let error = cut(&log, &part, &(0.0..5.0)).unwrap_err().to_string();
        assert!(error.contains("--recover"), "{error}");
        assert!(!part.exists());
    }
}
