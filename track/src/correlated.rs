//! How far off a fitted centre is where neighbouring pixels err together, as they do by compression and by texture behind the edge.
//!
//! With whitened residuals `z` and `a_i` what one of them, at pixel `i`, moves the centre by,
//!
//! ```text
//! var = s^2 sum_ij a_i a_j R(i - j),   R(d) = mean_i z_i z_i+d / s^2,   s^2 = mean_i z_i^2
//! ```
//!
//! which is the sandwich of generalised least squares with a stationary noise (Conley 1999, GMM estimation with cross sectional dependence).
//! A fit of `p` unknowns leaves residuals smaller than the errors. Pixels that err together are fewer than they look, `n / sum_d R(d)`, so
//! that the variance is raised by `1 / (1 - p sum_d R(d) / n)`.

use fearless_simd::prelude::*;
use fearless_simd::{dispatch, f32x16};

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

/// How large the errors are that residuals tell of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Size {
    /// As large as the residuals are on average, and no smaller than expected.
    Alike,
    /// As large as the residuals that move the centre: away from the edge much of a JPEG file is exact, as it was rounded to nothing.
    AtTheEdge,
}

/// Variance of the centre, mean of its axes [px^2], from the planes' pixels and the number of unknowns that they determined.
#[must_use]
pub fn centre_variance_px2(planes: &[Vec<Influence>], unknowns: f64, size: Size) -> f64 {
    let planes: Vec<Plane> = planes.iter().map(|plane| dispatch!(*LEVEL, simd => Plane::of(simd, plane, size))).collect();
    let left = 1.0 - unknowns / planes.iter().map(|plane| plane.independent).sum::<f64>().max(1.0);
    planes.iter().map(|plane| plane.variance_px2).sum::<f64>() / left.max(LEAST_LEFT)
}

/// What one plane tells.
struct Plane {
    variance_px2: f64,
    /// So many independent pixels would tell as much of the mean.
    independent: f64,
}

impl Plane {
    #[inline(always)]
    fn of<S: Simd>(simd: S, plane: &[Influence], size: Size) -> Self {
        let Some(grid) = Grid::of(plane) else { return Self { variance_px2: 0.0, independent: 0.0 } };
        let [square, influence] = grid.sums(simd, 0);
        let square = square / plane.len() as f64;
        let (mut among, mut correlated_px) = (0.0, 0.0);
        for shift in grid.shifts() {
            let count = sum_of_products(simd, &grid.there, &grid.there[shift..]);
            if count > 0.0 {
                let [products, influence] = grid.sums(simd, shift);
                among += 2.0 * influence * products / count;
                correlated_px += 2.0 * products / count;
            }
        }
        let (square_there, count) = match size {
            Size::Alike => (square.max(1.0), plane.len() as f64),
            Size::AtTheEdge => at_the_edge(plane),
        };
        let over_square = |sum: f64| if square > 0.0 { sum / square } else { 0.0 };
        Self {
            variance_px2: square_there * (influence + over_square(among)).max(influence),
            independent: count / (1.0 + over_square(correlated_px)).max(1.0),
        }
    }
}

/// Mean square of the residuals, each counting by the square of what it moves, and how many there would be if all moved as much.
fn at_the_edge(plane: &[Influence]) -> (f64, f64) {
    let (mut squares, mut moves, mut moves2) = (0.0, 0.0, 0.0);
    for influence in plane {
        let moved = influence.moves_px.iter().map(|&moves| f64::from(moves).powi(2)).sum::<f64>();
        squares += moved * f64::from(influence.whitened).powi(2);
        moves += moved;
        moves2 += moved * moved;
    }
    if moves > 0.0 { (squares / moves, moves * moves / moves2) } else { (0.0, 0.0) }
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

    /// Sums over all pixels and their neighbours at a distance: of the products of residuals, and of those of what they move, mean of the axes.
    #[inline(always)]
    fn sums<S: Simd>(&self, simd: S, shift: usize) -> [f64; 2] {
        let [across, along] = &self.moves_px;
        let moves = sum_of_products(simd, across, &across[shift..]) + sum_of_products(simd, along, &along[shift..]);
        [sum_of_products(simd, &self.whitened, &self.whitened[shift..]), 0.5 * moves]
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
