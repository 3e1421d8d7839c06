//! Every kind of message that the writer knows, read back.

use approx::assert_relative_eq;
use nalgebra::{Isometry3, Matrix3, Vector3};

use super::*;
use crate::camera::{Cameras, Pinhole, Quality};
use crate::robot::{ArmSide, SourceFormat};

fn observation(at: u64, status: TipStatus) -> TipObservation {
    TipObservation {
        stamp: ms(at),
        frame_id: "gold/frame0".to_owned(),
        status,
        left_px: [320.5, 200.25],
        right_px: [f64::NAN, f64::NAN],
        position_m: Vector3::new(-0.06, -0.02, 0.01),
        covariance_m2: Matrix3::new(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0) * 1e-8,
    }
}

#[test]
fn robot_joints_tip_and_what_goes_with_them() {
    let (_folder, path) = place();
    let session = BTreeMap::from([("arm".to_owned(), "gold".to_owned())]);
    let mut log = LogWriter::create(&path).unwrap();
    log.metadata("session", &session).unwrap();
    log.attachment("cameras.yaml", "application/yaml", b"left: 1\n").unwrap();
    for i in 0..5 {
        log.robot_state(Times { measured: ms(i), arrived: ms(i + 40) }, &state(i as f32)).unwrap();
        log.joint_states(topics::JOINT_ENCODERS, ms(i), &["shoulder", "elbow"], &[i as f64, 2.0], Some(&[0.5, 0.25])).unwrap();
    }
    log.tip(&observation(3, TipStatus::Seen)).unwrap();
    log.tip(&observation(1, TipStatus::Jumped)).unwrap();
    log.clock(ms(1), ClockSample { monotonic_ns: 5, realtime_ns: 6, ..ClockSample::default() }).unwrap();
    log.finish().unwrap();

    let recording = Recording::read(&path, &MotorSource::default()).unwrap();
    let motor = recording.require_motor().unwrap();
    assert_eq!((recording.start, recording.session.clone(), motor.names.len()), (ms(0), session, 3));
    assert_relative_eq!(recording.duration_s, 0.004, epsilon = 1e-12);
    assert_relative_eq!(motor.interpolate(0, 0.0025).unwrap(), 2.5_f64.to_radians(), epsilon = 1e-12);
    assert_eq!(motor.effort.as_ref().unwrap()[1], [0.25; 5]);
    assert_relative_eq!(recording.controller_joints.unwrap().position[2][0], 0.40, epsilon = 1e-7);
    let encoders = recording.joint_encoders.unwrap();
    assert_eq!((encoders.position[0][4], encoders.effort.unwrap()[1][0]), (4.0, 0.25));
    assert_eq!(recording.attachments["cameras.yaml"], b"left: 1\n");
    assert_eq!(recording.topics[topics::CLOCK], 1);
    // In the order of time, and the covariance not transposed. NaN is not equal to itself, so the text is compared.
    let expected = [observation(1, TipStatus::Jumped), observation(3, TipStatus::Seen)];
    assert_eq!(format!("{:?}", recording.tip), format!("{expected:?}"));

    let green = MotorSource { arm: ArmSide::Green, ..MotorSource::default() };
    let recording = Recording::read(&path, &green).unwrap();
    assert_relative_eq!(recording.motor.unwrap().position[0][3], -3.0_f64.to_radians(), epsilon = 1e-12);
}

/// A tracker that tries again writes two observations with one stamp.
#[test]
fn of_two_tips_with_one_stamp_that_which_was_seen_counts() {
    let (_folder, path) = place();
    let mut log = LogWriter::create(&path).unwrap();
    for (at, status) in [(3, TipStatus::Occluded), (3, TipStatus::Seen), (4, TipStatus::Seen), (4, TipStatus::Jumped)] {
        log.tip(&observation(at, status)).unwrap();
    }
    log.finish().unwrap();
    let tips = Recording::read(&path, &MotorSource::default()).unwrap().tip;
    let kept: Vec<(Stamp, TipStatus)> = tips.iter().map(|tip| (tip.stamp, tip.status)).collect();
    assert_eq!(kept, [(ms(3), TipStatus::Seen), (ms(4), TipStatus::Seen)]);
}

#[test]
fn frames_of_both_kinds() {
    let (_folder, path) = place();
    let rgb = image::RgbImage::from_fn(16, 8, |x, y| image::Rgb([x as u8 * 8, y as u8 * 8, 40]));
    let mut jpeg = Vec::new();
    image::codecs::jpeg::JpegEncoder::new_with_quality(&mut jpeg, 95).encode_image(&rgb).unwrap();
    let mut log = LogWriter::create(&path).unwrap();
    for (i, sequence) in [1, 2, 5].into_iter().enumerate() {
        let at = 66 * i as u64;
        let jpeg = if i == 1 { &jpeg[..jpeg.len() - 20] } else { &jpeg };
        log.compressed_image(Side::Left, Times { measured: ms(at), arrived: ms(at + 9) }, sequence, jpeg).unwrap();
        log.raw_image(Side::Right, ms(at + 2), 0, ("rgb8", [16, 8], 48), rgb.as_raw()).unwrap();
        log.frame_meta(Side::Left, ms(at), FrameMeta { sequence, gap: 2, ..FrameMeta::default() }).unwrap();
    }
    log.annotations(Side::Left, ms(0), Some(([3.0, 4.0], TipStatus::Seen, 8.0)), &[[1.0, 2.0]]).unwrap();
    log.finish().unwrap();

    let all: Vec<CameraFrame> = frames(&path).unwrap().collect::<Result<_, _>>().unwrap();
    assert_eq!(all.iter().map(|frame| frame.side).collect::<Vec<_>>(), [Side::Left, Side::Right].repeat(3));
    assert_eq!((all[0].stamp, all[0].log_time, all[0].sequence, all[1].sequence), (ms(0), ms(9), Some(1), None));
    assert_eq!(all[1].decode_rgb().unwrap(), rgb);
    assert!(!all[0].is_truncated() && all[2].is_truncated());
    let stamps: Vec<(Side, Stamp)> = all.iter().map(|frame| (frame.side, frame.stamp)).collect();
    assert_eq!(frame_stamps(&path).unwrap(), stamps);

    let recording = Recording::read(&path, &MotorSource::default()).unwrap();
    let images = Side::BOTH.map(|side| recording.require_images(side).unwrap());
    assert_eq!(images, [(topics::LEFT_COMPRESSED, 3), (topics::RIGHT_RAW, 3)]);

    let survey = Survey::of(&path).unwrap();
    let left = survey.topic(topics::LEFT_COMPRESSED).unwrap();
    assert_eq!((left.truncated_frames, left.missing_frames), (1, 2));
    assert_relative_eq!(survey.cameras.unwrap().right_minus_left_s, 0.002, epsilon = 1e-9);
    // Without robot and tip the images give the start.
    assert_eq!(Recording::read(&path, &MotorSource::default()).unwrap().start, ms(0));
}

#[test]
fn a_camera_is_described_as_in_its_file() {
    use foxglove::messages::CameraCalibration;
    use prost::Message;

    let (_folder, path) = place();
    let left = Pinhole { width: 640, height: 480, fx: 600.0, fy: 601.0, cx: 320.0, cy: 240.0, distortion: [0.1, -0.2, 0.3, 0.4, 0.5] };
    let cameras = Cameras {
        left,
        right: Pinhole { fx: 610.0, ..left },
        right_from_left: Isometry3::translation(-0.05, 0.0, 0.0),
        base_from_left: None,
        latency_s: 0.0,
        right_minus_left_s: 0.0,
        quality: Quality::default(),
    };
    let mut log = LogWriter::create(&path).unwrap();
    Side::BOTH.into_iter().for_each(|side| log.camera_info(side, ms(7), &cameras).unwrap());
    log.finish().unwrap();

    let mut found = Vec::new();
    let keep = |item: Item<'_>| {
        if let Item::Message(message) = item {
            assert_eq!(message.channel.schema.as_ref().unwrap().name, "foxglove.CameraCalibration");
            found.push((message.channel.topic.clone(), CameraCalibration::decode(message.data).unwrap()));
        }
        Ok(())
    };
    Walker::open(&path).unwrap().run(keep).unwrap();
    let [(left_topic, left), (right_topic, right)] = found.try_into().unwrap();
    assert_eq!((left_topic.as_str(), right_topic.as_str()), (topics::LEFT_CAMERA_INFO, topics::RIGHT_CAMERA_INFO));
    assert_eq!((left.width, left.height, left.distortion_model.as_str()), (640, 480, "plumb_bob"));
    assert_eq!((left.frame_id.as_str(), right.frame_id.as_str()), ("left_camera", "right_camera"));
    assert_eq!(left.d, [0.1, -0.2, 0.3, 0.4, 0.5]);
    assert_eq!(left.k, [600.0, 0.0, 320.0, 0.0, 601.0, 240.0, 0.0, 0.0, 1.0]);
    assert_eq!(left.r, [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    assert_eq!(left.p, [600.0, 0.0, 320.0, 0.0, 0.0, 601.0, 240.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    // ROS: fx times the right camera's place on the left one's x axis, negated.
    assert_eq!(right.p, [610.0, 0.0, 320.0, -30.5, 0.0, 601.0, 240.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
}

/// A driver announces a stream long before it sends anything on it, or never does.
#[test]
fn a_stream_without_frames_hides_none_that_has_them() {
    let (_folder, path) = place();
    let mut log = LogWriter::create(&path).unwrap();
    let schema = SchemaRef { name: "foxglove.CompressedImage", encoding: "protobuf", data: &[], message_encoding: "protobuf" };
    log.add_channel(topics::LEFT_COMPRESSED, schema, &BTreeMap::new()).unwrap();
    for i in 0..3 {
        log.raw_image(Side::Left, ms(66 * i), 0, ("mono8", [2, 1], 2), &[1, 2]).unwrap();
        log.raw_image(Side::Right, ms(66 * i + 2), 0, ("mono8", [2, 1], 2), &[3, 4]).unwrap();
    }
    // The kind that came first is taken.
    log.compressed_image(Side::Right, ms(200), 0, &[0xff, 0xd8, 0xff, 0xd9]).unwrap();
    log.finish().unwrap();
    let of = |wanted: Side| frames(&path).unwrap().map(Result::unwrap).filter(|frame| frame.side == wanted).count();
    assert_eq!((of(Side::Left), of(Side::Right)), (3, 3));
    assert_eq!(frame_stamps(&path).unwrap().len(), 6);
    let survey = Survey::of(&path).unwrap();
    assert_relative_eq!(survey.cameras.unwrap().right_minus_left_s, 0.002, epsilon = 1e-9);
}

#[test]
fn a_log_is_copied_byte_for_byte() {
    let (folder, path) = place();
    robot_log(&path);
    let copy = folder.path().join("copy.mcap");
    assert_eq!(recover(&path, &copy).unwrap().messages, 3000);
    let contents = |path: &Path| {
        let mut messages = Vec::new();
        let mut others = Vec::new();
        let mut walker = Walker::open(path).unwrap();
        let mut visit = |item: Item<'_>| {
            match item {
                Item::Message(m) => messages.push((m.channel.topic.clone(), m.sequence, m.log_time, m.publish_time, m.data.to_vec())),
                Item::Channel(channel) => others.push(format!("{:?} {:?}", channel.schema.as_ref().unwrap().data, channel.metadata)),
                other => others.push(format!("{other:?}")),
            }
            Ok(())
        };
        walker.run(&mut visit).unwrap();
        others.sort();
        (messages, others)
    };
    assert_eq!(contents(&path), contents(&copy));
}

#[test]
fn of_two_kinds_of_images_the_first_is_taken_everywhere() {
    let (_folder, path) = place();
    let mut log = LogWriter::create(&path).unwrap();
    log.raw_image(Side::Left, ms(1), 0, ("mono8", [2, 1], 2), &[1, 2]).unwrap();
    for at in [2, 3] {
        log.compressed_image(Side::Left, Times { measured: ms(at), arrived: ms(at) }, at as u32, &[0xff, 0xd8]).unwrap();
    }
    log.finish().unwrap();
    assert_eq!(frame_stamps(&path).unwrap(), [(Side::Left, ms(1))]);
    let recording = Recording::read(&path, &MotorSource::default()).unwrap();
    assert_eq!(recording.require_images(Side::Left).unwrap(), (topics::LEFT_RAW, 1));
}

#[test]
fn a_log_dropped_unfinished_leaves_nothing() {
    let (folder, path) = place();
    let mut log = LogWriter::create(&path).unwrap();
    log.robot_state(ms(0), &state(1.0)).unwrap();
    drop(log);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn what_is_missing_is_named() {
    let (_folder, path) = place();
    let mut log = LogWriter::create(&path).unwrap();
    log.joint_states(topics::MOTOR_JOINT_STATES, ms(0), &["carriage"], &[1.0], None).unwrap();
    log.finish().unwrap();
    let recording = Recording::read(&path, &MotorSource::default()).unwrap_err();
    assert!(recording.to_string().contains("Topics in the file: `/motor/joint_states`"), "{recording}");
    let source = MotorSource { topic: topics::MOTOR_JOINT_STATES.to_owned(), format: SourceFormat::JointState, ..MotorSource::default() };
    let recording = Recording::read(&path, &source).unwrap();
    assert!(recording.require_motor().unwrap().effort.is_none());
    let error = recording.require_tip().unwrap_err().to_string();
    assert!(error.contains("log.mcap") && error.contains("`/tip`") && error.contains("`/motor/joint_states`"), "{error}");
    assert!(recording.require_joint_encoders().is_err());
    let error = recording.require_images(Side::Right).unwrap_err().to_string();
    assert!(error.contains("log.mcap") && error.contains("right camera on `/stereo/right/image_raw/compressed`"), "{error}");
    let error = frames(&path).unwrap().next().unwrap().unwrap_err().to_string();
    assert!(error.contains("no camera images") && error.contains("`/motor/joint_states`"), "{error}");
    // The robot file expects the other kind of message.
    let wrong = MotorSource { format: SourceFormat::RavenState, ..source };
    let error = Recording::read(&path, &wrong).unwrap_err().to_string();
    assert!(error.contains("/motor/joint_states"), "{error}");
}

#[test]
fn what_was_computed_may_be_computed_again_and_a_recording_stays() {
    let (_folder, path) = place();
    let write = |log: crate::Result<LogWriter>| {
        let mut log = log?;
        log.robot_state(ms(0), &state(1.0))?;
        log.finish()
    };
    write(LogWriter::computed(&path)).unwrap();
    write(LogWriter::computed(&path)).unwrap();
    for refused in [write(LogWriter::create(&path)), write(LogWriter::live(&path))] {
        assert!(refused.unwrap_err().to_string().contains("never written over"));
    }
    std::fs::remove_file(&path).unwrap();
    write(LogWriter::create(&path)).unwrap();
    assert!(write(LogWriter::computed(&path)).unwrap_err().to_string().contains("never written over"));
    std::fs::write(&path, "notes").unwrap();
    assert!(write(LogWriter::computed(&path)).unwrap_err().to_string().contains("no recording and would be lost"));
}

#[test]
fn joints_are_told_by_their_names_where_there_are_any() {
    let source = MotorSource {
        topic: topics::MOTOR_JOINT_STATES.to_owned(),
        format: SourceFormat::JointState,
        joints: ["shoulder", "elbow", "insertion"].map(String::from).to_vec(),
        ..MotorSource::default()
    };
    let read = |names: &[&str]| {
        let (_folder, path) = place();
        let mut log = LogWriter::create(&path).unwrap();
        let numbers: Vec<f64> = (0..names.len()).map(|j| j as f64).collect();
        let more: Vec<f64> = numbers.iter().map(|number| number + 10.0).collect();
        log.joint_states(topics::MOTOR_JOINT_STATES, ms(1), names, &numbers, Some(&more)).unwrap();
        log.finish().unwrap();
        let recording = Recording::read(&path, &source).unwrap();
        recording.require_motor().map(|motor| {
            let of = |series: &[Vec<f64>]| series.iter().map(|joint| joint[0]).collect::<Vec<f64>>();
            (of(&motor.position), of(motor.effort.as_ref().unwrap()))
        })
    };
    let mixed = read(&["roll", "elbow", "insertion", "shoulder"]).unwrap();
    assert_eq!(mixed, (vec![3.0, 1.0, 2.0, 0.0], vec![13.0, 11.0, 12.0, 10.0]));
    assert_eq!(read(&["a", "b", "c"]).unwrap().0, [0.0, 1.0, 2.0]);
    let refused = read(&["elbow", "shoulder"]).unwrap_err().to_string();
    assert!(refused.contains("its joints are elbow, shoulder, and not `insertion`"), "{refused}");
}
