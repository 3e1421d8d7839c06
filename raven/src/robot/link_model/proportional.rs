//! The state equation where cables pull in proportion to their stretch and friction does not go by tension: accelerations are linear but for
//! dry friction.
//!
//! ```text
//! qdd = M^-1 [(1 + C)' r_l (2 k_e x + 2 b_e xdot) - bias - F_v qd] - M^-1 F(q, qd)      x = wound cable - r_l (1 + C) q
//! ```
//!
//! A step takes as long as its longest chain of products. Those of matrices are worked out once for the steps that share rigid-body terms.

use nalgebra::{Matrix3, Vector3};

use super::{Friction, LinkModel, LinkState, RigidBody, Wound, runge_kutta};

/// Exponent of a cable's law up to which its force is taken to be proportional to its stretch: within two parts in ten million.
const EXPONENT: f64 = 1e-3;

/// That equation with the products worked out.
pub(super) struct Proportional {
    /// By how much position and velocity slow the joints down.
    by_position: Matrix3<f64>,
    by_rate: Matrix3<f64>,
    /// By how much cable that is wound drives them.
    by_cable: Matrix3<f64>,
    by_cable_rate: Matrix3<f64>,
    /// Without any of these.
    free: Vector3<f64>,
    inverse_mass: Matrix3<f64>,
    /// Dry friction that gives way at rest, and that holds [N m, N m, N].
    creeping: Vector3<f64>,
    holding: Vector3<f64>,
}

impl LinkModel {
    /// Whether the equation is such a one at a state.
    pub(super) fn is_proportional(&self, state: &LinkState, wound: &Wound) -> bool {
        let stretch_m = self.stretch_m(state, wound);
        let taut = self.arm.cables.iter().zip(&stretch_m).all(|(c, x)| c.slack == 0.0 && x.abs() < EXPONENT * c.exponent_length);
        taut && !self.friction.goes_by_tension()
    }
}

impl Proportional {
    pub(super) fn new(links: &LinkModel, body: &RigidBody) -> Self {
        let levers_m = &links.arm.transmission.levers_m;
        let cables = &links.arm.cables;
        let pulled = body.inverse_mass * levers_m.transpose();
        let by_cable = pulled * Matrix3::from_diagonal(&Vector3::from_fn(|j, _| 2.0 * cables[j].stiffness));
        let by_cable_rate = pulled * Matrix3::from_diagonal(&Vector3::from_fn(|j, _| 2.0 * cables[j].damping));
        let [creeping, holding] = [Friction::creeping, Friction::holding].map(|part| part(&links.friction, &Vector3::zeros()));
        Self {
            by_position: by_cable * levers_m,
            by_rate: by_cable_rate * levers_m + body.inverse_mass * Matrix3::from_diagonal(&links.arm.viscous_friction()),
            by_cable,
            by_cable_rate,
            free: -(body.inverse_mass * body.bias),
            inverse_mass: body.inverse_mass,
            creeping,
            holding,
        }
    }

    // Each of the four stages waits for the one before, and would for what a call hands over in memory.
    #[inline(always)]
    fn acceleration(&self, links: &LinkModel, driven: &Vector3<f64>, state: &LinkState) -> Vector3<f64> {
        let creeping = self.creeping.component_mul(&links.friction.way(&state.rate));
        let dry = match &state.anchor {
            Some(anchor) => creeping + links.grip.friction(anchor, &state.position, &state.rate, &self.holding),
            None => creeping,
        };
        driven - (self.by_position * state.position + self.by_rate * state.rate) - self.inverse_mass * dry
    }

    pub(super) fn step(&self, links: &LinkModel, state: &LinkState, wound: &Wound, step_s: f64) -> LinkState {
        let driven = self.free + self.by_cable * wound.cable_m + self.by_cable_rate * wound.rate_m_s;
        let gained = self.by_cable * wound.rate_m_s;
        let reached = runge_kutta(state, step_s, |s, t| self.acceleration(links, &(driven + gained * t), s));
        let anchor = state.anchor.map(|anchor| links.grip.slid(&anchor, &reached.position, &self.holding));
        LinkState { anchor, ..reached }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::{Arm, nominal};

    /// A motion with all that acts on the joints, after as many steps as advance takes; and whether products were worked out for it.
    fn with_and_without_products(arm: Arm) -> ([LinkState; 2], bool) {
        let motor = arm.transmission.motor_from_joint(&Vector3::new(0.8, 1.5, 0.35));
        let motor_rate = Vector3::new(30.0, -25.0, 20.0);
        let links = LinkModel::new(arm);
        let settled = links.settled(&motor, &Vector3::zeros());
        let anchor = settled - Vector3::new(1e-6, 2e-6, -1e-6);
        let start = LinkState { anchor: Some(anchor), ..LinkState::new(settled, Vector3::new(2e-3, -0.1, 0.02)) };
        let wound = Wound::by(&links.arm.transmission, &motor, &motor_rate);
        let duration_s = 2e-3;
        let steps = (duration_s / links.step_max_s()).ceil();
        let step_s = duration_s / steps;
        let body = links.rigid_body_ahead(&start, 0.5 * duration_s);
        let plain = (0..steps as usize).fold(start, |state, i| links.step_with(&body, &state, &wound.after(i as f64 * step_s), step_s));
        let advanced = links.advance(start, &motor, &motor_rate, duration_s);
        ([advanced, plain], links.is_proportional(&start, &wound))
    }

    #[test]
    fn products_of_matrices_worked_out_change_nothing() {
        let mut arm = nominal::gold().arm().unwrap();
        arm.link_friction.iter_mut().for_each(|friction| friction.held_part = 0.6);
        let ([advanced, plain], proportional) = with_and_without_products(arm);
        assert!(proportional);
        for j in 0..3 {
            approx::assert_relative_eq!(advanced.position[j], plain.position[j], max_relative = 1e-10);
            approx::assert_relative_eq!(advanced.rate[j], plain.rate[j], max_relative = 1e-6);
            approx::assert_relative_eq!(advanced.anchor.unwrap()[j], plain.anchor.unwrap()[j], max_relative = 1e-10);
        }
    }

    #[test]
    fn what_is_not_proportional_goes_the_long_way() {
        let changes: [fn(&mut Arm); 4] = [
            |arm| arm.cables[1].slack = 1e-4,
            |arm| arm.cables[2].exponent_length = 1e-4,
            |arm| arm.link_friction[0].per_load = 0.1,
            |arm| (arm.link_friction[1].per_load, arm.link_friction[1].held_part) = (0.1, 1.0),
        ];
        for change in changes {
            let mut arm = nominal::gold().arm().unwrap();
            change(&mut arm);
            let ([advanced, plain], proportional) = with_and_without_products(arm);
            assert!(!proportional);
            assert_eq!(advanced, plain);
        }
    }
}
