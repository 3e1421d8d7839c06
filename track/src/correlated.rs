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

use nalgebra::Vector2;

/// Neighbours farther apart than this count as independent [px]: half a block of JPEG.
const REACH_PX: i32 = 4;

/// One pixel of one plane.
#[derive(Debug, Clone, Copy)]
pub struct Influence {
    /// Column and row in the image.
    pub pixel: [i32; 2],
    /// Residual over its standard deviation.
    pub whitened: f64,
    /// What a residual of one standard deviation moves the centre by [px].
    pub moves_px: Vector2<f64>,
}

/// Least part of the errors' square that residuals are taken to keep, where pixels are hardly more than the unknowns.
const LEAST_LEFT: f64 = 0.25;

/// Variance of the centre, mean of its axes [px^2], from the planes' pixels and the number of unknowns that they determined; residuals count
/// as no smaller than expected.
#[must_use]
pub fn centre_variance_px2(planes: &[Vec<Influence>; 2], unknowns: f64) -> f64 {
    let [chroma, luma] = planes.each_ref().map(|plane| Plane::of(plane));
    let left = 1.0 - unknowns / (chroma.independent + luma.independent).max(1.0);
    (chroma.variance_px2 + luma.variance_px2) / left.max(LEAST_LEFT)
}

/// What one plane tells.
struct Plane {
    variance_px2: f64,
    /// So many independent pixels would tell as much of the mean.
    independent: f64,
}

impl Plane {
    fn of(plane: &[Influence]) -> Self {
        let Some(grid) = Grid::of(plane) else { return Self { variance_px2: 0.0, independent: 0.0 } };
        // Half the plane of shifts: the other half is the same.
        let shifts = (0..=REACH_PX).flat_map(|dy| (-REACH_PX..=REACH_PX).map(move |dx| [dx, dy])).filter(|&[dx, dy]| dy > 0 || dx >= 0);
        let mut own = [0.0; 2];
        let (mut among, mut correlated_px) = (0.0, 0.0);
        for shift in shifts {
            let (mut count, mut products, mut influence) = (0.0, 0.0, 0.0);
            for here in plane {
                if let Some(there) = grid.at([here.pixel[0] + shift[0], here.pixel[1] + shift[1]]) {
                    count += 1.0;
                    products += here.whitened * there.whitened;
                    influence += 0.5 * here.moves_px.dot(&there.moves_px);
                }
            }
            if shift == [0, 0] {
                own = [products / count, influence];
            } else if count > 0.0 {
                among += 2.0 * influence * products / count;
                correlated_px += 2.0 * products / count;
            }
        }
        let [square, influence] = own;
        let over_square = |sum: f64| if square > 0.0 { sum / square } else { 0.0 };
        Self {
            variance_px2: square.max(1.0) * (influence + over_square(among)).max(influence),
            independent: plane.len() as f64 / (1.0 + over_square(correlated_px)).max(1.0),
        }
    }
}

/// Where each pixel of a plane is in its list.
struct Grid<'p> {
    first: [i32; 2],
    width: i32,
    index: Vec<Option<&'p Influence>>,
}

impl<'p> Grid<'p> {
    fn of(plane: &'p [Influence]) -> Option<Self> {
        let range = |axis: usize| Some((plane.iter().map(|i| i.pixel[axis]).min()?, plane.iter().map(|i| i.pixel[axis]).max()?));
        let ((left, right), (top, bottom)) = (range(0)?, range(1)?);
        let width = right - left + 1;
        let mut grid = Self { first: [left, top], width, index: vec![None; (width * (bottom - top + 1)) as usize] };
        for influence in plane {
            let place = grid.place(influence.pixel)?;
            grid.index[place] = Some(influence);
        }
        Some(grid)
    }

    fn place(&self, [x, y]: [i32; 2]) -> Option<usize> {
        let (column, row) = (x - self.first[0], y - self.first[1]);
        let place = usize::try_from(row * self.width + column).ok()?;
        ((0..self.width).contains(&column) && row >= 0 && place < self.index.len()).then_some(place)
    }

    fn at(&self, pixel: [i32; 2]) -> Option<&'p Influence> {
        self.index[self.place(pixel)?]
    }
}
