//! What a page about a run needs of the frames while they pass: why each was seen or not, and pictures of a few.

use raven::log::{CameraFrame, Side, Stamp};

use super::sample::{Largest, Spread};
use super::tile::Tile;
use crate::colour::MarkerColour;
use crate::reason::Reason;
use crate::tracker::{Looked, Sighting};

/// Pictures of each camera evenly over time, and of each kind that is worth a look.
const EVENLY: usize = 24;
const EACH: usize = 8;

/// Pictures and reasons of both cameras.
#[derive(Debug, Clone)]
pub struct Album {
    colour: MarkerColour,
    start: Option<Stamp>,
    cameras: [OfCamera; 2],
}

/// Pictures and reasons of one camera. At most `2 EVENLY + 5 EACH` pictures of 0.12 MB are in memory.
#[derive(Debug, Clone)]
pub struct OfCamera {
    /// Of every frame, when it was taken [s since the first of all] and what decided about it.
    pub reasons: Vec<(f64, Reason)>,
    evenly: Spread<Option<Tile>>,
    hidden: Spread<Option<Tile>>,
    rejected: Spread<Option<Tile>>,
    farthest: Largest<Option<Tile>>,
}

impl Default for OfCamera {
    fn default() -> Self {
        let (evenly, hidden, rejected) = (Spread::new(EVENLY), Spread::new(EACH), Spread::new(EACH));
        Self { reasons: Vec::new(), evenly, hidden, rejected, farthest: Largest::new(EACH) }
    }
}

impl Album {
    /// Of a marker of this colour.
    #[must_use]
    pub fn new(colour: MarkerColour) -> Self {
        Self { colour, start: None, cameras: Default::default() }
    }

    /// Takes what a step of the tracker made of the frames it was given.
    pub fn add(&mut self, frames: [Option<&CameraFrame>; 2], looked: &[Option<Looked>; 2]) {
        let Some(first) = frames.iter().flatten().map(|frame| frame.stamp).min() else { return };
        let start = *self.start.get_or_insert(first);
        for side in Side::BOTH {
            let k = side as usize;
            if let (Some(frame), Some(looked)) = (frames[k], &looked[k]) {
                self.cameras[k].add(frame, frame.stamp.seconds_since(start), looked, &self.colour);
            }
        }
    }

    /// Time of a stamp [s since the first frame].
    #[must_use]
    pub fn seconds(&self, stamp: Stamp) -> f64 {
        self.start.map_or(0.0, |start| stamp.seconds_since(start))
    }

    /// Of both cameras, left and right.
    #[must_use]
    pub fn into_cameras(self) -> [OfCamera; 2] {
        self.cameras
    }
}

impl OfCamera {
    fn add(&mut self, frame: &CameraFrame, time_s: f64, looked: &Looked, colour: &MarkerColour) {
        self.reasons.push((time_s, looked.reason));
        let tile = || Tile::cut(frame, time_s, looked, colour);
        if looked.searched.is_none() {
            return;
        }
        self.evenly.offer(tile);
        match looked.sighting {
            Sighting::Hidden => self.hidden.offer(tile),
            Sighting::Rejected(_) => self.rejected.offer(tile),
            Sighting::Seen(_) => {
                if let Some(miss_px) = Tile::miss_px(looked) {
                    self.farthest.offer(miss_px, tile);
                }
            }
        }
    }

    /// The pictures by kind: what they show, of how many frames they were chosen, and themselves.
    #[must_use]
    pub fn into_sheets(self) -> Vec<(&'static str, usize, Vec<Tile>)> {
        let seen = self.reasons.iter().filter(|(_, reason)| *reason == Reason::Seen).count();
        let of = |spread: Spread<Option<Tile>>| (spread.offered(), spread.into_chosen());
        let ((searched, evenly), (hidden, of_hidden), (rejected, of_rejected)) = (of(self.evenly), of(self.hidden), of(self.rejected));
        let sheets = [
            ("evenly over time", searched, evenly),
            ("hidden", hidden, of_hidden),
            ("rejected", rejected, of_rejected),
            ("seen farthest from where it was expected", seen, self.farthest.into_chosen()),
        ];
        sheets.into_iter().map(|(name, count, tiles)| (name, count, tiles.into_iter().flatten().collect())).collect()
    }
}

#[cfg(test)]
mod tests {
    use image::RgbImage;
    use nalgebra::{Matrix2, Vector2};

    use super::*;
    use crate::html::as_frame;
    use crate::look::Candidate;
    use crate::marker::Region;
    use crate::response::Response;

    #[test]
    fn the_worst_and_an_even_choice_are_kept_of_a_long_recording() {
        let mut album = Album::new(MarkerColour::default());
        let mut frame = as_frame(RgbImage::new(64, 48));
        for i in 0..2000_u32 {
            frame.stamp = Stamp::from_ros(100, 0).plus_seconds(f64::from(i) / 10.0);
            let centre = Vector2::new(30.0 + f64::from(i % 7), 20.0);
            let candidate =
                Candidate { centre, noise_px2: Matrix2::identity() * 0.01, response: Response::untold(0.07), radius_px: 4.0, share: 1.0 };
            let (sighting, reason) = match i % 100 {
                13 => (Sighting::Hidden, Reason::NoColour),
                50 => (Sighting::Rejected(candidate), Reason::Elsewhere),
                _ => (Sighting::Seen(candidate), Reason::Seen),
            };
            let searched = Some((Vector2::new(30.0, 20.0), Region { x: 10, y: 5, width: 40, height: 30 }));
            album.add([Some(&frame), None], &[Some(Looked { sighting, reason, searched }), None]);
        }
        let [left, right] = album.into_cameras();
        assert_eq!((left.reasons.len(), right.reasons.len(), left.reasons[1999].0), (2000, 0, 199.9));
        let sheets = left.into_sheets();
        let sizes: Vec<(usize, usize)> = sheets.iter().map(|(_, count, tiles)| (*count, tiles.len())).collect();
        assert_eq!(sizes, [(2000, 24), (20, 8), (20, 8), (1960, 8)]);
        let times: Vec<f64> = sheets[0].2.iter().map(|tile| tile.time_s).collect();
        assert!(times[0] < 17.0 && times[23] > 183.0, "{times:?}");
        assert!(sheets[3].2.iter().all(|tile| tile.caption().ends_with("6.0 px off")));
        assert!(right.into_sheets().iter().all(|(_, count, tiles)| *count == 0 && tiles.is_empty()));
    }
}
