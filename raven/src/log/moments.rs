//! Moments that several recordings hold, so that none counts twice: of one recording, a copy, a part and what was recovered hold the same.

use std::cmp::Ordering;
use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};
use std::path::PathBuf;

use super::{JointSeries, Recording, Stamp};
use crate::{Error, Result};

/// Samples that two recordings share by chance, such as those of two simulations before the robot moves, are fewer than this, or than half of those
/// that they have at the same time.
const SHARED_MIN: usize = 100;

/// What the motors did, moment by moment, in the recordings so far.
#[derive(Debug, Default)]
pub struct Moments {
    known: Vec<(PathBuf, Vec<(Stamp, u64)>)>,
}

impl Moments {
    /// Refuses recordings of which two hold the same moments.
    ///
    /// # Errors
    /// If two do.
    pub fn distinct<'r>(recordings: impl IntoIterator<Item = &'r Recording>) -> Result<()> {
        recordings.into_iter().try_fold(Self::default(), Self::with).map(drop)
    }

    /// With those of one more recording.
    ///
    /// # Errors
    /// If one of the recordings before holds the same, as the motors' positions and torques at the same stamps tell.
    pub fn with(mut self, recording: &Recording) -> Result<Self> {
        let moments = recording.motor.as_ref().map_or_else(Vec::new, |motor| of(recording.start, motor));
        for (other, known) in &self.known {
            let [shared, at_same_time] = shared(&moments, known);
            if shared >= SHARED_MIN && 2 * shared > at_same_time {
                let sentence = format!(
                    "{shared} of its {} samples of the motors are in {} as well, with the same stamps, and would count twice; leave one away.",
                    moments.len(),
                    other.display()
                );
                return Err(Error::file(&recording.path, sentence));
            }
        }
        self.known.push((recording.path.clone(), moments));
        Ok(self)
    }
}

/// The stamp and the contents of every sample.
fn of(start: Stamp, motor: &JointSeries) -> Vec<(Stamp, u64)> {
    let sample = |k: usize| {
        let mut hash = DefaultHasher::new();
        let joints = motor.position.iter().chain(motor.effort.iter().flatten());
        joints.for_each(|joint| joint[k].to_bits().hash(&mut hash));
        (start.plus_seconds(motor.time_s[k]), hash.finish())
    };
    (0..motor.len()).map(sample).collect()
}

/// How many moments of two are the same, and how many have the same stamp.
fn shared(one: &[(Stamp, u64)], other: &[(Stamp, u64)]) -> [usize; 2] {
    let (mut i, mut k, mut shared, mut at_same_time) = (0, 0, 0, 0);
    while let (Some(a), Some(b)) = (one.get(i), other.get(k)) {
        match a.0.cmp(&b.0) {
            Ordering::Less => i += 1,
            Ordering::Greater => k += 1,
            Ordering::Equal => {
                shared += usize::from(a.1 == b.1);
                at_same_time += 1;
                (i, k) = (i + 1, k + 1);
            }
        }
    }
    [shared, at_same_time]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A robot that rests for `rest` samples and then moves at `speed`.
    fn moments(first: u64, rest: u64, count: u64, speed: f64) -> Vec<(Stamp, u64)> {
        let time_s: Vec<f64> = (0..count).map(|k| k as f64 * 1e-3).collect();
        let at = |k: u64| speed * (first + k).saturating_sub(rest) as f64;
        let motor = JointSeries::new(vec!["shoulder".to_owned()], time_s, vec![(0..count).map(at).collect()], None);
        of(Stamp(1_000_000 * first), &motor)
    }

    #[test]
    fn a_part_is_the_same_and_another_motion_from_the_same_rest_is_not() {
        let whole = moments(0, 400, 1000, 0.1);
        assert_eq!(shared(&whole, &moments(300, 400, 500, 0.1)), [500, 500]);
        assert_eq!(shared(&whole, &moments(0, 400, 1000, 0.2)), [401, 1000]);
        assert_eq!(shared(&whole, &moments(1000, 400, 1000, 0.1)), [0, 0]);
    }
}
