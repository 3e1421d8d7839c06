//! How a simulation departs from the robot file's model: its tip, its joints and its torque less what the model has for its own motors.

use nalgebra::{Matrix3, Vector3};
use raven::Result;
use raven::camera::Cameras;
use raven::effects::{Channel, TipModel, TorqueModel, held};
use raven::log::{JointSeries, Recording, TipObservation, TipStatus};
use raven::observation::{TipCorrection, three_joints};
use raven::robot::{Arm, Robot};

use crate::evidence::recorded::bench::{Bench, Signs};
use crate::evidence::recorded::data::Data;
use crate::evidence::recorded::rows::Rows;

/// Longest pause that is bridged [s].
const BRIDGED_S: f64 = 0.5;
/// Time between the tips made of a simulation's joints [s].
const JOINTS_S: f64 = 0.02;

/// A quantity of three components over time, linear between samples.
#[derive(Debug, Clone, Default)]
pub(super) struct Series {
    pub time_s: Vec<f64>,
    pub value: Vec<Vector3<f64>>,
    /// Covariances of the values.
    pub covariance: Vec<Matrix3<f64>>,
}

impl Series {
    fn push(&mut self, time_s: f64, value: Vector3<f64>, covariance: Matrix3<f64>) {
        if value.iter().chain(&covariance).all(|v| v.is_finite()) {
            self.time_s.push(time_s);
            self.value.push(value);
            self.covariance.push(covariance);
        }
    }

    /// The first component at a time, over pauses and beyond the ends too; 0 of nothing.
    pub fn held(&self, time_s: f64) -> f64 {
        held(&self.time_s, &self.value, time_s).x
    }

    /// Value and covariance at a time; `None` before the first sample, after the last, and in pauses.
    pub fn at(&self, time_s: f64) -> Option<(Vector3<f64>, Matrix3<f64>)> {
        let after = self.time_s.partition_point(|&t| t < time_s);
        let (t1, v1, c1) = (*self.time_s.get(after)?, *self.value.get(after)?, *self.covariance.get(after)?);
        if t1 == time_s {
            return Some((v1, c1));
        }
        let before = after.checked_sub(1)?;
        let t0 = self.time_s[before];
        let part = (time_s - t0) / (t1 - t0);
        let value = self.value[before] * (1.0 - part) + v1 * part;
        let covariance = self.covariance[before] * (1.0 - part).powi(2) + c1 * part.powi(2);
        (t1 - t0 <= BRIDGED_S).then_some((value, covariance))
    }
}

/// How a simulation departs from the model, channel by channel; times since its own start.
pub(super) struct Deviation {
    /// Tip of an arm [m], at its stamps; `None` where neither tip nor joints were logged.
    pub tip: Option<Series>,
    /// Joints of a bench [rad or m]; `None` where they were not logged.
    pub joints: Option<[Series; 3]>,
    /// Torque of each joint's drive [N m or N]; `None` where it was not logged.
    pub torque: Option<[Series; 3]>,
}

impl Deviation {
    /// Of the simulation of an arm.
    pub fn of_arm(robot: &Robot, cameras: Option<&Cameras>, simulated: &Recording) -> Result<Self> {
        let simulated = with_tips(robot, simulated)?;
        let data = [Data::new(&simulated, cameras)?];
        let rows = Rows::new(robot, cameras, &data)?;
        let [data] = &data;
        let model = rows.model(&[], 0)?;
        let (seen, tensions) = TipModel::new(&model, &data.motors)?.rolled_out(&data.sights, &data.shafts);
        let mut tip = Series::default();
        for (sight, seen) in data.sights.iter().zip(seen) {
            if let Some(seen) = seen {
                tip.push(sight.stamp_s, sight.position_m - seen, sight.covariance_m2);
            }
        }
        let drives = TorqueModel::new(&model)?;
        let mut torque = <[Series; 3]>::default();
        for ((shaft, tension), weight) in data.shafts.iter().zip(tensions).zip(rows.torque_weights(0)) {
            push_counted(&mut torque, shaft.time_s, &drives.lacking(shaft, tension.as_ref()), weight);
        }
        Ok(Self {
            tip: (!tip.time_s.is_empty()).then_some(tip),
            joints: None,
            torque: torque.iter().any(|series| !series.time_s.is_empty()).then_some(torque),
        })
    }

    /// Of the simulation of a bench; torques and joints count as those of the recording do, by its `signs`.
    pub fn of_bench(robot: &Robot, simulated: &Recording, signs: &[Signs]) -> Result<Self> {
        let simulated = std::slice::from_ref(simulated);
        let bench = Bench::new(robot, simulated)?;
        let sign = |of: fn(&Signs) -> f64| Vector3::from_fn(|j, _| signs.get(j).map_or(1.0, of));
        let (joint_sign, torque_sign) = (sign(|s| s.joint), sign(|s| s.torque));
        let errors = bench.errors(&[], &[Channel::Tip, Channel::Torque])?;
        let (mut joints, mut torque) = <([Series; 3], [Series; 3])>::default();
        for (r, recorded) in bench.recordings().iter().enumerate() {
            for ((driven, [joint, lacking, _]), weights) in recorded.driven.iter().zip(&errors[r].0).zip(bench.weights(r)) {
                push_counted(&mut joints, driven.shaft.time_s, &joint.component_mul(&joint_sign), &weights[0]);
                push_counted(&mut torque, driven.shaft.time_s, &lacking.component_mul(&torque_sign), &weights[1]);
            }
        }
        let any = |series: [Series; 3]| series.iter().any(|series| !series.time_s.is_empty()).then_some(series);
        Ok(Self { tip: None, joints: any(joints), torque: any(torque) })
    }

    /// Takes it off a recording, whose times `to_own` turns into its own. Where it is not known the recording then has nothing.
    pub fn take_off(&self, recording: &mut Recording, to_own: &dyn Fn(f64) -> f64, covered: &dyn Fn(f64) -> bool) {
        let start = recording.start;
        for tip in recording.tip.iter_mut().filter(|tip| tip.status == TipStatus::Seen) {
            let stamp_s = to_own(tip.stamp.seconds_since(start));
            match self.tip.as_ref().and_then(|series| series.at(stamp_s)) {
                Some((away, covariance)) => {
                    tip.position_m -= away;
                    tip.covariance_m2 += covariance;
                }
                None => tip.status = TipStatus::Occluded,
            }
        }
        if let Some(series) = recording.joint_encoders.as_mut() {
            let away = |j: usize, time_s: f64| Some(self.joints.as_ref()?.get(j)?.held(to_own(time_s))).filter(|_| covered(time_s));
            subtract(&series.time_s, &mut series.position, &away);
        }
        if let Some(JointSeries { time_s, effort, .. }) = recording.motor.as_mut() {
            *effort = effort.take().zip(self.torque.as_ref()).map(|(mut effort, torque)| {
                // Near rest torque says nothing of either: what is known before and after stands in, for the other joints' sake.
                subtract(time_s, &mut effort, &|j, time_s| covered(time_s).then(|| torque[j].held(to_own(time_s))));
                effort
            });
        }
    }
}

/// Takes `away` off `values[joint][sample]`; NaN where it is not known.
fn subtract(time_s: &[f64], values: &mut [Vec<f64>], away: &dyn Fn(usize, f64) -> Option<f64>) {
    for (j, values) in values.iter_mut().enumerate().take(3) {
        values.iter_mut().zip(time_s).for_each(|(value, &t)| *value -= away(j, t).unwrap_or(f64::NAN));
    }
}

/// Near rest the direction of friction is in doubt, and with it what the model needs and how far its cables stretch.
fn push_counted(torque: &mut [Series; 3], time_s: f64, lacking: &Vector3<f64>, weight: &Vector3<f64>) {
    for (j, series) in torque.iter_mut().enumerate() {
        if weight[j] > 0.0 {
            series.push(time_s, Vector3::repeat(lacking[j]), Matrix3::zeros());
        }
    }
}

/// A simulation that logs its joints and no tip has the tip where the kinematics of the robot file have it, seen as images would show it.
pub(super) fn with_tips(robot: &Robot, simulated: &Recording) -> Result<Recording> {
    let mut simulated = simulated.clone();
    if let (true, Some(joints)) = (simulated.tip.is_empty(), simulated.joint_encoders.clone()) {
        let arm = robot.arm()?;
        simulated.tip = tips(robot, &arm, &simulated, &joints)?;
    }
    Ok(simulated)
}

fn tips(robot: &Robot, arm: &Arm, simulated: &Recording, joints: &JointSeries) -> Result<Vec<TipObservation>> {
    let correction = TipCorrection::of(robot, arm)?;
    let mut tips: Vec<TipObservation> = Vec::new();
    let mut due_s = f64::NEG_INFINITY;
    for (&time_s, joint) in joints.time_s.iter().zip(three_joints(joints, simulated)?) {
        if time_s < due_s {
            continue;
        }
        due_s = time_s + JOINTS_S;
        tips.push(TipObservation {
            stamp: simulated.start.plus_seconds(time_s + robot.observation.latency),
            frame_id: String::new(),
            status: TipStatus::Seen,
            left_px: [f64::NAN; 2],
            right_px: [f64::NAN; 2],
            position_m: correction.seen_m(&arm.kinematics.forward(&joint)),
            covariance_m2: Matrix3::zeros(),
        });
    }
    Ok(tips)
}
