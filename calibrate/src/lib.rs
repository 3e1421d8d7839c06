//! Calibrates the cameras and registers them to the robot.

pub mod board;
pub mod bundle;
pub mod calibration;
pub mod corners;
pub mod grid;
pub mod homography;
pub mod junction;
pub mod linear;
pub mod pairing;
pub mod saddle;
pub mod start;
pub mod uncertainty;

#[path = "scene.rs"]
pub mod scene;
