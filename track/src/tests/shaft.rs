//! Balls on a shaft by the renderer of the virtual lab, where the shaft hides a part of their edge.

use nalgebra::{Isometry3, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use raven::camera::Pinhole;
use raven::simulation::{MARKER_RADIUS_M, Renderer, Sensor, Tool};

use super::decoded;
use crate::colour::MarkerColour;
use crate::marker::{Blobs, Centre};
use crate::perspective::ball_centre;
use crate::shaft::Shaft;

const BALLS: usize = 40;

/// By how much centres lie on the shaft's side of where they are, with the shaft unknown and known [px].
fn towards_shaft_px(seed: u64) -> [Vec<f64>; 2] {
    let camera = Pinhole { width: 320, height: 240, fx: 600.0, fy: 600.0, cx: 160.0, cy: 120.0, distortion: [0.0; 5] };
    let (renderer, sensor) = (Renderer::new(&camera, Isometry3::identity(), seed), Sensor::new(seed));
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut off = [Vec::new(), Vec::new()];
    for _ in 0..BALLS {
        let tip = Vector3::new(rng.random_range(-0.05..0.05), rng.random_range(-0.03..0.03), 0.38);
        // Away from the camera by 20 deg, up to 40 deg from upright.
        let (lean, away) = (rng.random_range(-0.7..0.7_f64), 0.35_f64);
        let axis = Vector3::new(lean.sin() * away.cos(), -lean.cos() * away.cos(), away.sin());
        let mut canvas = renderer.canvas();
        renderer.draw_tool(&mut canvas, |_| Tool { tip, axis });
        let jpeg = sensor.jpeg(&sensor.expose(&canvas, 320, 1.0, &mut rng), 320, 240).unwrap();
        let (image, sampling) = decoded(jpeg);
        let true_px = camera.project(&tip).unwrap();
        let direction: Vector2<f64> = (camera.project(&(tip + 5e-3 * axis)).unwrap() - true_px).normalize();
        let shaft = Shaft { direction, radius_px: 0.5 * MARKER_RADIUS_M / tip.z * camera.fx };
        for (off, shaft) in off.iter_mut().zip([None, Some(shaft)]) {
            let blobs = Blobs::find(&image, None, &MarkerColour::default()).sampled(sampling.as_ref()).on_shaft(shaft);
            let near = |px: &Vector2<f64>| (px - true_px).norm() < 5.0;
            let ball = blobs.found.iter().map(|blob| blobs.centre(blob, Centre::Ball)).find(|ball| near(&ball.centre_px)).unwrap();
            off.push((ball_centre(&camera, &ball.centre_px, ball.radius_px) - true_px).dot(&direction));
        }
    }
    off
}

#[test]
fn a_known_shaft_moves_no_centre() {
    let [unknown, known]: [Vec<f64>; 2] = [1, 2].map(towards_shaft_px).into_iter().fold([Vec::new(), Vec::new()], |mut all, off| {
        all.iter_mut().zip(off).for_each(|(all, off)| all.extend(off));
        all
    });
    let mean = |off: &[f64]| off.iter().sum::<f64>() / off.len() as f64;
    // The lamp above moves them towards the shaft, and the hidden edge away from it.
    let (moved_px, left_px) = (mean(&known) - mean(&unknown), mean(&known));
    assert!(moved_px > 0.04 && left_px.abs() < 0.06, "{left_px:+.3} px with the shaft known, {moved_px:+.3} px from where it is not");
}
