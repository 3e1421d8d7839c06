//! The MD5 sum by which ROS 1 tells versions of a message type apart.
//!
//! It is the sum of a text with the constants first, then the fields, one per line, in which the name of a message type is replaced by that
//! type's own sum (genmsg, `compute_md5_text`).

use md5::{Digest, Md5};

use super::definition::{Definition, Kind};

/// MD5 sum of a message type in lower-case hexadecimal, `None` if the type contains itself.
#[must_use]
pub fn md5sum(definition: &Definition) -> Option<String> {
    sum_of(definition, &definition.root, 0)
}

fn sum_of(definition: &Definition, name: &str, depth: usize) -> Option<String> {
    if depth > 32 {
        return None;
    }
    let message = definition.types.get(name)?;
    let mut lines = message.constants.clone();
    for field in &message.fields {
        lines.push(match &field.kind {
            Kind::Primitive(_) => format!("{} {}", field.written_type, field.name),
            Kind::Message(used) => format!("{} {}", sum_of(definition, used, depth + 1)?, field.name),
        });
    }
    let digest = Md5::digest(lines.join("\n").trim());
    Some(digest.iter().map(|byte| format!("{byte:02x}")).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sums as `rosmsg md5` prints them.
    #[test]
    fn known_sums() {
        let header = "uint32 seq\ntime stamp\nstring frame_id\n";
        let sum = |name, text| md5sum(&Definition::parse(name, text).unwrap()).unwrap();
        assert_eq!(sum("std_msgs/Header", header), "2176decaecbce78abc3b96ef049fabed");
        let joints = "Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n";
        assert_eq!(sum("sensor_msgs/JointState", joints), "3066dcd76a6cfaef579bd0f34173e9fd");
        assert_eq!(sum("sensor_msgs/CompressedImage", "Header header\nstring format\nuint8[] data\n"), "8f7a12909da2c9d3332d540a0977563f");
    }
}
