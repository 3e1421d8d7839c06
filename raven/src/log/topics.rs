//! The topics of a log and what each carries.

use super::Side;

/// `raven_2/raven_state`: the robot's own message, 1 kHz.
pub const RAVEN_STATE: &str = "/ravenstate";
/// `raven_cal/TipObservation`: the tracked point in frame 0.
pub const TIP: &str = "/tip";
/// `sensor_msgs/JointState`: reference encoders at the joints; validation only.
pub const JOINT_ENCODERS: &str = "/joint_encoders";
/// `sensor_msgs/JointState`: motor side of a robot without `raven_state`.
pub const MOTOR_JOINT_STATES: &str = "/motor/joint_states";
/// JPEG frames of the left camera.
pub const LEFT_COMPRESSED: &str = "/stereo/left/image_raw/compressed";
/// JPEG frames of the right camera.
pub const RIGHT_COMPRESSED: &str = "/stereo/right/image_raw/compressed";
/// Raw frames of the left camera.
pub const LEFT_RAW: &str = "/stereo/left/image_raw";
/// Raw frames of the right camera.
pub const RIGHT_RAW: &str = "/stereo/right/image_raw";
/// What the driver said about each frame of the left camera.
pub const LEFT_FRAME_META: &str = "/stereo/left/frame_meta";
/// What the driver said about each frame of the right camera.
pub const RIGHT_FRAME_META: &str = "/stereo/right/frame_meta";
/// Calibration of the left camera, once.
pub const LEFT_CAMERA_INFO: &str = "/stereo/left/camera_info";
/// Calibration of the right camera, once.
pub const RIGHT_CAMERA_INFO: &str = "/stereo/right/camera_info";
/// What was drawn on the left image: marker centre and status.
pub const LEFT_ANNOTATIONS: &str = "/stereo/left/annotations";
/// What was drawn on the right image: marker centre and status.
pub const RIGHT_ANNOTATIONS: &str = "/stereo/right/annotations";
/// Pairs of monotonic and real time, 1 Hz.
pub const CLOCK: &str = "/clock";
/// Joints from the motors alone, by the transmission's ratios.
pub const ESTIMATE_KINEMATIC: &str = "/estimate/kinematic";
/// Joints from the cameras alone, by inverse kinematics.
pub const ESTIMATE_CAMERA: &str = "/estimate/camera";
/// Joints from the filter.
pub const ESTIMATE_FILTER: &str = "/estimate/filter";

/// Topic of the JPEG frames of a camera.
#[must_use]
pub const fn compressed(side: Side) -> &'static str {
    match side {
        Side::Left => LEFT_COMPRESSED,
        Side::Right => RIGHT_COMPRESSED,
    }
}

/// Topic of the raw frames of a camera.
#[must_use]
pub const fn raw(side: Side) -> &'static str {
    match side {
        Side::Left => LEFT_RAW,
        Side::Right => RIGHT_RAW,
    }
}

/// Topic of the driver's notes on the frames of a camera.
#[must_use]
pub const fn frame_meta(side: Side) -> &'static str {
    match side {
        Side::Left => LEFT_FRAME_META,
        Side::Right => RIGHT_FRAME_META,
    }
}

/// Topic of the calibration of a camera.
#[must_use]
pub const fn camera_info(side: Side) -> &'static str {
    match side {
        Side::Left => LEFT_CAMERA_INFO,
        Side::Right => RIGHT_CAMERA_INFO,
    }
}

/// Topic of the drawings on the images of a camera.
#[must_use]
pub const fn annotations(side: Side) -> &'static str {
    match side {
        Side::Left => LEFT_ANNOTATIONS,
        Side::Right => RIGHT_ANNOTATIONS,
    }
}

/// The camera whose frames, compressed or raw, a topic carries.
#[must_use]
pub fn camera_of(topic: &str) -> Option<Side> {
    Side::BOTH.into_iter().find(|&side| topic == compressed(side) || topic == raw(side))
}
