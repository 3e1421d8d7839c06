//! scratch
use nalgebra::*;
use rand::{Rng, RngExt, SeedableRng};
use raven_calibrate::*;
fn main() {
    let n: usize = std::env::args().nth(1).unwrap().parse().unwrap();
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    let size = board::BoardSize { columns: 9, rows: 6 };
    let (mut ss, mut cnt, mut full, mut mx) = (0.0, 0.0, 0, 0.0f64);
    let mut bins = [[0.0; 2]; 6];
    let mut tt = 0.0;
    for _ in 0..n {
        let k1 = rng.random_range(-0.3..0.0);
        let camera = raven::camera::Pinhole {
            width: 640,
            height: 480,
            fx: 600.0,
            fy: 600.0,
            cx: 320.0,
            cy: 240.0,
            distortion: [k1, -0.35 * k1, 1e-3, -5e-4, 0.0],
        };
        let b = board::Board { size, square_m: 0.012 };
        let scene = loop {
            let z = rng.random_range(0.15..0.5);
            let rot = UnitQuaternion::from_scaled_axis(Vector3::new(rng.random_range(-0.7..0.7), rng.random_range(-0.7..0.7), 0.0))
                * UnitQuaternion::from_scaled_axis(Vector3::z() * rng.random_range(-3.0..3.0));
            let c = Vector3::new(rng.random_range(-0.3..0.3) * z, rng.random_range(-0.2..0.2) * z, z);
            let t = c - rot * b.middle();
            let s = scene::Scene {
                camera,
                board: b,
                camera_from_board: Isometry3::from_parts(t.into(), rot),
                blur_px: rng.random_range(0.4..1.4),
                noise: rng.random_range(1.0..5.0),
            };
            if (0..54).all(|k| s.corner((k % 9, k / 9)).is_some_and(|p| camera.contains(&p, 12.0))) {
                break s;
            }
        };
        let img = scene.render(&mut rng);
        let t = std::time::Instant::now();
        let found = corners::find(&img, size);
        tt += t.elapsed().as_secs_f64();
        let Some(s) = found else { continue };
        if s.grid.corners.len() == 54 && s.placements.len() == 1 {
            full += 1;
        }
        for (l, p) in &s.grid.corners {
            let e = (p - scene.corner(s.placements[0].apply(*l)).unwrap()).norm_squared();
            ss += e;
            cnt += 1.0;
            mx = mx.max(e);
            let z = (scene.camera_from_board.translation.vector.z * 10.0) as usize;
            bins[z.min(5)][0] += e;
            bins[z.min(5)][1] += 1.0;
        }
    }
    println!(
        "full {full}/{n} rms per axis {:.4} max {:.3} time {:.1} ms; by z {:?}",
        (ss / cnt / 2.0f64).sqrt(),
        mx.sqrt(),
        tt / n as f64 * 1e3,
        bins.map(|b| (b[0] / b[1] / 2.0f64).sqrt())
    );
}
