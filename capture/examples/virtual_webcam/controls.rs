//! Exposure, focus and white balance of the webcam (USB Video Class 1.0, section 4.2.2). What is set is said on standard error.

use super::descriptors::{CAMERA, PROCESSING};

const SET_CUR: u8 = 0x01;
const GET: [(u8, Part); 5] = [(0x81, Part::Now), (0x82, Part::Least), (0x83, Part::Most), (0x84, Part::Step), (0x87, Part::Usual)];

#[derive(Clone, Copy)]
enum Part {
    Now,
    Least,
    Most,
    Step,
    Usual,
}

/// One control: whose it is, its number, bytes, name and values.
struct Control {
    unit: u8,
    selector: u8,
    bytes: usize,
    name: &'static str,
    least: u32,
    most: u32,
    /// Of the exposure mode: the modes there are, as bits.
    step: u32,
    usual: u32,
    now: u32,
}

/// All controls, on what an evening in a laboratory makes of them: long exposure, everything automatic.
pub struct Controls(Vec<Control>);

impl Controls {
    /// As they are when the webcam is plugged in.
    pub fn new() -> Self {
        let control = |unit, selector, bytes, name, [least, most, step, usual]: [u32; 4]| Control {
            unit,
            selector,
            bytes,
            name,
            least,
            most,
            step,
            usual,
            now: usual,
        };
        Self(vec![
            control(CAMERA, 0x02, 1, "exposure_mode", [1, 8, 0b1001, 8]),
            control(CAMERA, 0x03, 1, "exposure_priority", [0, 1, 1, 1]),
            control(CAMERA, 0x04, 4, "exposure_time", [1, 10_000, 1, 500]),
            control(CAMERA, 0x06, 2, "focus", [0, 250, 1, 30]),
            control(CAMERA, 0x08, 1, "focus_auto", [0, 1, 1, 1]),
            control(PROCESSING, 0x0a, 2, "white_balance", [2800, 6500, 1, 4000]),
            control(PROCESSING, 0x0b, 1, "white_balance_auto", [0, 1, 1, 1]),
        ])
    }

    /// Answers a request to a unit; `None` refuses it.
    pub fn answer(&mut self, request: u8, unit: u8, selector: u8, data: &[u8]) -> Option<Vec<u8>> {
        let control = self.0.iter_mut().find(|control| (control.unit, control.selector) == (unit, selector))?;
        if request == SET_CUR {
            control.now = data.iter().take(control.bytes).rev().fold(0, |value, byte| value << 8 | u32::from(*byte));
            eprintln!("set {} {}", control.name, control.now);
            return Some(Vec::new());
        }
        match request {
            0x85 => return Some((control.bytes as u16).to_le_bytes().to_vec()),
            // It can be read and set.
            0x86 => return Some(vec![3]),
            _ => {}
        }
        let (_, part) = GET.into_iter().find(|(number, _)| *number == request)?;
        let value = match part {
            Part::Now => control.now,
            Part::Least => control.least,
            Part::Most => control.most,
            Part::Step => control.step,
            Part::Usual => control.usual,
        };
        Some(value.to_le_bytes().into_iter().take(control.bytes).collect())
    }

    /// The exposure time, if the camera may lower its rate for it (100 us).
    pub fn lowers_rate(&self) -> Option<u32> {
        let now = |name| self.0.iter().find(|control| control.name == name).map(|control| control.now);
        now("exposure_time").filter(|_| now("exposure_priority") == Some(1))
    }
}
