//! Motors, cables and links in time: three motors and three joints under gravity, dry friction and the drives' torque.
//!
//! ```text
//! I_m qdd_m = tau / N - tau_c Sgn(qd_m) - tau_v qd_m - p'(q_mc) gamma / N
//! M(q) qdd  = (1 + C)' r_l gamma - C(q, qd) - G(q) - F_c Sgn(qd) - F_v qd
//! ```
//!
//! A step takes elastic and viscous forces at its middle, linear in the velocities before and after it, and lets dry friction choose
//! among the velocities after it. Without friction this is the implicit midpoint rule, of second order and stable for any stiffness.

use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};

use super::cable::{CableState, Motion};
use super::friction::stick_slip;
use super::machine::{Load, Machine};

/// Length of a step [s]. The fastest motion of the nominal robot has a time constant of 0.5 ms.
pub const STEP_S: f64 = 1e-4;

/// Positions and velocities.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlantState {
    /// Motor angles [rad], zero where the encoders' zero is.
    pub motor: Vector3<f64>,
    /// [rad/s].
    pub motor_rate: Vector3<f64>,
    /// Joints [rad, rad, m].
    pub joint: Vector3<f64>,
    /// [rad/s, rad/s, m/s].
    pub joint_rate: Vector3<f64>,
    /// Cables.
    pub cables: [CableState; 3],
}

/// A machine in motion.
#[derive(Debug, Clone)]
pub struct Plant {
    machine: Machine,
    state: PlantState,
    /// Velocities of the joints one step ago.
    earlier_rate: Vector3<f64>,
    links_held: bool,
}

impl Plant {
    /// The machine at rest at its hard stop, where its encoders are set: cables without load, links held by the stop.
    #[must_use]
    pub fn at_hard_stop(machine: Machine) -> Self {
        let state = PlantState {
            motor: machine.motor_at_hard_stop,
            motor_rate: Vector3::zeros(),
            joint: machine.hard_stop,
            joint_rate: Vector3::zeros(),
            cables: [CableState::default(); 3],
        };
        Self { machine, state, earlier_rate: Vector3::zeros(), links_held: true }
    }

    /// Holds the links where they are, or lets them go.
    pub fn hold_links(&mut self, held: bool) {
        self.links_held = held;
        if held {
            self.state.joint_rate = Vector3::zeros();
        }
    }

    /// Where everything is.
    #[must_use]
    pub fn state(&self) -> &PlantState {
        &self.state
    }

    /// What it is made of.
    #[must_use]
    pub fn machine(&self) -> &Machine {
        &self.machine
    }

    /// Moves on by `duration_s` in steps of at most `step_s` under drive torques after the gear box [N m].
    pub fn advance(&mut self, torque: &Vector3<f64>, duration_s: f64, step_s: f64) {
        let steps = (duration_s / step_s - 1e-9).ceil().max(1.0);
        let step_s = duration_s / steps;
        for _ in 0..steps as u64 {
            self.step(torque, step_s);
        }
    }

    fn step(&mut self, torque: &Vector3<f64>, h: f64) {
        let Self { machine, state, earlier_rate, links_held } = self;
        let middle = state.joint + state.joint_rate * (0.5 * h);
        let (mass, bias) = machine.inertia_and_bias(&middle, &(state.joint_rate * 1.5 - *earlier_rate * 0.5));
        *earlier_rate = state.joint_rate;
        let travel = &machine.travel_from_joint;
        let taken = travel * (state.joint - machine.hard_stop);
        let taken_rate = travel * state.joint_rate;

        let mut a = Matrix6::zeros();
        let mut b = Vector6::zeros();
        let mut limit = Vector6::zeros();
        a.fixed_view_mut::<3, 3>(3, 3).copy_from(&(mass + Matrix3::from_diagonal(&machine.extra_inertia)));
        // Rows of momentum: A v = A_mass v_before + h (forces of the middle), the velocity's half before the step on the right.
        let before = Vector6::new(
            state.motor_rate[0],
            state.motor_rate[1],
            state.motor_rate[2],
            state.joint_rate[0],
            state.joint_rate[1],
            state.joint_rate[2],
        );
        for j in 0..3 {
            a[(j, j)] = machine.drives[j].motor.inertia;
            b[j + 3] = -h * bias[j];
        }
        b += a * before;
        let mut cables = [Linked::default(); 3];
        for j in 0..3 {
            let drive = &machine.drives[j];
            let capstan = state.motor[j] / drive.gear_ratio;
            let start = machine.motor_at_hard_stop[j] / drive.gear_ratio;
            let winding = drive.wound_slope_m(capstan) / drive.gear_ratio;
            let (uneven, uneven_slope) = drive.bulge.map_or((0.0, 0.0), |bulge| bulge.taken(taken[j]));
            let pulling_m = drive.pulley_m * (1.0 + uneven_slope);
            let motion = Motion {
                wound_m: drive.wound_m(capstan) - drive.wound_m(start),
                wound_rate: winding * state.motor_rate[j],
                taken_m: drive.pulley_m * (taken[j] + uneven),
                taken_rate: pulling_m * taken_rate[j],
            };
            let shaft = drive.shaft_torque(torque[j], state.motor[j]);
            let tension_before = state.cables[j].tension_n;
            let way = if state.motor_rate[j] == 0.0 { shaft - winding * tension_before } else { state.motor_rate[j] };
            let linear = drive.linearise(&state.cables[j], &motion, way.signum(), h);
            cables[j] = Linked { wound_m: motion.wound_m, start, winding, pulling_m, linear };

            // Viscous friction acts on the mean of both velocities.
            for (row, viscous) in [(j, drive.motor.viscous_friction), (j + 3, drive.link_friction.viscous)] {
                a[(row, row)] += 0.5 * h * viscous;
                b[row] -= 0.5 * h * viscous * before[row];
            }
            b[j] += h * shaft;
            // The cable pulls every body by its lever times gamma, and is stretched by its lever times the body's velocity.
            let mut lever = Vector6::zeros();
            let mut stretch = Vector6::zeros();
            lever[j] = -winding;
            stretch[j] = linear.engaged * winding;
            for i in 0..3 {
                lever[i + 3] = pulling_m * travel[(j, i)];
                stretch[i + 3] = -lever[i + 3];
            }
            let half = 0.5 * linear.slope;
            b += lever * (h * (linear.force_n + half * stretch.dot(&before)));
            a -= lever * stretch.transpose() * (h * half);

            limit[j] = h * drive.motor_dry_friction(state.motor_rate[j]);
            limit[j + 3] = if *links_held { f64::INFINITY } else { h * drive.link_dry_friction(tension_before, state.joint[j]) };
        }
        let after = stick_slip(&a, &b, &limit, &before);

        let mean = (before + after) * 0.5;
        state.motor += mean.fixed_rows::<3>(0) * h;
        state.joint += mean.fixed_rows::<3>(3) * h;
        state.motor_rate = after.fixed_rows::<3>(0).into();
        state.joint_rate = after.fixed_rows::<3>(3).into();
        let taken_rate = travel * mean.fixed_rows::<3>(3);
        for j in 0..3 {
            let drive = &machine.drives[j];
            let Linked { wound_m, start, winding, pulling_m, linear } = cables[j];
            let rate = linear.engaged * winding * mean[j] - pulling_m * taken_rate[j];
            let wound_after_m = drive.wound_m(state.motor[j] / drive.gear_ratio) - drive.wound_m(start);
            drive.remember(&mut state.cables[j], wound_m, wound_after_m, linear.force_n + linear.slope * rate, h);
        }
    }
}

/// A cable within a step.
#[derive(Debug, Clone, Copy, Default)]
struct Linked {
    wound_m: f64,
    start: f64,
    winding: f64,
    pulling_m: f64,
    linear: super::cable::Linear,
}

impl super::machine::Drive {
    /// Torque on the motor's shaft [N m] of a torque commanded after the gear box, as this drive delivers it.
    fn shaft_torque(&self, commanded: f64, motor_rad: f64) -> f64 {
        let delivered = (commanded * self.torque_gain).clamp(-self.torque_limit, self.torque_limit);
        let ripple = self.ripple.map_or(0.0, |[amplitude, per_turn]| amplitude * (per_turn * motor_rad).sin());
        delivered / self.gear_ratio + ripple
    }

    fn motor_dry_friction(&self, rate: f64) -> f64 {
        let more = self.stribeck.map_or(0.0, |[depth, speed]| depth * (-(rate / speed).powi(2)).exp());
        self.motor.coulomb_friction * (1.0 + more)
    }

    fn link_dry_friction(&self, tension_n: f64, joint: f64) -> f64 {
        let here = self.bump.map_or(0.0, |bump| bump.friction(joint));
        self.link_friction.coulomb + self.load_friction * (tension_n * self.pulley_m).abs() + here
    }
}

impl Machine {
    /// Mass matrix, and velocity, gravity and contact forces, of what the cables move.
    fn inertia_and_bias(&self, joint: &Vector3<f64>, rate: &Vector3<f64>) -> (Matrix3<f64>, Vector3<f64>) {
        match &self.load {
            Load::Arm { kinematics, dynamics, contact } => {
                let pushed = contact.map_or_else(Vector3::zeros, |contact| {
                    kinematics.jacobian(joint).transpose() * contact.force_n(&kinematics.forward(joint))
                });
                let (mass, bias) = dynamics.mass_and_bias(joint, rate);
                (mass, bias - pushed)
            }
            Load::Bench(mass) => (Matrix3::from_diagonal(mass), Vector3::zeros()),
        }
    }
}
