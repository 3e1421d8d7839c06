//! The webcam's pictures, sent when they are due, with the faults that were asked for.

use std::sync::atomic::Ordering::SeqCst;
use std::thread;
use std::time::{Duration, Instant};

use super::Args;
use super::descriptors::{FRAME_BYTES, PAYLOAD_BYTES, YUYV};
use super::plug::Device;

const HEADER_BYTES: usize = 12;
/// Bits of a payload header: header ends, source clock, presentation time, frame error, frame ends.
const END_OF_HEADER: u8 = 0x80;
const TIMES: u8 = 0x0C;
const ERROR: u8 = 0x40;
const END_OF_FRAME: u8 = 0x02;
/// A number that divides this frame's number is due.
fn due(every: Option<u32>, number: u32) -> bool {
    every.is_some_and(|every| number.is_multiple_of(every))
}

/// Sends frames whenever the webcam streams, until it is unplugged.
pub fn send(device: &Device, args: &Args, files: &[Vec<u8>]) {
    let plugged = Instant::now();
    let clock = || (plugged.elapsed().as_nanos() * 48 / 1000) as u32;
    let (mut opening, mut number, mut toggle, mut next) = (0, 0_u32, 0_u8, None);
    while !device.gone.load(SeqCst) {
        if !device.streaming.load(SeqCst) {
            thread::sleep(Duration::from_millis(2));
            continue;
        }
        let now = device.openings.load(SeqCst);
        if now != opening {
            (opening, number, next) = (now, 0, None);
        }
        let moment = next.unwrap_or_else(|| Instant::now() + Duration::from_micros(args.delay_us));
        next = Some(moment + device.interval());
        thread::sleep(moment.saturating_duration_since(Instant::now()));
        // A machine that is too busy for a webcam leaves gaps that are nobody's fault.
        if moment.elapsed() > device.interval() / 4 {
            eprintln!("late {number}");
        }
        number += 1;
        if due(args.skip_every, number) || args.stall_at.is_some_and(|last| number > last) {
            continue;
        }
        let shown = if due(args.repeat_every, number) { number - 1 } else { number };
        let picture = if device.format.load(SeqCst) == u32::from(YUYV) {
            (0..FRAME_BYTES).map(|i| if i % 2 == 1 { 128 } else { (i / 2 % 640 + shown * 4) as u8 }).collect()
        } else {
            files[shown as usize % files.len()].clone()
        };
        let part = if due(args.short_every, number) { 3 } else { 1 };
        let error = if due(args.error_every, number) { ERROR } else { 0 };
        let presented = clock();
        let mut chunks = picture[..picture.len() / part].chunks(PAYLOAD_BYTES as usize - HEADER_BYTES).peekable();
        while let Some(chunk) = chunks.next() {
            let end = if chunks.peek().is_none() { END_OF_FRAME } else { 0 };
            let frame_of_usb = (plugged.elapsed().as_millis() as u16) & 0x7ff;
            let mut payload = vec![HEADER_BYTES as u8, END_OF_HEADER | TIMES | error | end | toggle];
            payload.extend(presented.to_le_bytes());
            payload.extend(clock().to_le_bytes());
            payload.extend(frame_of_usb.to_le_bytes());
            payload.extend(chunk);
            if !device.deliver(&payload) {
                break;
            }
        }
        toggle ^= 1;
    }
}
