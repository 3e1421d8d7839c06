//! One recording as the estimation sees it: how the motors moved, and where the cameras saw the tip.

use nalgebra::{Matrix3, Vector3};

use crate::motion::Motion;

/// The tip, seen once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sighting {
    /// Stamp [s], from the session's start.
    pub time_s: f64,
    /// Where it was seen, frame 0 [m].
    pub position_m: Vector3<f64>,
    /// Covariance of the position [m^2].
    pub covariance_m2: Matrix3<f64>,
}

impl Sighting {
    /// With the covariance [m^2] of the position; `None` if that is no covariance or anything is not finite.
    #[must_use]
    pub fn new(time_s: f64, position_m: Vector3<f64>, covariance_m2: &Matrix3<f64>) -> Option<Self> {
        let covariance_m2 = 0.5 * (covariance_m2 + covariance_m2.transpose());
        let finite = time_s.is_finite() && position_m.iter().all(|v| v.is_finite());
        (finite && whitening(&covariance_m2).is_some()).then_some(Self { time_s, position_m, covariance_m2 })
    }
}

/// What makes an error of this covariance one of unit covariance; `None` if it is no covariance.
#[must_use]
pub fn whitening(covariance: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let whiten = covariance.cholesky()?.l().try_inverse()?;
    whiten.iter().all(|v| v.is_finite()).then_some(whiten)
}

/// One recording.
#[derive(Debug, Clone)]
pub struct Session {
    /// File name.
    pub name: String,
    /// SHA-256 of the file.
    pub sha256: String,
    /// Motors.
    pub motion: Motion,
    /// Usable sightings, in time.
    pub sightings: Vec<Sighting>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn whitening_gives_unit_covariance() {
        let covariance = Matrix3::new(4e-6, 1e-6, 0.0, 1e-6, 2e-6, 0.0, 0.0, 0.0, 1e-8);
        let whiten = whitening(&covariance).unwrap();
        assert_relative_eq!(whiten * covariance * whiten.transpose(), Matrix3::identity(), epsilon = 1e-12);
    }

    #[test]
    fn what_is_no_covariance_is_refused() {
        assert!(Sighting::new(0.0, Vector3::zeros(), &Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0))).is_none());
        assert!(Sighting::new(0.0, Vector3::new(f64::NAN, 0.0, 0.0), &Matrix3::identity()).is_none());
        assert!(Sighting::new(0.0, Vector3::zeros(), &Matrix3::repeat(f64::NAN)).is_none());
    }
}
