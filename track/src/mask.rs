//! From a speckled mask to outlines: 5x5 median, 3x3 erosion, 3x3 dilation, outer contours and their moments.
//!
//! Moments of the polygon through the outline's pixels by Green's theorem, `m_pq = integral of x^p y^q`, as OpenCV's `moments` has them:
//!
//! ```text
//! m00 = 1/2 sum c,   m10 = 1/6 sum c (x + x'),   m20 = 1/12 sum c (x^2 + x x' + x'^2),   c = x y' - x' y
//! m11 = 1/24 sum c (2 x y + x y' + x' y + 2 x' y')
//! ```

use image::GrayImage;
use imageproc::contours::{BorderType, find_contours};
use imageproc::distance_transform::Norm;
use imageproc::filter::median_filter;
use imageproc::morphology::{dilate, erode};
use imageproc::point::Point;
use nalgebra::{Matrix2, Vector2};

/// The paper's clean-up of a thresholded image: median over 5x5 pixels, then erosion and dilation by 3x3.
#[must_use]
pub fn clean(mask: &GrayImage) -> GrayImage {
    dilate(&erode(&median_filter(mask, 2, 2), Norm::LInf, 1), Norm::LInf, 1)
}

/// Outer outlines of the white areas, holes filled; in pixels of the mask.
#[must_use]
pub fn outlines(mask: &GrayImage) -> Vec<Vec<Point<i32>>> {
    find_contours(mask).into_iter().filter(|c| c.border_type == BorderType::Outer).map(|c| c.points).collect()
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
    pub fn of(outline: &[Point<i32>]) -> Option<Self> {
        // Relative to the first point: products of small numbers stay exact.
        let origin = Vector2::new(f64::from(outline.first()?.x), f64::from(outline.first()?.y));
        let point = |p: &Point<i32>| Vector2::new(f64::from(p.x), f64::from(p.y)) - origin;
        let (mut m00, mut first, mut second) = (0.0, Vector2::zeros(), Matrix2::zeros());
        for (here, next) in outline.iter().zip(outline.iter().cycle().skip(1)) {
            let (p, q) = (point(here), point(next));
            let c = p.x * q.y - q.x * p.y;
            let sum = p + q;
            m00 += c / 2.0;
            first += c / 6.0 * sum;
            second += c / 24.0 * (p * p.transpose() + q * q.transpose() + sum * sum.transpose());
        }
        if m00.abs() < 0.5 {
            return None;
        }
        let centroid = first / m00;
        let spread_px2 = second / m00 - centroid * centroid.transpose();
        Some(Self { area_px2: m00.abs(), centroid_px: centroid + origin, spread_px2 })
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
pub fn pixels_within(outline: &[Point<i32>], area_px2: f64) -> f64 {
    area_px2 + outline.len() as f64 / 2.0 + 1.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use image::Luma;

    #[test]
    fn moments_of_a_rectangle_by_hand() {
        let outline: Vec<Point<i32>> = [(10, 20), (16, 20), (16, 24), (10, 24)].map(|(x, y)| Point::new(x, y)).to_vec();
        let moments = Moments::of(&outline).unwrap();
        assert_relative_eq!(moments.area_px2, 24.0);
        assert_relative_eq!(moments.centroid_px, Vector2::new(13.0, 22.0));
        assert_relative_eq!(moments.spread_px2, Matrix2::new(3.0, 0.0, 0.0, 4.0 / 3.0), epsilon = 1e-12);
        assert_relative_eq!(moments.aspect(), 2.0 / 3.0, epsilon = 1e-12);
        assert_relative_eq!(moments.ellipse_fill(), 3.0 / std::f64::consts::PI, epsilon = 1e-12);
        assert!(Moments::of(&outline[..2]).is_none());
    }

    #[test]
    fn speckles_go_and_the_pixels_of_a_blob_are_counted() {
        let mask = GrayImage::from_fn(40, 30, |x, y| {
            let disc = (x as i32 - 20).pow(2) + (y as i32 - 15).pow(2) <= 49;
            Luma([if disc || (x, y) == (3, 3) { 255 } else { 0 }])
        });
        let clean = clean(&mask);
        let found = outlines(&clean);
        assert_eq!(found.len(), 1);
        let moments = Moments::of(&found[0]).unwrap();
        let white = clean.pixels().filter(|p| p.0[0] > 0).count() as f64;
        assert_relative_eq!(pixels_within(&found[0], moments.area_px2), white);
        assert_relative_eq!(moments.centroid_px, Vector2::new(20.0, 15.0), epsilon = 1e-9);
    }
}
