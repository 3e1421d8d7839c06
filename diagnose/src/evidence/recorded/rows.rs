//! Whitened residuals of recordings against a model: three per tip, one per joint and torque sample.

use std::sync::Arc;

use nalgebra::Vector3;
use raven::Result;
use raven::camera::Cameras;
use raven::effects::{Channel, Measure, Model, Need, Scale, Shaft, Sited, TipModel, TorqueModel, WhereKnown};
use raven::robot::{Arm, LinkModel, Robot};

use super::data::{Data, miscounts};
use super::settings::{Setting, of_recording};
use super::tensions::Remembered;
use super::torques::{Loose, commanded_per_delivered, dry_friction, torque_weights, with_clipping};

/// How many times the dry friction that was assumed makes a difference to how far torque is in doubt near rest.
const MORE_FRICTION: f64 = 1.5;

/// Shortest step that a hypothesis may ask of the links, as a part of the nominal model's. The library's dampers go to ten times the file's; a fit
/// that has lost its way makes them a hundred times as large, whose fast motion shows in no recording and takes as much longer to follow.
const STEP_MIN: f64 = 0.1;
/// Sights of a block: two seconds at fifteen a second. One second of thirty, as two leave few blocks of a recording, and what is alike over
/// time then passes for more than it is: a soft cable was named beside a pair of which there were 46 s.
const SIGHTS_OF_BLOCK: usize = 30;
/// So many miscounts of an encoder are looked at, the farthest.
const MISCOUNTS_MAX: usize = 5;

/// Recordings of one robot, and how much each residual weighs.
#[derive(Clone)]
pub struct Rows<'a> {
    robot: &'a Robot,
    cameras: Option<&'a Cameras>,
    data: &'a [Data],
    /// Per recording, what whitens each sight.
    whiten: Vec<Vec<nalgebra::Matrix3<f64>>>,
    /// Inverse deviations of each torque sample; 0 where it says nothing.
    torque_weight: Vec<Vec<Vector3<f64>>>,
    /// Per recording, from when on the past no longer shows.
    loose: Vec<Loose>,
    /// Whose friction near rest is in doubt.
    rubbing: Arm,
    /// Shortest step [s] that links may need.
    step_min_s: f64,
    /// When each joint's encoder miscounts, as parts of a recording.
    miscounts: [Vec<f64>; 3],
    tensions: Remembered,
}

/// How the links follow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Links {
    /// Through their equations of motion.
    RolledOut,
    /// At rest at every instant.
    Settled,
}

/// By how much deviations are larger than stated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inflation {
    /// Of tips.
    pub tip: f64,
    /// Of each joint's torque.
    pub torque: Vector3<f64>,
}

/// Recordings as hypotheses see them.
pub trait Observed: Sync {
    /// The nominal robot.
    fn robot(&self) -> &Robot;

    /// How many there are: each begins as the motion before it left the robot.
    fn recordings(&self) -> usize;

    /// Rows of tips (on a bench: of joint encoders), three per sight, before those of torques.
    fn tip_rows(&self) -> usize;

    /// Rows of torques, three per sample.
    fn torque_rows(&self) -> usize;

    /// Rows of tips in a block of time.
    fn tip_block(&self) -> usize;

    /// What an effect's sizes are measured in.
    fn measure(&self, sited: &Sited) -> Measure {
        sited.measure
    }

    /// Why an effect could not show whatever the recordings were, if so.
    fn cannot_show(&self, sited: &Sited) -> Option<&'static str>;

    /// When the encoder of a joint miscounts, as parts of a recording, as far as it can be seen in its readings alone.
    fn miscounts(&self, _joint: usize) -> &[f64] {
        &[]
    }

    /// Whitened measured less predicted with effects built in; rolled out or, fifty times as fast, settled. Channels that are not asked
    /// for are zero, as are rows that say nothing.
    ///
    /// # Errors
    /// If the robot does not fit the recordings.
    fn residuals(&self, settings: &[Setting], links: Links, channels: &[Channel]) -> Result<Vec<f64>>;

    /// Residuals less others, in these channels, and zero elsewhere.
    fn less(&self, residuals: &[f64], others: &[f64], channels: &[Channel]) -> Vec<f64> {
        let channel = |row: usize| if row < self.tip_rows() { Channel::Tip } else { Channel::Torque };
        let less = |(row, (r, other)): (usize, (&f64, &f64))| if channels.contains(&channel(row)) { r - other } else { 0.0 };
        residuals.iter().zip(others).enumerate().map(less).collect()
    }
}

/// Both channels.
pub const ALL: [Channel; 2] = [Channel::Tip, Channel::Torque];

impl<'a> Rows<'a> {
    /// Of recordings.
    ///
    /// # Errors
    /// If the robot is no arm.
    pub fn new(robot: &'a Robot, cameras: Option<&'a Cameras>, data: &'a [Data]) -> Result<Self> {
        let arm = robot.arm()?;
        let loose: Vec<Loose> = data.iter().map(|data| Loose::new(&arm, &data.motors)).collect();
        let whiten = |(data, loose): (&Data, &Loose)| {
            let factor = |s: &raven::effects::Sight| {
                let factor = s.covariance_m2.cholesky().filter(|_| s.stamp_s >= loose.links_s).and_then(|c| c.l().try_inverse());
                factor.unwrap_or_else(nalgebra::Matrix3::zeros)
            };
            data.sights.iter().map(factor).collect()
        };
        let whiten = data.iter().zip(&loose).map(whiten).collect();
        let miscounts = [0, 1, 2].map(|j| data.iter().flat_map(|data| miscounts(&data.motors, j, MISCOUNTS_MAX)).collect());
        let step_min_s = STEP_MIN * LinkModel::new(arm.clone()).step_max_s();
        let (torque_weight, tensions) = (Vec::new(), Remembered::default());
        let mut rows = Self { robot, cameras, data, whiten, torque_weight, loose, rubbing: arm, step_min_s, miscounts, tensions };
        rows.torque_weight = rows.weighed(&rows.rubbing);
        Ok(rows)
    }

    /// The same with torque samples near rest in as much doubt as the dry friction with these effects asks for; `None` where that is hardly
    /// more than was assumed.
    ///
    /// # Errors
    /// If the robot is no arm.
    pub fn reweighted(&self, settings: &[Setting]) -> Result<Option<Self>> {
        let arm = self.model(settings, 0)?.robot.arm()?;
        let shafts = || self.data.iter().flat_map(|data| &data.shafts);
        let friction = |of: &Arm| shafts().map(|shaft| dry_friction(of, shaft)).sum::<Vector3<f64>>();
        let (found, assumed) = (friction(&arm), friction(&self.rubbing));
        if (0..3).all(|j| found[j] <= MORE_FRICTION * assumed[j]) {
            return Ok(None);
        }
        Ok(Some(Self { torque_weight: self.weighed(&arm), rubbing: arm, ..self.clone() }))
    }

    /// Inverse deviations of torque samples where the friction of `arm` is what is in doubt near rest.
    fn weighed(&self, arm: &Arm) -> Vec<Vec<Vector3<f64>>> {
        let recordings = self.data.iter().zip(&self.loose);
        recordings.map(|(data, loose)| torque_weights(self.robot, arm, &data.shafts, loose)).collect()
    }

    /// The same with part of the rows counting less: each sight and torque sample's deviations are multiplied by what `inflation` says of
    /// its recording and time [s]; an infinite one takes it out.
    #[must_use]
    pub fn inflated(&self, inflation: impl Fn(usize, f64) -> Inflation) -> Self {
        let mut rows = self.clone();
        for (r, data) in self.data.iter().enumerate() {
            for (sight, whiten) in data.sights.iter().zip(&mut rows.whiten[r]) {
                *whiten /= inflation(r, sight.stamp_s).tip;
            }
            for (shaft, weight) in data.shafts.iter().zip(&mut rows.torque_weight[r]) {
                *weight = weight.component_div(&inflation(r, shaft.time_s).torque);
            }
        }
        rows
    }

    /// Recordings.
    #[must_use]
    pub fn data(&self) -> &'a [Data] {
        self.data
    }

    /// Inverse deviations of each torque sample of a recording; 0 where it says nothing.
    #[must_use]
    pub fn torque_weights(&self, recording: usize) -> &[Vector3<f64>] {
        &self.torque_weight[recording]
    }

    /// The nominal model with effects built in, as a recording begins.
    ///
    /// # Errors
    /// If the robot is no arm.
    pub fn model(&self, settings: &[Setting], recording: usize) -> Result<Model> {
        Model::with_effects(self.robot, self.cameras, &of_recording(settings, recording))
    }
}

impl Observed for Rows<'_> {
    fn robot(&self) -> &Robot {
        self.robot
    }

    fn recordings(&self) -> usize {
        self.data.len()
    }

    fn tip_rows(&self) -> usize {
        3 * self.data.iter().map(|data| data.sights.len()).sum::<usize>()
    }

    fn torque_rows(&self) -> usize {
        3 * self.data.iter().map(|data| data.shafts.len()).sum::<usize>()
    }

    fn tip_block(&self) -> usize {
        3 * SIGHTS_OF_BLOCK
    }

    fn cannot_show(&self, sited: &Sited) -> Option<&'static str> {
        let needs_lenses = self.tip_rows() > 0 && sited.effect.needs.contains(&Need::Lenses);
        let lacking = match self.cameras {
            None => Some("the cameras are not known; give --cameras"),
            Some(cameras) if cameras.base_from_left.is_none() => {
                Some("the cameras are not registered to the robot; run raven-calibrate register")
            }
            Some(_) => None,
        };
        lacking.filter(|_| needs_lenses).or_else(|| unlike_several(sited, self.data.len()))
    }

    fn miscounts(&self, joint: usize) -> &[f64] {
        &self.miscounts[joint]
    }

    fn residuals(&self, settings: &[Setting], links: Links, channels: &[Channel]) -> Result<Vec<f64>> {
        let models = (0..self.data.len()).map(|recording| self.model(settings, recording)).collect::<Result<Vec<_>>>()?;
        let torques = models.iter().map(TorqueModel::new).collect::<Result<Vec<_>>>()?;
        let lost = || Ok(vec![f64::INFINITY; self.tip_rows() + self.torque_rows()]);
        let mut rows = Vec::with_capacity(self.tip_rows() + self.torque_rows());
        let tensions = if channels == [Channel::Torque] {
            let take = || Ok(self.followed(&models, &torques, links, channels)?.map(|(_, tensions)| tensions));
            let Some(tensions) = self.tensions.or_take(settings, links, take)? else { return lost() };
            tensions
        } else {
            let Some((seen, tensions)) = self.followed(&models, &torques, links, channels)? else { return lost() };
            rows.extend(self.of_tips(&seen, links));
            Arc::new(tensions)
        };
        rows.resize(self.tip_rows(), 0.0);
        if channels.contains(&Channel::Torque) {
            rows.extend(self.of_torques(&torques, &tensions));
        }
        rows.resize(self.tip_rows() + self.torque_rows(), 0.0);
        Ok(rows)
    }
}

impl Rows<'_> {
    /// Per recording, tips as the cameras should see them and tensions of the cables, in the channels that are asked for; `None` where links take
    /// too short a step to be followed.
    fn followed(
        &self,
        models: &[Model],
        torques: &[TorqueModel],
        links: Links,
        channels: &[Channel],
    ) -> Result<Option<(Vec<WhereKnown>, Vec<WhereKnown>)>> {
        let [with_tip, with_torque] = ALL.map(|channel| channels.contains(&channel));
        let (mut tips, mut tensions) = (Vec::with_capacity(self.data.len()), Vec::with_capacity(self.data.len()));
        for ((data, model), torque) in self.data.iter().zip(models).zip(torques) {
            let sights = if with_tip { data.sights.as_slice() } else { &[] };
            let shafts = if with_torque { data.shafts.as_slice() } else { &[] };
            let motors = if links == Links::RolledOut { &data.motors } else { &data.motors_at_rest };
            let tip = TipModel::new(model, motors)?;
            let (seen, tension) = match links {
                Links::RolledOut if tip.step_max_s() < self.step_min_s => return Ok(None),
                Links::RolledOut => tip.rolled_out(sights, shafts),
                Links::Settled => {
                    let dragged = tip.dragged();
                    let tension = |shaft: &Shaft| Some(torque.dragged_n(shaft, &dragged.drag_about(shaft.time_s, 0.5 * shaft.window_s)?));
                    (tip.settled(sights, &dragged), shafts.iter().map(tension).collect())
                }
            };
            tips.push(seen);
            tensions.push(tension);
        }
        Ok(Some((tips, tensions)))
    }

    /// Whitened measured tips less those that should be seen.
    fn of_tips(&self, seen: &[WhereKnown], links: Links) -> Vec<f64> {
        // A motion that does not stay finite explains nothing; slopes have nothing to say where there is no prediction.
        let lost = if links == Links::RolledOut { f64::INFINITY } else { 0.0 };
        let mut rows = Vec::with_capacity(self.tip_rows());
        for ((data, whiten), seen) in self.data.iter().zip(&self.whiten).zip(seen) {
            for ((sight, whiten), seen) in data.sights.iter().zip(whiten).zip(seen) {
                let row = seen.map_or_else(Vector3::zeros, |seen| whiten * (sight.position_m - seen));
                rows.extend(row.iter().map(|v| if v.is_finite() { *v } else { lost }));
            }
        }
        rows
    }

    /// Whitened torques delivered less those needed while the cables pull.
    fn of_torques(&self, torques: &[TorqueModel], tensions: &[WhereKnown]) -> Vec<f64> {
        let mut rows = Vec::with_capacity(self.torque_rows());
        for (((data, torque), weights), tensions) in self.data.iter().zip(torques).zip(&self.torque_weight).zip(tensions) {
            let shafts = &data.shafts;
            let delivered: Vec<Vector3<f64>> = shafts.iter().map(|shaft| torque.delivered(&shaft.commanded)).collect();
            let per_delivered =
                commanded_per_delivered(shafts.iter().map(|shaft| shaft.commanded.mean()).zip(delivered.iter().copied()), weights);
            for (((shaft, weight), tension), delivered) in shafts.iter().zip(weights).zip(tensions).zip(delivered) {
                let tension_n = tension.unwrap_or_else(|| torque.rigid_n(shaft));
                let lacking = delivered - torque.needed(shaft, &tension_n);
                let whitened = lacking.component_mul(weight).component_mul(&per_delivered);
                rows.extend(whitened.zip_map(&torque.clipped(&shaft.commanded), with_clipping).iter());
            }
        }
        rows
    }
}

/// Why an effect cannot show in so many recordings at once, if it happens at a moment.
pub(super) fn unlike_several(sited: &Sited, recordings: usize) -> Option<&'static str> {
    let happens = sited.effect.parameters.iter().any(|parameter| parameter.scale == Scale::Moment);
    (recordings > 1 && happens).then_some("it happens in one recording and not in the others; give each alone")
}

#[cfg(test)]
mod tests {
    use raven::effects::Command;
    use raven::robot::{MotorTrack, nominal};

    use super::super::data::WINDOW_S;
    use super::super::torques::CREEP_RAD_S;
    use super::*;

    /// A recording without tips of joints that begin to swing at such times [s].
    fn swinging(robot: &Robot, begins_s: [f64; 3], lasts_s: f64) -> Data {
        const AMPLITUDES: [f64; 3] = [0.3, 0.3, 0.05];
        let transmission = robot.arm().unwrap().transmission;
        let swing = |t: f64, j: usize| AMPLITUDES[j] * (3.0 * (t - begins_s[j]).max(0.0)).sin();
        let joint = |t: f64| Vector3::new(0.8, 1.6, 0.35) + Vector3::from_fn(|j, _| swing(t, j));
        let time_s: Vec<f64> = (0..(lasts_s * 1e3) as usize).map(|k| 1e-3 * k as f64).collect();
        let motors = MotorTrack { angle: time_s.iter().map(|&t| transmission.motor_from_joint(&joint(t))).collect(), time_s };
        let shaft = |k: usize| {
            let [before, now, after] = [k - 1, k, k + 1].map(|k| motors.angle[k]);
            let (rate, acceleration) = ((after - before) / 2e-3, (after - now * 2.0 + before) / 1e-6);
            Shaft {
                time_s: motors.time_s[k],
                angle: now,
                rate,
                acceleration,
                commanded: Command::steady(Vector3::repeat(0.01)),
                window_s: WINDOW_S,
            }
        };
        let shafts: Vec<Shaft> = (20..motors.time_s.len() - 20).step_by(20).map(shaft).collect();
        Data::of(&motors, Vec::new(), shafts)
    }

    #[test]
    fn tensions_are_remembered_for_what_leaves_them_as_they_are() {
        let robot = nominal::gold();
        let data = [swinging(&robot, [0.0; 3], 4.0)];
        let rows = Rows::new(&robot, None, &data).unwrap();
        let all = Sited::all(&robot);
        let at = |sited: &Sited, u: f64| (*sited, vec![u; sited.effect.parameters.len()]);
        let soft = at(all.iter().find(|sited| sited.effect.id == "cable-stretch" && sited.place.first == 1).unwrap(), -0.5);
        for links in [Links::Settled, Links::RolledOut] {
            for sited in all.iter().filter(|sited| sited.effect.channels.contains(&Channel::Torque)) {
                for settings in [vec![at(sited, 0.6)], vec![soft.clone(), at(sited, 0.6)], vec![soft.clone()], Vec::new()] {
                    let [alone, whole] = [&[Channel::Torque], ALL.as_slice()].map(|of| rows.residuals(&settings, links, of).unwrap());
                    assert_eq!(alone, whole, "{} {} by {links:?}", sited.effect.id, settings.len());
                }
            }
        }
    }

    #[test]
    fn no_damper_is_followed_that_is_far_larger_than_any_of_the_library() {
        let robot = nominal::gold();
        let angle = robot.arm().unwrap().transmission.motor_from_joint(&Vector3::new(0.8, 1.6, 0.35));
        let time_s: Vec<f64> = (0..500).map(|k| 1e-3 * f64::from(k)).collect();
        let shaft = |&time_s: &f64| Shaft {
            time_s,
            angle,
            rate: Vector3::zeros(),
            acceleration: Vector3::zeros(),
            commanded: Command::steady(Vector3::repeat(0.01)),
            window_s: WINDOW_S,
        };
        let shafts = time_s[50..450].iter().step_by(20).map(shaft).collect();
        let data = [Data::of(&MotorTrack { angle: vec![angle; time_s.len()], time_s }, Vec::new(), shafts)];
        let rows = Rows::new(&robot, None, &data).unwrap();
        let is_damper = |sited: &Sited| sited.effect.id == "cable-damping" && sited.place.first == 2;
        let damper = Sited::all(&robot).into_iter().find(is_damper).unwrap();
        let parameter = &damper.effect.parameters[0];
        let with = |factor: f64| {
            let settings = [(damper, vec![parameter.u(factor, damper.measure)])];
            rows.residuals(&settings, Links::RolledOut, &ALL).unwrap()
        };
        assert!(with(10.0).iter().all(|r| r.is_finite()));
        assert!(with(100.0).iter().all(|r| r.is_infinite()));
    }

    #[test]
    fn a_miscount_is_not_looked_for_in_several_recordings() {
        let robot = nominal::gold();
        let angle = robot.arm().unwrap().transmission.motor_from_joint(&Vector3::new(0.8, 1.6, 0.35));
        let motors = MotorTrack { time_s: (0..500).map(|k| 1e-2 * f64::from(k)).collect(), angle: vec![angle; 500] };
        let data = || Data::of(&motors, Vec::new(), Vec::new());
        let miscount = Sited::all(&robot).into_iter().find(|sited| sited.effect.id == "missed-counts").unwrap();
        for (data, because) in [(vec![data()], None), (vec![data(), data()], Some("give each alone"))] {
            let rows = Rows::new(&robot, None, &data).unwrap();
            let said = rows.cannot_show(&miscount);
            assert!(said.is_some() == because.is_some() && said.unwrap_or_default().contains(because.unwrap_or_default()), "{said:?}");
        }
    }

    #[test]
    fn torque_says_nothing_until_links_are_loose_from_where_friction_held_them() {
        // When each joint begins to swing [s]: the recording cannot spare the time until the insertion does.
        const BEGINS_S: [f64; 3] = [0.5, 2.0, 10.0];
        let robot = nominal::gold();
        let data = [swinging(&robot, BEGINS_S, 30.0)];
        let rows = Rows::new(&robot, None, &data).unwrap();
        let first_s = [0, 1, 2].map(|j| {
            let counts = data[0].shafts.iter().zip(rows.torque_weights(0)).find(|(_, weight)| weight[j] > 0.0);
            counts.unwrap().0.time_s
        });
        for (j, from_s) in [2.0, 2.0, 10.0].into_iter().enumerate() {
            assert!((from_s..from_s + 0.5).contains(&first_s[j]), "joint {j} counts from {} s", first_s[j]);
        }
        // The insertion's motor turns before, as its cable runs over the other joints' pulleys.
        assert!(data[0].shafts.iter().any(|shaft| shaft.time_s < 9.0 && shaft.rate[2].abs() > 2.0 * CREEP_RAD_S));
    }
}
