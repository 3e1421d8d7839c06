//! ROS 1 messages in other layouts than the public controller's.

use approx::assert_relative_eq;
use proptest::prelude::*;

use super::super::ros1::{Definition, Extractor};
use super::*;
use crate::robot::SourceFormat;

fn read(path: &Path) -> Recording {
    Recording::read(path, &MotorSource::default()).unwrap()
}

/// `header` instead of `hdr`, numbers in another type, arrays of variable length, nested messages and strings in between.
#[test]
fn fields_are_found_by_name() {
    let (_folder, path) = place();
    let definition = format!(
        "uint8 MAX=3 # a constant\nstring note\nHeader header\nArm[] arms\nArm[2] pair\nfloat64[] mpos\nstring[] errors\ntime other\n\
         bool ok\nfloat32[16] tau\nint16[] encVals\n================\nMSG: raven_2/Arm\nint8[] a\nfloat32 b\n{HEADER_TYPE}"
    );
    let arm = |wire: Wire| wire.u32s(&[3]).bytes(&[1, 2, 3]).f32s(&[0.5]);
    let mut log = LogWriter::create(&path).unwrap();
    let channel = ros1_channel(&mut log, topics::RAVEN_STATE, "raven_2/raven_state", &definition);
    for i in 0..3_u32 {
        let mut wire = Wire::default().text("note").header(ms(u64::from(i))).u32s(&[1]);
        for _ in 0..3 {
            wire = arm(wire);
        }
        let wire = wire.counted(&[180.0 + f64::from(i), 90.0, 45.0, 0.0]).u32s(&[2]).text("").text("two").u32s(&[1, 2]).bytes(&[1]);
        let wire = wire.f32s(&[0.1; 16]).u32s(&[3]).bytes(&[9, 0, 8, 0, 7, 0]);
        log.write(channel, Times { measured: Stamp(0), arrived: Stamp(0) }, 0, &wire.0).unwrap();
    }
    log.finish().unwrap();
    let recording = read(&path);
    let motor = recording.motor.unwrap();
    assert_eq!((recording.start, motor.len()), (ms(0), 3));
    assert_relative_eq!(motor.position[0][2], 182.0_f64.to_radians());
    assert_relative_eq!(motor.effort.unwrap()[2][0], 0.1, epsilon = 1e-8);
    assert!(recording.controller_joints.is_none());
}

/// A message without any stamp is dated by its publication, and that is counted.
#[test]
fn publication_stands_in_for_a_missing_stamp() {
    let (_folder, path) = place();
    let mut log = LogWriter::create(&path).unwrap();
    let channel = ros1_channel(&mut log, topics::RAVEN_STATE, "raven_2_control/raven_state", "float32 f_secs\nfloat32[16] mpos\n");
    for i in 0..3 {
        let wire = Wire::default().f32s(&[0.0; 17]);
        log.write(channel, Times { measured: ms(i), arrived: ms(40) }, 0, &wire.0).unwrap();
    }
    log.finish().unwrap();
    let recording = read(&path);
    assert_relative_eq!(recording.duration_s, 0.002, epsilon = 1e-12);
    let quality = &recording.quality[topics::RAVEN_STATE];
    assert_eq!((quality.without_stamp, recording.motor.unwrap().effort), (3, None));
}

#[test]
fn messages_that_cannot_be_used_are_counted_or_named() {
    let (_folder, path) = place();
    let mut log = LogWriter::create(&path).unwrap();
    let definition = format!("Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n{HEADER_TYPE}");
    let channel = ros1_channel(&mut log, topics::JOINT_ENCODERS, "sensor_msgs/JointState", &definition);
    let message = |at, position: f64, effort: &[f64]| {
        Wire::default().header(ms(at)).u32s(&[1]).text("x").counted(&[position]).counted(&[]).counted(effort).0
    };
    let good = message(0, 1.0, &[]);
    for wire in [&good, &message(2, 2.0, &[]), &message(1, 1.5, &[f64::NAN]), &message(3, f64::NAN, &[]), &message(2, 9.0, &[])] {
        log.write(channel, ms(9), 0, wire).unwrap();
    }
    log.write(channel, ms(9), 0, &good[..good.len() - 1]).unwrap();
    let state = ros1_channel(&mut log, topics::RAVEN_STATE, "raven_2/raven_state", "float32 speed\n");
    log.write(state, ms(9), 0, &[0; 4]).unwrap();
    let tip = SchemaRef { message_encoding: "cdr", name: "raven_cal/msg/TipObservation", encoding: "ros2msg", data: b"uint8 status" };
    let tip = log.add_channel(topics::TIP, tip, &BTreeMap::new()).unwrap();
    log.write(tip, ms(9), 0, &[0; 8]).unwrap();
    log.finish().unwrap();

    let recording = read(&path);
    let encoders = recording.require_joint_encoders().unwrap();
    assert_eq!((encoders.position.clone(), encoders.effort.clone()), (vec![vec![1.0, 1.5, 2.0]], None));
    let quality = &recording.quality[topics::JOINT_ENCODERS];
    assert_eq!((quality.backward, quality.duplicates, quality.non_finite, quality.undecodable), (2, 1, 1, 1));
    let survey = Survey::of(&path).unwrap();
    let quality = &survey.topic(topics::JOINT_ENCODERS).unwrap().quality;
    assert_eq!((quality.undecodable, quality.without_stamp), (1, 0));
    let error = recording.require_motor().unwrap_err().to_string();
    assert!(error.contains("no field `mpos`"), "{error}");
    let error = recording.require_tip().unwrap_err().to_string();
    assert!(error.contains("`cdr`"), "{error}");
}

/// The same observation and frame in ROS 1.
#[test]
fn tip_and_frames_in_ros1() {
    let (_folder, path) = place();
    let mut log = LogWriter::create(&path).unwrap();
    let definition = format!(
        "Header header\nuint8 status\nfloat64[2] left_px\nfloat64[2] right_px\nfloat64[3] position\nfloat64[9] covariance\n\
         uint8 SEEN=0\n{HEADER_TYPE}"
    );
    let tip = ros1_channel(&mut log, topics::TIP, "raven_cal/TipObservation", &definition);
    let covariance: Vec<f64> = (1..10).map(f64::from).collect();
    let message =
        |status: u8, x: f64| Wire::default().header(ms(5)).bytes(&[status]).f64s(&[1.0, 2.0, 3.0, 4.0, x, 6.0, 7.0]).f64s(&covariance).0;
    log.write(tip, ms(9), 0, &message(0, 5.0)).unwrap();
    let raw = format!(
        "Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\nuint8[] data\n{HEADER_TYPE}"
    );
    let image = ros1_channel(&mut log, topics::LEFT_RAW, "sensor_msgs/Image", &raw);
    let wire = Wire::default().header(ms(6)).u32s(&[1, 2]).text("mono8").bytes(&[0]).u32s(&[2, 2]).bytes(&[10, 20]);
    log.write(image, ms(9), 0, &wire.0).unwrap();
    let compressed = format!("Header header\nstring format\nuint8[] data\n{HEADER_TYPE}");
    let image = ros1_channel(&mut log, topics::RIGHT_COMPRESSED, "sensor_msgs/CompressedImage", &compressed);
    let wire = Wire::default().header(ms(7)).text("jpeg").u32s(&[4]).bytes(&[0xff, 0xd8, 0xff, 0xd9]);
    log.write(image, ms(9), 0, &wire.0).unwrap();
    log.finish().unwrap();
    let recording = read(&path);
    let tip = &recording.require_tip().unwrap()[0];
    assert_eq!((tip.stamp, tip.frame_id.as_str(), tip.status, tip.right_px), (ms(5), "robot", TipStatus::Seen, [3.0, 4.0]));
    assert_eq!((tip.position_m.x, tip.covariance_m2[(0, 1)]), (5.0, 2.0));
    let both: Vec<CameraFrame> = frames(&path).unwrap().collect::<Result<_, _>>().unwrap();
    let [raw, jpeg] = both.as_slice() else { panic!("{both:?}") };
    assert_eq!((raw.stamp, raw.sequence, raw.side), (ms(6), Some(7), Side::Left));
    assert_eq!(raw.decode_gray().unwrap().as_raw(), &[10, 20]);
    assert_eq!((jpeg.stamp, jpeg.side), (ms(7), Side::Right));
    assert_eq!(jpeg.data, FrameData::Jpeg(vec![0xff, 0xd8, 0xff, 0xd9]));
}

/// Counts of 64 bits that leap and start again.
#[test]
fn missing_frames_are_counted_as_far_as_numbers_go() {
    let (_folder, path) = place();
    let definition = format!("Header header\nstring format\nuint8[] data\n{}", HEADER_TYPE.replace("uint32 seq", "uint64 seq"));
    let mut log = LogWriter::create(&path).unwrap();
    let image = ros1_channel(&mut log, topics::LEFT_COMPRESSED, "sensor_msgs/CompressedImage", &definition);
    for count in [1, i64::MAX].repeat(3) {
        let (seconds, nanoseconds) = ms(0).to_ros();
        let wire = Wire::default().bytes(&count.to_le_bytes()).u32s(&[seconds, nanoseconds]).text("left").text("jpeg").u32s(&[0]);
        log.write(image, ms(0), 0, &wire.0).unwrap();
    }
    log.finish().unwrap();
    let surveyed = Survey::of(&path).unwrap();
    assert_eq!(surveyed.topics[0].missing_frames, u64::MAX);
}

/// A position that is not finite cannot be used, whatever its status says.
#[test]
fn a_seen_tip_without_numbers_counts_as_occluded() {
    let (_folder, path) = place();
    let mut log = LogWriter::create(&path).unwrap();
    let tip = TipObservation {
        stamp: ms(0),
        frame_id: String::new(),
        status: TipStatus::Seen,
        left_px: [0.0; 2],
        right_px: [0.0; 2],
        position_m: nalgebra::Vector3::new(f64::NAN, 0.0, 0.0),
        covariance_m2: nalgebra::Matrix3::identity(),
    };
    log.tip(&tip).unwrap();
    log.finish().unwrap();
    let source = MotorSource { format: SourceFormat::JointState, ..MotorSource::default() };
    let recording = Recording::read(&path, &source).unwrap();
    assert_eq!((recording.tip[0].status, recording.quality[topics::TIP].non_finite), (TipStatus::Occluded, 1));
}

const ANY: &str = "Header header\nA[] many\nA[3] few\nstring[] names\nfloat64[] position\nuint8[5] five\nstring[2] two\n\
                   ===\nMSG: p/A\nstring name\nint32[] n\n";

proptest! {
    #[test]
    fn no_message_panics(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let extractor = Extractor::new(&Definition::parse("p/Any", ANY).unwrap(), &["header.stamp", "names", "position", "five"]).unwrap();
        if let Ok(values) = extractor.walk::<4>(&bytes) {
            for value in values.into_iter().flatten() {
                let _ = (value.number(3), value.integer(2), value.stamp(), value.texts().count(), value.numbers::<4>());
            }
        }
    }

    /// Counts that would fit are tried, too: most random counts do not.
    #[test]
    fn no_nearly_right_message_panics(words in prop::collection::vec(0_u32..5, 0..80), cut in 0_usize..4) {
        let extractor = Extractor::new(&Definition::parse("p/Any", ANY).unwrap(), &["names", "position"]).unwrap();
        let bytes = Wire::default().u32s(&words).0;
        let _ = extractor.walk::<2>(&bytes[..bytes.len().saturating_sub(cut)]);
    }

    /// A message of one layout is refused when it is cut anywhere.
    #[test]
    fn a_cut_message_is_refused(cut in 0_usize..980) {
        let definition = Definition::parse(RAVEN_STATE_TYPE, RAVEN_STATE_DEFINITION).unwrap();
        let extractor = Extractor::new(&definition, &["mpos"]).unwrap();
        let wire = state(1.0).encode(ms(1));
        prop_assert!(extractor.walk::<1>(&wire).is_ok());
        prop_assert!(extractor.walk::<1>(&wire[..cut]).is_err());
    }

    /// Definitions that nest, repeat and contain themselves compile or are refused, and what compiles walks any bytes.
    #[test]
    fn no_definition_panics(
        text in r"((int8|string|time|Header|A|B)(\[[0-9]{0,20}\])? [a-c]\n){1,8}(={3}\nMSG: p/(A|B)\n((int8|string|A|B)(\[[0-9]{0,12}\])? [a-c]\n){0,5}){0,2}",
        bytes in prop::collection::vec(any::<u8>(), 0..100),
    ) {
        if let Ok(definition) = Definition::parse("p/Root", &text)
            && let Ok(extractor) = Extractor::new(&definition, &["a", "b.a"])
        {
            let _ = extractor.walk::<2>(&bytes);
            let _ = super::super::ros1::md5::md5sum(&definition);
        }
    }
}

/// Nothing repeated as often as can be said takes no time, as it takes no bytes.
#[test]
fn what_takes_no_bytes_is_not_walked() {
    let nothing = "================\nMSG: p/Nothing\nstring[0] a\nfloat64[0] b\n";
    for (field, bytes) in [("p/Nothing[18446744073709551615] all", vec![]), ("p/Nothing[] all", vec![0xff; 4])] {
        let definition = Definition::parse("p/Any", &format!("{field}\nuint8 after\n{nothing}")).unwrap();
        let extractor = Extractor::new(&definition, &["after"]).unwrap();
        let message = [bytes.as_slice(), &[7]].concat();
        let Ok([Some(after)]) = extractor.walk::<1>(&message) else { panic!("{field}") };
        assert_eq!(after.integer(0), Some(7));
    }
}

/// A camera's node that is started anew goes on on its topic as another publisher.
#[test]
fn frames_of_every_publisher_are_taken() {
    let (_folder, first) = place();
    let mut log = LogWriter::create(&first).unwrap();
    (0..3).for_each(|i| log.compressed_image(Side::Left, ms(i), 0, &[0xff, 0xd8, 0xff, 0xd9]).unwrap());
    log.finish().unwrap();
    let (_folder, path) = place();
    let mut log = LogWriter::create(&path).unwrap();
    for publisher in ["/camera_1", "/camera_2"] {
        let mut id = None;
        Walker::open(&first)
            .unwrap()
            .run(|item| {
                match item {
                    Item::Channel(channel) => {
                        let mut channel = Channel::clone(channel);
                        channel.metadata.insert("callerid".to_owned(), publisher.to_owned());
                        id = Some(log.copy_channel(&channel)?);
                    }
                    Item::Message(message) => log.copy_message(id.unwrap(), &message)?,
                    _ => {}
                }
                Ok(())
            })
            .unwrap();
    }
    log.finish().unwrap();
    assert_eq!((frames(&path).unwrap().count(), frame_stamps(&path).unwrap().len()), (6, 6));
}

/// A driver may say nothing at first.
#[test]
fn joints_are_named_by_the_first_message_that_has_any() {
    let (_folder, path) = place();
    let mut log = LogWriter::create(&path).unwrap();
    log.joint_states::<&str>(topics::JOINT_ENCODERS, ms(0), &[], &[], None).unwrap();
    (1..5).for_each(|i| log.joint_states(topics::JOINT_ENCODERS, ms(i), &["elbow"], &[i as f64], None).unwrap());
    log.finish().unwrap();
    let encoders = read(&path).joint_encoders.unwrap();
    assert_eq!((encoders.names.as_slice(), encoders.len()), (&["elbow".to_owned()][..], 4));
}
