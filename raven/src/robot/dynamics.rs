//! Rigid-body dynamics of the links: `M(q) qdd + C(q, qd) + G(q)`, each link in its own DH frame.
//!
//! A whole motion goes by the recursive Newton-Euler method (Luh, Walker, Paul 1980; Craig, Introduction to Robotics, section 6.5). The mass matrix,
//! and what the motion there is asks for, are of the second and third link as one body, whose inertia about the remote centre the insertion changes:
//! the same for a third of the price.

use nalgebra::{Matrix3, Vector3};
use serde::Deserialize;

use super::Kinematics;

/// One link: mass, centre of mass and inertia about it, in the link's own DH frame.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Link {
    /// [kg].
    pub mass: f64,
    /// [m].
    pub center_of_mass: [f64; 3],
    /// `[xx, yy, zz, xy, xz, yz]` [kg m^2] about the centre of mass.
    pub inertia: [f64; 6],
}

impl Link {
    /// Its inertia as a matrix [kg m^2].
    #[must_use]
    pub fn inertia_matrix(&self) -> Matrix3<f64> {
        let [xx, yy, zz, xy, xz, yz] = self.inertia;
        Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
    }
}

/// Dynamics of the first three links.
#[derive(Debug, Clone, PartialEq)]
pub struct LinkDynamics {
    kinematics: Kinematics,
    mass: [f64; 3],
    center: [Vector3<f64>; 3],
    inertia: [Matrix3<f64>; 3],
    gravity: Vector3<f64>,
    payload_kg: f64,
    fixed: FixedParts,
}

/// The second and third link as one body, in frame 2.
struct OuterLinks {
    /// Inertia about the remote centre [kg m^2].
    inertia: Matrix3<f64>,
    /// Joint axes 1 and 3.
    axis_1: Vector3<f64>,
    axis_3: Vector3<f64>,
    /// First moment of what slides along axis 3 [kg m], and its mass.
    sliding_moment: Vector3<f64>,
    sliding_kg: f64,
}

/// What does not change with the pose: the filter evaluates the dynamics a hundred times per millisecond of log.
#[derive(Debug, Clone, PartialEq)]
struct FixedParts {
    /// Sine and cosine of the first two twists.
    twists: [(f64, f64); 2],
    /// Rotation between frames 2 and 3: the insertion does not turn.
    rotation_23: Matrix3<f64>,
    /// Inertia of the first two links about the remote centre, in their own frames.
    about_center: [Matrix3<f64>; 2],
}

impl LinkDynamics {
    /// From the links of the robot file and gravity in frame 0 [m/s^2].
    #[must_use]
    pub fn new(kinematics: Kinematics, links: [Link; 3], gravity: Vector3<f64>) -> Self {
        let center = links.map(|l| Vector3::from(l.center_of_mass));
        let inertia = links.map(|l| l.inertia_matrix());
        let [twist_1, twist_2, _] = kinematics.twists();
        let fixed = FixedParts {
            twists: [twist_1.sin_cos(), twist_2.sin_cos()],
            rotation_23: kinematics.link_rotations(&Vector3::zeros())[2],
            about_center: std::array::from_fn(|i| moved(&inertia[i], links[i].mass, &center[i])),
        };
        Self { kinematics, mass: links.map(|l| l.mass), center, inertia, gravity, payload_kg: 0.0, fixed }
    }

    /// The same links with a point mass [kg] at the tracked point.
    #[must_use]
    pub fn with_payload(mut self, payload_kg: f64) -> Self {
        self.payload_kg = payload_kg;
        self
    }

    /// Joint forces [N m, N m, N] for a motion: positions, velocities and accelerations in rad and m.
    #[must_use]
    pub fn inverse(&self, joint: &Vector3<f64>, rate: &Vector3<f64>, acceleration: &Vector3<f64>) -> Vector3<f64> {
        let (rotations, insertion_m) = (self.rotations(joint), joint[2]);
        let z = Vector3::z();
        let mut omega = Vector3::zeros();
        let mut alpha = Vector3::zeros();
        // Gravity as an acceleration of the base.
        let mut linear = -self.gravity;
        let mut forces = [Vector3::zeros(); 3];
        let mut moments = [Vector3::zeros(); 3];
        for i in 0..3 {
            let into = rotations[i].transpose();
            let carried = into * omega;
            alpha = into * alpha;
            linear = into * linear;
            if i < 2 {
                alpha += carried.cross(&(z * rate[i])) + z * acceleration[i];
                omega = carried + z * rate[i];
            } else {
                omega = carried;
                let arm = z * insertion_m;
                linear += alpha.cross(&arm) + omega.cross(&omega.cross(&arm)) + 2.0 * omega.cross(&(z * rate[i])) + z * acceleration[i];
            }
            let at = |point: &Vector3<f64>| linear + alpha.cross(point) + omega.cross(&omega.cross(point));
            forces[i] = self.mass[i] * at(&self.center[i]);
            moments[i] = self.inertia[i] * alpha + omega.cross(&(self.inertia[i] * omega)) + self.center[i].cross(&forces[i]);
            if i == 2 {
                let payload = z * self.kinematics.wrist_offset;
                let force = self.payload_kg * at(&payload);
                forces[i] += force;
                moments[i] += payload.cross(&force);
            }
        }
        // Back to the base: the origins of frames 1 and 2 coincide, frame 3 sits at the insertion depth.
        let moment_2 = moments[1] + rotations[2] * (moments[2] + (z * insertion_m).cross(&forces[2]));
        let moment_1 = moments[0] + rotations[1] * moment_2;
        Vector3::new(moment_1.z, moment_2.z, forces[2].z)
    }

    /// Velocity and gravity terms `C(q, qd) + G(q)` [N m, N m, N].
    #[must_use]
    pub fn bias(&self, joint: &Vector3<f64>, rate: &Vector3<f64>) -> Vector3<f64> {
        self.mass_and_bias(joint, rate).1
    }

    /// Gravity alone, `G(q)` [N m, N m, N]: what holds the links at rest.
    #[must_use]
    pub fn gravity(&self, joint: &Vector3<f64>) -> Vector3<f64> {
        let [r01, r12, r23] = self.rotations(joint);
        let up_1 = r01.tr_mul(&-self.gravity);
        let up_2 = r12.tr_mul(&up_1);
        let up_3 = r23.tr_mul(&up_2);
        let (about_3, held_kg) = self.sliding(joint[2]);
        let moment_2 = self.center[1].cross(&up_2) * self.mass[1] + r23 * about_3.cross(&up_3);
        let moment_1 = self.center[0].cross(&up_1) * self.mass[0] + r12 * moment_2;
        Vector3::new(moment_1.z, moment_2.z, up_3.z * held_kg)
    }

    /// First moment about the remote centre [kg m], in frame 3, and mass [kg] of what slides along the third axis.
    fn sliding(&self, insertion_m: f64) -> (Vector3<f64>, f64) {
        let z = Vector3::z();
        let payload = z * (insertion_m + self.kinematics.wrist_offset);
        ((self.center[2] + z * insertion_m) * self.mass[2] + payload * self.payload_kg, self.mass[2] + self.payload_kg)
    }

    /// Mass matrix `M(q)`, 3x3 [kg m^2, kg m, kg].
    #[must_use]
    pub fn mass_matrix(&self, joint: &Vector3<f64>) -> Matrix3<f64> {
        self.mass(&self.outer(&self.rotations(joint), joint[2]))
    }

    /// [`Self::mass_matrix`] and [`Self::bias`] in one go.
    #[must_use]
    pub fn mass_and_bias(&self, joint: &Vector3<f64>, rate: &Vector3<f64>) -> (Matrix3<f64>, Vector3<f64>) {
        let rotations = self.rotations(joint);
        let outer = self.outer(&rotations, joint[2]);
        (self.mass(&outer), self.bias_with(&outer, &rotations, rate))
    }

    fn outer(&self, [_, r12, r23]: &[Matrix3<f64>; 3], insertion_m: f64) -> OuterLinks {
        let z = Vector3::z();
        let center_3 = self.center[2] + z * insertion_m;
        let payload = z * (insertion_m + self.kinematics.wrist_offset);
        let about_3 = moved(&self.inertia[2], self.mass[2], &center_3) + moved(&Matrix3::zeros(), self.payload_kg, &payload);
        let (first_moment, sliding_kg) = self.sliding(insertion_m);
        OuterLinks {
            inertia: self.fixed.about_center[1] + r23 * about_3 * r23.transpose(),
            axis_1: r12.row(2).transpose(),
            axis_3: r23.column(2).into(),
            sliding_moment: r23 * first_moment,
            sliding_kg,
        }
    }

    fn mass(&self, outer: &OuterLinks) -> Matrix3<f64> {
        let OuterLinks { inertia, axis_1, axis_3, sliding_moment, sliding_kg } = outer;
        let inertia_1 = inertia * axis_1;
        let sliding = sliding_moment.cross(axis_3);
        let (m11, m12) = (self.fixed.about_center[0][(2, 2)] + axis_1.dot(&inertia_1), inertia_1.z);
        let (m13, m23) = (axis_1.dot(&sliding), sliding.z);
        Matrix3::new(m11, m12, m13, m12, inertia[(2, 2)], m23, m13, m23, *sliding_kg)
    }

    /// By Euler's equation about the remote centre. The first link, which turns about an axis that stays, asks for its weight to be held alone.
    fn bias_with(&self, outer: &OuterLinks, [r01, r12, _]: &[Matrix3<f64>; 3], rate: &Vector3<f64>) -> Vector3<f64> {
        let OuterLinks { inertia, axis_1, axis_3, sliding_moment, sliding_kg } = outer;
        let up_1 = r01.tr_mul(&-self.gravity);
        let up_2 = r12.tr_mul(&up_1);
        let (turning_1, turning_2) = (axis_1 * rate[0], Vector3::z() * rate[1]);
        let omega = turning_1 + turning_2;
        let alpha = turning_1.cross(&turning_2);
        // All that slides is deflected alike.
        let deflected = up_2 + 2.0 * rate[2] * omega.cross(axis_3);
        let moment = inertia * alpha
            + omega.cross(&(inertia * omega))
            + self.center[1].cross(&up_2) * self.mass[1]
            + sliding_moment.cross(&deflected);
        let along_3 = up_2 * *sliding_kg + alpha.cross(sliding_moment) + omega.cross(&omega.cross(sliding_moment));
        let held_1 = self.center[0].cross(&up_1) * self.mass[0];
        Vector3::new(held_1.z + axis_1.dot(&moment), moment.z, axis_3.dot(&along_3))
    }

    fn rotations(&self, joint: &Vector3<f64>) -> [Matrix3<f64>; 3] {
        let [theta_1, theta_2, _] = self.kinematics.thetas(joint);
        let turn = |(sin_twist, cos_twist): (f64, f64), theta: f64| {
            let (s, c) = theta.sin_cos();
            Matrix3::new(c, -s, 0.0, s * cos_twist, c * cos_twist, -sin_twist, s * sin_twist, c * sin_twist, cos_twist)
        };
        [turn(self.fixed.twists[0], theta_1), turn(self.fixed.twists[1], theta_2), self.fixed.rotation_23]
    }
}

/// Inertia about a point from which the centre of mass is seen at `center` (Steiner).
fn moved(inertia: &Matrix3<f64>, mass_kg: f64, center: &Vector3<f64>) -> Matrix3<f64> {
    inertia + (Matrix3::identity() * center.norm_squared() - center * center.transpose()) * mass_kg
}
