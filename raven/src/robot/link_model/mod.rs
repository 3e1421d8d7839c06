//! Links behind their cables, driven by the motor angle: the state equation of the paper's filter (eqs. 2-6).
//!
//! ```text
//! M(q) qdd = (1 + C)' r_l gamma(x, xdot) - C(q, qd) - G(q) - F_c clip(qd / v_s) - F_v qd
//! ```
//!
//! The motor angle is measured, so it is an input; the state is `[q, qd]`, 6x1 [rad, rad, m, rad/s, rad/s, m/s]. Friction that holds
//! (`held_part`) is in the motor angle as [play](super::stiction), or [grips](super::grip) the joints if the state says where.

mod proportional;

use nalgebra::{Matrix3, Vector3};

use self::proportional::Proportional;
use super::cable::Pull;
use super::friction::Friction;
use super::grip::Grip;
use super::{Arm, JointType, SteadyMotion, Transmission};

/// Speed below which Coulomb friction fades, per joint [rad/s, rad/s, m/s]: a tenth of the slowest motion that matters here.
pub const STICTION_SPEED: [f64; 3] = [5e-3, 5e-3, 1e-3];

/// The same by kind of joint.
#[must_use]
pub fn stiction_speed(kind: JointType) -> f64 {
    STICTION_SPEED[if kind == JointType::Revolute { 0 } else { 2 }]
}

/// Joint positions and velocities.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinkState {
    /// [rad, rad, m].
    pub position: Vector3<f64>,
    /// [rad/s, rad/s, m/s].
    pub rate: Vector3<f64>,
    /// Where friction that holds has hold of the joints [rad, rad, m]; `None` where it is in what drives them.
    pub anchor: Option<Vector3<f64>>,
}

impl LinkState {
    /// Of joints behind the play of friction that holds, or without such friction.
    #[must_use]
    pub fn new(position: Vector3<f64>, rate: Vector3<f64>) -> Self {
        Self { position, rate, anchor: None }
    }

    fn is_finite(&self) -> bool {
        self.position.iter().chain(&self.rate).all(|v| v.is_finite())
    }
}

/// Cable that motors which move steadily have wound, by [`Transmission::wound_m`].
#[derive(Clone, Copy)]
struct Wound {
    cable_m: Vector3<f64>,
    rate_m_s: Vector3<f64>,
}

impl Wound {
    fn by(transmission: &Transmission, motor: &Vector3<f64>, motor_rate: &Vector3<f64>) -> Self {
        Self { cable_m: transmission.wound_m(motor), rate_m_s: motor_rate.component_mul(&transmission.cable_per_motor_m) }
    }

    fn after(&self, time_s: f64) -> Self {
        Self { cable_m: self.cable_m + self.rate_m_s * time_s, ..*self }
    }
}

/// Rigid-body terms at one state.
#[derive(Clone, Copy)]
struct RigidBody {
    inverse_mass: Matrix3<f64>,
    bias: Vector3<f64>,
}

impl RigidBody {
    fn acceleration(&self, force: &Vector3<f64>) -> Vector3<f64> {
        self.inverse_mass * (force - self.bias)
    }
}

/// The state equation as steps share it: rigid-body terms change by parts in ten thousand meanwhile, and they take most of the time.
#[expect(clippy::large_enum_variant, reason = "a rollout has one, and boxed it would be allocated anew every few milliseconds of motion")]
enum Equation {
    Proportional(Proportional),
    General(RigidBody),
}

/// What steps share.
pub(super) struct Shared {
    equation: Option<Equation>,
    /// Time that they are shared over, and what is left of it [s].
    over_s: f64,
    left_s: f64,
}

impl Shared {
    /// By steps within so much time [s], or within four milliseconds.
    pub(super) fn over(time_s: f64) -> Self {
        Self { equation: None, over_s: time_s.min(RIGID_S), left_s: 0.0 }
    }
}

/// The link side of an arm.
#[derive(Debug, Clone)]
pub struct LinkModel {
    arm: Arm,
    grip: Grip,
    step_max_s: f64,
    pulls: [Pull; 3],
    friction: Friction,
}

impl LinkModel {
    /// The link side of `arm`.
    #[must_use]
    pub fn new(arm: Arm) -> Self {
        let middle = Vector3::from_fn(|j, _| 0.5 * (arm.limits[j][0] + arm.limits[j][1]));
        let inertia = arm.dynamics.mass_matrix(&middle).diagonal();
        let grip = Grip::new(&arm, &inertia);
        let (pulls, friction) = (arm.cables.map(|cable| Pull::new(&cable)), Friction::new(&arm));
        let pole = fastest_pole(&arm, &grip, &friction, &middle, &inertia);
        Self { arm, grip, step_max_s: (RUNGE_KUTTA_REACH / pole).clamp(STEP_MIN_S, STEP_MAX_S), pulls, friction }
    }

    /// Longest step [s] that [`Self::step`] takes with good accuracy: set by the fastest pole of cables and friction.
    #[must_use]
    pub fn step_max_s(&self) -> f64 {
        self.step_max_s
    }

    /// The arm it was made of.
    #[must_use]
    pub fn arm(&self) -> &Arm {
        &self.arm
    }

    /// Accelerations of the joints for a state and the motors' angle [rad] and velocity [rad/s].
    #[must_use]
    pub fn acceleration(&self, state: &LinkState, motor: &Vector3<f64>, motor_rate: &Vector3<f64>) -> Vector3<f64> {
        let wound = Wound::by(&self.arm.transmission, motor, motor_rate);
        self.rigid_body(state).acceleration(&self.force(state, &wound))
    }

    /// Joint forces of cables and friction [N m, N m, N].
    fn force(&self, state: &LinkState, wound: &Wound) -> Vector3<f64> {
        let levers_m = &self.arm.transmission.levers_m;
        let (stretch, stretch_rate) = (self.stretch_m(state, wound), wound.rate_m_s - levers_m * state.rate);
        let tension = Vector3::from_fn(|j, _| self.pulls[j].n(stretch[j], stretch_rate[j]));
        let free = levers_m.tr_mul(&tension) - self.friction(&state.rate, &tension);
        match &state.anchor {
            Some(anchor) => free - self.grip.friction(anchor, &state.position, &state.rate, &self.friction.holding(&tension)),
            None => free,
        }
    }

    fn stretch_m(&self, state: &LinkState, wound: &Wound) -> Vector3<f64> {
        wound.cable_m - self.arm.transmission.levers_m * state.position
    }

    /// Where joints are held that have come to a state.
    fn slid(&self, state: &LinkState, wound: &Wound) -> Option<Vector3<f64>> {
        let anchor = state.anchor?;
        let pulled = || {
            let stretch = self.stretch_m(state, wound);
            Vector3::from_fn(|j, _| self.pulls[j].n(stretch[j], 0.0))
        };
        let tension = if self.friction.holds_by_tension() { pulled() } else { Vector3::zeros() };
        Some(self.grip.slid(&anchor, &state.position, &self.friction.holding(&tension)))
    }

    fn rigid_body(&self, state: &LinkState) -> RigidBody {
        let (mass, bias) = self.arm.dynamics.mass_and_bias(&state.position, &state.rate);
        // Positive definite for links with positive mass and inertia; a file without them is refused when read.
        RigidBody { inverse_mass: mass.try_inverse().unwrap_or_else(|| Matrix3::repeat(f64::NAN)), bias }
    }

    /// Friction of the joints [N m, N m, N] at joint velocities, under tension differences of the cables [N].
    #[must_use]
    pub fn friction(&self, rate: &Vector3<f64>, tension_n: &Vector3<f64>) -> Vector3<f64> {
        self.friction.moving(rate, tension_n)
    }

    /// One Runge-Kutta step of order four over `step_s`, the motors moving steadily from `motor` at `motor_rate`.
    ///
    /// Cables and friction are evaluated at each of the four stages. Mass matrix, gravity and velocity terms are those of the middle: they
    /// change by parts in ten thousand within a step, and they take most of the time.
    #[must_use]
    pub fn step(&self, state: &LinkState, motor: &Vector3<f64>, motor_rate: &Vector3<f64>, step_s: f64) -> LinkState {
        let wound = Wound::by(&self.arm.transmission, motor, motor_rate);
        self.step_with(&self.rigid_body_ahead(state, 0.5 * step_s), state, &wound, step_s)
    }

    /// Rigid-body terms after a time at the velocity there is.
    fn rigid_body_ahead(&self, state: &LinkState, time_s: f64) -> RigidBody {
        self.rigid_body(&LinkState { position: state.position + state.rate * time_s, ..*state })
    }

    fn step_with(&self, body: &RigidBody, state: &LinkState, wound: &Wound, step_s: f64) -> LinkState {
        let reached = runge_kutta(state, step_s, |s, t| body.acceleration(&self.force(s, &wound.after(t))));
        LinkState { anchor: self.slid(&reached, &wound.after(step_s)), ..reached }
    }

    /// What steps from a state on share for a time.
    fn equation(&self, state: &LinkState, wound: &Wound, over_s: f64) -> Equation {
        let body = self.rigid_body_ahead(state, 0.5 * over_s);
        if self.is_proportional(state, wound) { Equation::Proportional(Proportional::new(self, &body)) } else { Equation::General(body) }
    }

    /// State after `duration_s`, in as many steps as stability asks for, the motors moving steadily. Steps within four milliseconds share
    /// their rigid-body terms. A cable that stiffens asks for more steps the harder it is pulled: where they were too few, for finer ones.
    /// A state that is not finite stays as it is.
    #[must_use]
    pub fn advance(&self, state: LinkState, motor: &Vector3<f64>, motor_rate: &Vector3<f64>, duration_s: f64) -> LinkState {
        let mut reached = state;
        self.advance_along(&state, motor, motor_rate, duration_s, &mut Shared::over(duration_s), |_, state| reached = *state);
        reached
    }

    /// As [`Self::advance`]; `pass` hears of the states at the start, where rigid-body terms are taken anew and at the end, with the time since
    /// the start [s], and all over again where steps were too few.
    pub(super) fn advance_along(
        &self,
        state: &LinkState,
        motor: &Vector3<f64>,
        motor_rate: &Vector3<f64>,
        duration_s: f64,
        shared: &mut Shared,
        mut pass: impl FnMut(f64, &LinkState),
    ) {
        let steps = |step_s: f64| (duration_s / step_s).ceil().max(1.0);
        let (coarse, most) = (steps(self.step_max_s), steps(STEP_MIN_S));
        if !state.is_finite() {
            pass(0.0, state);
            pass(duration_s, state);
            return;
        }
        let wound = Wound::by(&self.arm.transmission, motor, motor_rate);
        for finer in FINER {
            let steps = (finer * coarse).min(most);
            pass(0.0, state);
            let reached = self.in_steps(state, &wound, duration_s, steps, shared, &mut pass);
            pass(duration_s, &reached);
            if reached.is_finite() || steps == most {
                break;
            }
            shared.left_s = 0.0;
        }
    }

    fn in_steps(
        &self,
        state: &LinkState,
        wound: &Wound,
        duration_s: f64,
        steps: f64,
        shared: &mut Shared,
        pass: &mut impl FnMut(f64, &LinkState),
    ) -> LinkState {
        let mut state = *state;
        let step_s = duration_s / steps;
        for i in 0..steps as usize {
            let at_s = i as f64 * step_s;
            let wound = wound.after(at_s);
            // To the nearest step, however times round.
            let equation = match &mut shared.equation {
                Some(equation) if shared.left_s > 0.5 * step_s => equation,
                equation => {
                    if i > 0 {
                        pass(at_s, &state);
                    }
                    shared.left_s = shared.over_s;
                    equation.insert(self.equation(&state, &wound, shared.over_s))
                }
            };
            shared.left_s -= step_s;
            state = match equation {
                Equation::Proportional(proportional) => proportional.step(self, &state, &wound, step_s),
                Equation::General(body) => self.step_with(body, &state, &wound, step_s),
            };
        }
        state
    }

    /// Joint angles at which the cables hold the links against gravity and friction of the given direction (-1, 0, 1 per joint).
    ///
    /// The stretch is so small that gravity at the rigid position is gravity at the stretched one to second order; two passes suffice.
    #[must_use]
    pub fn settled(&self, motor: &Vector3<f64>, direction: &Vector3<f64>) -> Vector3<f64> {
        let creeping = |tension: &Vector3<f64>| self.friction.creeping(tension).component_mul(direction);
        self.settled_under(motor, |joint, tension| self.arm.dynamics.gravity(joint) + creeping(tension), &Vector3::zeros()).0
    }

    /// The links as motors begin to be known: moving as cables that stretch no further drag them, those at rest where the cables have them, or as
    /// a recording that begins finds them, with cables that have not stretched by all they will, and gripped by friction that lets them lag
    /// behind.
    pub(super) fn starting(&self, motor: &SteadyMotion, begins: bool, gripped: bool) -> LinkState {
        let transmission = &self.arm.transmission;
        let [rate, acceleration] = [motor.rate, motor.acceleration].map(|of_motor| transmission.joint_rate_from_motor(&of_motor));
        let moves = Vector3::from_fn(|j, _| if rate[j].abs() > MOVES * self.arm.stiction_speed(j) { 1.0 } else { 0.0 });
        let [rate, acceleration] = [rate, acceleration].map(|of_joint| of_joint.component_mul(&moves));
        let at_start = |part: &dyn Fn(usize) -> f64| Vector3::from_fn(|j, _| if begins { part(j) } else { 0.0 });
        let fresh = at_start(&|j| self.arm.cables[j].fresh_part);
        let lag = at_start(&|j| if gripped { self.arm.link_friction[j].lag_at_start } else { 0.0 });
        let way = Vector3::from_fn(|j, _| if moves[j] > 0.0 { rate[j].signum() } else { lag[j] });
        let held = |tension: &Vector3<f64>| if gripped { self.friction.holding(tension).component_mul(&way) } else { Vector3::zeros() };
        let load = |joint: &Vector3<f64>, tension: &Vector3<f64>| {
            let (mass, bias) = self.arm.dynamics.mass_and_bias(joint, &rate);
            mass * acceleration + bias + self.friction(&rate, tension) + held(tension)
        };
        let (position, tension) = self.settled_under(&motor.angle, load, &fresh);
        LinkState { anchor: gripped.then(|| self.grip.anchor(&position, &held(&tension))), ..LinkState::new(position, rate) }
    }

    /// Joint angles at which the cables hold the links against a load [N m, N m, N] that may depend on these angles and on the cables' tension, and
    /// that tension [N]; cables of which a part of the stretch is not there yet as if it were.
    fn settled_under(
        &self,
        motor: &Vector3<f64>,
        load: impl Fn(&Vector3<f64>, &Vector3<f64>) -> Vector3<f64>,
        fresh: &Vector3<f64>,
    ) -> (Vector3<f64>, Vector3<f64>) {
        let rigid = self.arm.transmission.joint_from_motor(motor);
        let mut joint = rigid;
        let mut tension = Vector3::zeros();
        for _ in 0..2 {
            tension = self.arm.transmission.tension_n(&load(&joint, &tension));
            let stretch = Vector3::from_fn(|j, _| self.arm.cables[j].static_stretch_m(tension[j]) * (1.0 - fresh[j]));
            joint = rigid - self.arm.transmission.joint_lag(&stretch);
        }
        (joint, tension)
    }
}

/// One step of order four by accelerations at states and times [s] since the start.
fn runge_kutta(state: &LinkState, step_s: f64, acceleration: impl Fn(&LinkState, f64) -> Vector3<f64>) -> LinkState {
    let half = 0.5 * step_s;
    let slope = |s: &LinkState, t: f64| (s.rate, acceleration(s, t));
    let ahead =
        |(v, a): &(Vector3<f64>, Vector3<f64>), h: f64| LinkState { position: state.position + v * h, rate: state.rate + a * h, ..*state };
    let k1 = slope(state, 0.0);
    let k2 = slope(&ahead(&k1, half), half);
    let k3 = slope(&ahead(&k2, half), half);
    let k4 = slope(&ahead(&k3, step_s), step_s);
    LinkState {
        position: state.position + (k1.0 + 2.0 * (k2.0 + k3.0) + k4.0) * (step_s / 6.0),
        rate: state.rate + (k1.1 + 2.0 * (k2.1 + k3.1) + k4.1) * (step_s / 6.0),
        ..*state
    }
}

/// Product of pole and step up to which order-four Runge-Kutta is accurate; it is stable up to 2.78.
const RUNGE_KUTTA_REACH: f64 = 2.2;

/// A joint moves as motors begin to be known if it is so many times as fast as friction needs to be whole: what is slower may be encoders' steps.
const MOVES: f64 = 2.0;

/// Time over which steps share their rigid-body terms [s].
const RIGID_S: f64 = 4e-3;

/// Longest step, and the shortest that is tried [s]: what asks for shorter ones does not stay finite, instead of taking for ever.
const STEP_MAX_S: f64 = 1e-3;
const STEP_MIN_S: f64 = 1e-6;

/// By how much steps are made shorter where the motion does not stay finite.
const FINER: [f64; 4] = [1.0, 4.0, 16.0, 64.0];
/// Joint acceleration that a controller may ask for [rad/s^2, m/s^2].
const HARD_ACCELERATION: f64 = 20.0;

/// Upper estimate of the fastest pole [1/s]: damping and stiffness of cables and of what holds joints, and the slope of the friction at rest,
/// in the middle of the ranges.
fn fastest_pole(arm: &Arm, grip: &Grip, friction: &Friction, middle: &Vector3<f64>, inertia: &Vector3<f64>) -> f64 {
    let gravity = arm.dynamics.gravity(middle);
    // A cable that stiffens is stiffest, and friction by the load steepest, under the largest load.
    let load_n = (gravity.abs() + inertia * HARD_ACCELERATION).component_div(&arm.transmission.link_radius_m);
    let rubbing = friction.by_speed_at_rest(&load_n);
    (0..3)
        .map(|j| {
            let radius2 = arm.transmission.link_radius_m[j].powi(2);
            let damping = 2.0 * arm.cables[j].damping * radius2 + grip.damping[j] + rubbing[j];
            let stiffness = arm.joint_stiffness(j, load_n[j]) + grip.stiffness[j];
            let (rate, square) = (damping / inertia[j], stiffness / inertia[j]);
            // The larger root of s^2 + rate s + square = 0, or its modulus where the two are complex.
            if rate * rate > 4.0 * square { 0.5 * (rate + (rate * rate - 4.0 * square).sqrt()) } else { square.sqrt() }
        })
        .fold(1.0, f64::max)
}
