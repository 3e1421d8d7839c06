//! The messages that logs carry in protobuf: Foxglove's own where there is one, which every viewer knows, and the project's.

use std::collections::BTreeMap;

use foxglove::messages::points_annotation::Type;
use foxglove::messages::{
    CameraCalibration, CircleAnnotation, Color, CompressedImage, ImageAnnotations, JointState, JointStates, Point2, PointsAnnotation,
    RawImage,
};
use foxglove::{Encode, bytes::Bytes};
use nalgebra::Matrix3;
use prost::Message;

use super::protobuf::{ClockSample, Described, FrameMeta, timestamp};
use super::writer::{ChannelId, LogWriter, SchemaRef, Times};
use super::{Side, TipObservation, TipStatus, topics};
use crate::camera::{Cameras, Pinhole};
use crate::{Error, Result};

impl LogWriter {
    /// Writes a JPEG, or a PNG, as it came from the camera; `sequence` is the camera's count of frames, 0 if it has none.
    ///
    /// # Errors
    /// If the disk is full.
    pub fn compressed_image(&mut self, side: Side, times: impl Into<Times>, sequence: u32, jpeg: &[u8]) -> Result<()> {
        let times = times.into();
        let image = CompressedImage {
            timestamp: timestamp(times.measured),
            frame_id: frame_id(side),
            data: Bytes::copy_from_slice(jpeg),
            format: if jpeg.starts_with(b"\x89PNG") { "png" } else { "jpeg" }.to_owned(),
        };
        self.foxglove(topics::compressed(side), times, sequence, &image)
    }

    /// Writes a raw frame of `size_px` columns and rows; `encoding` is ROS's name of its layout, `step` the bytes of a row.
    ///
    /// # Errors
    /// If the disk is full.
    pub fn raw_image(
        &mut self,
        side: Side,
        times: impl Into<Times>,
        sequence: u32,
        (encoding, size_px, step): (&str, [u32; 2], u32),
        data: &[u8],
    ) -> Result<()> {
        let times = times.into();
        let image = RawImage {
            timestamp: timestamp(times.measured),
            frame_id: frame_id(side),
            width: size_px[0],
            height: size_px[1],
            encoding: encoding.to_owned(),
            step,
            data: Bytes::copy_from_slice(data),
        };
        self.foxglove(topics::raw(side), times, sequence, &image)
    }

    /// Writes joint states on one of the known topics: `position` and, where recorded, `effort` in the order of `names`.
    ///
    /// # Errors
    /// If the numbers do not match the names, or the disk is full.
    pub fn joint_states<S: AsRef<str>>(
        &mut self,
        topic: &'static str,
        times: impl Into<Times>,
        names: &[S],
        position: &[f64],
        effort: Option<&[f64]>,
    ) -> Result<()> {
        if position.len() != names.len() || effort.is_some_and(|effort| effort.len() != names.len()) {
            return Err(Error::Data(format!("`{topic}`: {} joints, but {} positions.", names.len(), position.len())));
        }
        let times = times.into();
        let joint = |(i, (name, &position)): (usize, (&S, &f64))| JointState {
            name: name.as_ref().to_owned(),
            position: Some(position),
            effort: effort.and_then(|effort| effort.get(i).copied()),
            ..JointState::default()
        };
        let joints = names.iter().zip(position).enumerate().map(joint).collect();
        self.foxglove(topic, times, 0, &JointStates { timestamp: timestamp(times.measured), joints })
    }

    /// Writes what is known of a camera, as its block of `cameras.yaml` says it: viewers draw points of the camera's frame over its images.
    ///
    /// # Errors
    /// If the disk is full.
    pub fn camera_info(&mut self, side: Side, times: impl Into<Times>, cameras: &Cameras) -> Result<()> {
        let times = times.into();
        let (camera, projection) = match side {
            Side::Left => (&cameras.left, cameras.projections()[0]),
            Side::Right => (&cameras.right, cameras.projections()[1]),
        };
        let message = CameraCalibration {
            timestamp: timestamp(times.measured),
            frame_id: frame_id(side),
            width: camera.width,
            height: camera.height,
            distortion_model: Pinhole::DISTORTION_MODEL.to_owned(),
            d: camera.distortion.to_vec(),
            k: camera.intrinsics().transpose().as_slice().to_vec(),
            r: Matrix3::identity().as_slice().to_vec(),
            p: projection.transpose().as_slice().to_vec(),
        };
        self.foxglove(topics::camera_info(side), times, 0, &message)
    }

    /// Draws what tracking made of an image: a circle of `diameter_px` at the marker, green where it was accepted, red where it was rejected,
    /// and a path of points, as in the trace of the marker or the corners of a board.
    ///
    /// # Errors
    /// If the disk is full.
    pub fn annotations(
        &mut self,
        side: Side,
        times: impl Into<Times>,
        marker: Option<([f64; 2], TipStatus, f64)>,
        path_px: &[[f64; 2]],
    ) -> Result<()> {
        let times = times.into();
        let point = |[x, y]: [f64; 2]| Point2 { x, y };
        let circle = |(centre, status, diameter): ([f64; 2], TipStatus, f64)| CircleAnnotation {
            position: Some(point(centre)),
            diameter,
            thickness: 2.0,
            outline_color: Some(if status == TipStatus::Seen { GREEN } else { RED }),
            ..CircleAnnotation::default()
        };
        let path = PointsAnnotation {
            r#type: Type::LineStrip.into(),
            points: path_px.iter().copied().map(point).collect(),
            outline_color: Some(GREEN),
            thickness: 1.0,
            ..PointsAnnotation::default()
        };
        let message = ImageAnnotations {
            timestamp: timestamp(times.measured),
            circles: marker.map(circle).into_iter().collect(),
            points: if path_px.is_empty() { Vec::new() } else { vec![path] },
            ..ImageAnnotations::default()
        };
        self.foxglove(topics::annotations(side), times, 0, &message)
    }

    /// Writes a tip observation; it is measured at its stamp.
    ///
    /// # Errors
    /// If the disk is full.
    pub fn tip(&mut self, tip: &TipObservation) -> Result<()> {
        self.own(topics::TIP, tip.stamp.into(), 0, &tip.to_message())
    }

    /// Writes what the driver said about a frame.
    ///
    /// # Errors
    /// If the disk is full.
    pub fn frame_meta(&mut self, side: Side, times: impl Into<Times>, meta: FrameMeta) -> Result<()> {
        let times = times.into();
        let sequence = meta.sequence;
        self.own(topics::frame_meta(side), times, sequence, &FrameMeta { timestamp: timestamp(times.measured), ..meta })
    }

    /// Writes one reading of both clocks.
    ///
    /// # Errors
    /// If the disk is full.
    pub fn clock(&mut self, times: impl Into<Times>, sample: ClockSample) -> Result<()> {
        let times = times.into();
        self.own(topics::CLOCK, times, 0, &ClockSample { timestamp: timestamp(times.measured), ..sample })
    }

    fn foxglove<M: Encode + Message>(&mut self, topic: &'static str, times: Times, sequence: u32, message: &M) -> Result<()> {
        let channel = self.channel(topic, |log| {
            let schema = M::get_schema().ok_or_else(|| Error::Data(format!("`{topic}`: the message has no schema.")))?;
            log.protobuf_channel(topic, &schema.name, &schema.data)
        })?;
        self.write(channel, times, sequence, &message.encode_to_vec())
    }

    fn own<M: Described>(&mut self, topic: &'static str, times: Times, sequence: u32, message: &M) -> Result<()> {
        let channel = self.channel(topic, |log| {
            let (name, data) = M::schema();
            log.protobuf_channel(topic, &name, &data)
        })?;
        self.write(channel, times, sequence, &message.encode_to_vec())
    }

    fn protobuf_channel(&mut self, topic: &str, name: &str, data: &[u8]) -> Result<ChannelId> {
        self.add_channel(topic, SchemaRef { message_encoding: "protobuf", name, encoding: "protobuf", data }, &BTreeMap::new())
    }
}

const GREEN: Color = Color { r: 0.0, g: 0.8, b: 0.2, a: 1.0 };
const RED: Color = Color { r: 0.9, g: 0.1, b: 0.1, a: 1.0 };

fn frame_id(side: Side) -> String {
    format!("{}_camera", side.name())
}
