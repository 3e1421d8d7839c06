//! Webcams that are replayed: pictures from memory, each when it is due.

use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, ImageEncoder};
use raven::log::Side;
use raven_capture::camera::{CameraFault, Driver, Encoding, Frame, Mode, Opened, Stream};
use raven_capture::clock::Arrival;

pub const RATE_HZ: u32 = 30;
/// Pictures that a webcam has; it shows them one after the other, over and over.
pub const PICTURES: usize = 40;
/// By how much the right webcam's pictures are later than the left one's.
pub const SKEW: Duration = Duration::from_millis(12);
/// Of a frame by a driver that stamps with the monotonic clock, at the start of the frame.
const FLAGS: u32 = 0x1_2001;

/// Bytes of a picture that is replayed, as many as webcams send, which no other picture has and which do not compress.
const OWN_BYTES: usize = 38_000;

/// A JPEG that no other number has: a gradient with noise, some 12 kB.
pub fn picture(seed: u32, number: usize) -> Vec<u8> {
    encoded(seed, number, 50)
}

fn encoded(seed: u32, number: usize, quality: u8) -> Vec<u8> {
    let mut noise = seed.wrapping_mul(7919).wrapping_add(number as u32) | 1;
    let mut pixels = Vec::with_capacity(640 * 480);
    for i in 0..640 * 480_u32 {
        noise ^= noise << 13;
        noise ^= noise >> 17;
        noise ^= noise << 5;
        pixels.push(((i % 640 + 16 * number as u32) / 4 % 200 + noise % 16) as u8);
    }
    let mut jpeg = Vec::new();
    JpegEncoder::new_with_quality(&mut jpeg, quality).write_image(&pixels, 640, 480, ExtendedColorType::L8).unwrap();
    jpeg
}

/// The pictures of a replayed webcam: one coarse picture, with a comment (marker `FFFE`) that is another in each.
pub fn pictures(side: Side) -> Vec<Vec<u8>> {
    let seed = if side == Side::Left { 1 } else { 2 };
    let picture = encoded(seed, 0, 5);
    let (start, rest) = picture.split_at(2);
    let comment = |number: usize| -> Vec<u8> {
        let mut state = (number as u64 + 1) << 8 | u64::from(seed);
        let noise = (0..OWN_BYTES).map(|_| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 24) as u8
        });
        [0xff, 0xfe].into_iter().chain((OWN_BYTES as u16 + 2).to_be_bytes()).chain(noise).collect()
    };
    (0..PICTURES).map(|number| [start, &comment(number), rest].concat()).collect()
}

/// A webcam with MJPG at 30 frames per second that loses none.
pub struct Webcam {
    pictures: Arc<[Vec<u8>]>,
    delay: Duration,
}

impl Webcam {
    pub fn driver(side: Side) -> Box<dyn Driver> {
        Box::new(Self { pictures: pictures(side).into(), delay: if side == Side::Left { Duration::ZERO } else { SKEW } })
    }
}

impl Driver for Webcam {
    fn open(&mut self) -> Result<Opened, CameraFault> {
        let mode = Mode { encoding: Encoding::Mjpg, size_px: [640, 480], interval_s: [1, RATE_HZ], stride_bytes: 0 };
        let (start, start_ns) = (Instant::now() + self.delay, Arrival::now().monotonic_ns + self.delay.as_nanos() as u64);
        let stream = Box::new(Showing { pictures: Arc::clone(&self.pictures), start, start_ns, number: 0 });
        let record = [("card", "Replayed"), ("mode", &mode.to_string())].map(|(key, value)| (key.to_owned(), value.to_owned())).into();
        Ok(Opened { stream, mode, record, notices: Vec::new() })
    }
}

struct Showing {
    pictures: Arc<[Vec<u8>]>,
    start: Instant,
    start_ns: u64,
    number: u32,
}

impl Stream for Showing {
    fn next(&mut self, within: Duration) -> Result<Option<Frame>, CameraFault> {
        let due = Duration::from_secs(self.number.into()) / RATE_HZ;
        let left = (self.start + due).saturating_duration_since(Instant::now());
        thread::sleep(left.min(within));
        if left > within {
            return Ok(None);
        }
        let bytes = self.pictures[self.number as usize % self.pictures.len()].clone();
        let kernel_ns = self.start_ns + due.as_nanos() as u64;
        let frame = Frame { bytes, sequence: self.number, flags: FLAGS, kernel_ns, dequeued: Arrival::now() };
        self.number += 1;
        Ok(Some(frame))
    }
}
