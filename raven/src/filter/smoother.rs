//! Square-root Rauch-Tung-Striebel smoother: the best offline estimate, with all observations before and after.
//!
//! ```text
//! x_s = x + G (x_s+ - x-),   S_s  from  [ B   G S_s+ ]
//! ```
//!
//! Source: Rauch, Tung, Striebel 1965; the array form after Park, Kailath 1995. As in the filter, no covariance is subtracted.

use nalgebra::{SMatrix, SVector};

use super::SmootherStep;
use super::array::Triangulariser;

/// Smoothed mean and covariance factor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Smoothed<const N: usize> {
    /// Mean.
    pub mean: SVector<f64, N>,
    /// Lower-triangular factor of the covariance.
    pub factor: SMatrix<f64, N, N>,
}

/// Runs backwards over the recorded steps from the last filtered state. Entry `k` belongs to the start of step `k`, the last one to the end.
#[must_use]
pub fn smooth<const N: usize>(steps: &[SmootherStep<N>], last: Smoothed<N>) -> Vec<Smoothed<N>> {
    let mut array = Triangulariser::new(N, 2 * N);
    let mut smoothed = vec![last; steps.len() + 1];
    for (k, step) in steps.iter().enumerate().rev() {
        let next = smoothed[k + 1];
        let carried = step.gain * next.factor;
        for row in 0..N {
            for column in 0..N {
                array.set(row, column, step.residual_factor[(row, column)]);
                array.set(row, N + column, carried[(row, column)]);
            }
        }
        array.triangularise();
        smoothed[k] = Smoothed {
            mean: step.filtered + step.gain * (next.mean - step.predicted),
            factor: SMatrix::from_fn(|r, c| if c <= r { array.get(r, c) } else { 0.0 }),
        };
    }
    smoothed
}
