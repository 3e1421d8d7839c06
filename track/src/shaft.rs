//! The shaft that a marker sits on, as it goes away from the ball in an image.
//!
//! A cylinder that leaves a ball of twice its width hides a seventh of the radius at the ball's edge, unless it leads away from the camera. No residual
//! shows that as something that is not the ball, and the centre moves away from the shaft by up to 0.15 px, more in one place than in another, which
//! passes for a radius. The robot's own numbers and the registration have the direction of the shaft to a few degrees, and what lies along it is not
//! looked at.

use nalgebra::Vector2;

use crate::plane::Kind;

/// Part of the shaft along which the ball's edge is not looked at: where the ball is twice as wide it hides two thirds as much there as in its middle.
/// Where all of it is left out radii come out nearer still, but light and shade tell more on the centre: squared errors of an independent renderer's
/// tips are then 1.6 times as large over their claims.
const HIDING: f64 = 0.6;

/// A shaft in an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shaft {
    /// Where it goes from the ball's centre, unit length.
    pub direction: Vector2<f64>,
    /// Half its width [px].
    pub radius_px: f64,
}

impl Shaft {
    /// Takes what lies along the shaft outside a ball, row by row of so many columns, for what is not looked at. The place of the ball's `centre` is
    /// that of the mask, and counts as the first pixel's do.
    pub(crate) fn hide(&self, kinds: &mut [Kind], columns: usize, centre: Vector2<f64>) {
        for (i, kind) in kinds.iter_mut().enumerate().filter(|(_, kind)| **kind != Kind::Core) {
            let from_centre = Vector2::new((i % columns) as f64, (i / columns) as f64) - centre;
            let across = from_centre.perp(&self.direction).abs();
            if from_centre.dot(&self.direction) > 0.0 && across < HIDING * self.radius_px {
                *kind = Kind::Far;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_lies_along_the_shaft_and_not_in_the_ball_is_left_out() {
        let shaft = Shaft { direction: Vector2::new(0.0, -1.0), radius_px: 1.2 / HIDING };
        let mut kinds = [Kind::Outside; 25];
        (kinds[12], kinds[7]) = (Kind::Core, Kind::Edge);
        shaft.hide(&mut kinds, 5, Vector2::new(2.0, 2.0));
        let far: Vec<usize> = (0..25).filter(|&i| kinds[i] == Kind::Far).collect();
        assert_eq!(far, [1, 2, 3, 6, 7, 8], "two rows above the centre, three columns wide");
        assert!(kinds[12] == Kind::Core);
    }
}
