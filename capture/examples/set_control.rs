//! Sets a control of a video device by its number: `set_control /dev/video0 0x00f0f042 [VALUE]`. The value is 1 if it is left off, as a button's.

use std::io::{Error, Result};

use v4l::control::{Control, Value};

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (device, id, value) = match arguments.as_slice() {
        [device, id] => (device, id, "1"),
        [device, id, value] => (device, id, value.as_str()),
        _ => return Err(Error::other("expected DEVICE CONTROL [VALUE]")),
    };
    let id = u32::from_str_radix(id.trim_start_matches("0x"), 16).map_err(Error::other)?;
    let value = Value::Integer(value.parse().map_err(Error::other)?);
    v4l::Device::with_path(device)?.set_control(Control { id, value })
}
