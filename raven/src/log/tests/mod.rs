//! Logs written and read back, in both encodings, whole and damaged.

mod damage;
mod forks;
mod laboratory;
mod live;
mod round_trip;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::*;

/// A folder and a log's path in it.
fn place() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    (folder, path)
}

/// Bytes of a ROS 1 message.
#[derive(Default)]
struct Wire(Vec<u8>);

impl Wire {
    fn header(self, stamp: Stamp) -> Self {
        let (seconds, nanoseconds) = stamp.to_ros();
        self.u32s(&[7, seconds, nanoseconds]).text("robot")
    }

    fn u32s(mut self, values: &[u32]) -> Self {
        self.0.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        self
    }

    fn text(self, text: &str) -> Self {
        let mut longer = self.u32s(&[text.len() as u32]);
        longer.0.extend_from_slice(text.as_bytes());
        longer
    }

    fn bytes(mut self, bytes: &[u8]) -> Self {
        self.0.extend_from_slice(bytes);
        self
    }

    fn f64s(mut self, values: &[f64]) -> Self {
        self.0.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        self
    }

    fn f32s(mut self, values: &[f32]) -> Self {
        self.0.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        self
    }

    fn counted(self, values: &[f64]) -> Self {
        self.u32s(&[values.len() as u32]).f64s(values)
    }
}

const HEADER_TYPE: &str = "================\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n";

/// A channel of ROS 1 messages with this definition.
fn ros1_channel(log: &mut LogWriter, topic: &str, name: &str, definition: &str) -> ChannelId {
    let schema = SchemaRef { message_encoding: "ros1", name, encoding: "ros1msg", data: definition.as_bytes() };
    log.add_channel(topic, schema, &BTreeMap::new()).unwrap()
}

fn ms(milliseconds: u64) -> Stamp {
    Stamp::from_ros(1_700_000_000, 0).plus_seconds(milliseconds as f64 * 1e-3)
}

/// The robot's message with a motor angle of `degrees` at the shoulder of both arms, and other numbers beside it.
fn state(degrees: f32) -> RavenState {
    let mut state = RavenState::default();
    for offset in [0, 8] {
        let sign = if offset == 0 { 1.0 } else { -1.0 };
        state.mpos_deg[offset] = sign * degrees;
        state.mpos_deg[offset + 2] = sign * 1000.0;
        state.jpos_deg[offset + 2] = 22.918_312;
        state.tau[offset + 1] = 0.25;
    }
    state
}

/// A log of 1 s of robot state at 1 kHz: several chunks' worth.
fn robot_log(path: &Path) {
    let mut log = LogWriter::create(path).unwrap();
    log.metadata("session", &BTreeMap::from([("robot".to_owned(), "raven2-gold".to_owned())])).unwrap();
    log.attachment("robot.yaml", "application/yaml", b"name: x\n").unwrap();
    for i in 0..3000 {
        log.robot_state(ms(i), &state(i as f32)).unwrap();
    }
    log.finish().unwrap();
}
