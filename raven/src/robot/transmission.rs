//! Rigid transmission: motor angle to joint angle through pulleys, with coupling, from the hard stop on.
//!
//! Cable travel wanted by joint `j`, expressed at the joint, is `c = (1 + C) q`. The encoders are set at the hard stop, so
//!
//! ```text
//! c - c_hs = (q_m - q_m,hs) r_mc / (N r_l)
//! ```
//!
//! and a wrong radius is an error proportional to the distance from the hard stop, not from zero.

use nalgebra::{Matrix3, Vector3};

use super::Joint;

/// Rigid transmission of three coupled joints.
#[derive(Debug, Clone, PartialEq)]
pub struct Transmission {
    /// Motor angle per cable travel at the joint: `N r_l / r_mc` [rad/rad, rad/rad, rad/m].
    pub ratio: Vector3<f64>,
    /// Cable travel per motor angle: `r_mc / N` [m/rad].
    pub cable_per_motor_m: Vector3<f64>,
    /// Radius of the pulley at the link [m]; 1 on a prismatic joint.
    pub link_radius_m: Vector3<f64>,
    /// Motor angles at the hard stop, as set when the logs were recorded [rad].
    pub motor_at_hard_stop: Vector3<f64>,
    /// Cable that joints take up as they move [m/rad, m/rad, 1]: by cable (row) and joint (column). Transposed, force at the joints by tension.
    pub levers_m: Matrix3<f64>,
    travel_at_hard_stop: Vector3<f64>,
    travel_from_joint: Matrix3<f64>,
    joint_from_travel: Matrix3<f64>,
}

impl Transmission {
    /// From the joints of the robot file and its coupling matrix `C` (row: cable, column: joint).
    #[must_use]
    pub fn new(joints: &[Joint; 3], coupling: &Matrix3<f64>) -> Self {
        let per_joint = |f: fn(&Joint) -> f64| Vector3::from_fn(|j, _| f(&joints[j]));
        let ratio = per_joint(Joint::ratio);
        let travel_from_joint = Matrix3::identity() + coupling;
        let travel_at_hard_stop = travel_from_joint * per_joint(|j| j.hard_stop);
        let motor_at_hard_stop = Vector3::from_fn(|j, _| joints[j].motor_at_hard_stop.unwrap_or(ratio[j] * travel_at_hard_stop[j]));
        let link_radius_m = per_joint(|j| j.link_pulley_radius);
        Self {
            ratio,
            cable_per_motor_m: per_joint(|j| j.motor_capstan_radius / j.gear_ratio),
            link_radius_m,
            motor_at_hard_stop,
            levers_m: Matrix3::from_diagonal(&link_radius_m) * travel_from_joint,
            travel_at_hard_stop,
            travel_from_joint,
            // A coupling matrix that cannot be inverted would tie two joints together; the file is checked for it when read.
            joint_from_travel: travel_from_joint.try_inverse().unwrap_or_else(Matrix3::identity),
        }
    }

    /// Joint angles [rad, rad, m] of motor angles [rad], as if no cable stretched: the paper's "transmission kinematics".
    #[must_use]
    pub fn joint_from_motor(&self, motor: &Vector3<f64>) -> Vector3<f64> {
        self.joint_from_travel * (self.travel_at_hard_stop + (motor - self.motor_at_hard_stop).component_div(&self.ratio))
    }

    /// Position of joint `j` [rad or m] at its motor's angle [rad] where no joint moves another's cable, as on a bench.
    #[must_use]
    pub fn joint_alone(&self, j: usize, motor: f64) -> f64 {
        self.travel_at_hard_stop[j] + (motor - self.motor_at_hard_stop[j]) / self.ratio[j]
    }

    /// Motor angles [rad] of joint angles [rad, rad, m].
    #[must_use]
    pub fn motor_from_joint(&self, joint: &Vector3<f64>) -> Vector3<f64> {
        self.motor_at_hard_stop + (self.travel_from_joint * joint - self.travel_at_hard_stop).component_mul(&self.ratio)
    }

    /// Joint velocities of motor velocities, rigidly.
    #[must_use]
    pub fn joint_rate_from_motor(&self, motor_rate: &Vector3<f64>) -> Vector3<f64> {
        self.joint_from_travel * motor_rate.component_div(&self.ratio)
    }

    /// Motor velocities of joint velocities, rigidly.
    #[must_use]
    pub fn motor_rate_from_joint(&self, joint_rate: &Vector3<f64>) -> Vector3<f64> {
        (self.travel_from_joint * joint_rate).component_mul(&self.ratio)
    }

    /// Cable stretch [m]: what the capstan has wound, less what the joint has taken up.
    #[must_use]
    pub fn stretch_m(&self, motor: &Vector3<f64>, joint: &Vector3<f64>) -> Vector3<f64> {
        self.wound_m(motor) - self.levers_m * joint
    }

    /// Cable that the capstans have wound [m], counted from where all joints are at zero.
    #[must_use]
    pub fn wound_m(&self, motor: &Vector3<f64>) -> Vector3<f64> {
        (motor - self.motor_at_hard_stop).component_mul(&self.cable_per_motor_m)
            + self.travel_at_hard_stop.component_mul(&self.link_radius_m)
    }

    /// Rate of the cable stretch [m/s] from motor and joint velocities.
    #[must_use]
    pub fn stretch_rate_m_s(&self, motor_rate: &Vector3<f64>, joint_rate: &Vector3<f64>) -> Vector3<f64> {
        motor_rate.component_mul(&self.cable_per_motor_m) - self.levers_m * joint_rate
    }

    /// Joint forces [N m, N m, N] of cable tension differences [N], the coupling's reaction on the moving joints included.
    #[must_use]
    pub fn joint_force(&self, tension_n: &Vector3<f64>) -> Vector3<f64> {
        self.levers_m.tr_mul(tension_n)
    }

    /// Cable tension differences [N] that hold joint forces [N m, N m, N].
    #[must_use]
    pub fn tension_n(&self, joint_force: &Vector3<f64>) -> Vector3<f64> {
        self.joint_from_travel.tr_mul(joint_force).component_div(&self.link_radius_m)
    }

    /// Change of the joint angles when the cables stretch by `stretch_m` at fixed motors.
    #[must_use]
    pub fn joint_lag(&self, stretch_m: &Vector3<f64>) -> Vector3<f64> {
        self.joint_from_travel * stretch_m.component_div(&self.link_radius_m)
    }
}
