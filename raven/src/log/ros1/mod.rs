//! The ROS 1 wire format, read by the definition stored in the file.

pub mod definition;
pub mod extract;
pub mod md5;

pub use definition::Definition;
pub use extract::{Extractor, HEADER_STAMPS, Misfit, Value, header_stamp};
