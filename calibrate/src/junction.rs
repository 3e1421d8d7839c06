//! The last digit of a corner: an X-junction of two blurred straight edges fitted to all grey values around it.
//!
//! ```text
//! I(p) = m + c g(n1 . (p - x) / w) g(n2 . (p - x) / w),   g(t) = erf(t / sqrt(2)),   n = (cos a, sin a)
//! ```
//!
//! Seven numbers: the corner `x`, the edges' directions, the blur `w`, brightness and contrast. Where the grey values carry independent
//! noise this is the maximum-likelihood place of the corner. Model errors that are the same on opposite sides, such as a wrong shape of
//! the blur, do not move it.

use std::f64::consts::{FRAC_1_SQRT_2, FRAC_2_PI};

use image::GrayImage;
use nalgebra::{SMatrix, SVector, Vector2};

/// The blur is e^+-0.7 px: weight of that in squared grey levels, as if it were known from a pixel with noise of five of them. Without it
/// edges that run along the pixels of a sharp image leave the blur open.
const BLUR_PRIOR: f64 = (5.0 / 0.7) * (5.0 / 0.7);

/// Parameters: x, y, edge angles, log blur, brightness, contrast.
type Parameters = SVector<f64, 7>;

/// Fits the junction at `start` to the pixels within `radius_px`, with edges along `sides`; `None` if it does not settle nearby.
#[must_use]
pub fn fit(image: &GrayImage, start: Vector2<f64>, sides: [Vector2<f64>; 2], radius_px: f64) -> Option<Vector2<f64>> {
    let pixels = pixels_within(image, start, radius_px)?;
    // A normal stands on each edge: turned by a right angle.
    let normal_angle = |side: Vector2<f64>| side.x.atan2(-side.y);
    let mut parameters = Parameters::from([start.x, start.y, normal_angle(sides[0]), normal_angle(sides[1]), 0.0, 0.0, 0.0]);
    set_levels(&mut parameters, &pixels)?;
    let mut damping = 1e-3;
    let (mut cost, mut gradient, mut curvature) = normal_equations(&parameters, &pixels);
    for _ in 0..40 {
        let mut damped = curvature;
        (0..7).for_each(|i| damped[(i, i)] *= 1.0 + damping);
        let step = -damped.cholesky()?.solve(&gradient);
        let trial = parameters + step;
        let (trial_cost, trial_gradient, trial_curvature) = normal_equations(&trial, &pixels);
        if trial_cost <= cost {
            (parameters, cost, gradient, curvature) = (trial, trial_cost, trial_gradient, trial_curvature);
            damping = (damping * 0.1).max(1e-9);
            if step.fixed_rows::<2>(0).norm() < 1e-4 {
                let found = Vector2::new(parameters[0], parameters[1]);
                return ((found - start).norm() < 0.5 * radius_px).then_some(found);
            }
        } else {
            damping *= 10.0;
            if damping > 1e6 {
                return None;
            }
        }
    }
    None
}

fn pixels_within(image: &GrayImage, middle: Vector2<f64>, radius_px: f64) -> Option<Vec<(Vector2<f64>, f64)>> {
    let (low, high) = (middle.add_scalar(-radius_px), middle.add_scalar(radius_px));
    if !(low.min() >= 0.0 && high.x < f64::from(image.width()) && high.y < f64::from(image.height())) {
        return None;
    }
    let mut pixels = Vec::new();
    for y in low.y.ceil() as u32..=high.y as u32 {
        for x in low.x.ceil() as u32..=high.x as u32 {
            let at = Vector2::new(f64::from(x), f64::from(y));
            if (at - middle).norm() <= radius_px {
                pixels.push((at, f64::from(image.get_pixel(x, y)[0])));
            }
        }
    }
    Some(pixels)
}

/// Brightness and contrast that fit best, all else given; they enter linearly.
fn set_levels(parameters: &mut Parameters, pixels: &[(Vector2<f64>, f64)]) -> Option<()> {
    let count = pixels.len() as f64;
    let (mut s, mut ss, mut g, mut sg) = (0.0, 0.0, 0.0, 0.0);
    for (at, grey) in pixels {
        let shape = shape(parameters, at).0;
        s += shape;
        ss += shape * shape;
        g += grey;
        sg += shape * grey;
    }
    let determinant = count * ss - s * s;
    parameters[6] = (count * sg - s * g) / determinant;
    parameters[5] = (g - parameters[6] * s) / count;
    (determinant > 0.0 && parameters[6].abs() > 1.0).then_some(())
}

/// `g g` of the model and its slope with x, y, both angles and the log of the blur.
fn shape(parameters: &Parameters, at: &Vector2<f64>) -> (f64, SVector<f64, 5>) {
    let width = parameters[4].exp();
    let offset = at - Vector2::new(parameters[0], parameters[1]);
    let edge = |angle: f64| {
        let (sin, cos) = angle.sin_cos();
        let (t, along) = ((cos * offset.x + sin * offset.y) / width, (cos * offset.y - sin * offset.x) / width);
        let bell = (-0.5 * t * t).exp();
        (step(t, bell), FRAC_2_PI.sqrt() * bell, t, along, Vector2::new(cos, sin) / width)
    };
    let (g1, d1, t1, along1, n1) = edge(parameters[2]);
    let (g2, d2, t2, along2, n2) = edge(parameters[3]);
    let by_x = -(n1 * d1 * g2 + n2 * d2 * g1);
    (g1 * g2, SVector::<f64, 5>::from([by_x.x, by_x.y, d1 * along1 * g2, d2 * along2 * g1, -(d1 * t1 * g2 + d2 * t2 * g1)]))
}

fn normal_equations(parameters: &Parameters, pixels: &[(Vector2<f64>, f64)]) -> (f64, Parameters, SMatrix<f64, 7, 7>) {
    let (mut cost, mut gradient, mut curvature) = (0.0, Parameters::zeros(), SMatrix::<f64, 7, 7>::zeros());
    cost += BLUR_PRIOR * parameters[4] * parameters[4];
    gradient[4] += BLUR_PRIOR * parameters[4];
    curvature[(4, 4)] += BLUR_PRIOR;
    for (at, grey) in pixels {
        let (shape, slope) = shape(parameters, at);
        let residual = parameters[5] + parameters[6] * shape - grey;
        let slope = slope * parameters[6];
        let row = Parameters::from([slope[0], slope[1], slope[2], slope[3], slope[4], 1.0, shape]);
        cost += residual * residual;
        gradient += row * residual;
        curvature += row * row.transpose();
    }
    (cost, gradient, curvature)
}

/// `erf(t / sqrt(2))` to 1.5e-7, where `bell` is `exp(-t^2 / 2)` (Abramowitz and Stegun 7.1.26).
fn step(t: f64, bell: f64) -> f64 {
    let u = 1.0 / (1.0 + 0.327_591_1 * FRAC_1_SQRT_2 * t.abs());
    let polynomial = u * (0.254_829_592 + u * (-0.284_496_736 + u * (1.421_413_741 + u * (-1.453_152_027 + u * 1.061_405_429))));
    (1.0 - polynomial * bell).copysign(t)
}
