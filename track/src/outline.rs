//! Outlines of the white areas of a binary image, as OpenCV's `findContours` follows them, and their moments.
//!
//! Areas are connected over edges and corners. The outer border of each is followed from its first pixel, holes are filled (Suzuki and Abe
//! 1985). Moments of the polygon through the outline's pixels follow from Green's theorem, `m_pq = integral of x^p y^q`:
//!
//! ```text
//! m00 = 1/2 sum c,   m10 = 1/6 sum c (x + x'),   m20 = 1/12 sum c (x^2 + x x' + x'^2),   c = x' y - x y'
//! m11 = 1/24 sum c (2 x y + x y' + x' y + 2 x' y')
//! ```
//!
//! The sums are whole numbers and exact; the centroid is made of them with the operations of OpenCV's `moments`, so that it is the same to
//! the last digit.

use nalgebra::{Matrix2, Vector2};

use crate::bits::Bits;

/// A pixel, column and row.
pub type Pixel = Vector2<i32>;

/// Neighbours of a pixel, clockwise in the image from the one to the left.
const AROUND: [[i32; 2]; 8] = [[-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0], [1, 1], [0, 1], [-1, 1]];

/// Outer outlines of all white areas, in the order of their first pixels, row by row.
#[must_use]
pub fn outlines(mask: &Bits) -> Vec<Vec<Pixel>> {
    first_pixels(mask).into_iter().map(|first| follow(mask, first)).collect()
}

/// White pixels next to each other in a row, from `start` up to, not including, `end`.
struct Run {
    start: usize,
    end: usize,
    /// An earlier run of the same area, or itself.
    parent: usize,
}

/// The uppermost of the leftmost pixels of each area: where a scan row by row first meets it.
fn first_pixels(mask: &Bits) -> Vec<Pixel> {
    let mut runs: Vec<(usize, Run)> = Vec::new();
    let mut above = 0..0;
    for y in 0..mask.height() {
        let first = runs.len();
        for (start, end) in runs_of(mask.row(y)) {
            let index = runs.len();
            runs.push((y, Run { start, end, parent: index }));
            // Runs of the row above that end before this one will not touch a later one either.
            while runs.get(above.start).is_some_and(|(_, run)| run.end < start) && !above.is_empty() {
                above.start += 1;
            }
            for other in above.clone() {
                if runs.get(other).is_none_or(|(_, run)| run.start > end) {
                    break;
                }
                join(&mut runs, index, other);
            }
        }
        above = first..runs.len();
    }
    let of = |(index, (y, run)): (usize, &(usize, Run))| (run.parent == index).then(|| Pixel::new(run.start as i32, *y as i32));
    runs.iter().enumerate().filter_map(of).collect()
}

/// Makes the earlier of two runs' roots the root of both.
fn join(runs: &mut [(usize, Run)], a: usize, b: usize) {
    let root = |mut index: usize| {
        while let Some((_, run)) = runs.get(index).filter(|(_, run)| run.parent != index) {
            index = run.parent;
        }
        index
    };
    let (a, b) = (root(a), root(b));
    if let Some((_, run)) = runs.get_mut(a.max(b)) {
        run.parent = a.min(b);
    }
}

/// Starts and ends of the runs in the words of a row.
fn runs_of(row: &[u64]) -> Vec<(usize, usize)> {
    let mut runs: Vec<(usize, usize)> = Vec::new();
    for (i, &word) in row.iter().enumerate() {
        let mut left = word;
        while left != 0 {
            let start = left.trailing_zeros();
            let length = (left >> start).trailing_ones();
            let from = 64 * i + start as usize;
            match runs.last_mut() {
                Some((_, end)) if *end == from => *end += length as usize,
                _ => runs.push((from, from + length as usize)),
            }
            left &= u64::MAX.checked_shl(start + length).unwrap_or(0);
        }
    }
    runs
}

/// The border of the area whose first pixel this is.
fn follow(mask: &Bits, first: Pixel) -> Vec<Pixel> {
    let neighbour = |pixel: Pixel, direction: usize| pixel + Pixel::from(AROUND[direction % 8]);
    let white = |pixel: Pixel, direction: usize| {
        let at = neighbour(pixel, direction);
        mask.get(at.x, at.y)
    };
    // The last pixel of the border: the first white one clockwise from the left.
    let Some(to_last) = (0..8).find(|&direction| white(first, direction)) else { return vec![first] };
    let last = neighbour(first, to_last);
    let mut outline = Vec::new();
    let (mut here, mut back) = (first, to_last);
    loop {
        outline.push(here);
        // The next: the first white one anticlockwise after the one that was come from, which is white itself.
        let ahead = (1..=8).map(|turn| back + 8 - turn).find(|&direction| white(here, direction)).unwrap_or(back);
        let next = neighbour(here, ahead);
        if next == first && here == last {
            return outline;
        }
        (here, back) = (next, (ahead + 4) % 8);
    }
}

/// Moments of the area within an outline.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moments {
    /// Area of the polygon through the outline's pixel centres [px^2].
    pub area_px2: f64,
    /// Its centroid [px].
    pub centroid_px: Vector2<f64>,
    /// Its second central moments over its area [px^2].
    pub spread_px2: Matrix2<f64>,
}

impl Moments {
    /// Of a closed outline; `None` where it encloses no area, as a line or a single pixel does.
    #[must_use]
    pub fn of(outline: &[Pixel]) -> Option<Self> {
        let (mut a00, mut a10, mut a01, mut a20, mut a11, mut a02) = (0_i64, 0_i64, 0_i64, 0_i64, 0_i64, 0_i64);
        for (here, next) in outline.iter().zip(outline.iter().cycle().skip(1)) {
            let [(x, y), (u, v)] = [here, next].map(|p| (i64::from(p.x), i64::from(p.y)));
            let c = x * v - u * y;
            a00 += c;
            a10 += c * (x + u);
            a01 += c * (y + v);
            a20 += c * (x * x + x * u + u * u);
            a11 += c * (2 * x * y + x * v + u * y + 2 * u * v);
            a02 += c * (y * y + y * v + v * v);
        }
        if a00 == 0 {
            return None;
        }
        // Products with the rounded reciprocals, and a quotient: in this order it is OpenCV's centroid.
        let [m00, m10, m01] = [(a00, 0.5), (a10, 1.0 / 6.0), (a01, 1.0 / 6.0)].map(|(sum, factor)| sum as f64 * factor);
        let centroid_px = Vector2::new(m10 / m00, m01 / m00);
        let second = Matrix2::new(a20 as f64 / 12.0, a11 as f64 / 24.0, a11 as f64 / 24.0, a02 as f64 / 12.0) / m00;
        Some(Self { area_px2: m00.abs(), centroid_px, spread_px2: second - centroid_px * centroid_px.transpose() })
    }

    /// Minor over major axis of the ellipse with these second moments: 1 for a disc.
    #[must_use]
    pub fn aspect(&self) -> f64 {
        let [minor, major] = self.variances();
        if major > 0.0 { (minor.max(0.0) / major).sqrt() } else { 0.0 }
    }

    /// The area over that of the ellipse with the same second moments: 1 for every ellipse, 0.955 for a rectangle, less for what is bent or torn.
    #[must_use]
    pub fn ellipse_fill(&self) -> f64 {
        let product = self.spread_px2.determinant();
        if product > 0.0 { self.area_px2 / (4.0 * std::f64::consts::PI * product.sqrt()) } else { 0.0 }
    }

    fn variances(&self) -> [f64; 2] {
        let (half, difference) = (self.spread_px2.trace() / 2.0, (self.spread_px2.m11 - self.spread_px2.m22) / 2.0);
        let root = difference.hypot(self.spread_px2.m12);
        [half - root, half + root]
    }
}

/// Number of pixels on and within an outline, by Pick's theorem: area + boundary / 2 + 1.
#[must_use]
pub fn pixels_within(outline: &[Pixel], area_px2: f64) -> f64 {
    area_px2 + outline.len() as f64 / 2.0 + 1.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn image(rows: &[&str]) -> Bits {
        let mut bits = Bits::black(rows[0].len(), rows.len());
        for (words, row) in bits.rows_mut().zip(rows) {
            for (x, _) in row.bytes().enumerate().filter(|(_, byte)| *byte == b'#') {
                words[x / 64] |= 1 << (x % 64);
            }
        }
        bits
    }

    #[test]
    fn moments_of_a_rectangle_by_hand() {
        let outline: Vec<Pixel> = [(10, 20), (16, 20), (16, 24), (10, 24)].map(|(x, y)| Pixel::new(x, y)).to_vec();
        let moments = Moments::of(&outline).unwrap();
        assert_relative_eq!(moments.area_px2, 24.0);
        assert_relative_eq!(moments.centroid_px, Vector2::new(13.0, 22.0));
        assert_relative_eq!(moments.spread_px2, Matrix2::new(3.0, 0.0, 0.0, 4.0 / 3.0), epsilon = 1e-10);
        assert_relative_eq!(moments.aspect(), 2.0 / 3.0, epsilon = 1e-10);
        assert_relative_eq!(moments.ellipse_fill(), 3.0 / std::f64::consts::PI, epsilon = 1e-10);
        assert!(Moments::of(&outline[..2]).is_none());
    }

    #[test]
    fn areas_that_meet_at_corners_or_below_are_one() {
        let bits = image(&["#...#..#", ".#.#....", "..#....#", "#.......", "#..##..."]);
        let found = outlines(&bits);
        let firsts: Vec<Pixel> = found.iter().map(|outline| outline[0]).collect();
        assert_eq!(firsts, [(0, 0), (7, 0), (7, 2), (0, 3), (3, 4)].map(|(x, y)| Pixel::new(x, y)));
        // There and back along both arms of the V.
        assert_eq!(found[0].len(), 8);
        assert_eq!(found[1], [Pixel::new(7, 0)]);
    }

    #[test]
    fn holes_are_filled_and_what_is_in_them_is_another_area() {
        let bits = image(&["#######", "#.....#", "#..#..#", "#.....#", "#######"]);
        let found = outlines(&bits);
        assert_eq!(found.iter().map(Vec::len).collect::<Vec<_>>(), [20, 1]);
        let moments = Moments::of(&found[0]).unwrap();
        assert_relative_eq!(moments.area_px2, 24.0);
        assert_relative_eq!(pixels_within(&found[0], moments.area_px2), 35.0);
        assert_eq!(moments.centroid_px, Vector2::new(3.0, 2.0));
    }

    #[test]
    fn a_run_over_the_edge_of_a_word_is_one() {
        let row = format!("{}{}{}", ".".repeat(60), "#".repeat(80), ".".repeat(10));
        assert_eq!(runs_of(image(&[&row]).row(0)), [(60, 140)]);
        assert_eq!(outlines(&image(&[&row, &row])).len(), 1);
    }
}
