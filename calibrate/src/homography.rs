//! Plane to image: `s (u, v, 1)' = H (x, y, 1)'`, fitted to point pairs by the normalised direct linear transform (Hartley 1997).

use nalgebra::{Matrix3, SMatrix, SVector, Vector2, Vector3};

/// Homography that takes the first of each pair to the second; the scale is such that `H[2][2]`'s row has unit length.
///
/// `None` for fewer than four pairs, for pairs on one line, or for numbers that are not finite.
#[must_use]
pub fn fit(pairs: &[(Vector2<f64>, Vector2<f64>)]) -> Option<Matrix3<f64>> {
    if pairs.len() < 4 {
        return None;
    }
    let from = normaliser(pairs.iter().map(|p| p.0))?;
    let to = normaliser(pairs.iter().map(|p| p.1))?;
    let mut normal = SMatrix::<f64, 9, 9>::zeros();
    for (a, b) in pairs {
        let p = from * a.push(1.0);
        let q = to * b.push(1.0);
        let first = SVector::<f64, 9>::from([p.x, p.y, 1.0, 0.0, 0.0, 0.0, -q.x * p.x, -q.x * p.y, -q.x]);
        let second = SVector::<f64, 9>::from([0.0, 0.0, 0.0, p.x, p.y, 1.0, -q.y * p.x, -q.y * p.y, -q.y]);
        normal += first * first.transpose() + second * second.transpose();
    }
    let eigen = normal.symmetric_eigen();
    let mut order: Vec<usize> = (0..9).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    // A second vanishing eigenvalue: the points do not determine a homography.
    if eigen.eigenvalues[order[1]] < 1e-9 * eigen.eigenvalues[order[8]] {
        return None;
    }
    let h = eigen.eigenvectors.column(order[0]);
    let matrix = to.try_inverse()? * Matrix3::from_row_slice(h.as_slice()) * from;
    let scale = matrix.row(2).norm();
    (scale > 0.0 && matrix.iter().all(|v| v.is_finite())).then(|| matrix / scale)
}

/// Where a homography takes a point; `None` on or behind the line that it takes to infinity.
#[must_use]
pub fn apply(homography: &Matrix3<f64>, point: &Vector2<f64>) -> Option<Vector2<f64>> {
    let image = homography * point.push(1.0);
    (image.z.abs() > 1e-12).then(|| image.xy() / image.z)
}

/// Moves the middle of the points to the origin and their mean distance from it to the square root of two.
fn normaliser(points: impl Iterator<Item = Vector2<f64>> + Clone) -> Option<Matrix3<f64>> {
    let count = points.clone().count() as f64;
    let middle = points.clone().sum::<Vector2<f64>>() / count;
    let spread = points.map(|p| (p - middle).norm()).sum::<f64>() / count;
    let scale = std::f64::consts::SQRT_2 / spread;
    let shift = -scale * middle;
    (scale.is_finite() && shift.iter().all(|v| v.is_finite()))
        .then(|| Matrix3::from_columns(&[Vector3::x() * scale, Vector3::y() * scale, shift.push(1.0)]))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn exact_points_give_the_homography_back(
            tilt in prop::array::uniform2(-1e-3..1e-3_f64), turn in -3.0..3.0_f64, scale in 10.0..60.0_f64, shift in prop::array::uniform2(50.0..500.0_f64),
        ) {
            let (s, c) = turn.sin_cos();
            let truth = Matrix3::new(scale * c, -scale * s, shift[0], scale * s, scale * c, shift[1], 10.0 * tilt[0], 10.0 * tilt[1], 1.0);
            let grid = (0..20).map(|k| Vector2::new(f64::from(k % 5), f64::from(k / 5)));
            let pairs: Vec<_> = grid.map(|p| (p, apply(&truth, &p).unwrap())).collect();
            let found = fit(&pairs).unwrap();
            for (p, q) in &pairs {
                prop_assert!((apply(&found, p).unwrap() - q).norm() < 1e-6);
            }
        }
    }

    #[test]
    fn a_line_of_points_is_refused() {
        let pairs: Vec<_> = (0..9).map(|k| (Vector2::new(f64::from(k), 2.0), Vector2::new(3.0 * f64::from(k), 7.0))).collect();
        assert!(fit(&pairs).is_none());
        assert!(fit(&pairs[..3]).is_none());
    }
}
