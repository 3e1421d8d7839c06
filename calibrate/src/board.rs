//! The checkerboard: inner corners, counted in columns and rows, and the length of a square.

use std::str::FromStr;

use nalgebra::{Vector2, Vector3};

use crate::grid::Label;

/// A flat checkerboard. Its frame has the first inner corner as origin, x along the columns, y along the rows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Board {
    /// Inner corners along x and y.
    pub size: BoardSize,
    /// Length of a square [m].
    pub square_m: f64,
}

/// Inner corners of a checkerboard, as in `9x6`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BoardSize {
    /// Inner corners in a row.
    pub columns: usize,
    /// Inner corners in a column.
    pub rows: usize,
}

impl BoardSize {
    /// Number of inner corners.
    #[must_use]
    pub fn corners(self) -> usize {
        self.columns * self.rows
    }
}

impl FromStr for BoardSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = text.split_once(['x', 'X']).and_then(|(c, r)| Some((c.trim().parse().ok()?, r.trim().parse().ok()?)));
        match parsed {
            Some((columns, rows)) if (3..=60).contains(&columns) && (3..=60).contains(&rows) => Ok(Self { columns, rows }),
            _ => Err("expected inner corners as COLUMNSxROWS, each from 3 to 60, such as 9x6".to_owned()),
        }
    }
}

impl Board {
    /// A corner in the board's frame [m].
    #[must_use]
    pub fn point(&self, (column, row): Label) -> Vector3<f64> {
        Vector3::new(f64::from(column), f64::from(row), 0.0) * self.square_m
    }

    /// How far the two numbers of the board's bow move a corner: `1 - x^2, 1 - y^2` with `x, y` from -1 to 1 across the corners.
    #[must_use]
    pub fn bow(&self, (column, row): Label) -> Vector2<f64> {
        let part = |at: i32, count: usize| 1.0 - (2.0 * f64::from(at) / (count as f64 - 1.0) - 1.0).powi(2);
        Vector2::new(part(column, self.size.columns), part(row, self.size.rows))
    }

    /// The middle of the corners in the board's frame [m].
    #[must_use]
    pub fn middle(&self) -> Vector3<f64> {
        Vector3::new((self.size.columns - 1) as f64, (self.size.rows - 1) as f64, 0.0) * (0.5 * self.square_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_read_or_refused() {
        assert_eq!("9x6".parse(), Ok(BoardSize { columns: 9, rows: 6 }));
        assert_eq!(" 8 X 5 ".parse(), Ok(BoardSize { columns: 8, rows: 5 }));
        for wrong in ["", "9", "9x", "2x6", "9x-6", "9x6x3", "9*6", "900x6"] {
            assert!(wrong.parse::<BoardSize>().is_err(), "{wrong}");
        }
    }
}
