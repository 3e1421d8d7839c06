//! Dry friction as a set: a body at rest stays at rest under any force up to the limit.
//!
//! One step of a mechanism with dry friction asks for velocities `v` and friction impulses `f` with
//!
//! ```text
//! A v = b + f,   f_i in -limit_i Sgn(v_i),   Sgn(0) = [-1, 1]
//! ```
//!
//! solved row by row, each row in closed form, until nothing moves (projected Gauss-Seidel; Moreau's sweeping process, time-stepping
//! after Stewart 2000, SIAM Review 42). Velocities of bodies that stick come out as exactly zero.

use nalgebra::{Matrix6, Vector6};

/// Rows are swept until no velocity changes by more than this part of what its row is made of.
const TOLERANCE: f64 = 1e-13;
const SWEEPS: usize = 200;

/// Velocities after the step. `limit` holds the friction impulses at sliding; infinite locks a body. `guess` is where to start.
#[must_use]
pub fn stick_slip(a: &Matrix6<f64>, b: &Vector6<f64>, limit: &Vector6<f64>, guess: &Vector6<f64>) -> Vector6<f64> {
    let mut v = *guess;
    for _ in 0..SWEEPS {
        let mut settled = true;
        for i in 0..6 {
            let mut driving = b[i];
            let mut size = b[i].abs();
            for j in 0..6 {
                if j != i {
                    let term = a[(i, j)] * v[j];
                    driving -= term;
                    size += term.abs();
                }
            }
            let sliding = (driving.abs() - limit[i]).max(0.0);
            let new = driving.signum() * sliding / a[(i, i)];
            settled &= (new - v[i]).abs() * a[(i, i)] <= TOLERANCE * size;
            v[i] = new;
        }
        if settled {
            break;
        }
    }
    v
}

#[cfg(test)]
mod tests {
    use super::*;

    fn coupled() -> Matrix6<f64> {
        let mut a = Matrix6::identity();
        for i in 0..5 {
            a[(i, i + 1)] = -0.3;
            a[(i + 1, i)] = -0.3;
        }
        a
    }

    #[test]
    fn without_friction_it_is_the_linear_system() {
        let b = Vector6::new(1.0, -2.0, 0.5, 0.0, 3.0, -1.0);
        let v = stick_slip(&coupled(), &b, &Vector6::zeros(), &Vector6::zeros());
        assert!((coupled() * v - b).amax() < 1e-12);
    }

    #[test]
    fn each_body_sticks_or_slides_against_its_motion() {
        let (b, limit) = (Vector6::new(1.0, -2.0, 0.5, 0.01, 3.0, -1.0), Vector6::repeat(0.6));
        let v = stick_slip(&coupled(), &b, &limit, &Vector6::zeros());
        let friction = coupled() * v - b;
        let mut stuck = 0;
        for i in 0..6 {
            if v[i] == 0.0 {
                stuck += 1;
                assert!(friction[i].abs() <= limit[i] + 1e-12);
            } else {
                assert!((friction[i] + limit[i] * v[i].signum()).abs() < 1e-11);
            }
        }
        assert!(stuck > 0 && stuck < 6, "the case must have both: {v}");
    }

    #[test]
    fn an_infinite_limit_locks() {
        let mut limit = Vector6::zeros();
        limit[2] = f64::INFINITY;
        let v = stick_slip(&coupled(), &Vector6::repeat(1.0), &limit, &Vector6::repeat(1.0));
        assert_eq!(v[2], 0.0);
        assert!(v[1] > 0.0);
    }
}
