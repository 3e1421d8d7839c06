//! Corners labelled by column and row, before it is known where on the board they sit.
//!
//! A detector numbers the corners it finds from any of them and with any of four turns. Two grids of one board therefore differ by a
//! quarter turn and a shift, [`Relabel`]; the known size of the board and the colour of its squares leave few of these, see
//! [`Grid::placements`].

use std::collections::BTreeMap;

use image::GrayImage;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector2, Vector3};

use crate::board::BoardSize;
use crate::saddle::bilinear;

/// Column and row of a corner.
pub type Label = (i32, i32);

/// Labelled corners of one image [px].
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Grid {
    /// Pixel of each corner found.
    pub corners: BTreeMap<Label, Vector2<f64>>,
}

/// A quarter turn and a shift of labels: a whole-numbered motion of the board in its own plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Relabel {
    /// Quarter turns from columns to rows, 0 to 3.
    pub turns: u8,
    /// Added after the turn.
    pub shift: Label,
}

impl Relabel {
    /// New label of a corner.
    #[must_use]
    pub fn apply(&self, label: Label) -> Label {
        let (column, row) = turned(self.turns, label);
        (column + self.shift.0, row + self.shift.1)
    }

    /// The way back.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let turns = (4 - self.turns) % 4;
        let (column, row) = turned(turns, self.shift);
        Self { turns, shift: (-column, -row) }
    }

    /// First `first`, then this.
    #[must_use]
    pub fn after(&self, first: &Self) -> Self {
        Self { turns: (self.turns + first.turns) % 4, shift: self.apply(first.shift) }
    }

    /// The same motion of points on a board with squares of this length.
    #[must_use]
    pub fn motion(&self, square_m: f64) -> Isometry3<f64> {
        let turn = UnitQuaternion::from_scaled_axis(Vector3::z() * f64::from(self.turns) * std::f64::consts::FRAC_PI_2);
        let shift = Vector3::new(f64::from(self.shift.0), f64::from(self.shift.1), 0.0) * square_m;
        Isometry3::from_parts(Translation3::from(shift), turn)
    }
}

fn turned(turns: u8, (column, row): Label) -> Label {
    match turns % 4 {
        0 => (column, row),
        1 => (-row, column),
        2 => (-column, -row),
        _ => (row, -column),
    }
}

impl Grid {
    /// Smallest and largest column and row; `None` of an empty grid.
    #[must_use]
    pub fn extent(&self) -> Option<(Label, Label)> {
        let columns = self.corners.keys().map(|l| l.0);
        let rows = self.corners.keys().map(|l| l.1);
        Some(((columns.clone().min()?, rows.clone().min()?), (columns.max()?, rows.max()?)))
    }

    /// Number of columns and rows that the corners span.
    #[must_use]
    pub fn span(&self) -> (usize, usize) {
        self.extent().map_or((0, 0), |((c0, r0), (c1, r1))| ((c1 - c0 + 1) as usize, (r1 - r0 + 1) as usize))
    }

    /// Whether a span can be a part of the board, upright or lying.
    #[must_use]
    pub fn fits((columns, rows): (usize, usize), size: BoardSize) -> bool {
        (columns <= size.columns && rows <= size.rows) || (columns <= size.rows && rows <= size.columns)
    }

    /// Mirrors the labels where they are left-handed in the image, so that turning from columns to rows is turning from u to v.
    pub fn make_right_handed(&mut self) {
        let area: f64 = self
            .corners
            .iter()
            .filter_map(|(&(c, r), p)| {
                let (across, down) = (self.corners.get(&(c + 1, r))? - p, self.corners.get(&(c, r + 1))? - p);
                Some(across.x * down.y - across.y * down.x)
            })
            .sum();
        if area < 0.0 {
            self.corners = std::mem::take(&mut self.corners).into_iter().map(|((c, r), p)| ((-c, r), p)).collect();
        }
    }

    /// Keeps the part of the size of the board with the most corners, of equals the one with the largest `weight`.
    pub fn crop(&mut self, size: BoardSize, weight: impl Fn(Label) -> f64) {
        let (Some(((c0, r0), _)), span) = (self.extent(), self.span()) else { return };
        if Self::fits(span, size) {
            return;
        }
        let inside =
            |&(c, r): &Label, at: Label, window: (i32, i32)| (0..window.0).contains(&(c - at.0)) && (0..window.1).contains(&(r - at.1));
        let mut best: Option<(usize, f64, Label, (i32, i32))> = None;
        for (columns, rows) in [(size.columns, size.rows), (size.rows, size.columns)] {
            let window = (columns as i32, rows as i32);
            for c in c0..=c0 + span.0.saturating_sub(columns) as i32 {
                for r in r0..=r0 + span.1.saturating_sub(rows) as i32 {
                    let kept: Vec<Label> = self.corners.keys().copied().filter(|l| inside(l, (c, r), window)).collect();
                    let candidate = (kept.len(), kept.iter().map(|&l| weight(l)).sum::<f64>(), (c, r), window);
                    if best.is_none_or(|b| (candidate.0, candidate.1) > (b.0, b.1)) {
                        best = Some(candidate);
                    }
                }
            }
        }
        if let Some((_, _, at, window)) = best {
            self.corners.retain(|l, _| inside(l, at, window));
        }
    }

    /// Whether the squares of even column plus row are the dark ones; `None` where the image does not say.
    ///
    /// A square is named by its corner of smallest column and row.
    #[must_use]
    pub fn even_squares_are_dark(&self, image: &GrayImage) -> Option<bool> {
        let (mut sum, mut squares, mut count) = ([0.0; 2], [0.0; 2], 0.0);
        for (&(c, r), p) in &self.corners {
            let others = [(c + 1, r), (c, r + 1), (c + 1, r + 1)].map(|l| self.corners.get(&l));
            let [Some(q), Some(s), Some(t)] = others else { continue };
            let Some(grey) = bilinear(image, (p + q + s + t) * 0.25) else { continue };
            let odd = usize::from((c + r).rem_euclid(2) == 1);
            sum[odd] += grey;
            squares[odd] += 1.0;
            count += 1.0;
        }
        // Both colours must have been seen, and differ by what noise of a few grey levels cannot make.
        let contrast = sum[1] / squares[1] - sum[0] / squares[0];
        (count >= 2.0 && contrast.abs() > 5.0).then_some(contrast > 0.0)
    }

    /// The ways in which these corners can sit on a board whose square between its first four inner corners is dark.
    ///
    /// Boards with an odd sum of columns and rows leave one way to a full grid, others two, square ones up to four.
    #[must_use]
    pub fn placements(&self, size: BoardSize, even_squares_are_dark: Option<bool>) -> Vec<Relabel> {
        let Some((low, high)) = self.extent() else { return Vec::new() };
        let mut found = Vec::new();
        for turns in 0..4 {
            let (a, b) = (turned(turns, low), turned(turns, high));
            let (first, last) = ((a.0.min(b.0), a.1.min(b.1)), (a.0.max(b.0), a.1.max(b.1)));
            let free = (size.columns as i32 - 1 - (last.0 - first.0), size.rows as i32 - 1 - (last.1 - first.1));
            for c in 0..=free.0 {
                for r in 0..=free.1 {
                    let relabel = Relabel { turns, shift: (c - first.0, r - first.1) };
                    if even_squares_are_dark.is_none_or(|dark| relabel.keeps_colour() == dark) {
                        found.push(relabel);
                    }
                }
            }
        }
        found
    }
}

impl Relabel {
    /// Whether squares of even label get even labels.
    fn keeps_colour(&self) -> bool {
        let corners = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|l| self.apply(l));
        let first = corners.into_iter().fold((i32::MAX, i32::MAX), |m, l| (m.0.min(l.0), m.1.min(l.1)));
        (first.0 + first.1).rem_euclid(2) == 0
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use nalgebra::Point3;
    use proptest::prelude::*;

    use super::*;

    fn full(columns: i32, rows: i32) -> Grid {
        let labels = (0..columns).flat_map(|c| (0..rows).map(move |r| (c, r)));
        Grid { corners: labels.map(|(c, r)| ((c, r), Vector2::new(30.0 + 20.0 * f64::from(c), 40.0 + 20.0 * f64::from(r)))).collect() }
    }

    fn any_relabel() -> impl Strategy<Value = Relabel> {
        (0..4_u8, -9..9_i32, -9..9_i32).prop_map(|(turns, c, r)| Relabel { turns, shift: (c, r) })
    }

    proptest! {
        #[test]
        fn relabels_are_a_group_of_motions(a in any_relabel(), b in any_relabel(), c in -9..9_i32, r in -9..9_i32) {
            prop_assert_eq!(a.inverse().apply(a.apply((c, r))), (c, r));
            prop_assert_eq!(a.after(&b).apply((c, r)), a.apply(b.apply((c, r))));
            let (x, y) = a.apply((c, r));
            let moved = a.motion(0.012) * Point3::new(f64::from(c) * 0.012, f64::from(r) * 0.012, 0.0);
            prop_assert!((moved - Point3::new(f64::from(x) * 0.012, f64::from(y) * 0.012, 0.0)).norm() < 1e-12);
        }
    }

    #[test]
    fn colour_and_size_leave_the_right_number_of_placements() {
        let board = |columns, rows| BoardSize { columns, rows };
        let count = |grid: &Grid, size, dark| grid.placements(size, dark).len();
        assert_eq!(count(&full(9, 6), board(9, 6), Some(true)), 1);
        assert_eq!(full(9, 6).placements(board(9, 6), Some(false))[0].turns, 2);
        assert_eq!(count(&full(6, 9), board(9, 6), Some(true)), 1);
        assert_eq!(count(&full(8, 6), board(8, 6), Some(true)), 2);
        assert_eq!(count(&full(6, 6), board(6, 6), Some(true)), 4);
        assert_eq!(count(&full(7, 7), board(7, 7), Some(true)), 2);
        assert_eq!(count(&full(9, 6), board(9, 6), None), 2);
        // One column lacks: two shifts, of which the colour leaves one per turn.
        assert_eq!(count(&full(8, 6), board(9, 6), Some(true)), 2);
        assert_eq!(count(&full(9, 7), board(9, 6), Some(true)), 0);
    }

    #[test]
    fn over_detections_are_cropped_to_the_best_part() {
        let mut grid = full(10, 7);
        grid.corners.remove(&(0, 3));
        grid.crop(BoardSize { columns: 9, rows: 6 }, |(_, r)| if r == 6 { 5.0 } else { 10.0 });
        assert_eq!(grid.extent(), Some(((1, 0), (9, 5))));
        assert_eq!(grid.corners.len(), 54);
    }

    #[test]
    fn colours_are_read_from_the_image() {
        let grid = full(9, 6);
        let image = GrayImage::from_fn(300, 200, |x, y| image::Luma([if (x.wrapping_sub(30) / 20 + y / 20) % 2 == 0 { 40 } else { 200 }]));
        assert_eq!(grid.even_squares_are_dark(&image), Some(true));
        let flat = GrayImage::from_pixel(300, 200, image::Luma([90]));
        assert_eq!(grid.even_squares_are_dark(&flat), None);
    }

    #[test]
    fn mirrored_labels_are_turned_round() {
        let mut grid = full(9, 6);
        grid.corners = grid.corners.into_iter().map(|((c, r), p)| ((-c, r), p)).collect();
        grid.make_right_handed();
        assert_relative_eq!(grid.corners[&(1, 0)] - grid.corners[&(0, 0)], Vector2::new(20.0, 0.0));
    }
}
