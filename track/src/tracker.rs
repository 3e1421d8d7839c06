//! Follows the marker through the frames of both cameras and decides which blob is it.
//!
//! A blob is the marker if its size fits and, when both cameras have one, if their rays meet and the point is where the motors put the
//! tip, up to a difference that changes slowly (see [`crate::lock`]). Frames of the two cameras that are not taken at the same time are
//! compared after moving the right one by the predicted motion between them; the track itself is free of that.

use nalgebra::{Isometry3, Matrix2, Matrix3, Point3, Vector2, Vector3};
use raven::Result;
use raven::camera::{CALIBRATION_STD_PX, Cameras, StereoPoint};
use raven::log::{CameraFrame, Side, Stamp};

use crate::lock::Lock;
use crate::look::{Candidate, Found, Marker, Search};
use crate::marker::Region;
use crate::predict::{Predictor, View, view};
use crate::reason::Reason;

/// Chi-square with one degree of freedom that is exceeded by chance in 1 of 10000: the rays do not meet.
const EPIPOLAR_CHI2: f64 = 15.1;
/// Standard deviation of a candidate's area, logarithmic: mask edges, light, motion blur.
const AREA_STD: f64 = 0.3;

/// What became of the marker in one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sighting {
    /// Found and accepted.
    Seen(Candidate),
    /// Not found, or too much of it hidden.
    Hidden,
    /// Found where it cannot be.
    Rejected(Candidate),
}

impl Sighting {
    /// The marker where it was found and accepted.
    #[must_use]
    pub const fn seen(&self) -> Option<&Candidate> {
        if let Self::Seen(candidate) = self { Some(candidate) } else { None }
    }
}

/// One frame's sighting.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Record {
    /// Stamp of the frame.
    pub stamp: Stamp,
    /// What was seen.
    pub sighting: Sighting,
}

/// What one frame was asked, and what it answered.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Looked {
    /// What became of the marker.
    pub sighting: Sighting,
    /// Why.
    pub reason: Reason,
    /// Where the marker was expected [px], and the region that was searched for it; `None` if the frame was not searched.
    pub searched: Option<(Vector2<f64>, Region)>,
}

/// Follows the marker.
pub struct Tracker<'a> {
    cameras: &'a Cameras,
    base_from_left: Isometry3<f64>,
    predictor: &'a Predictor<'a>,
    search: [Search; 2],
    lock: Lock,
    followed: Followed,
}

/// What a tracker has seen.
#[derive(Debug, Clone, Default)]
pub struct Followed {
    /// What was seen, left and right.
    pub records: [Vec<Record>; 2],
    /// Frames at whose time the log has no motor angles.
    pub without_motor: usize,
    /// Frames in whose image the tip cannot be, left and right: see [`view`].
    pub out_of_view: [usize; 2],
    /// Frames that could not be decoded; they have no record.
    pub undecodable: usize,
}

/// What one frame shows.
struct Look {
    stamp: Stamp,
    tip: Vector3<f64>,
    expected: View,
    found: Found,
}

/// A candidate of each camera, taken together.
struct Pair {
    chosen: [Candidate; 2],
    offset_m: Vector3<f64>,
    covariance: Matrix3<f64>,
    /// `None` if the change is impossible.
    cost: Option<f64>,
}

impl<'a> Tracker<'a> {
    /// A tracker for registered cameras.
    #[must_use]
    pub fn new(cameras: &'a Cameras, base_from_left: Isometry3<f64>, predictor: &'a Predictor<'a>, marker: Marker) -> Self {
        let search = [cameras.left, cameras.right].map(|camera| Search::new(camera, marker));
        Self { cameras, base_from_left, predictor, search, lock: Lock::default(), followed: Followed::default() }
    }

    /// Takes the next frame of one camera, or of both if they belong together, left first. Says what it made of each; nothing of one that
    /// cannot be decoded.
    pub fn step(&mut self, frames: [Option<&CameraFrame>; 2]) -> [Option<Looked>; 2] {
        let this = &*self;
        let look = |side: Side| frames[side as usize].map(|frame| this.look(side, frame));
        let (left, right) = rayon::join(|| look(Side::Left), || look(Side::Right));
        let looks = [left, right].map(|look| look.and_then(Result::ok));
        self.followed.undecodable += frames.iter().flatten().count() - looks.iter().flatten().count();
        let decided = self.decide(&looks);
        [0, 1].map(|k| {
            let (frame, (sighting, reason)) = (frames[k]?, decided[k]?);
            match (sighting, reason) {
                (Sighting::Seen(candidate), _) => self.search[k].seen(candidate.share),
                (Sighting::Hidden, Reason::NoMotor) => self.followed.without_motor += 1,
                (Sighting::Hidden, Reason::OutOfView) => self.followed.out_of_view[k] += 1,
                (Sighting::Hidden, _) => self.search[k].lost(),
                (Sighting::Rejected(_), _) => {}
            }
            self.followed.records[k].push(Record { stamp: frame.stamp, sighting });
            let searched = looks[k].as_ref().and_then(|look| look.as_ref().ok());
            Some(Looked { sighting, reason, searched: searched.map(|look| (look.expected.pixel, look.found.region)) })
        })
    }

    /// What was seen so far.
    #[must_use]
    pub fn finish(self) -> Followed {
        self.followed
    }

    /// What a frame shows, or why the marker cannot be expected anywhere in it; an error if it cannot be decoded.
    fn look(&self, side: Side, frame: &CameraFrame) -> Result<Result<Look, Reason>> {
        let Some(tip) = self.predictor.tip(frame.stamp) else { return Ok(Err(Reason::NoMotor)) };
        let Some(expected) = view(self.cameras, side, &(tip + self.lock.offset_m())) else { return Ok(Err(Reason::OutOfView)) };
        let found = self.search[side as usize].look(frame, &expected)?;
        Ok(Ok(Look { stamp: frame.stamp, tip, expected, found }))
    }

    /// `None` of a frame that is not there.
    fn decide(&mut self, looks: &[Option<Result<Look, Reason>>; 2]) -> [Option<(Sighting, Reason)>; 2] {
        if let [Some(Ok(left)), Some(Ok(right))] = looks
            && !left.found.candidates.is_empty()
            && !right.found.candidates.is_empty()
        {
            return self.decide_pair(left, right).map(Some);
        }
        let alone = |look: &Result<Look, Reason>| look.as_ref().map_or_else(|&why| (Sighting::Hidden, why), |look| self.decide_alone(look));
        looks.each_ref().map(|look| look.as_ref().map(alone))
    }

    /// One camera alone can follow the marker but not find it for the first time.
    fn decide_alone(&self, look: &Look) -> (Sighting, Reason) {
        let off = |c: &Candidate| (c.centre - look.expected.pixel).norm();
        let Some(nearest) = look.found.candidates.iter().min_by(|a, b| off(a).total_cmp(&off(b))) else {
            return (Sighting::Hidden, if look.found.blobs == 0 { Reason::NoColour } else { Reason::NoBall });
        };
        let reach_px = self.lock.reach_m(self.seconds(look.stamp)) * look.expected.px_per_m;
        if self.lock.is_set() && off(nearest) <= reach_px {
            (Sighting::Seen(*nearest), Reason::Seen)
        } else {
            (Sighting::Rejected(*nearest), Reason::Alone)
        }
    }

    fn decide_pair(&mut self, left: &Look, right: &Look) -> [(Sighting, Reason); 2] {
        let time_s = self.seconds(left.stamp);
        let (of_left, of_right) = (&left.found.candidates, &right.found.candidates);
        let pairs = of_left.iter().flat_map(|l| of_right.iter().map(move |r| [*l, *r]));
        let pairs: Vec<Pair> = pairs.filter_map(|chosen| self.pair(chosen, left, right, time_s)).collect();
        let possible = pairs.iter().filter_map(|pair| Some((pair, pair.cost?)));
        if let Some((best, _)) = possible.min_by(|a, b| a.1.total_cmp(&b.1)) {
            self.lock.accept(best.offset_m, time_s);
            return best.chosen.map(|candidate| (Sighting::Seen(candidate), Reason::Seen));
        }
        let nearest = pairs.iter().min_by(|a, b| a.offset_m.norm().total_cmp(&b.offset_m.norm()));
        if let Some(nearest) = nearest
            && self.lock.reject(nearest.offset_m, &nearest.covariance, time_s)
        {
            for search in &mut self.search {
                search.size.forget();
            }
        }
        let reason = if nearest.is_some() { Reason::Elsewhere } else { Reason::RaysMiss };
        let rejected = nearest.map_or([of_left[0], of_right[0]], |pair| pair.chosen);
        rejected.map(|candidate| (Sighting::Rejected(candidate), reason))
    }

    /// The point that two candidates make; `None` where their rays do not meet.
    fn pair(&self, chosen: [Candidate; 2], left: &Look, right: &Look, time_s: f64) -> Option<Pair> {
        let moved = view(self.cameras, Side::Right, &(left.tip + self.lock.offset_m()))?.pixel - right.expected.pixel;
        let pixels = [chosen[0].centre, chosen[1].centre + moved];
        let point = meet(self.cameras, &pixels, &chosen.map(|c| c.covariance_px2()))?;
        let tip = (self.base_from_left * Point3::from(point.point_left)).coords;
        let rotation = self.base_from_left.rotation.to_rotation_matrix();
        let covariance = rotation * point.covariance * rotation.transpose();
        let offset_m = tip - left.tip;
        let odd_size: f64 = chosen.iter().map(|c| (c.share.ln() / AREA_STD).powi(2)).sum();
        let cost = self.lock.distance2(&offset_m, &covariance, time_s).map(|distance2| distance2 + point.chi2 + odd_size);
        Some(Pair { chosen, offset_m, covariance, cost })
    }

    fn seconds(&self, stamp: Stamp) -> f64 {
        self.predictor.seconds(stamp)
    }
}

/// The point that two pixels of a covariance [px^2] make, the calibration's error added to it; `None` where their rays do not meet.
#[must_use]
pub fn meet(cameras: &Cameras, pixels: &[Vector2<f64>; 2], covariance: &[Matrix2<f64>; 2]) -> Option<StereoPoint> {
    let calibration = Matrix2::identity() * (CALIBRATION_STD_PX * CALIBRATION_STD_PX);
    cameras.triangulate(pixels, &covariance.map(|c| c + calibration)).filter(|point| point.chi2 <= EPIPOLAR_CHI2)
}
