//! Frames of a log, decoded a batch at a time on all cores while the batch before is being tracked.

use std::path::Path;

use raven::camera::Cameras;
use raven::log::{CameraFrame, Side, Stamp, frames};
use raven::{Error, Result};
use rayon::prelude::*;

use crate::tracker::Frame;

/// Frames that are decoded at a time. Two batches are in memory: 2 x 32 x 0.9 MB at 640x480.
const BATCH: usize = 32;

/// How many frames there were and what became of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Frames in the log, left and right.
    pub frames: [usize; 2],
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

/// Decodes the frames of `log` and hands them to `take` in the order of time: both cameras' together, left first, where they are within
/// `pair_within_s`, else one alone.
///
/// # Errors
/// If the log has no cameras or is damaged, or no frame of a camera has the size that was calibrated.
pub fn for_each(log: &Path, cameras: &Cameras, pair_within_s: f64, take: impl FnMut([Option<&Frame>; 2]) + Send) -> Result<Counts> {
    let counts = Counts::default();
    let mut source = Source { frames: Box::new(frames(log)?), cameras, counts, right_size: [0; 2], wrong_size: [None; 2] };
    let mut queue = Queue { waiting: Vec::new(), last: [None; 2], out_of_order: 0, pair_within_s, take };
    loop {
        let (next, ()) = rayon::join(|| source.next(), || queue.hand_over(1));
        let Some(next) = next? else { break };
        queue.waiting.extend(next);
        queue.waiting.sort_by_key(|(side, frame)| (frame.stamp, *side));
    }
    queue.hand_over(0);
    source.check_sizes(log)?;
    Ok(Counts { out_of_order: queue.out_of_order, ..source.counts })
}

struct Source<'c> {
    frames: Box<dyn Iterator<Item = Result<CameraFrame>> + Send>,
    cameras: &'c Cameras,
    counts: Counts,
    /// Frames of the calibrated size, and one of the other sizes, of each camera.
    right_size: [usize; 2],
    wrong_size: [Option<(u32, u32)>; 2],
}

impl Source<'_> {
    /// The next batch without what cannot be decoded or has another size; `None` at the end.
    fn next(&mut self) -> Result<Option<Vec<(Side, Frame)>>> {
        let encoded: Vec<CameraFrame> = self.frames.by_ref().take(BATCH).collect::<Result<_>>()?;
        if encoded.is_empty() {
            return Ok(None);
        }
        for frame in &encoded {
            self.counts.frames[frame.side as usize] += 1;
        }
        let whole = |frame: &CameraFrame| {
            let image = if frame.is_truncated() { None } else { frame.decode_rgb().ok() };
            image.map(|image| (frame.side, Frame { stamp: frame.stamp, image }))
        };
        let mut decoded: Vec<(Side, Frame)> = encoded.par_iter().filter_map(whole).collect();
        self.counts.undecodable += encoded.len() - decoded.len();
        decoded.retain(|(side, frame)| {
            let (size, k) = (frame.image.dimensions(), *side as usize);
            let fits = size == calibrated(self.cameras, *side);
            if fits {
                self.right_size[k] += 1;
            } else {
                self.counts.other_size += 1;
                self.wrong_size[k].get_or_insert(size);
            }
            fits
        });
        Ok(Some(decoded))
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

/// Decoded frames that wait for their turn.
struct Queue<F> {
    waiting: Vec<(Side, Frame)>,
    last: [Option<Stamp>; 2],
    out_of_order: usize,
    pair_within_s: f64,
    take: F,
}

impl<F: FnMut([Option<&Frame>; 2])> Queue<F> {
    /// Hands over all but the last `keep` frames, whose partners may come with the next batch.
    fn hand_over(&mut self, keep: usize) {
        let kept = self.waiting.split_off(self.waiting.len().saturating_sub(keep));
        let ready = std::mem::replace(&mut self.waiting, kept);
        let (last, before) = (&mut self.last, ready.len());
        let ready: Vec<(Side, Frame)> = ready
            .into_iter()
            .filter(|(side, frame)| {
                let later = last[*side as usize].is_none_or(|last| frame.stamp > last);
                if later {
                    last[*side as usize] = Some(frame.stamp);
                }
                later
            })
            .collect();
        self.out_of_order += before - ready.len();
        let mut rest = ready.as_slice();
        while let Some(((side, frame), after)) = rest.split_first() {
            let mut step = [None, None];
            step[*side as usize] = Some(frame);
            rest = after;
            if let Some(((other, partner), after)) = rest.split_first()
                && other != side
                && partner.stamp.seconds_since(frame.stamp) <= self.pair_within_s
            {
                step[*other as usize] = Some(partner);
                rest = after;
            }
            (self.take)(step);
        }
    }
}
