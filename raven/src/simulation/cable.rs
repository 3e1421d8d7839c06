//! From the capstan to the joint: wound length, play, dead zone, spring and damper, creep and slip.
//!
//! ```text
//! p = r_mc q_mc - e cos(q_mc + phase)          wound by the capstan
//! w follows p behind the file's hysteresis, and with play that is hidden, in the cable
//! x = w - r_l c - z - s                         stretch; z creeps, s has slipped
//! gamma = 2 k_e x0 sinh(y / x0) + 2 b_e ydot    y is x beyond the dead zone
//! ```

use super::machine::Drive;

/// What a cable remembers.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct CableState {
    /// Lag of the hysteresis that the robot file has, as a part of its half loop.
    pub lag: f64,
    /// `w`: where the cable's end at the capstan is [m].
    pub follower_m: f64,
    /// `z` [m].
    pub creep_m: f64,
    /// `s` [m].
    pub slipped_m: f64,
    /// `gamma` of the last step [N].
    pub tension_n: f64,
}

/// The cable's force over one step, linear in the velocities: `force + slope (engaged pdot - r_l cdot)`, velocities at its middle.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Linear {
    /// Elastic force at the step's start [N].
    pub force_n: f64,
    /// Force per stretch rate [N s/m]: the damper, and the spring over half the step.
    pub slope: f64,
    /// How much of the capstan's way the cable's end moves: 1 beyond hysteresis and play, 0 inside the play.
    pub engaged: f64,
}

impl Drive {
    /// Length wound at a capstan angle [rad], from angle zero [m].
    #[must_use]
    pub fn wound_m(&self, capstan_rad: f64) -> f64 {
        let [eccentricity, phase] = self.eccentricity;
        self.capstan_m * capstan_rad + eccentricity * (phase.cos() - (capstan_rad + phase).cos())
    }

    /// Length wound per angle of the capstan [m].
    #[must_use]
    pub fn wound_slope_m(&self, capstan_rad: f64) -> f64 {
        let [eccentricity, phase] = self.eccentricity;
        self.capstan_m + eccentricity * (capstan_rad + phase).sin()
    }

    /// Length wound [m] once the file's hysteresis has its part of it.
    fn behind_hysteresis_m(&self, wound_m: f64, lag: f64) -> f64 {
        wound_m - self.hysteresis_m.half_loop * lag
    }

    /// Spring force [N] and its slope [N/m] at a stretch [m].
    fn spring(&self, stretch_m: f64) -> (f64, f64) {
        let beyond = stretch_m - stretch_m.clamp(-self.backlash_half_m, self.backlash_half_m);
        if beyond == 0.0 && self.backlash_half_m > 0.0 {
            return (0.0, 0.0);
        }
        let scaled = beyond / self.stiffening_m;
        (2.0 * self.stiffness_n * self.stiffening_m * scaled.sinh(), 2.0 * self.stiffness_n * scaled.cosh())
    }

    /// Stretch [m] of which `wound_m` is the capstan's side and `taken_m` what the joint has taken up.
    fn stretch_m(&self, state: &CableState, taken_m: f64) -> f64 {
        state.follower_m - taken_m - state.creep_m - state.slipped_m
    }

    /// The cable over the coming step. `drive_sign` is the way in which the capstan moves or is about to move.
    #[must_use]
    pub fn linearise(&self, state: &CableState, motion: &Motion, drive_sign: f64, step_s: f64) -> Linear {
        let passed_on = self.hysteresis_m.passed_on(state.lag, drive_sign);
        let to_go = self.play_half_m - drive_sign * (self.behind_hysteresis_m(motion.wound_m, state.lag) - state.follower_m);
        let is_engaged = self.play_half_m == 0.0 || to_go <= 0.5 * step_s * (passed_on * motion.wound_rate).abs();
        let engaged = if is_engaged { passed_on } else { 0.0 };
        let (force_n, stiffness) = self.spring(self.stretch_m(state, motion.taken_m));
        let rate = engaged * motion.wound_rate - motion.taken_rate;
        let free = self.backlash_half_m > 0.0 && (stiffness == 0.0 || force_n * (force_n + 2.0 * self.damping * rate) <= 0.0);
        if free {
            // Inside the dead zone, or leaving it faster than the spring follows: a slack cable cannot push.
            return Linear { force_n: 0.0, slope: 0.0, engaged };
        }
        Linear { force_n, slope: 2.0 * self.damping + 0.5 * step_s * stiffness, engaged }
    }

    /// Moves what the cable remembers over a step that wound it from `before` to `wound_m` under `tension_n`.
    pub fn remember(&self, state: &mut CableState, before_m: f64, wound_m: f64, tension_n: f64, step_s: f64) {
        state.lag = self.hysteresis_m.lag_after(state.lag, wound_m - before_m);
        let end_m = self.behind_hysteresis_m(wound_m, state.lag);
        state.follower_m = state.follower_m.clamp(end_m - self.play_half_m, end_m + self.play_half_m);
        if let Some([ratio, time_s]) = self.creep {
            let settled_m = ratio * tension_n / (2.0 * self.stiffness_n);
            // Exact for a force that stays over the step.
            state.creep_m = settled_m + (state.creep_m - settled_m) * (-step_s / time_s).exp();
        }
        if let Some([force_n, fraction]) = self.slip
            && tension_n.abs() > force_n
        {
            state.slipped_m += fraction * (wound_m - before_m).abs() * tension_n.signum();
        }
        state.tension_n = tension_n;
    }
}

/// Both ends of a cable: lengths [m] and their rates [m/s].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Wound by the capstan.
    pub wound_m: f64,
    /// Its rate.
    pub wound_rate: f64,
    /// Taken up by the joints.
    pub taken_m: f64,
    /// Its rate.
    pub taken_rate: f64,
}
