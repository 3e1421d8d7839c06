//! Where the cameras should see the tip when the motors move as recorded.

use std::borrow::Cow;

use nalgebra::{Matrix3, Vector3};

use super::{Model, Shaft};
use crate::Result;
use crate::robot::stiction::{Dragged, behind_friction};
use crate::robot::{LinkModel, LinkState, MotorTrack};

/// How often a window is looked at. A stiff cable is wound within milliseconds where its joint turns round. A window of 70 ms is looked at every
/// 5 ms, at times that it shares with those that are 20 ms earlier and later.
const NODES: usize = 13;
/// Times that are closer are the same [s].
const ALIKE_S: f64 = 1e-9;

/// A vector for each that was asked about, `None` where the motors are not known.
pub type WhereKnown = Vec<Option<Vector3<f64>>>;

/// Where in half a window a node is [-1 to 1].
fn node(k: usize) -> f64 {
    2.0 * (k + 1) as f64 / (NODES + 1) as f64 - 1.0
}

fn nodes_s(shaft: &Shaft) -> [f64; NODES] {
    std::array::from_fn(|k| shaft.time_s + 0.5 * shaft.window_s * node(k))
}

/// A tip to be predicted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sight {
    /// Stamp [s], on the motors' clock.
    pub stamp_s: f64,
    /// Seen here [m, frame 0].
    pub position_m: Vector3<f64>,
    /// [m^2].
    pub covariance_m2: Matrix3<f64>,
    /// Rows of the two images, from -1/2 to 1/2; 0 where they are not known.
    pub rows: [f64; 2],
}

/// A model of the tip over one recording's motors.
pub struct TipModel<'a> {
    model: &'a Model,
    links: LinkModel,
    /// As they wind the cables.
    motors: Cow<'a, MotorTrack>,
}

impl<'a> TipModel<'a> {
    /// Of a model over recorded motors.
    ///
    /// # Errors
    /// If the robot is no arm.
    pub fn new(model: &'a Model, recorded: &'a MotorTrack) -> Result<Self> {
        let arm = model.robot.arm()?;
        let motors = match model.motors(&arm, recorded) {
            Cow::Borrowed(motors) => arm.winding(motors),
            Cow::Owned(motors) => Cow::Owned(arm.winding(&motors).into_owned()),
        };
        Ok(Self { model, links: LinkModel::new(arm), motors })
    }

    /// Longest step [s] of [`Self::rolled_out`], which takes as much longer as it is shorter than a millisecond.
    #[must_use]
    pub fn step_max_s(&self) -> f64 {
        self.links.step_max_s()
    }

    /// Predictions with the links rolled out through cables and friction: exact, and some hundredths of a second per minute of recording; and the
    /// cables' tension differences [N], averaged over the window of each of `shafts` as its torque is.
    #[must_use]
    pub fn rolled_out(&self, sights: &[Sight], shafts: &[Shaft]) -> (WhereKnown, WhereKnown) {
        let times: Vec<f64> = sights.iter().flat_map(|sight| self.images_at_s(sight)).chain(shafts.iter().flat_map(nodes_s)).collect();
        let (distinct_s, place) = distinct(&times);
        let states = self.links.rollout_gripped(&self.motors, &distinct_s);
        let (of_images, of_shafts) = place.split_at(2 * sights.len());
        let joints: WhereKnown = of_images.iter().map(|&k| states[k].map(|state| state.position)).collect();
        let looked_at = if shafts.is_empty() { 0 } else { distinct_s.len() };
        let stretch_m: WhereKnown =
            distinct_s[..looked_at].iter().zip(&states).map(|(&time_s, state)| self.stretch_m(time_s, state)).collect();
        let tension = |(shaft, nodes): (&Shaft, &[usize])| {
            let stretch_m: Vec<Vector3<f64>> = nodes.iter().map(|&k| stretch_m[k]).collect::<Option<_>>()?;
            Some(self.averaged_tension_n(&stretch_m, shaft.window_s / (NODES + 1) as f64))
        };
        (self.seen(&joints), shafts.iter().zip(of_shafts.chunks(NODES)).map(tension).collect())
    }

    /// Of stretches at the nodes of a window, which are so far apart in time.
    fn averaged_tension_n(&self, stretch_m: &[Vector3<f64>], apart_s: f64) -> Vector3<f64> {
        let cables = &self.links.arm().cables;
        let (mut sum, mut weights) = (Vector3::zeros(), 0.0);
        for (k, at) in stretch_m.iter().enumerate() {
            let (before, after) = (k.saturating_sub(1), (k + 1).min(NODES - 1));
            let rate = (stretch_m[after] - stretch_m[before]) / ((after - before) as f64 * apart_s);
            let weight = Shaft::weight(node(k));
            sum += Vector3::from_fn(|j, _| cables[j].force(at[j], rate[j])) * weight;
            weights += weight;
        }
        sum / weights
    }

    fn stretch_m(&self, time_s: f64, state: &Option<LinkState>) -> Option<Vector3<f64>> {
        let (motor, _) = self.motors.at(time_s)?;
        Some(self.links.arm().transmission.stretch_m(&motor, &state.as_ref()?.position))
    }

    /// The links without inertia, against all their friction.
    #[must_use]
    pub fn dragged(&self) -> Dragged {
        behind_friction(self.links.arm(), &self.motors)
    }

    /// Predictions with links without inertia, at rest where cables and friction hold them: fifty times as fast, good for slopes.
    #[must_use]
    pub fn settled(&self, sights: &[Sight], dragged: &Dragged) -> WhereKnown {
        let settled = |time_s: f64| Some(self.links.settled(&dragged.motors.at(time_s)?.0, &Vector3::zeros()));
        let joints = |sight: &Sight| {
            let [left_s, right_s] = self.images_at_s(sight);
            let left = settled(left_s);
            [left, if right_s == left_s { left } else { settled(right_s) }]
        };
        self.seen(&sights.iter().flat_map(joints).collect::<Vec<_>>())
    }

    fn images_at_s(&self, sight: &Sight) -> [f64; 2] {
        self.model.view.images_at_s(sight.stamp_s, sight.rows)
    }

    /// Tips of joints as the left and the right image of each sight show them.
    fn seen(&self, joints: &[Option<Vector3<f64>>]) -> WhereKnown {
        let (look, kinematics) = (self.model.view.look(), &self.links.arm().kinematics);
        let seen = |images: &[Option<Vector3<f64>>]| {
            let &[Some(left), Some(right)] = images else { return None };
            let left_m = kinematics.forward(&left);
            look.seen_m(&[left_m, if right == left { left_m } else { kinematics.forward(&right) }])
        };
        joints.chunks(2).map(seen).collect()
    }
}

/// Times in any order, sorted, each once; and where among these every one of them is.
fn distinct(times_s: &[f64]) -> (Vec<f64>, Vec<usize>) {
    let mut order: Vec<usize> = (0..times_s.len()).collect();
    order.sort_by(|&a, &b| times_s[a].total_cmp(&times_s[b]));
    let mut distinct_s: Vec<f64> = Vec::with_capacity(times_s.len());
    let mut place = vec![0; times_s.len()];
    for k in order {
        if distinct_s.last().is_none_or(|&last_s| times_s[k] - last_s >= ALIKE_S) {
            distinct_s.push(times_s[k]);
        }
        place[k] = distinct_s.len() - 1;
    }
    (distinct_s, place)
}
