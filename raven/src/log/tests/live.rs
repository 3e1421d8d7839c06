//! Logs that are recorded while they are written, and cut off at any byte.

use std::fs::OpenOptions;

use proptest::prelude::*;

use super::super::live::{active_name, complete};
use super::*;

/// Writes 200 states and flushes, writes 200 more and finishes; gives the bytes at both moments.
fn live_log(path: &Path) -> (u64, u64) {
    let mut log = LogWriter::live(path).unwrap();
    (0..200).for_each(|i| log.robot_state(ms(i), &state(i as f32)).unwrap());
    let flushed = log.flush().unwrap();
    // Whoever kills the program now leaves a file that is whole, with everything flushed.
    let survey = Survey::of(&active_name(path)).unwrap();
    assert_eq!((survey.messages, survey.damage), (200, None));
    assert!(active_name(path).metadata().unwrap().len() > flushed);
    (200..400).for_each(|i| log.robot_state(ms(i), &state(i as f32)).unwrap());
    log.finish().unwrap();
    (flushed, path.metadata().unwrap().len())
}

fn cut(path: &Path, at: u64) {
    OpenOptions::new().write(true).open(path).unwrap().set_len(at).unwrap();
}

#[test]
fn a_live_log_gets_its_name_at_the_end_and_never_writes_over_another() {
    let (folder, path) = place();
    live_log(&path);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    let survey = Survey::of(&path).unwrap();
    assert_eq!((survey.messages, &survey.damage), (400, &None));
    assert!(LogWriter::live(&path).err().unwrap().to_string().contains("never written over"));
    std::fs::rename(&path, active_name(&path)).unwrap();
    assert!(LogWriter::live(&path).err().unwrap().to_string().contains("--recover"));
}

#[test]
fn a_live_log_that_is_dropped_stays() {
    let (_folder, path) = place();
    let mut log = LogWriter::live(&path).unwrap();
    log.robot_state(ms(0), &state(1.0)).unwrap();
    let good = log.flush().unwrap();
    drop(log);
    assert!(!path.exists());
    complete(&path, good).unwrap();
    assert_eq!(Survey::of(&path).unwrap().messages, 1);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn what_was_flushed_survives_a_cut_at_any_byte(part in 0.0..1.0_f64) {
        let (folder, path) = place();
        let (flushed, length) = live_log(&path);
        let at = flushed + (part * (length - flushed) as f64) as u64;
        let active = active_name(&path);
        std::fs::rename(&path, &active).unwrap();
        cut(&active, at);
        let recovery = recover(&active, &folder.path().join("saved.mcap")).unwrap();
        prop_assert!((200..=400).contains(&recovery.messages), "{recovery:?}");
        complete(&path, flushed).unwrap();
        let survey = Survey::of(&path).unwrap();
        prop_assert_eq!((survey.messages, survey.damage), (200, None));
    }
}
