//! Joint positions and efforts over time.

use super::{Stamp, StreamQuality};
use crate::stats::median_step;

/// Samples this close are joined by a straight line even in a fast stream: at 10 rad/s^2 the line is off by at most 0.5 mrad.
const JOINED_S: f64 = 0.02;
/// In a slow stream, samples this many median intervals apart are joined: one or two may be missing.
const JOINED_INTERVALS: f64 = 3.0;

/// Positions, and efforts where they were recorded, of some joints at strictly increasing times.
#[derive(Debug, Clone, PartialEq)]
pub struct JointSeries {
    /// Names of the joints.
    pub names: Vec<String>,
    /// Times since [`super::Recording::start`] (s).
    pub time_s: Vec<f64>,
    /// `position[joint][sample]` (rad or m).
    pub position: Vec<Vec<f64>>,
    /// `effort[joint][sample]` (N m or N), `None` if it was not recorded.
    pub effort: Option<Vec<Vec<f64>>>,
    joined_s: f64,
}

impl JointSeries {
    /// A series of `position[joint][sample]` at strictly increasing times.
    #[must_use]
    pub fn new(names: Vec<String>, time_s: Vec<f64>, position: Vec<Vec<f64>>, effort: Option<Vec<Vec<f64>>>) -> Self {
        let joined_s = median_step(&time_s).map_or(JOINED_S, |median| (JOINED_INTERVALS * median).max(JOINED_S));
        Self { names, time_s, position, effort, joined_s }
    }

    /// The same with the joints of these names first, in their order, and what there is besides after them. A series that has none of the names
    /// stays as it is: its joints are told by their places.
    ///
    /// # Errors
    /// Half a sentence if it has some of the names and not all.
    pub(super) fn ordered_by(mut self, names: &[String]) -> Result<Self, String> {
        let place = |name: &String| self.names.iter().position(|own| own == name);
        let (found, missing): (Vec<&String>, Vec<&String>) = names.iter().partition(|name| place(name).is_some());
        if found.is_empty() {
            return Ok(self);
        }
        if let Some(missing) = missing.first() {
            let there = self.names.join(", ");
            return Err(format!("its joints are {there}, and not `{missing}`, which the robot file has; give both the same names"));
        }
        let first: Vec<usize> = names.iter().filter_map(place).collect();
        let others = (0..self.names.len()).filter(|j| !first.contains(j));
        let order: Vec<usize> = first.iter().copied().chain(others).collect();
        let ordered = |joints: &[Vec<f64>]| order.iter().filter_map(|&j| joints.get(j).cloned()).collect::<Vec<_>>();
        self.names = order.iter().map(|&j| self.names[j].clone()).collect();
        self.position = ordered(&self.position);
        self.effort = self.effort.map(|effort| ordered(&effort));
        Ok(self)
    }

    /// Number of samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Whether there are no samples.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// The longest interval that [`JointSeries::interpolate`] bridges: three median intervals, at least 20 ms (s).
    #[must_use]
    pub const fn longest_joined_s(&self) -> f64 {
        self.joined_s
    }

    /// Position of a joint at time `t`, linear between samples; `None` before the first and after the last sample, within a gap, and for a
    /// joint that is not there.
    #[must_use]
    pub fn interpolate(&self, joint: usize, t: f64) -> Option<f64> {
        self.between(self.position.get(joint)?, t)
    }

    /// Effort of a joint at time `t`, as [`JointSeries::interpolate`]; `None` also if effort was not recorded.
    #[must_use]
    pub fn interpolate_effort(&self, joint: usize, t: f64) -> Option<f64> {
        self.between(self.effort.as_ref()?.get(joint)?, t)
    }

    fn between(&self, values: &[f64], t: f64) -> Option<f64> {
        let after = self.time_s.partition_point(|&time| time < t);
        let (t1, v1) = (*self.time_s.get(after)?, *values.get(after)?);
        if t1 == t {
            return Some(v1);
        }
        let before = after.checked_sub(1)?;
        let (t0, v0) = (*self.time_s.get(before)?, *values.get(before)?);
        (t1 - t0 <= self.joined_s).then(|| v0 + (v1 - v0) * (t - t0) / (t1 - t0))
    }
}

/// Collects samples in the order of the file.
#[derive(Debug, Default)]
pub(super) struct SeriesBuilder {
    names: Vec<String>,
    stamps: Vec<Stamp>,
    position: Vec<f64>,
    effort: Vec<f64>,
    pub(super) without_stamp: usize,
    pub(super) undecodable: usize,
}

impl SeriesBuilder {
    pub(super) fn new(names: Vec<String>) -> Self {
        Self { names, ..Self::default() }
    }

    /// Names the joints, once the first message says which there are.
    pub(super) fn begin(&mut self, names: Vec<String>) {
        self.names = names;
    }

    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    pub(super) fn first(&self) -> Option<Stamp> {
        self.stamps.iter().min().copied()
    }

    pub(super) fn last(&self) -> Option<Stamp> {
        self.stamps.iter().max().copied()
    }

    /// Adds a sample with one number per joint; an effort of another length was not recorded.
    pub(super) fn push(&mut self, stamp: Stamp, position: &[f64], effort: &[f64]) {
        if position.len() != self.names.len() {
            self.undecodable += 1;
            return;
        }
        self.stamps.push(stamp);
        self.position.extend_from_slice(position);
        if effort.len() == position.len() {
            self.effort.extend_from_slice(effort);
        } else {
            self.effort.extend(std::iter::repeat_n(f64::NAN, position.len()));
        }
    }

    /// The series in the order of time.
    ///
    /// Samples with a position that is not finite are left out, and of two samples at one time the second. Effort counts as recorded if
    /// at least half of the samples have it for all joints; then samples without it are left out too.
    pub(super) fn finish(self, origin: Stamp) -> (JointSeries, StreamQuality) {
        let joints = self.names.len();
        let finite = |values: &[f64], i: usize| values.iter().skip(i * joints).take(joints).all(|value| value.is_finite());
        let samples = self.stamps.len();
        let with_effort = (0..samples).filter(|&i| joints > 0 && finite(&self.effort, i)).count();
        let has_effort = with_effort > 0 && 2 * with_effort >= samples;
        let mut order: Vec<usize> =
            (0..samples).filter(|&i| finite(&self.position, i) && (!has_effort || finite(&self.effort, i))).collect();
        let mut quality = StreamQuality::of(&self.stamps);
        quality.non_finite = samples - order.len();
        quality.without_stamp = self.without_stamp;
        quality.undecodable = self.undecodable;
        order.sort_by_key(|&i| self.stamps.get(i));
        // Far from the origin, stamps that differ may be the same in seconds.
        let seconds = |i: usize| self.stamps.get(i).map(|stamp| stamp.seconds_since(origin));
        order.dedup_by_key(|i| seconds(*i));
        let time_s = order.iter().filter_map(|&i| seconds(i)).collect();
        let position = columns(&self.position, joints, &order);
        let effort = has_effort.then(|| columns(&self.effort, joints, &order));
        (JointSeries::new(self.names, time_s, position, effort), quality)
    }
}

/// `columns[c][i]` from rows of `width` values each, taken in `order`.
fn columns(rows: &[f64], width: usize, order: &[usize]) -> Vec<Vec<f64>> {
    (0..width).map(|column| order.iter().filter_map(|&row| rows.get(row * width + column).copied()).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series(rows: &[(u64, f64, f64)]) -> (JointSeries, StreamQuality) {
        let mut builder = SeriesBuilder::new(vec!["x".into()]);
        for &(ms, position, effort) in rows {
            builder.push(Stamp(ms * 1_000_000), &[position], &[effort]);
        }
        builder.finish(Stamp(0))
    }

    #[test]
    fn out_of_order_samples_are_sorted_and_repeated_stamps_kept_once() {
        let (series, quality) = series(&[(0, 0.0, 1.0), (20, 2.0, 1.0), (10, 1.0, 1.0), (10, 9.0, 1.0)]);
        assert_eq!(series.position, [[0.0, 1.0, 2.0]]);
        assert_eq!((quality.backward, quality.duplicates), (1, 1));
    }

    /// Seconds since 1970 have steps of 0.24 us as floating-point numbers.
    #[test]
    fn samples_at_one_time_of_a_distant_origin_are_kept_once() {
        let mut builder = SeriesBuilder::new(vec!["x".into()]);
        for (nanoseconds, position) in [(0, 0.0), (5, 1.0), (1_000_000, 2.0)] {
            builder.push(Stamp(1_700_000_000_000_000_000 + nanoseconds), &[position], &[1.0]);
        }
        let (series, _) = builder.finish(Stamp(0));
        assert_eq!((series.position, series.time_s.len()), (vec![vec![0.0, 2.0]], 2));
        assert!(series.time_s[0] < series.time_s[1]);
    }

    #[test]
    fn interpolation_is_linear_and_stops_at_gaps_and_ends() {
        let (series, _) = series(&[(0, 0.0, 1.0), (10, 1.0, 3.0), (20, 2.0, 1.0), (120, 12.0, 1.0)]);
        assert_eq!(series.interpolate(0, 0.005), Some(0.5));
        assert_eq!(series.interpolate_effort(0, 0.005), Some(2.0));
        assert_eq!(series.interpolate(0, 0.12), Some(12.0));
        assert_eq!(series.interpolate(0, 0.05), None);
        assert_eq!(series.interpolate(0, -0.001), None);
        assert_eq!(series.interpolate(0, 0.121), None);
        assert_eq!(series.interpolate(0, f64::NAN), None);
        assert_eq!(series.interpolate(1, 0.0), None);
    }

    #[test]
    fn numbers_that_are_not_finite_are_left_out_and_counted() {
        let nan = f64::NAN;
        let (some, quality) = series(&[(0, 0.0, 1.0), (1, nan, 1.0), (2, 2.0, nan), (3, 3.0, 1.0)]);
        assert_eq!((some.position, quality.non_finite), (vec![vec![0.0, 3.0]], 2));
        let (none, quality) = series(&[(0, 0.0, nan), (1, nan, nan), (2, 2.0, 1.0), (3, 3.0, nan)]);
        assert_eq!((none.effort, none.position, quality.non_finite), (None, vec![vec![0.0, 2.0, 3.0]], 1));
    }
}
