//! The images of a recording: which camera exposes when, what is before it then, and the JPEGs in the order of their arrival.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector2, Vector3};
use rand::{Rng, RngExt};
use rayon::prelude::*;

use super::render::{Board, Canvas, Renderer, Sensor, Tool};
use super::rig::Rig;
use super::shutter::{Delays, Exposure};
use super::truth::stream;
use crate::camera::{Cameras, Pinhole};
use crate::log::Side;
use crate::{Error, Result};

/// Length of an exposure [s].
const EXPOSURE_S: f64 = 0.012;
/// From a frame's stamp to its arrival at the recorder [s].
const TRANSFER_S: f64 = 0.006;
/// Frames that are rendered before they are handed on, and those of them that one thread takes at a time.
const BATCH: usize = 128;
const SHARE: usize = 16;

/// Both cameras with everything that stays the same in their images.
#[derive(Debug)]
pub struct Studio {
    seed: u64,
    cameras: Cameras,
    delays: Delays,
    renderers: [Renderer; 2],
    sensor: Sensor,
    lamp_phase: f64,
}

/// What moves before the cameras.
pub enum Scene<'a> {
    /// The tool over time, in the left camera's frame.
    Tool(&'a (dyn Fn(f64) -> Tool + Sync)),
    /// A board that is still while it is exposed: poses by number of the frame.
    Board(Board, &'a [Isometry3<f64>]),
}

/// One frame to be rendered.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shot {
    /// Camera.
    pub side: Side,
    /// When, and what its stamp says.
    pub exposure: Exposure,
    /// Pose of the board.
    pub pose: usize,
}

impl Shot {
    /// Arrival at the recorder, after the start [s].
    #[must_use]
    pub fn arrived_s(&self) -> f64 {
        self.exposure.stamp_s + TRANSFER_S
    }
}

impl Studio {
    /// Sets the scene of a seed for a rig.
    #[must_use]
    pub fn new(seed: u64, rig: &Rig, delays: Delays) -> Self {
        let cameras = rig.actual.clone();
        let renderers =
            [Renderer::new(&cameras.left, Isometry3::identity(), seed), Renderer::new(&cameras.right, cameras.right_from_left, seed)];
        let lamp_phase = stream(seed, "lamp").random_range(0.0..std::f64::consts::TAU);
        Self { seed, cameras, delays, renderers, sensor: Sensor::new(seed), lamp_phase }
    }

    /// Renders shots and hands on their JPEGs in the same order.
    ///
    /// # Errors
    /// If an image cannot be compressed, or `take` fails.
    pub fn shoot(&self, name: &str, scene: &Scene<'_>, shots: &[Shot], mut take: impl FnMut(&Shot, Vec<u8>) -> Result<()>) -> Result<()> {
        for batch in shots.chunks(BATCH) {
            let jpegs: Vec<Vec<Result<Vec<u8>>>> = batch
                .par_chunks(SHARE)
                .map(|share| {
                    let mut canvases = self.renderers.each_ref().map(Renderer::canvas);
                    share.iter().map(|shot| self.jpeg(name, scene, shot, &mut canvases)).collect()
                })
                .collect();
            for (shot, jpeg) in batch.iter().zip(jpegs.into_iter().flatten()) {
                take(shot, jpeg?)?;
            }
        }
        Ok(())
    }

    fn jpeg(&self, name: &str, scene: &Scene<'_>, shot: &Shot, canvases: &mut [Canvas; 2]) -> Result<Vec<u8>> {
        let index = usize::from(shot.side == Side::Right);
        let (renderer, canvas) = (&self.renderers[index], &mut canvases[index]);
        let camera = self.camera(shot.side);
        match scene {
            Scene::Tool(tool_at) => {
                let late_s = self.row_delay_s(shot, &tool_at(shot.exposure.time_s).tip);
                let at = |part: f64| tool_at(shot.exposure.time_s + late_s + (part - 0.5) * EXPOSURE_S);
                renderer.draw_tool(canvas, at);
                if shot.exposure.hidden {
                    renderer.draw_finger(canvas, &at(0.5).tip);
                }
            }
            Scene::Board(board, poses) => {
                if let Some(pose) = poses.get(shot.pose) {
                    renderer.draw_board(canvas, board, pose);
                }
            }
        }
        let mut rng = stream(self.seed, &format!("noise {name} {} {}", shot.side.name(), shot.exposure.sequence));
        let image = self.sensor.expose(canvas, camera.width as usize, self.light(shot.exposure.time_s), &mut rng);
        renderer.wipe(canvas);
        // Two webcams of 640 x 480: see `Rig`.
        self.sensor.jpeg(&image, camera.width as u16, camera.height as u16)
    }

    fn camera(&self, side: Side) -> &Pinhole {
        match side {
            Side::Left => &self.cameras.left,
            Side::Right => &self.cameras.right,
        }
    }

    /// When a rolling shutter exposes the row where the tip is, after the middle row [s].
    fn row_delay_s(&self, shot: &Shot, tip: &Vector3<f64>) -> f64 {
        let pixel = self.cameras.project(tip).map(|pixels| pixels[usize::from(shot.side == Side::Right)]);
        pixel.map_or(0.0, |pixel| self.delays.of_row(pixel.y, self.camera(shot.side).height))
    }

    /// The room's light, which drifts slowly.
    fn light(&self, time_s: f64) -> f32 {
        (1.0 + 0.05 * (time_s / 6.5 + self.lamp_phase).sin() + 0.0004 * time_s.min(150.0)) as f32
    }
}

/// Frames of both cameras in the order of their arrival.
#[must_use]
pub fn shots(left: &[Exposure], right: &[Exposure]) -> Vec<Shot> {
    let of = |side, exposures: &[Exposure]| exposures.iter().map(move |&exposure| Shot { side, exposure, pose: 0 }).collect::<Vec<_>>();
    let mut shots = of(Side::Left, left);
    shots.extend(of(Side::Right, right));
    in_order(shots)
}

/// One pair per pose, each held for a second: the first left frame after its middle, and the right one nearest to it.
#[must_use]
pub fn stills(left: &[Exposure], right: &[Exposure], poses: usize) -> Vec<Shot> {
    let mut shots = Vec::new();
    for pose in 0..poses {
        let held_s = pose as f64 + 0.5;
        let Some(&exposure) = left.get(left.partition_point(|e| e.time_s < held_s)) else { continue };
        shots.push(Shot { side: Side::Left, exposure, pose });
        let apart_s = |e: &Exposure| (e.stamp_s - exposure.stamp_s).abs();
        if let Some(&exposure) = right.iter().min_by(|a, b| apart_s(a).total_cmp(&apart_s(b))) {
            shots.push(Shot { side: Side::Right, exposure, pose });
        }
    }
    in_order(shots)
}

fn in_order(mut shots: Vec<Shot>) -> Vec<Shot> {
    shots.sort_by(|a, b| a.exposure.stamp_s.total_cmp(&b.exposure.stamp_s));
    shots
}

/// Poses of a board all over both images, near and far, tilted every way.
///
/// # Errors
/// If the cameras have no view in common.
pub fn board_poses(board: &Board, cameras: &Cameras, count: usize, rng: &mut impl Rng) -> Result<Vec<Isometry3<f64>>> {
    let center = 0.5 * board.square_m * Vector3::new(f64::from(board.corners[0]) - 1.0, f64::from(board.corners[1]) - 1.0, 0.0);
    (0..count)
        .map(|k| {
            for _ in 0..TRIES {
                // Cells of the left image in turn; the right one decides with the left whether all of the board is seen.
                let cell = Vector2::new((k % 4) as f64, (k / 4 % 3) as f64);
                let within = cell + Vector2::new(rng.random_range(0.0..1.0), rng.random_range(0.0..1.0));
                let size = Vector2::new(f64::from(cameras.left.width) / 4.0, f64::from(cameras.left.height) / 3.0);
                let Some(ray) = cameras.left.undistort(&within.component_mul(&size)) else { continue };
                let middle = ray.push(1.0) * rng.random_range(0.22..0.46);
                let mut about = |most: f64| rng.random_range(-most..most);
                let tilt = UnitQuaternion::from_scaled_axis(Vector3::new(about(0.65), about(0.65), 0.0));
                let roll = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.0, about(0.5)));
                let turn = tilt * roll;
                let pose = Isometry3::from_parts(Translation3::from(middle - turn * center), turn);
                if in_both(board, cameras, &pose) {
                    return Ok(pose);
                }
            }
            Err(Error::Data("the two cameras see no place where a whole board fits; are they turned away from each other?".to_owned()))
        })
        .collect()
}

/// Attempts per pose; about one in twenty succeeds at the left edge, which the right camera hardly sees.
const TRIES: usize = 20_000;

fn in_both(board: &Board, cameras: &Cameras, pose: &Isometry3<f64>) -> bool {
    let facing = (pose.rotation * Vector3::z()).dot(&pose.translation.vector.normalize()) > 0.5;
    facing
        && board.plate().iter().all(|corner: &Point3<f64>| {
            let pixels = cameras.project(&(pose * corner).coords);
            pixels.is_some_and(|[left, right]| cameras.left.contains(&left, 3.0) && cameras.right.contains(&right, 3.0))
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_frames_of_a_still_are_less_than_half_a_period_apart() {
        let exposures = |phase: f64| {
            let one = |k: u32| Exposure {
                sequence: k,
                time_s: (f64::from(k) + phase) / 15.0,
                stamp_s: (f64::from(k) + phase) / 15.0,
                hidden: false,
            };
            (0..75).map(one).collect::<Vec<_>>()
        };
        for phase in [0.0, 0.2, 0.45, 0.55, 0.8, 0.99] {
            let shots = stills(&exposures(0.49), &exposures(phase), 4);
            assert_eq!(shots.len(), 8);
            for pair in shots.chunks(2) {
                assert_ne!(pair[0].side, pair[1].side);
                assert!((pair[0].exposure.stamp_s - pair[1].exposure.stamp_s).abs() <= 0.5 / 15.0 + 1e-9);
            }
        }
    }
}
