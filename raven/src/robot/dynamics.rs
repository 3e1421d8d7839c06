//! Rigid-body dynamics of the links: `M(q) qdd + C(q, qd) + G(q)` by the recursive Newton-Euler method, each link in its own DH frame.
//!
//! Source of the recursion: Luh, Walker, Paul 1980; Craig, Introduction to Robotics, section 6.5.

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

/// Dynamics of the first three links.
#[derive(Debug, Clone, PartialEq)]
pub struct LinkDynamics {
    kinematics: Kinematics,
    mass: [f64; 3],
    center: [Vector3<f64>; 3],
    inertia: [Matrix3<f64>; 3],
    gravity: Vector3<f64>,
    payload_kg: f64,
}

impl LinkDynamics {
    /// From the links of the robot file and gravity in frame 0 [m/s^2].
    #[must_use]
    pub fn new(kinematics: Kinematics, links: [Link; 3], gravity: Vector3<f64>) -> Self {
        Self {
            kinematics,
            mass: links.map(|l| l.mass),
            center: links.map(|l| Vector3::from(l.center_of_mass)),
            inertia: links.map(|l| {
                let [xx, yy, zz, xy, xz, yz] = l.inertia;
                Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz)
            }),
            gravity,
            payload_kg: 0.0,
        }
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
        self.recursion(&self.kinematics.link_rotations(joint), joint[2], rate, acceleration, &self.gravity)
    }

    /// Velocity and gravity terms `C(q, qd) + G(q)` [N m, N m, N].
    #[must_use]
    pub fn bias(&self, joint: &Vector3<f64>, rate: &Vector3<f64>) -> Vector3<f64> {
        self.inverse(joint, rate, &Vector3::zeros())
    }

    /// Mass matrix `M(q)`, 3x3 [kg m^2, kg m, kg].
    #[must_use]
    pub fn mass_matrix(&self, joint: &Vector3<f64>) -> Matrix3<f64> {
        let rotations = self.kinematics.link_rotations(joint);
        let column = |j: usize| {
            let unit = Vector3::from_fn(|i, _| f64::from(u8::from(i == j)));
            self.recursion(&rotations, joint[2], &Vector3::zeros(), &unit, &Vector3::zeros())
        };
        Matrix3::from_columns(&[column(0), column(1), column(2)])
    }

    /// Accelerations [rad/s^2, rad/s^2, m/s^2] under joint forces [N m, N m, N].
    #[must_use]
    pub fn forward(&self, joint: &Vector3<f64>, rate: &Vector3<f64>, force: &Vector3<f64>) -> Vector3<f64> {
        let net = force - self.bias(joint, rate);
        // The mass matrix of links with positive mass and inertia is positive definite; a file without it is refused when read.
        self.mass_matrix(joint).cholesky().map_or_else(|| Vector3::repeat(f64::NAN), |m| m.solve(&net))
    }

    fn recursion(
        &self,
        rotations: &[Matrix3<f64>; 3],
        insertion_m: f64,
        rate: &Vector3<f64>,
        acceleration: &Vector3<f64>,
        gravity: &Vector3<f64>,
    ) -> Vector3<f64> {
        let z = Vector3::z();
        let mut omega = Vector3::zeros();
        let mut alpha = Vector3::zeros();
        // Gravity as an acceleration of the base.
        let mut linear = -gravity;
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
}
