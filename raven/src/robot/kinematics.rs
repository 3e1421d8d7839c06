//! Spherical-wrist kinematics of the first three joints: frames after Craig, `T(i-1,i) = Rx(alpha) Rz(theta) Tz(d)`.
//!
//! All axes meet in the remote centre of motion, the origin of frame 0. With `rho = d3 + d4` the tracked point is `rho z3`, in closed
//! form (gold) with `G1, G2 = sin, cos` of the first link's angle and `G3, G4 = sin, cos` of the second's:
//!
//! ```text
//! x = rho ( B1 cos t1 + B2 sin t1),  y = rho (-B2 cos t1 + B1 sin t1),  z = -rho (G1 G3 cos t2 + G2 G4)
//! B1 = G3 sin t2,  B2 = G2 G3 cos t2 - G1 G4
//! ```
//!
//! Source: the public UW controller's DH table; see `docs/conventions.md`.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Matrix3, Rotation3, Vector3};
use serde::Deserialize;

/// Which arm: it fixes the frames and the signs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ArmSide {
    /// The left arm.
    Gold,
    /// The right arm.
    Green,
}

impl ArmSide {
    /// As in robot files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Gold => "gold",
            Self::Green => "green",
        }
    }

    /// Name of the arm's frame 0 in logs.
    #[must_use]
    pub const fn frame0(self) -> &'static str {
        match self {
            Self::Gold => "frame0_gold",
            Self::Green => "frame0_green",
        }
    }

    /// The arm on the other side.
    #[must_use]
    pub const fn other(self) -> Self {
        match self {
            Self::Gold => Self::Green,
            Self::Green => Self::Gold,
        }
    }
}

/// On which side of the remote centre the tracked point is: the inverse has two branches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Branch {
    /// `d3 < -d4`: where the robot works.
    Working,
    /// `d3 > -d4`: where its hard stop is.
    HardStop,
}

/// Geometry of the first three joints.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kinematics {
    /// Gold or green.
    pub arm: ArmSide,
    /// Angle between axes 1 and 2 [rad].
    pub link_angle_12: f64,
    /// Angle between axes 2 and 3 [rad].
    pub link_angle_23: f64,
    /// `d4` [m]: the tracked point sits at `d3 + d4` along the tool.
    pub wrist_offset: f64,
    pub(super) gravity: [f64; 3],
}

impl Kinematics {
    /// Gravity in frame 0 [m/s^2].
    #[must_use]
    pub fn gravity(&self) -> Vector3<f64> {
        Vector3::from(self.gravity)
    }

    pub(super) fn gravity_array(&self) -> [f64; 3] {
        self.gravity
    }

    pub(super) fn twists(&self) -> [f64; 3] {
        match self.arm {
            ArmSide::Gold => [0.0, self.link_angle_12, PI - self.link_angle_23],
            ArmSide::Green => [PI, self.link_angle_12, self.link_angle_23],
        }
    }

    pub(super) fn thetas(&self, joint: &Vector3<f64>) -> [f64; 3] {
        let (offset1, offset2, theta3) = self.angle_offsets();
        [joint[0] + offset1, joint[1] + offset2, theta3]
    }

    fn angle_offsets(&self) -> (f64, f64, f64) {
        match self.arm {
            ArmSide::Gold => (205.0_f64.to_radians(), PI, FRAC_PI_2),
            ArmSide::Green => (25.0_f64.to_radians(), 0.0, -FRAC_PI_2),
        }
    }

    /// Rotations between neighbouring frames, `R(i-1,i)`.
    #[must_use]
    pub fn link_rotations(&self, joint: &Vector3<f64>) -> [Matrix3<f64>; 3] {
        let (twist, theta) = (self.twists(), self.thetas(joint));
        std::array::from_fn(|i| {
            let ((sa, ca), (st, ct)) = (twist[i].sin_cos(), theta[i].sin_cos());
            Matrix3::new(ct, -st, 0.0, st * ca, ct * ca, -sa, st * sa, ct * sa, ca)
        })
    }

    /// Axes `z1`, `z2`, `z3` of the joints in frame 0, and the orientation of the tool's frame.
    #[must_use]
    pub fn axes(&self, joint: &Vector3<f64>) -> ([Vector3<f64>; 3], Rotation3<f64>) {
        let [r01, r12, r23] = self.link_rotations(joint);
        let r02 = r01 * r12;
        let r03 = r02 * r23;
        let z = |r: &Matrix3<f64>| Vector3::from(r.column(2));
        ([z(&r01), z(&r02), z(&r03)], Rotation3::from_matrix_unchecked(r03))
    }

    /// Tracked point in frame 0 [m] of joint angles [rad, rad, m].
    #[must_use]
    pub fn forward(&self, joint: &Vector3<f64>) -> Vector3<f64> {
        self.axes(joint).0[2] * (joint[2] + self.wrist_offset)
    }

    /// Jacobian of [`Self::forward`], 3x3 [m/rad, m/rad, 1].
    #[must_use]
    pub fn jacobian(&self, joint: &Vector3<f64>) -> Matrix3<f64> {
        let ([z1, z2, z3], _) = self.axes(joint);
        let tip = z3 * (joint[2] + self.wrist_offset);
        Matrix3::from_columns(&[z1.cross(&tip), z2.cross(&tip), z3])
    }

    /// Joint angles [rad, rad, m] that bring the tracked point to `tip` [m, frame 0], with the elbow between 0 and 180 deg.
    ///
    /// `None` at the remote centre, where the angles cannot be seen, and outside the reach.
    #[must_use]
    pub fn inverse(&self, tip: &Vector3<f64>, branch: Branch) -> Option<Vector3<f64>> {
        let reach = tip.norm();
        if !reach.is_normal() || reach < 1e-6 {
            return None;
        }
        let rho = match branch {
            Branch::Working => -reach,
            Branch::HardStop => reach,
        };
        let ((g1, g2), (g3, g4)) = (self.link_angle_12.sin_cos(), self.link_angle_23.sin_cos());
        let direction = tip / rho;
        let (offset1, offset2, _) = self.angle_offsets();
        let (cos2, sin2_sign, y, b2_constant) = match self.arm {
            ArmSide::Gold => ((-direction.z - g2 * g4) / (g1 * g3), -1.0, direction.y, -g1 * g4),
            ArmSide::Green => ((direction.z + g2 * g4) / (g1 * g3), 1.0, -direction.y, g1 * g4),
        };
        if cos2.abs() > 1.0 {
            return None;
        }
        let sin2 = sin2_sign * (1.0 - cos2 * cos2).sqrt();
        let (b1, b2) = (g3 * sin2, g2 * g3 * cos2 + b2_constant);
        let theta1 = y.atan2(direction.x) + b2.atan2(b1);
        Some(Vector3::new(wrap(theta1 - offset1), wrap(sin2.atan2(cos2) - offset2), rho - self.wrist_offset))
    }

    /// The branch that a joint position lies on.
    #[must_use]
    pub fn branch(&self, joint: &Vector3<f64>) -> Branch {
        if joint[2] + self.wrist_offset > 0.0 { Branch::HardStop } else { Branch::Working }
    }
}

/// An angle in (-pi, pi].
fn wrap(angle: f64) -> f64 {
    let turned = angle.rem_euclid(2.0 * PI);
    if turned > PI { turned - 2.0 * PI } else { turned }
}
