//! A moving recording as the registration sees it: the marker followed in both cameras, on one clock, and placed by cameras that are
//! registered roughly.

use nalgebra::{Isometry3, Matrix2, Point3, Vector2, Vector3};
use raven::camera::Cameras;
use raven::log::{Recording, Side};
use raven::robot::Robot;
use raven::{Error, Result, cli, files};
use raven_identify::motion::Motion;
use raven_identify::session::{Session, Sighting};
use raven_track::batches;
use raven_track::interpolate::Interpolated;
use raven_track::look::Marker;
use raven_track::predict::Predictor;
use raven_track::stereo::StereoTrack;
use raven_track::tips;
use raven_track::tracker::{Record, Tracker};

use crate::align::Glimpse;
use crate::desync::Seen;

/// How far around a sighting the motion must be known [s]: what the latency may turn out to be.
const MARGIN_S: f64 = 0.1;
/// Time between the motor samples that are taken in [s]. What lies between is read off straight lines: at 5 rad/s^2 of a joint they are 1e-5 rad
/// off, and the laws of friction and hysteresis, which go through every sample, take most of a registration.
const MOTORS_S: f64 = 0.004;

/// One recording, with the marker followed.
pub struct Moving {
    name: String,
    sha256: String,
    pub(crate) recording: Recording,
    records: [Vec<Record>; 2],
    /// Left frames.
    pub frames: usize,
    /// Frames that were cut off, could not be decoded or have another size than was calibrated.
    pub lost: usize,
}

/// What the estimation takes in of a recording.
pub struct Taken {
    /// Motors and sightings, in frame 0 as the rough registration has it.
    pub session: Session,
    /// What both cameras saw, one for each sighting.
    pub seen: Vec<[Interpolated; 2]>,
}

impl Moving {
    /// Follows the marker through a recording, with cameras that are registered to within a few centimetres and degrees.
    ///
    /// # Errors
    /// If the recording lacks motors or a camera.
    pub fn follow(recording: Recording, robot: &Robot, cameras: &Cameras, marker: Marker) -> Result<Self> {
        let frames: u64 = Side::BOTH.into_iter().map(|side| Ok(recording.require_images(side)?.1)).sum::<Result<_>>()?;
        let base_from_left =
            cameras.base_from_left.ok_or_else(|| Error::Data("the cameras have no registration to follow the marker by.".to_owned()))?;
        let predictor = Predictor::new(&recording, robot, cameras.latency_s)?;
        let pair_within_s = batches::pair_within_s(&recording);
        let mut tracker = Tracker::new(cameras, base_from_left, &predictor, marker);
        let bar = cli::progress(frames, "following the marker");
        let counts = batches::for_each_encoded(&recording.path, cameras, pair_within_s, |step| {
            tracker.step(step);
            bar.inc(step.iter().flatten().count() as u64);
        })?;
        bar.finish_and_clear();
        let followed = tracker.finish();
        Ok(Self { lost: counts.lost() + followed.undecodable, ..Self::new(recording, followed.records)? })
    }

    /// A recording and what was seen in the frames of both cameras.
    ///
    /// # Errors
    /// If the recording's file cannot be read any more.
    pub fn new(recording: Recording, records: [Vec<Record>; 2]) -> Result<Self> {
        let name = recording.path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let sha256 = files::sha256(&recording.path)?;
        Ok(Self { name, sha256, recording, frames: records[0].len(), records, lost: 0 })
    }

    /// How much later than a left frame the nearest right one is by their stamps, median [s].
    #[must_use]
    pub fn stamps_apart_s(&self) -> f64 {
        tips::right_minus_left_s(&self.records)
    }

    /// What both cameras saw at the left frames, the right ones taken `right_minus_left_s` before their stamps [s].
    #[must_use]
    pub fn seen(&self, right_minus_left_s: f64) -> Vec<Seen> {
        let stereo = StereoTrack::new(&self.records, None, right_minus_left_s);
        let seen = |i: usize| match stereo.at_left(i) {
            [Some(left), Some(right)] => Some(Seen { time_s: stereo.stamp(i).seconds_since(self.recording.start), both: [left, right] }),
            _ => None,
        };
        (0..stereo.frames()).filter_map(seen).collect()
    }

    /// Where the left camera saw the marker, and the motors' tips at those times.
    ///
    /// # Errors
    /// If the recording has no motors, or the robot is no arm.
    pub fn glimpses(&self, robot: &Robot, cameras: &Cameras, right_minus_left_s: f64) -> Result<Vec<Glimpse>> {
        let predictor = Predictor::new(&self.recording, robot, 0.0)?;
        let glimpse = |Seen { time_s, both }: Seen| {
            let point = tips::triangulate(cameras, &both)?;
            let tip = |latency_s: f64| predictor.tip(self.recording.start.plus_seconds(time_s - latency_s));
            Glimpse::new(vec![point.point_left], tip)
        };
        Ok(self.seen(right_minus_left_s).into_iter().filter_map(glimpse).collect())
    }

    /// Sightings in frame 0 and the motors.
    ///
    /// # Errors
    /// If the recording has no motors.
    pub fn take(&self, cameras: &Cameras, base_from_left: &Isometry3<f64>, right_minus_left_s: f64) -> Result<Taken> {
        let motor = self.recording.require_motor()?;
        let motion = Motion::new(self.recording.motor_track()?.thinned(MOTORS_S), motor.longest_joined_s())
            .ok_or_else(|| Error::file(&self.recording.path, "the log has a single robot message; a registration needs a motion."))?;
        let turn = base_from_left.rotation.to_rotation_matrix();
        let (mut sightings, mut seen) = (Vec::new(), Vec::new());
        for Seen { time_s, both } in self.seen(right_minus_left_s) {
            let Some(point) = tips::triangulate(cameras, &both) else { continue };
            let position_m = (base_from_left * Point3::from(point.point_left)).coords;
            let covariance_m2 = turn * point.covariance * turn.transpose();
            let known = motion.covers(time_s - cameras.latency_s - MARGIN_S, time_s - cameras.latency_s + MARGIN_S);
            if let Some(sighting) = Sighting::new(time_s, position_m, &covariance_m2).filter(|_| known) {
                sightings.push(sighting);
                seen.push(both);
            }
        }
        let session = Session { name: self.name.clone(), sha256: self.sha256.clone(), motion, sightings };
        Ok(Taken { session, seen })
    }
}

impl Taken {
    /// How far each sighting moves if the right pixels move by `shift` [m, frame 0].
    #[must_use]
    pub fn moved_by(
        &self,
        cameras: &Cameras,
        base_from_left: &Isometry3<f64>,
        shift: impl Fn(&Interpolated) -> Vector2<f64>,
    ) -> Vec<Vector3<f64>> {
        let moved = |[left, right]: &[Interpolated; 2]| {
            let by = [Vector2::zeros(), shift(right)];
            let moved = cameras.moved_by_pixels(&[left.pixel, right.pixel], &[Matrix2::identity(); 2], &by);
            moved.map_or_else(Vector3::zeros, |moved| base_from_left * moved)
        };
        self.seen.iter().map(moved).collect()
    }
}
