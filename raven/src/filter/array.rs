//! Triangularisation `L L' = A A'` by Householder reflections: the one step on which array filters rest.
//!
//! No covariance is ever formed and nothing is ever subtracted from one, so the result has a real factor whatever the noise
//! (Kailath, Sayed, Hassibi, Linear Estimation, chapter 12).

/// A work space that turns `A` (rows x columns, more columns than rows) into the lower-triangular `L` with `L L' = A A'`.
#[derive(Debug, Clone)]
pub(super) struct Triangulariser {
    rows: usize,
    columns: usize,
    /// Row-major, so that each Householder vector runs over contiguous numbers.
    entries: Vec<f64>,
}

impl Triangulariser {
    pub(super) fn new(rows: usize, columns: usize) -> Self {
        Self { rows, columns, entries: vec![0.0; rows * columns] }
    }

    /// Sets `A[row, column]`.
    pub(super) fn set(&mut self, row: usize, column: usize, value: f64) {
        self.entries[row * self.columns + column] = value;
    }

    pub(super) fn clear(&mut self) {
        self.entries.fill(0.0);
    }

    /// Reflects `A` to `[L 0]` in place, the diagonal of `L` not negative.
    pub(super) fn triangularise(&mut self) {
        let width = self.columns;
        for pivot in 0..self.rows {
            let (done, below) = self.entries.split_at_mut((pivot + 1) * width);
            let vector = &mut done[pivot * width + pivot..];
            let norm = vector.iter().map(|v| v * v).sum::<f64>().sqrt();
            if norm == 0.0 {
                continue;
            }
            // The sign that avoids cancellation makes the pivot -sign(head) norm; the row is flipped to a positive diagonal after.
            let head = vector[0];
            let pivoted = if head > 0.0 { -norm } else { norm };
            vector[0] = head - pivoted;
            let scale = -1.0 / (pivoted * vector[0]);
            let flip = pivoted < 0.0;
            for row in below.chunks_exact_mut(width) {
                let tail = &mut row[pivot..];
                let dot: f64 = tail.iter().zip(vector.iter()).map(|(a, b)| a * b).sum();
                let factor = dot * scale;
                for (a, b) in tail.iter_mut().zip(vector.iter()) {
                    *a -= factor * b;
                }
                if flip {
                    tail[0] = -tail[0];
                }
            }
            vector.fill(0.0);
            vector[0] = norm;
        }
    }

    /// `L[row, column]` after [`Self::triangularise`].
    pub(super) fn get(&self, row: usize, column: usize) -> f64 {
        self.entries[row * self.columns + column]
    }
}
