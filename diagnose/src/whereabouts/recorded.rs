//! Channels of recordings: motor torque, joints, and the tip in pixels or metres.
//!
//! The motor's motion is no channel of its own: torque minus what the motion needs is the same residual before it is integrated twice, and
//! unlike its integral it stays where it arose.

use nalgebra::{Matrix3, Vector2, Vector3};
use raven::Result;
use raven::camera::{Cameras, Pinhole};
use raven::effects::{Model, Shaft, Stage, TipModel, TorqueModel};
use raven::log::{Recording, TipObservation, TipStatus};
use raven::robot::{Arm, Joint, MotorTrack, Robot};
use raven::stats::{median, rms};

use super::{Channel, Kind, Track};
use crate::evidence::data::Data;
use crate::phase::{Phase, phases};
use crate::residual::{self, Residuals};

/// Denser residuals are averaged over so long [s]: more samples say no more about motions of a few hertz.
const AVERAGED_S: f64 = 0.02;
/// Torque samples this far apart share no motor sample [s].
const TORQUE_STRIDE_S: f64 = crate::evidence::data::WINDOW_S;
/// What a model of rigid links and dry friction is good for, as part of the torque commanded [1].
const TORQUE_MODEL: f64 = 0.02;
/// Slowest motor at which the direction of its friction is beyond doubt [rad/s]; slower, the torque that a model asks for is arbitrary.
const SLOWEST_RAD_S: f64 = 1.0;
/// Root mean square of the third difference of white noise with unit deviation, squared: 1 + 9 + 9 + 1.
const THIRD_DIFFERENCE: f64 = 20.0;
/// Median of the magnitude of a normal deviate.
const MEDIAN_MAGNITUDE: f64 = 0.674_49;

/// All channels that recordings offer; `residuals` are those of the joints, recording by recording.
///
/// # Errors
/// If a recording has no motor angles, or the model cannot be built.
pub fn recorded(
    robot: &Robot,
    cameras: Option<&Cameras>,
    recordings: &[Recording],
    residuals: &[residual::Channels],
) -> Result<Vec<Channel>> {
    let joint_channel = |joint: &Joint, stage, name: String, unit, scale| Channel {
        stage,
        joint: Some(joint.name.clone()),
        name,
        unit,
        scale,
        position_unit: joint.display_unit().0,
        tracks: Vec::new(),
    };
    let mut joints: Vec<Channel> = Vec::new();
    let mut torques: Vec<Channel> = Vec::new();
    for joint in &robot.joints {
        let (unit, scale) = joint.display_unit();
        joints.push(joint_channel(joint, Stage::Transmission, joint.name.clone(), unit, scale));
        torques.push(joint_channel(joint, Stage::Motor, format!("{} torque", joint.name), "N m", 1.0));
    }
    let arm = robot.arm().ok();
    let seen_in_pixels = pixels_known(cameras, recordings);
    let mut tips = tip_channels(seen_in_pixels.is_some());
    for (recording, residuals) in recordings.iter().zip(residuals) {
        let ninths = seen_in_pixels.map_or_else(Vec::new, |cameras| ninths(recording, &cameras.left, robot.observation.latency));
        for (j, (channel, residuals)) in joints.iter_mut().zip(&residuals.joints).enumerate() {
            channel.tracks.push(match &arm {
                Some(arm) => joint_track(arm, &robot.joints[j], j, &recording.motor_track()?, residuals, &ninths),
                None => bench_track(recording, &robot.joints[j], j, &averaged(residuals))?,
            });
        }
        if let Some(arm) = &arm {
            let (model, data) = (Model::new(robot, cameras)?, Data::new(recording, cameras)?);
            let model_of_torque = TorqueModel::new(&model)?;
            for (j, channel) in torques.iter_mut().enumerate() {
                channel.tracks.push(torque_track(arm, &robot.joints[j], j, &model_of_torque, &data.shafts));
            }
            let tracks = tip_tracks(&model, arm, &data, recording, seen_in_pixels, &ninths)?;
            tips.iter_mut().zip(tracks).for_each(|(channel, track)| channel.tracks.push(track));
        }
    }
    let mut all = [torques, joints, tips].concat();
    all.iter_mut().for_each(|channel| channel.tracks.retain(|track| !track.error.is_empty()));
    all.retain(|channel| !channel.tracks.is_empty());
    Ok(all)
}

/// The cameras, where they are registered and every tip came with its pixels.
fn pixels_known<'a>(cameras: Option<&'a Cameras>, recordings: &[Recording]) -> Option<&'a Cameras> {
    let with_pixels = |tip: &TipObservation| tip.left_px.iter().chain(&tip.right_px).all(|v| v.is_finite());
    let all = recordings.iter().all(|recording| seen(recording).all(with_pixels));
    cameras.filter(|cameras| all && cameras.base_from_left.is_some())
}

fn seen(recording: &Recording) -> impl Iterator<Item = &TipObservation> {
    recording.tip.iter().filter(|tip| tip.status == TipStatus::Seen)
}

fn tip_channels(pixels: bool) -> Vec<Channel> {
    let (names, unit, scale): (&[&str], _, _) =
        if pixels { (&["left u", "left v", "right u", "right v"], "px", 1.0) } else { (&["tip x", "tip y", "tip z"], "mm", 1e3) };
    let channel = |name: &&str| Channel {
        stage: if pixels { Stage::Camera } else { Stage::Kinematics },
        joint: None,
        name: (*name).to_owned(),
        unit,
        scale,
        position_unit: "mm",
        tracks: Vec::new(),
    };
    names.iter().map(channel).collect()
}

/// When the left image showed the tip in which ninth of it [s, 0 to 8].
fn ninths(recording: &Recording, left: &Pinhole, latency_s: f64) -> Vec<(f64, f64)> {
    let third = |pixel: f64, size: u32| (3.0 * (pixel + 0.5) / f64::from(size)).floor().clamp(0.0, 2.0);
    let ninth = |tip: &TipObservation| third(tip.left_px[0], left.width) + 3.0 * third(tip.left_px[1], left.height);
    seen(recording).map(|tip| (tip.stamp.seconds_since(recording.start) - latency_s, ninth(tip))).collect()
}

fn ninth_at(ninths: &[(f64, f64)], time_s: f64) -> f64 {
    let at = ninths.partition_point(|(t, _)| *t < time_s - 1e-6);
    ninths.get(at).filter(|(t, _)| (t - time_s).abs() < 1e-3).map_or(f64::NAN, |(_, ninth)| *ninth)
}

fn phase_factor(time_s: &[f64], rate: &[f64]) -> Vec<f64> {
    let index = |phase: &Phase| Phase::ALL.iter().position(|p| p == phase).map_or(f64::NAN, |k| k as f64);
    phases(time_s, rate).iter().map(index).collect()
}

/// What an arm's joint may depend on, from the motors at `time_s`.
fn joint_factors(
    arm: &Arm,
    joint: &Joint,
    j: usize,
    motors: &[Option<Vector3<f64>>],
    time_s: &[f64],
    rate: &[f64],
) -> Vec<(Kind, Vec<f64>)> {
    let (_, scale) = joint.display_unit();
    let per_sample = |of: &dyn Fn(&Vector3<f64>) -> f64| motors.iter().map(|m| m.as_ref().map_or(f64::NAN, of)).collect::<Vec<f64>>();
    vec![
        (Kind::Phase, phase_factor(time_s, rate)),
        (Kind::Speed, rate.iter().map(|r| r.abs() * scale).collect()),
        (Kind::Load, per_sample(&|m| arm.dynamics.bias(&arm.transmission.joint_from_motor(m), &Vector3::zeros())[j])),
        (Kind::Position, per_sample(&|m| arm.transmission.joint_from_motor(m)[j] * scale)),
        (Kind::Capstan, per_sample(&|m| turn(m[j], joint))),
    ]
}

fn turn(motor: f64, joint: &Joint) -> f64 {
    (motor / joint.gear_ratio / std::f64::consts::TAU).rem_euclid(1.0)
}

fn joint_track(arm: &Arm, joint: &Joint, j: usize, motor: &MotorTrack, residuals: &Residuals, ninths: &[(f64, f64)]) -> Track {
    let motors: Vec<Option<Vector3<f64>>> = residuals.time_s.iter().map(|&t| motor.at(t).map(|(angle, _)| angle)).collect();
    let mut factors = joint_factors(arm, joint, j, &motors, &residuals.time_s, &residuals.rate);
    factors.push((Kind::Image, residuals.time_s.iter().map(|&t| ninth_at(ninths, t)).collect()));
    Track { time_s: residuals.time_s.clone(), error: residuals.error.clone(), noise: residuals.noise.clone(), factors }
}

fn bench_track(recording: &Recording, joint: &Joint, j: usize, residuals: &Residuals) -> Result<Track> {
    let motor = recording.require_motor()?;
    let (_, scale) = joint.display_unit();
    let angles: Vec<f64> = residuals.time_s.iter().map(|&t| motor.interpolate(j, t).unwrap_or(f64::NAN)).collect();
    let factors = vec![
        (Kind::Phase, phase_factor(&residuals.time_s, &residuals.rate)),
        (Kind::Speed, residuals.rate.iter().map(|r| r.abs() * scale).collect()),
        (Kind::Position, angles.iter().map(|a| (joint.hard_stop + a / joint.ratio()) * scale).collect()),
        (Kind::Capstan, angles.iter().map(|&a| turn(a, joint)).collect()),
    ];
    Ok(Track { time_s: residuals.time_s.clone(), error: residuals.error.clone(), noise: residuals.noise.clone(), factors })
}

/// Means over [`AVERAGED_S`] of residuals that are denser.
fn averaged(residuals: &Residuals) -> Residuals {
    let steps: Vec<f64> = residuals.time_s.windows(2).map(|w| w[1] - w[0]).collect();
    if median(&steps).is_none_or(|step| step > 0.5 * AVERAGED_S) {
        return residuals.clone();
    }
    let mut all = Residuals::default();
    let mut from = 0;
    while let Some(&start) = residuals.time_s.get(from) {
        let to = residuals.time_s.partition_point(|&t| t < start + AVERAGED_S).max(from + 1);
        let count = (to - from) as f64;
        let mean = |column: &[f64]| column[from..to].iter().sum::<f64>() / count;
        all.time_s.push(mean(&residuals.time_s));
        all.error.push(mean(&residuals.error));
        all.rigid_error.push(mean(&residuals.rigid_error));
        all.noise.push(mean(&residuals.noise) / count.sqrt());
        all.rate.push(mean(&residuals.rate));
        from = to;
    }
    all
}

/// Torque delivered less torque needed where the direction of friction is beyond doubt.
fn torque_track(arm: &Arm, joint: &Joint, j: usize, model: &TorqueModel, shafts: &[Shaft]) -> Track {
    let mut apart: Vec<&Shaft> = Vec::new();
    for shaft in shafts {
        if apart.last().is_none_or(|last| shaft.time_s - last.time_s >= 0.999 * TORQUE_STRIDE_S) {
            apart.push(shaft);
        }
    }
    let all_time_s: Vec<f64> = apart.iter().map(|s| s.time_s).collect();
    let rates: Vec<f64> = apart.iter().map(|s| arm.transmission.joint_rate_from_motor(&s.rate)[j]).collect();
    let residual: Vec<f64> = apart.iter().map(|s| (model.delivered(&s.commanded) - model.needed(s))[j]).collect();
    let commanded: Vec<f64> = apart.iter().map(|s| s.commanded[j]).collect();
    let noise = white_noise(&residual).hypot(TORQUE_MODEL * rms(&commanded).unwrap_or(0.0));
    let motors: Vec<Option<Vector3<f64>>> = apart.iter().map(|s| Some(s.angle)).collect();
    let factors = joint_factors(arm, joint, j, &motors, &all_time_s, &rates);
    let moving = |s: &Shaft| s.rate[j].abs() > SLOWEST_RAD_S + 0.5 * TORQUE_STRIDE_S * s.acceleration[j].abs();
    let kept: Vec<usize> = (0..apart.len()).filter(|&k| moving(apart[k])).collect();
    let pick = |column: &[f64]| kept.iter().map(|&k| column[k]).collect::<Vec<f64>>();
    Track {
        time_s: pick(&all_time_s),
        error: pick(&residual),
        noise: vec![noise; kept.len()],
        factors: factors.iter().map(|(kind, values)| (*kind, pick(values))).collect(),
    }
}

/// Deviation of the white part of a series, from the median of its third differences: what is smooth, and rare steps, leave it alone.
fn white_noise(values: &[f64]) -> f64 {
    let third: Vec<f64> = values.windows(4).map(|w| (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]).abs()).collect();
    median(&third).map_or(0.0, |m| m / MEDIAN_MAGNITUDE / THIRD_DIFFERENCE.sqrt())
}

/// Tip residuals: left u, left v, right u, right v [px] where pixels are known, else x, y, z [m].
fn tip_tracks(
    model: &Model,
    arm: &Arm,
    data: &Data,
    recording: &Recording,
    cameras: Option<&Cameras>,
    ninths: &[(f64, f64)],
) -> Result<Vec<Track>> {
    if data.sights.is_empty() {
        return Ok(Vec::new());
    }
    let mut tracks = vec![Track::default(); if cameras.is_some() { 4 } else { 3 }];
    let (mut speed, mut ninth) = (Vec::new(), Vec::new());
    let predicted = TipModel::new(model, &data.motors)?.rolled_out(&data.sights);
    let observed: std::collections::BTreeMap<i64, &TipObservation> =
        seen(recording).map(|tip| (nanoseconds(tip.stamp.seconds_since(recording.start)), tip)).collect();
    for (sight, predicted_m) in data.sights.iter().zip(predicted) {
        let shown_s = model.view.shown_at_s(sight.stamp_s);
        let Some((predicted_m, (angle, rate))) = predicted_m.zip(data.motors.at(shown_s)) else { continue };
        let rows = match cameras {
            Some(cameras) => {
                observed.get(&nanoseconds(sight.stamp_s)).and_then(|tip| pixel_residuals(cameras, tip, &predicted_m, &sight.covariance_m2))
            }
            None => Some((0..3).map(|k| (sight.position_m[k] - predicted_m[k], sight.covariance_m2[(k, k)].sqrt())).collect()),
        };
        let Some(rows) = rows else { continue };
        let joint = arm.transmission.joint_from_motor(&angle);
        speed.push((arm.kinematics.jacobian(&joint) * arm.transmission.joint_rate_from_motor(&rate)).norm() * 1e3);
        ninth.push(ninth_at(ninths, shown_s));
        for (track, (error, noise)) in tracks.iter_mut().zip(rows) {
            track.time_s.push(shown_s);
            track.error.push(error);
            track.noise.push(noise);
        }
    }
    for track in &mut tracks {
        track.factors =
            vec![(Kind::Phase, phase_factor(&track.time_s, &speed)), (Kind::Speed, speed.clone()), (Kind::Image, ninth.clone())];
    }
    Ok(tracks)
}

fn nanoseconds(time_s: f64) -> i64 {
    (time_s * 1e9).round() as i64
}

/// Measured less predicted pixels with the deviations that the triangulated point's covariance stands for.
fn pixel_residuals(
    cameras: &Cameras,
    tip: &TipObservation,
    predicted_m: &Vector3<f64>,
    covariance_m2: &Matrix3<f64>,
) -> Option<Vec<(f64, f64)>> {
    let left_from_base = cameras.base_from_left?.inverse();
    let in_left = left_from_base * nalgebra::Point3::from(*predicted_m);
    let in_right = cameras.right_from_left * in_left;
    let left_turn = left_from_base.rotation.to_rotation_matrix();
    let right_turn = cameras.right_from_left.rotation.to_rotation_matrix() * left_turn;
    let mut rows = Vec::new();
    for (camera, point, turn, measured) in
        [(&cameras.left, in_left, left_turn, tip.left_px), (&cameras.right, in_right, right_turn, tip.right_px)]
    {
        let (pixel, slope) = camera.project_with_slope(&point.coords)?;
        let slope = slope * turn.matrix();
        let covariance = slope * covariance_m2 * slope.transpose();
        let miss = Vector2::from(measured) - pixel;
        rows.extend((0..2).map(|k| (miss[k], covariance[(k, k)].sqrt())));
    }
    rows.iter().all(|(miss, deviation)| miss.is_finite() && deviation.is_finite()).then_some(rows)
}
