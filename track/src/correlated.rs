//! How far off a fitted centre is, and in which direction, where neighbouring pixels err together, as they do by compression and by texture
//! behind the edge.
//!
//! With whitened residuals `z` and `a_i` what one of them, at pixel `i`, moves the centre by along an axis,
//!
//! ```text
//! var = s^2 sum_ij a_i a_j R(i - j),   R(d) = mean_i z_i z_i+d / s^2,   s^2 = mean_i z_i^2
//! ```
//!
//! which is the sandwich of generalised least squares with a stationary noise (Conley 1999, GMM estimation with cross sectional dependence).
//! A fit of `p` unknowns leaves residuals smaller than the errors. Pixels that err together are fewer than they look, `n / sum_d R(d)`, so
//! that the variance is raised by `1 / (1 - p sum_d R(d) / n)`. What both axes have in common is as if pixels erred independently.

use fearless_simd::prelude::*;
use fearless_simd::{dispatch, f32x16};
use nalgebra::{Matrix2, Vector2};

use crate::patch::LANES;
use crate::sieve::LEVEL;

/// Neighbours farther apart than this count as independent [px]: half a block of JPEG.
const REACH_PX: usize = 4;

/// One pixel of one plane.
#[derive(Debug, Clone, Copy)]
pub struct Influence {
    /// Column and row in the image.
    pub pixel: [i32; 2],
    /// Residual over its standard deviation.
    pub whitened: f32,
    /// What a residual of one standard deviation moves the centre by [px].
    pub moves_px: [f32; 2],
}

/// Least part of the errors' square that residuals are taken to keep, where pixels are hardly more than the unknowns.
const LEAST_LEFT: f64 = 0.25;

/// Covariance of the centre [px^2], from the planes' pixels and how many unknowns they determined. Errors are taken to be as large as the
/// residuals are on average, and no smaller than expected.
#[must_use]
pub fn centre_covariance_px2(planes: &[Vec<Influence>], determined: f64) -> Matrix2<f64> {
    let planes: Vec<Plane> = planes.iter().map(|plane| dispatch!(*LEVEL, simd => Plane::of(simd, plane))).collect();
    let left = 1.0 - determined / planes.iter().map(|plane| plane.independent).sum::<f64>().max(1.0);
    planes.iter().map(|plane| plane.covariance_px2).sum::<Matrix2<f64>>() / left.max(LEAST_LEFT)
}

/// What one plane tells.
struct Plane {
    covariance_px2: Matrix2<f64>,
    /// So many independent pixels would tell as much of the mean.
    independent: f64,
}

impl Plane {
    #[inline(always)]
    fn of<S: Simd>(simd: S, plane: &[Influence]) -> Self {
        let Some(grid) = Grid::of(plane) else { return Self { covariance_px2: Matrix2::zeros(), independent: 0.0 } };
        let (squares, influence) = grid.sums(simd, 0);
        let square = squares / plane.len() as f64;
        let (mut among, mut correlated_px) = (Vector2::zeros(), 0.0);
        for shift in grid.shifts() {
            let count = sum_of_products(simd, &grid.there, &grid.there[shift..]);
            if count > 0.0 {
                let (products, influence) = grid.sums(simd, shift);
                among += influence * (2.0 * products / count);
                correlated_px += 2.0 * products / count;
            }
        }
        let over_square = |sum: f64| if square > 0.0 { sum / square } else { 0.0 };
        let together = (1.0 + over_square(correlated_px)).max(1.0);
        // How much farther off each axis is than if residuals were independent and as expected.
        let raised = influence.zip_map(&among, |influence, among| {
            let raised = if influence > 0.0 { 1.0 + over_square(among) / influence } else { 1.0 };
            (square.max(1.0) * raised.max(1.0)).sqrt()
        });
        let [across, along] = &grid.moves_px;
        let in_common = sum_of_products(simd, across, along);
        let independent_px2 = Matrix2::new(influence.x, in_common, in_common, influence.y);
        Self { covariance_px2: independent_px2.component_mul(&(raised * raised.transpose())), independent: plane.len() as f64 / together }
    }
}

/// A plane's pixels row by row, zeros where there is none. A row ends in so many zeros that no neighbour is one of another row.
struct Grid {
    /// From a row to the next.
    stride: usize,
    /// 1 where there is a pixel.
    there: Vec<f32>,
    whitened: Vec<f32>,
    moves_px: [Vec<f32>; 2],
}

impl Grid {
    /// `None` of nothing.
    fn of(plane: &[Influence]) -> Option<Self> {
        let range = |axis: usize| Some((plane.iter().map(|i| i.pixel[axis]).min()?, plane.iter().map(|i| i.pixel[axis]).max()?));
        let ((left, right), (top, bottom)) = (range(0)?, range(1)?);
        let stride = (right - left) as usize + 1 + REACH_PX;
        let zeros = vec![0.0; stride * ((bottom - top) as usize + 1 + REACH_PX) + LANES];
        let mut grid = Self { stride, there: zeros.clone(), whitened: zeros.clone(), moves_px: [zeros.clone(), zeros] };
        for influence in plane {
            let [x, y] = influence.pixel;
            let place = (y - top) as usize * stride + (x - left) as usize;
            grid.there[place] = 1.0;
            grid.whitened[place] = influence.whitened;
            [grid.moves_px[0][place], grid.moves_px[1][place]] = influence.moves_px;
        }
        Some(grid)
    }

    /// Half the neighbours, as distances within the grid: the other half is the same.
    fn shifts(&self) -> impl Iterator<Item = usize> + use<> {
        let (stride, reach) = (self.stride, REACH_PX);
        let below = (1..=reach).flat_map(move |dy| dy * stride - reach..=dy * stride + reach);
        (1..=reach).chain(below)
    }

    /// Sums over all pixels and their neighbours at a distance: of the products of residuals, and of those of what they move by axis.
    #[inline(always)]
    fn sums<S: Simd>(&self, simd: S, shift: usize) -> (f64, Vector2<f64>) {
        let [across, along] = &self.moves_px;
        let moves = Vector2::new(sum_of_products(simd, across, &across[shift..]), sum_of_products(simd, along, &along[shift..]));
        (sum_of_products(simd, &self.whitened, &self.whitened[shift..]), moves)
    }
}

/// Of as many as both have, but for those that do not fill [`LANES`].
#[inline(always)]
fn sum_of_products<S: Simd>(simd: S, a: &[f32], b: &[f32]) -> f64 {
    let mut sums = f32x16::splat(simd, 0.0);
    for (&a, &b) in a.as_chunks::<LANES>().0.iter().zip(b.as_chunks::<LANES>().0) {
        sums += f32x16::load_array(simd, a) * f32x16::load_array(simd, b);
    }
    sums.reduce_sum().into()
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    use super::*;

    /// A disc's pixels, of which those at its edge move the centre along their normals, with errors of 2 that neighbours in a row share by a half.
    fn drawn(random: &mut ChaCha8Rng) -> Vec<Influence> {
        const RADIUS_PX: f64 = 12.0;
        let mut plane = Vec::new();
        for row in -16..=16 {
            let mut before: f64 = StandardNormal.sample(random);
            for column in -16..=16 {
                let here: f64 = StandardNormal.sample(random);
                let place = Vector2::new(f64::from(column), f64::from(row)) / RADIUS_PX;
                let edge = (-(12.0 * (place.norm() - 1.0)).powi(2)).exp();
                let moves = place * (0.02 * edge);
                let whitened = 2.0_f64.sqrt() * (here + before);
                plane.push(Influence { pixel: [column, row], whitened: whitened as f32, moves_px: [moves.x as f32, moves.y as f32] });
                before = here;
            }
        }
        plane
    }

    #[test]
    fn neighbours_that_err_together_scatter_the_centre_as_claimed() {
        let (mut random, draws) = (ChaCha8Rng::seed_from_u64(3), 2000);
        let (mut scatter, mut claimed) = (Matrix2::zeros(), Matrix2::zeros());
        for _ in 0..draws {
            let plane = drawn(&mut random);
            let shift: Vector2<f64> = plane.iter().map(|i| Vector2::from(i.moves_px.map(f64::from)) * f64::from(i.whitened)).sum();
            scatter += shift * shift.transpose() / f64::from(draws);
            claimed += centre_covariance_px2(&[plane], 0.0) / f64::from(draws);
        }
        for axis in 0..2 {
            let ratio = scatter[(axis, axis)] / claimed[(axis, axis)];
            assert!((0.9..1.1).contains(&ratio), "axis {axis}: {ratio}, {scatter} {claimed}");
        }
    }
}
