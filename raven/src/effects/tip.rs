//! Where the cameras should see the tip when the motors move as recorded.

use std::borrow::Cow;

use nalgebra::{Matrix3, Vector3};

use super::{LinkMotion, Model};
use crate::Result;
use crate::robot::stiction::behind_friction;
use crate::robot::{LinkModel, LinkState, MotorTrack};

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

    /// Predictions with the links rolled out through cables and friction: exact, and a tenth of a second per minute of recording; and how
    /// the links move within each of `windows` of a width. `None` where the motors are not known.
    #[must_use]
    pub fn rolled_out(&self, sights: &[Sight], windows: &[f64], width_s: f64) -> (Vec<Option<Vector3<f64>>>, Vec<Option<LinkMotion>>) {
        let shown = sights.iter().map(|sight| self.model.view.shown_at_s(sight.stamp_s));
        let within = windows.iter().flat_map(|&t| [t - 0.5 * width_s, t, t + 0.5 * width_s]);
        let times: Vec<f64> = shown.chain(within).collect();
        let mut order: Vec<usize> = (0..times.len()).collect();
        order.sort_by(|&a, &b| times[a].total_cmp(&times[b]));
        let sorted: Vec<f64> = order.iter().map(|&k| times[k]).collect();
        let mut states = vec![None; times.len()];
        for (k, state) in order.into_iter().zip(self.links.rollout_gripped(&self.motors, &sorted)) {
            states[k] = state;
        }
        let moving = states.split_off(sights.len());
        let motions = moving.chunks(3).map(|three| match three {
            [Some(before), Some(at), Some(after)] => Some(LinkMotion {
                position: at.position,
                rate: (after.position - before.position) / width_s,
                acceleration: (after.position - at.position * 2.0 + before.position) * (4.0 / (width_s * width_s)),
            }),
            _ => None,
        });
        let motions = motions.collect();
        (self.seen(sights, states), motions)
    }

    /// Predictions with links without inertia, at rest where cables and friction hold them: fifty times as fast, good for slopes.
    #[must_use]
    pub fn settled(&self, sights: &[Sight]) -> Vec<Option<Vector3<f64>>> {
        let free = behind_friction(self.links.arm(), &self.motors);
        let state = |sight: &Sight| {
            let time_s = self.model.view.shown_at_s(sight.stamp_s);
            let (angle, _) = free.at(time_s)?;
            let rate = self.links.arm().transmission.joint_rate_from_motor(&self.motors.steady(time_s)?.rate);
            Some(LinkState::new(self.links.settled(&angle, &Vector3::zeros()), rate))
        };
        self.seen(sights, sights.iter().map(state).collect())
    }

    fn seen(&self, sights: &[Sight], states: Vec<Option<LinkState>>) -> Vec<Option<Vector3<f64>>> {
        let (look, kinematics) = (self.model.view.look(), &self.links.arm().kinematics);
        let seen = |(sight, state): (&Sight, Option<LinkState>)| {
            let state = state?;
            let (tip_m, jacobian) = kinematics.forward_and_jacobian(&state.position);
            look.seen_m(&tip_m, &(jacobian * state.rate), sight.rows)
        };
        sights.iter().zip(states).map(seen).collect()
    }
}
