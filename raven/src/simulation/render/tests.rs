//! Where things are in an image, measured in the image, against where they are in space.

use nalgebra::{Isometry3, UnitQuaternion, Vector2, Vector3};
use rand::RngExt;

use super::*;
use crate::camera::Pinhole;
use crate::simulation::MARKER_RADIUS_M;
use crate::simulation::truth::stream;

fn camera() -> Pinhole {
    Pinhole { width: 640, height: 480, fx: 604.0, fy: 602.5, cx: 322.7, cy: 234.3, distortion: [-0.25, 0.08, 3e-4, -2e-4, 0.0] }
}

/// Centroid of the area inside the ball's outline: tangent rays, projected, as a polygon.
fn outline_centre(camera: &Pinhole, centre: &Vector3<f64>) -> Vector2<f64> {
    let towards = centre.normalize();
    let across = towards.cross(&Vector3::x()).normalize();
    let other = towards.cross(&across);
    let half_angle = (MARKER_RADIUS_M / centre.norm()).asin();
    let outline: Vec<Vector2<f64>> = (0..2000)
        .map(|k| {
            let (sin, cos) = (f64::from(k) * std::f64::consts::TAU / 2000.0).sin_cos();
            camera.project(&(towards * half_angle.cos() + (across * cos + other * sin) * half_angle.sin())).unwrap()
        })
        .collect();
    let mut area = 0.0;
    let mut moment = Vector2::zeros();
    for (a, b) in outline.iter().zip(outline.iter().cycle().skip(1)) {
        let wedge = a.perp(b);
        area += wedge;
        moment += (a + b) * wedge;
    }
    moment / (3.0 * area)
}

#[test]
fn the_ball_is_where_its_outline_is() {
    let renderer = Renderer::before_black(&camera(), Isometry3::identity());
    let mut rng = stream(1, "balls");
    let mut worst = 0.0_f64;
    for _ in 0..100 {
        let depth = rng.random_range(0.25..0.5);
        let centre = Vector3::new(rng.random_range(-0.45..0.45), rng.random_range(-0.33..0.33), 1.0) * depth;
        let marker = Marker::new(centre);
        let mut sum = Vector2::zeros();
        let mut weight = 0.0;
        for (v, columns) in marker.area(&renderer.optics).unwrap().rows() {
            for u in columns {
                if let Some(seen) = marker.at(&renderer.optics, renderer.optics.index(u, v)) {
                    sum += Vector2::new(u as f64, v as f64) * f64::from(seen.cover);
                    weight += f64::from(seen.cover);
                }
            }
        }
        worst = worst.max((sum / weight - outline_centre(&camera(), &centre)).norm());
    }
    assert!(worst < 0.01, "{worst} px");
}

#[test]
fn a_moving_ball_is_where_it_is_in_the_middle_of_the_exposure() {
    let renderer = Renderer::before_black(&camera(), Isometry3::identity());
    let middle = Vector3::new(0.02, -0.03, 0.35);
    let path = |part: f64| Tool { tip: middle + Vector3::new(0.001, 0.0007, 0.0) * (part - 0.5), axis: Vector3::new(0.0, 0.0, 1.0) };
    let mut canvas = renderer.canvas();
    renderer.draw_tool(&mut canvas, path);
    let spread = |canvas: &Canvas| {
        // Green alone: the shaft behind the ball is grey, and hidden.
        let (mut sum, mut squares, mut weight) = (Vector2::zeros(), 0.0, 0.0);
        for (index, colour) in canvas.pixels().iter().enumerate() {
            let place = Vector2::new((index % 640) as f64, (index / 640) as f64);
            let green = f64::from(colour[1] - colour[0]);
            sum += place * green;
            squares += place.norm_squared() * green;
            weight += green;
        }
        let mean = sum / weight;
        (mean, squares / weight - mean.norm_squared())
    };
    let (blurred, wide) = spread(&canvas);
    renderer.wipe(&mut canvas);
    assert!(canvas.pixels() == renderer.background);
    renderer.draw_tool(&mut canvas, |_| path(0.5));
    let (still, narrow) = spread(&canvas);
    assert!((blurred - still).norm() < 0.01, "{}", blurred - still);
    // A path of length l spreads by l^2 / 12.
    let length = 0.001_f64.hypot(0.0007) / 0.35 * 603.0;
    assert!(((wide - narrow) / (length * length / 12.0) - 1.0).abs() < 0.2, "{}", wide - narrow);
}

/// Where two edges cross near `start`: the place of each from the light on either side of it, row by row and column by column, and a
/// curve through the places.
fn crossing(canvas: &Canvas, start: Vector2<f64>) -> Vector2<f64> {
    let (u0, v0) = (start.x.round() as i64, start.y.round() as i64);
    let light = |across: bool, t: i64, w: i64| {
        let (u, v) = if across { (u0 + w, v0 + t) } else { (u0 + t, v0 + w) };
        f64::from(canvas.pixels()[(v * 640 + u) as usize][1])
    };
    // Edge position w at t = a + b t + c t^2, from rows (or columns) on both sides of the crossing.
    let edge = |across: bool| {
        let mut normal = nalgebra::Matrix3::zeros();
        let mut right = Vector3::zeros();
        for t in (-8..=-5).chain(5..=8) {
            let (first, last) = (light(across, t, -6), light(across, t, 6));
            let place = -6.5 + (-6..=6).map(|w| (light(across, t, w) - last) / (first - last)).sum::<f64>();
            let powers = Vector3::new(1.0, t as f64, (t * t) as f64);
            normal += powers * powers.transpose();
            right += powers * place;
        }
        normal.try_inverse().unwrap() * right
    };
    let (upright, level) = (edge(true), edge(false));
    let on = |curve: &Vector3<f64>, t: f64| curve[0] + t * (curve[1] + t * curve[2]);
    let mut corner = Vector2::zeros();
    for _ in 0..20 {
        corner = Vector2::new(on(&upright, corner.y), on(&level, corner.x));
    }
    corner + Vector2::new(u0 as f64, v0 as f64)
}

#[test]
fn the_boards_corners_are_where_they_project() {
    let camera = camera();
    let renderer = Renderer::before_black(&camera, Isometry3::identity());
    let board = Board { corners: [9, 6], square_m: 0.012 };
    let mut rng = stream(2, "boards");
    let mut canvas = renderer.canvas();
    let (mut squares, mut count, mut worst) = (0.0, 0.0, 0.0_f64);
    for _ in 0..12 {
        let mut about = |size: f64| rng.random_range(-size..size);
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(about(0.5), about(0.5), about(0.25)));
        let place = Isometry3::from_parts(Vector3::new(-0.05 + about(0.04), -0.03 + about(0.03), 0.28 + about(0.04)).into(), turn);
        renderer.wipe(&mut canvas);
        renderer.draw_board(&mut canvas, &board, &place);
        for point in board.corner_points() {
            let pixel = camera.project(&(place * point).coords).unwrap();
            if camera.contains(&pixel, 12.0) {
                let miss = (crossing(&canvas, pixel) - pixel).norm();
                squares += miss * miss;
                count += 1.0;
                worst = worst.max(miss);
            }
        }
    }
    assert!(count > 300.0);
    let rms = f64::sqrt(squares / count);
    assert!(rms < 0.01 && worst < 0.05, "rms {rms} px, worst {worst} px");
}

#[test]
fn the_nearer_of_ball_and_shaft_hides_the_other() {
    let renderer = Renderer::before_black(&camera(), Isometry3::identity());
    let tip = Vector3::new(0.0, 0.0, 0.35);
    // Four pixels from the centre, on the way that the shaft takes.
    let green_at_the_shaft = |axis: Vector3<f64>| {
        let mut canvas = renderer.canvas();
        renderer.draw_tool(&mut canvas, |_| Tool { tip, axis: axis.normalize() });
        let pixel = camera().project(&tip).unwrap();
        let [red, green, _] = canvas.pixels()[renderer.optics.index(pixel.x.round() as usize, pixel.y.round() as usize + 4)];
        green > 1.5 * red
    };
    assert!(green_at_the_shaft(Vector3::new(0.0, 0.3, 1.0)));
    assert!(!green_at_the_shaft(Vector3::new(0.0, 0.3, -1.0)));
}

#[test]
fn a_finger_hides_the_marker() {
    let renderer = Renderer::new(&camera(), Isometry3::identity(), 3);
    let tip = Vector3::new(0.01, 0.02, 0.35);
    let mut canvas = renderer.canvas();
    let green = |canvas: &Canvas| {
        let pixel = camera().project(&tip).unwrap();
        let (u, v) = (pixel.x as usize, pixel.y as usize);
        (v - 12..v + 12)
            .flat_map(|v| (u - 12..u + 12).map(move |u| v * 640 + u))
            .filter(|&i| {
                let [r, g, b] = canvas.pixels()[i];
                g > 1.4 * r && g > 1.4 * b
            })
            .count()
    };
    renderer.draw_tool(&mut canvas, |_| Tool { tip, axis: Vector3::new(0.0, -0.6, 0.8) });
    assert!(green(&canvas) > 100);
    renderer.draw_finger(&mut canvas, &tip);
    assert_eq!(green(&canvas), 0);
}

#[test]
fn what_is_outside_or_behind_draws_nothing_and_breaks_nothing() {
    let renderer = Renderer::new(&camera(), Isometry3::identity(), 3);
    let mut canvas = renderer.canvas();
    for tip in [Vector3::new(0.0, 0.0, -0.3), Vector3::new(3.0, 0.0, 0.3), Vector3::new(0.0, 0.0, 0.01)] {
        for axis in [Vector3::x(), -Vector3::y(), -Vector3::z()] {
            renderer.draw_tool(&mut canvas, |_| Tool { tip, axis });
            renderer.draw_finger(&mut canvas, &tip);
        }
    }
    let board = Board { corners: [9, 6], square_m: 0.012 };
    renderer.draw_board(&mut canvas, &board, &Isometry3::translation(0.0, 0.0, -0.2));
    renderer.draw_board(&mut canvas, &board, &Isometry3::translation(5.0, 0.0, 0.2));
    renderer.wipe(&mut canvas);
    assert!(canvas.pixels() == renderer.background);
}

#[test]
fn noise_has_its_size_and_light_its_gain() {
    let camera = camera();
    let renderer = Renderer::new(&camera, Isometry3::identity(), 3);
    let canvas = renderer.canvas();
    let sensor = Sensor::new(5);
    let image = sensor.expose(&canvas, 640, 1.1, &mut stream(5, "frame"));
    let (mut sum, mut squares) = (0.0, 0.0);
    for (byte, light) in image.iter().zip(canvas.pixels().as_flattened()) {
        let miss = f64::from(*byte) - f64::from(light * 1.1);
        sum += miss;
        squares += miss * miss;
    }
    let count = image.len() as f64;
    assert!((sum / count).abs() < 0.02);
    // 1.5 and the two roundings.
    assert!(((squares / count).sqrt() - (2.25_f64 + 2.0 / 12.0).sqrt()).abs() < 0.03);
}

#[test]
fn another_decoder_reads_the_jpegs() {
    let sensor = Sensor::new(5);
    // Sides that are whole units and sides that are not.
    for (width, height) in [(640_u16, 480_u16), (333, 251), (16, 8), (1, 1)] {
        let smooth = |x: usize, y: usize| [(x % 200) as u8 / 2 + 60, 90 + (y % 160) as u8 / 2, 255 - (x + y) as u8 / 4];
        let image: Vec<u8> = (0..usize::from(height)).flat_map(|y| (0..usize::from(width)).flat_map(move |x| smooth(x, y))).collect();
        let back = image::load_from_memory(&sensor.jpeg(&image, width, height).unwrap()).unwrap().to_rgb8();
        assert_eq!(back.dimensions(), (u32::from(width), u32::from(height)));
        let off: f64 = back.as_raw().iter().zip(&image).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum::<f64>();
        let rms = (off / image.len() as f64).sqrt();
        assert!(rms < 5.0, "{width} x {height}: {rms}");
    }
}
