//! Frames of a log in the order of time, those of both cameras that belong together at once, while the next are being read.

use std::ops::ControlFlow;
use std::path::Path;

use image::RgbImage;
use raven::camera::Cameras;
use raven::log::{CameraFrame, Recording, Side, Stamp, frames};
use raven::{Error, Result};
use rayon::prelude::*;

/// Frames that are read at a time. Two batches are in memory: decoded, 2 x 32 x 0.9 MB at 640x480.
const BATCH: usize = 32;

/// Frames of both cameras belong together if their stamps are within this part of the interval between frames: free-running ones are half an
/// interval apart at most.
const PAIR_WITHIN: f64 = 0.55;

/// How far apart the stamps of a pair of frames may be [s].
#[must_use]
pub fn pair_within_s(recording: &Recording) -> f64 {
    PAIR_WITHIN * recording.frame_interval_s.unwrap_or(recording.duration_s)
}

/// How many frames there were and what became of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Frames that were cut off or could not be decoded.
    pub undecodable: usize,
    /// Frames of another size than the camera was calibrated at.
    pub other_size: usize,
    /// Frames left out as their stamp was not after that of the frame before.
    pub out_of_order: usize,
}

impl Counts {
    /// Frames that hold nothing which could be used.
    #[must_use]
    pub const fn lost(&self) -> usize {
        self.undecodable + self.other_size
    }
}

/// A decoded frame.
#[derive(Debug, Clone)]
pub struct Frame {
    /// When it was taken.
    pub stamp: Stamp,
    /// Its pixels.
    pub image: RgbImage,
}

/// Decodes the frames of `log` on all cores and hands them to `take` in the order of time: both cameras' together, left first, where they
/// are within `pair_within_s`, else one alone.
///
/// # Errors
/// If the log has no cameras or is damaged, or no frame of a camera has the size that was calibrated.
pub fn for_each(log: &Path, cameras: &Cameras, pair_within_s: f64, mut take: impl FnMut([Option<&Frame>; 2]) + Send) -> Result<Counts> {
    hand_over(log, cameras, pair_within_s, decoded, |step| {
        take(step);
        ControlFlow::Continue(())
    })
}

/// The first pairs of frames, `most` of them at most, however far apart their stamps are; how many there were. What is behind them is not read.
///
/// # Errors
/// As [`for_each`], up to there.
pub fn for_first_pairs(log: &Path, cameras: &Cameras, most: usize, mut take: impl FnMut([&Frame; 2]) + Send) -> Result<usize> {
    let mut pairs = 0;
    hand_over(log, cameras, f64::INFINITY, decoded, |step| {
        if let [Some(left), Some(right)] = step {
            take([left, right]);
            pairs += 1;
        }
        if pairs < most { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    })?;
    Ok(pairs)
}

/// The same without decoding them: whether their pixels can be decoded is left to `take`.
///
/// # Errors
/// As [`for_each`].
pub fn for_each_encoded(
    log: &Path,
    cameras: &Cameras,
    pair_within_s: f64,
    mut take: impl FnMut([Option<&CameraFrame>; 2]) + Send,
) -> Result<Counts> {
    hand_over(log, cameras, pair_within_s, Some, |step| {
        take(step);
        ControlFlow::Continue(())
    })
}

fn decoded(frame: CameraFrame) -> Option<Frame> {
    frame.decode_rgb().ok().map(|image| Frame { stamp: frame.stamp, image })
}

/// Reads until `take` breaks.
fn hand_over<F: Send>(
    log: &Path,
    cameras: &Cameras,
    pair_within_s: f64,
    open: impl Fn(CameraFrame) -> Option<F> + Sync + Send,
    take: impl FnMut([Option<&F>; 2]) -> ControlFlow<()> + Send,
) -> Result<Counts> {
    let counts = Counts::default();
    let mut source = Source { frames: Box::new(frames(log)?), cameras, counts, right_size: [0; 2], wrong_size: [None; 2], open };
    let mut queue = Queue { waiting: Vec::new(), last: [None; 2], out_of_order: 0, pair_within_s, take };
    loop {
        let (next, flow) = rayon::join(|| source.next(), || queue.hand_over(true));
        if flow.is_break() {
            return Ok(Counts { out_of_order: queue.out_of_order, ..source.counts });
        }
        let Some(next) = next? else { break };
        queue.line_up(next);
    }
    let _nothing_follows = queue.hand_over(false);
    source.check_sizes(log)?;
    Ok(Counts { out_of_order: queue.out_of_order, ..source.counts })
}

struct Source<'c, O> {
    frames: Box<dyn Iterator<Item = Result<CameraFrame>> + Send>,
    cameras: &'c Cameras,
    counts: Counts,
    /// Frames of the calibrated size, and one of the other sizes, of each camera.
    right_size: [usize; 2],
    wrong_size: [Option<(u32, u32)>; 2],
    open: O,
}

impl<F: Send, O: Fn(CameraFrame) -> Option<F> + Sync + Send> Source<'_, O> {
    /// The next batch without what cannot be opened or has another size; `None` at the end.
    fn next(&mut self) -> Result<Option<Vec<Waiting<F>>>> {
        let mut encoded: Vec<CameraFrame> = self.frames.by_ref().take(BATCH).collect::<Result<_>>()?;
        if encoded.is_empty() {
            return Ok(None);
        }
        encoded.retain(|frame| self.admits(frame));
        let open = |frame: CameraFrame| {
            let (side, stamp) = (frame.side, frame.stamp);
            (self.open)(frame).map(|frame| Waiting { side, stamp, frame })
        };
        let admitted = encoded.len();
        let opened: Vec<Waiting<F>> = encoded.into_par_iter().filter_map(open).collect();
        self.counts.undecodable += admitted - opened.len();
        Ok(Some(opened))
    }

    /// Whether a frame is whole and as large as was calibrated.
    fn admits(&mut self, frame: &CameraFrame) -> bool {
        let k = frame.side as usize;
        let Some(size) = frame.size().ok().filter(|_| !frame.is_truncated()) else {
            self.counts.undecodable += 1;
            return false;
        };
        let fits = size == calibrated(self.cameras, frame.side);
        if fits {
            self.right_size[k] += 1;
        } else {
            self.counts.other_size += 1;
            self.wrong_size[k].get_or_insert(size);
        }
        fits
    }

    /// Refuses a camera whose frames are all of another size than was calibrated.
    fn check_sizes(&self, log: &Path) -> Result<()> {
        for side in Side::BOTH {
            if let (Some((width, height)), 0) = (self.wrong_size[side as usize], self.right_size[side as usize]) {
                let (calibrated_width, calibrated_height) = calibrated(self.cameras, side);
                let message = format!(
                    "the {} images are {width} x {height}, but the camera was calibrated at {calibrated_width} x {calibrated_height}. \
                     Calibrate at the size that is recorded.",
                    side.name(),
                );
                return Err(Error::file(log, message));
            }
        }
        Ok(())
    }
}

fn calibrated(cameras: &Cameras, side: Side) -> (u32, u32) {
    let camera = match side {
        Side::Left => &cameras.left,
        Side::Right => &cameras.right,
    };
    (camera.width, camera.height)
}

/// A frame that waits for its turn.
struct Waiting<F> {
    side: Side,
    stamp: Stamp,
    frame: F,
}

struct Queue<F, T> {
    waiting: Vec<Waiting<F>>,
    last: [Option<Stamp>; 2],
    out_of_order: usize,
    pair_within_s: f64,
    take: T,
}

impl<F, T: FnMut([Option<&F>; 2]) -> ControlFlow<()>> Queue<F, T> {
    /// Takes in the next frames, in the order of time. One that is in the log twice must not stand between a frame and its partner.
    fn line_up(&mut self, next: Vec<Waiting<F>>) {
        self.waiting.extend(next);
        self.waiting.sort_by_key(|waiting| (waiting.stamp, waiting.side));
        let all = self.waiting.len();
        self.waiting.dedup_by_key(|waiting| (waiting.stamp, waiting.side));
        self.out_of_order += all - self.waiting.len();
    }

    /// Hands over all frames but the last one, if it has no partner yet and there may be more to come.
    fn hand_over(&mut self, more_to_come: bool) -> ControlFlow<()> {
        let mut ready = std::mem::take(&mut self.waiting);
        let mut rest = ready.as_slice();
        while let Some((first, after)) = rest.split_first() {
            if after.is_empty() && more_to_come {
                break;
            }
            rest = after;
            if !self.is_later(first) {
                self.out_of_order += 1;
                continue;
            }
            let mut step = [None, None];
            step[first.side as usize] = Some(&first.frame);
            if let Some((partner, after)) = rest.split_first()
                && partner.side != first.side
                && partner.stamp.seconds_since(first.stamp) <= self.pair_within_s
                && self.is_later(partner)
            {
                step[partner.side as usize] = Some(&partner.frame);
                rest = after;
            }
            (self.take)(step)?;
        }
        let handed_over = ready.len() - rest.len();
        self.waiting = ready.split_off(handed_over);
        ControlFlow::Continue(())
    }

    /// Whether a frame was taken after the last of its camera that was handed over, which it then is.
    fn is_later(&mut self, frame: &Waiting<F>) -> bool {
        let last = &mut self.last[frame.side as usize];
        let is_later = last.is_none_or(|last| frame.stamp > last);
        if is_later {
            *last = Some(frame.stamp);
        }
        is_later
    }
}
