//! Square-root unscented Kalman filter in array form, with `alpha = 1`, `beta = 2`, `kappa = 0`.
//!
//! With these the weights of the mean are `0, 1/2n, ...` and those of the covariance `2, 1/2n, ...`: none is negative, so every
//! covariance is a sum and one orthogonal triangularisation gives its factor. Sigma points lie at `x +- sqrt(n) S_i` and are drawn
//! anew for the update, so that process noise reaches the innovation's covariance.
//!
//! ```text
//! predict:  S-   from  [ sqrt(W_i) (f(X_i) - x-)   S_q ]
//! update:   [ S_y  0 ]        [ S_r   sqrt(W_i) (h(X_i) - y-) ]
//!           [ K'   S ]  from  [  0    sqrt(W_i) (X_i - x-)    ],   x = x- + K' S_y^-1 (y - y-)
//! ```
//!
//! Sources: van der Merwe, Wan 2001 (the unscented square root); Kailath, Sayed, Hassibi 2000, chapter 12 (the array). The published
//! form with a Cholesky downdate loses the small covariances it was made for; this one does not.

use nalgebra::allocator::Allocator;
use nalgebra::{Const, DefaultAllocator, Dim, OMatrix, OVector, SMatrix, SVector};

use super::array::Triangulariser;

/// Mean and covariance factor of `N` states that are observed `M` at a time. `N` is a `Const`, or `Dyn` where only the run knows how many.
#[derive(Debug, Clone)]
pub struct SquareRootUkf<N: Dim, const M: usize>
where
    DefaultAllocator: Allocator<N> + Allocator<N, N>,
{
    /// State estimate.
    pub mean: OVector<f64, N>,
    /// Lower-triangular factor `S` of the covariance `P = S S'`.
    pub factor: OMatrix<f64, N, N>,
    points: Vec<OVector<f64, N>>,
    observed: Vec<SVector<f64, M>>,
    before: Vec<OVector<f64, N>>,
    time_array: Triangulariser,
    smoothing_array: Triangulariser,
    measurement_array: Triangulariser,
}

/// What an observation said against the prediction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Innovation<const M: usize> {
    /// Observed less predicted.
    pub residual: SVector<f64, M>,
    /// Lower-triangular factor of its covariance.
    pub factor: SMatrix<f64, M, M>,
    /// Normalised square `v' S^-1 v`: chi-square with `M` degrees of freedom if the filter is consistent.
    pub nis: f64,
    /// Whether the state was changed: false where the gate refused it or it was not finite.
    pub accepted: bool,
}

/// One prediction, as the backward pass of the smoother needs it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SmootherStep<const N: usize> {
    /// Mean before the prediction, all observations up to there taken in.
    pub filtered: SVector<f64, N>,
    /// Mean after it.
    pub predicted: SVector<f64, N>,
    /// Smoother gain `G`; zero where the predicted covariance has no inverse.
    pub gain: SMatrix<f64, N, N>,
    /// Factor `B` of the covariance that remains if the next state were known; all of the filtered one where the gain is zero.
    pub residual_factor: SMatrix<f64, N, N>,
}

impl<N: Dim, const M: usize> SquareRootUkf<N, M>
where
    DefaultAllocator: Allocator<N> + Allocator<N, N>,
{
    /// A filter at `mean` with covariance `factor factor'`; `factor` is lower-triangular. All memory is taken here.
    #[must_use]
    pub fn new(mean: OVector<f64, N>, factor: OMatrix<f64, N, N>) -> Self {
        let n = mean.len();
        let points = 2 * n + 1;
        Self {
            points: vec![mean.clone(); points],
            observed: vec![SVector::zeros(); points],
            before: vec![mean.clone(); points],
            time_array: Triangulariser::new(n, points + n),
            smoothing_array: Triangulariser::new(2 * n, points + n),
            measurement_array: Triangulariser::new(M + n, M + points),
            mean,
            factor,
        }
    }

    /// Carries mean and covariance through `transition` and adds noise with factor `noise_factor`.
    pub fn predict(&mut self, mut transition: impl FnMut(&OVector<f64, N>) -> OVector<f64, N>, noise_factor: &OMatrix<f64, N, N>) {
        self.predict_batch(|points| points.iter_mut().for_each(|point| *point = transition(point)), noise_factor);
    }

    /// As [`Self::predict`], with a transition that carries all `2N + 1` sigma points at once, in place; point 0 is the mean.
    pub fn predict_batch(&mut self, transition: impl FnOnce(&mut [OVector<f64, N>]), noise_factor: &OMatrix<f64, N, N>) {
        self.draw_points();
        transition(&mut self.points);
        let n = self.mean.len();
        self.mean.fill(0.0);
        self.points[1..].iter().for_each(|point| self.mean += point);
        self.mean /= (2 * n) as f64;
        for (i, point) in self.points.iter().enumerate() {
            let weight = root_weight(n, i);
            for row in 0..n {
                self.time_array.set(row, i, weight * (point[row] - self.mean[row]));
            }
        }
        for column in 0..n {
            for row in 0..n {
                self.time_array.set(row, 2 * n + 1 + column, noise_factor[(row, column)]);
            }
        }
        self.time_array.triangularise();
        for row in 0..n {
            for column in 0..=row {
                self.factor[(row, column)] = self.time_array.get(row, column);
            }
        }
    }

    /// Takes in an observation `measured = observe(x) + noise`; `noise_factor` is the lower-triangular factor of the noise.
    ///
    /// An observation whose NIS exceeds `gate`, or that is not finite, changes nothing and is reported as not accepted.
    pub fn update(
        &mut self,
        measured: &SVector<f64, M>,
        mut observe: impl FnMut(&OVector<f64, N>) -> SVector<f64, M>,
        noise_factor: &SMatrix<f64, M, M>,
        gate: Option<f64>,
    ) -> Innovation<M> {
        let each = |points: &[OVector<f64, N>], observed: &mut [SVector<f64, M>]| {
            points.iter().zip(observed).for_each(|(point, observed)| *observed = observe(point));
        };
        self.update_batch(measured, each, noise_factor, gate)
    }

    /// As [`Self::update`], with an observation function that fills in what all `2N + 1` sigma points would show; point 0 is the mean.
    pub fn update_batch(
        &mut self,
        measured: &SVector<f64, M>,
        observe: impl FnOnce(&[OVector<f64, N>], &mut [SVector<f64, M>]),
        noise_factor: &SMatrix<f64, M, M>,
        gate: Option<f64>,
    ) -> Innovation<M> {
        self.draw_points();
        observe(&self.points, &mut self.observed);
        let n = self.mean.len();
        let predicted = self.observed[1..].iter().sum::<SVector<f64, M>>() / (2 * n) as f64;
        let array = &mut self.measurement_array;
        array.clear();
        for column in 0..M {
            for row in 0..M {
                array.set(row, column, noise_factor[(row, column)]);
            }
        }
        for (i, (point, observed)) in self.points.iter().zip(&self.observed).enumerate() {
            let weight = root_weight(n, i);
            for row in 0..M {
                array.set(row, M + i, weight * (observed[row] - predicted[row]));
            }
            for row in 0..n {
                array.set(M + row, M + i, weight * (point[row] - self.mean[row]));
            }
        }
        array.triangularise();
        let factor = SMatrix::<f64, M, M>::from_fn(|r, c| if c <= r { array.get(r, c) } else { 0.0 });
        let residual = measured - predicted;
        let whitened = factor.solve_lower_triangular(&residual).unwrap_or_else(|| SVector::repeat(f64::NAN));
        let nis = whitened.norm_squared();
        let accepted = nis.is_finite() && gate.is_none_or(|limit| nis <= limit);
        if accepted {
            for row in 0..n {
                self.mean[row] += (0..M).map(|c| array.get(M + row, c) * whitened[c]).sum::<f64>();
                for column in 0..=row {
                    self.factor[(row, column)] = array.get(M + row, M + column);
                }
            }
        }
        Innovation { residual, factor, nis, accepted }
    }

    /// Covariance `S S'`.
    #[must_use]
    pub fn covariance(&self) -> OMatrix<f64, N, N> {
        &self.factor * self.factor.transpose()
    }

    fn draw_points(&mut self) {
        let n = self.mean.len();
        let spread = (n as f64).sqrt();
        self.points.iter_mut().for_each(|point| point.copy_from(&self.mean));
        for i in 0..n {
            for row in 0..n {
                let step = self.factor[(row, i)] * spread;
                self.points[1 + i][row] += step;
                self.points[1 + n + i][row] -= step;
            }
        }
    }
}

impl<const N: usize, const M: usize> SquareRootUkf<Const<N>, M> {
    /// As [`Self::predict`], and keeps what the backward pass of a smoother needs of this step:
    ///
    /// ```text
    /// [ S-  0 ]        [ sqrt(W_i) (f(X_i) - x-)   S_q ]
    /// [ A   B ]  from  [ sqrt(W_i) (X_i - x)       0   ],   G = A S-^-1
    /// ```
    pub fn predict_recorded(
        &mut self,
        transition: impl FnMut(&SVector<f64, N>) -> SVector<f64, N>,
        noise_factor: &SMatrix<f64, N, N>,
    ) -> SmootherStep<N> {
        self.draw_points();
        self.before.copy_from_slice(&self.points);
        let (filtered, filtered_factor) = (self.mean, self.factor);
        self.predict(transition, noise_factor);
        let array = &mut self.smoothing_array;
        array.clear();
        for (i, (after, before)) in self.points.iter().zip(&self.before).enumerate() {
            let weight = root_weight(N, i);
            for row in 0..N {
                array.set(row, i, weight * (after[row] - self.mean[row]));
                array.set(N + row, i, weight * (before[row] - filtered[row]));
            }
        }
        for column in 0..N {
            for row in 0..N {
                array.set(row, 2 * N + 1 + column, noise_factor[(row, column)]);
            }
        }
        array.triangularise();
        let across = SMatrix::<f64, N, N>::from_fn(|r, c| array.get(N + r, c));
        let remaining = || SMatrix::from_fn(|r, c| if c <= r { array.get(N + r, N + c) } else { 0.0 });
        // A prediction that is certain in some direction has no inverse: the step stays as filtered, in every direction.
        let (gain, residual_factor) = match self.factor.transpose().solve_upper_triangular(&across.transpose()) {
            Some(gain) => (gain.transpose(), remaining()),
            None => (SMatrix::zeros(), filtered_factor),
        };
        SmootherStep { filtered, predicted: self.mean, gain, residual_factor }
    }
}

/// Root of the covariance weight of sigma point `i` of `n` states: `2` at the centre, `1 / 2n` elsewhere.
fn root_weight(n: usize, i: usize) -> f64 {
    if i == 0 { std::f64::consts::SQRT_2 } else { (0.5 / n as f64).sqrt() }
}
