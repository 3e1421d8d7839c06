//! Recordings of a laboratory, where they are at hand beside the repository.

use super::*;
use crate::robot::SourceFormat;

fn data(name: &str) -> Option<PathBuf> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data")).join(name);
    if path.exists() {
        return Some(path);
    }
    eprintln!("skipped: {} is not there", path.display());
    None
}

#[test]
fn a_whole_session() {
    let Some(path) = data("lab/sinusoid.mcap") else { return };
    let recording = Recording::read(&path, &MotorSource::default()).unwrap();
    let motor = recording.require_motor().unwrap();
    assert_eq!((motor.len(), recording.require_joint_encoders().unwrap().len()), (40_000, 40_000));
    assert_eq!((motor.names.as_slice(), recording.session["motion"].as_str()), (&ARM_JOINTS.map(String::from)[..], "sinusoid"));
    // The insertion in metres, not in degrees.
    let insertion = &recording.controller_joints.as_ref().unwrap().position[2];
    assert!(insertion.iter().all(|&q| (0.2..0.6).contains(&q)));
    let mut frame_count = 0;
    for frame in frames(&path).unwrap() {
        let frame = frame.unwrap();
        assert!(!frame.is_truncated());
        if frame_count == 0 {
            assert_eq!(frame.decode_gray().unwrap().dimensions(), frame.decode_rgb().unwrap().dimensions());
        }
        frame_count += 1;
    }
    assert_eq!((frame_count, frame_stamps(&path).unwrap().len()), (598 + 595, 598 + 595));
}

#[test]
fn real_recordings() {
    if let Some(path) = data("real/raven2_phasespace.mcap") {
        let (topic, format) = (topics::MOTOR_JOINT_STATES.to_owned(), SourceFormat::JointState);
        let recording = Recording::read(&path, &MotorSource { topic, format, ..MotorSource::default() }).unwrap();
        assert!(recording.require_motor().unwrap().effort.is_none());
        assert_eq!(recording.require_tip().unwrap().len(), 20_366);
    }
    if let Some(path) = data("real/raven2_uiuc_run.mcap") {
        let recording = Recording::read(&path, &MotorSource::default()).unwrap();
        assert_eq!(recording.require_motor().unwrap().effort.as_ref().unwrap()[0].len(), 9700);
        assert!(recording.require_tip().is_err());
    }
}
