//! What is known beforehand: an unknown is its prior value and how far from it the truth may be.
//!
//! The solver works in steps of one prior standard deviation, `z`, so every prior is `N(0, 1)` and the posterior deviation of `z` is
//! the ratio of posterior to prior deviation. A positive quantity is `prior exp(spread z)`, any other `prior + spread z`.
//!
//! An offset of the shoulder and a turned camera look almost alike. Who absorbs what is decided by what is known: a hard stop that
//! nobody asked for has the tolerance of the robot file (0.05 deg, 0.3 mm), the registration what its calibration claims, 1 deg and
//! 5 mm if it claims nothing. So the registration gives way first, and a named hard stop gets room of its own.

use raven::camera::Quality;
use raven::robot::{JointType, Robot};
use raven::{Error, Result};

use crate::parameters::{ALL, Quantity, Selection};

/// Spread of a radius that is looked for: 10 %.
const RADIUS: f64 = 0.1;
/// Spread of stiffness, damping and friction that are looked for: a factor of three.
const FACTOR: f64 = 1.098_612_288_668_109_8;
/// Spread of a hard stop that is looked for, 3 deg and 10 mm.
const HARD_STOP_RAD: f64 = 0.052_359_877_559_829_89;
const HARD_STOP_M: f64 = 0.01;
/// Spread of a coupling that is looked for, per radian of the joint that moves: the size of the errors seen on such hardware.
const COUPLING_RAD: f64 = 0.05;
const COUPLING_M: f64 = 0.01;
/// Spread of half a hysteresis loop, 0.5 deg and 1 mm.
const HYSTERESIS_RAD: f64 = 0.008_726_646_259_971_648;
const HYSTERESIS_M: f64 = 1e-3;
/// Spread of a loop's straight part, which is anywhere from -1 to 1: that of a uniform distribution.
const STRAIGHT_PART: f64 = 0.577_350_269_189_625_8;
/// Spread of the latency [s]: webcams are 5 to 150 ms late.
const LATENCY_S: f64 = 0.1;
/// Spread of a registration whose quality is not written down, 1 deg and 5 mm.
const REGISTRATION_RAD: f64 = 0.017_453_292_519_943_295;
const REGISTRATION_M: f64 = 0.005;

/// Prior deviations of a logarithm beyond which no value is looked at: a factor of 81 for cables.
const FACTORS_MAX: f64 = 4.0;
/// The same for more damping, whose poles make rollouts slow: a factor of nine.
const DAMPING_MAX: f64 = 2.0;

/// One unknown of the estimation.
#[derive(Debug, Clone, PartialEq)]
pub struct Unknown {
    /// What it is.
    pub quantity: Quantity,
    /// Where it stands in the robot file.
    pub key: String,
    /// Value in the robot file [SI].
    pub prior: f64,
    /// Prior standard deviation, of the logarithm if the quantity is positive.
    pub spread: f64,
    /// Whether it was asked for, as against estimated along.
    pub named: bool,
}

impl Unknown {
    /// The value [SI] at `z` prior deviations from the prior, [bounded](Self::bounded).
    #[must_use]
    pub fn value(&self, z: f64) -> f64 {
        let z = self.bounded(z);
        if self.quantity.is_positive() { self.prior * (self.spread * z).exp() } else { self.prior + self.spread * z }
    }

    /// How many prior deviations a value [SI] is from the prior.
    #[must_use]
    pub fn z(&self, value: f64) -> f64 {
        let moved = if self.quantity.is_positive() { (value / self.prior).ln() } else { value - self.prior };
        moved / self.spread
    }

    /// `z`, kept where hardware can be if a factor is estimated, a factor of 81, and of nine for more damping; and a straight part from -1 to 1.
    #[must_use]
    pub fn bounded(&self, z: f64) -> f64 {
        match self.quantity {
            Quantity::StraightPart(_) => z.clamp(self.z(-1.0), self.z(1.0)),
            Quantity::Damping(_) => z.clamp(-FACTORS_MAX, DAMPING_MAX),
            quantity if quantity.is_positive() => z.clamp(-FACTORS_MAX, FACTORS_MAX),
            _ => z,
        }
    }

    /// Standard deviation [SI] at a value, of a standard deviation of `z`.
    #[must_use]
    pub fn std(&self, value: f64, std_z: f64) -> f64 {
        if self.quantity.is_positive() { value * self.spread * std_z } else { self.spread * std_z }
    }

    /// Standard deviation before [SI].
    #[must_use]
    pub fn prior_std(&self) -> f64 {
        self.std(self.prior, 1.0)
    }
}

/// The unknowns of a selection, with the registration along, in the order of [`ALL`].
///
/// # Errors
/// If the robot file has no number for a selected quantity, or one that a factor cannot be put on.
pub fn unknowns(robot: &Robot, selection: &Selection, quality: &Quality) -> Result<Vec<Unknown>> {
    let mut numbers = robot.clone();
    let mut list = Vec::new();
    for quantity in ALL {
        let asked = |quantity: Quantity| selection.quantities.contains(&quantity);
        // Over what travel a loop turns means nothing without how it does.
        let selected = asked(quantity) || matches!(quantity, Quantity::StraightPart(j) if asked(Quantity::Rounding(j)));
        if !selected && !quantity.is_registration() {
            continue;
        }
        let key = quantity.key(robot);
        let prior = *numbers.value_mut(&key).ok_or_else(|| {
            Error::Data(format!("robot `{}` has no {key}, so {} cannot be estimated; add it to the file.", robot.name, quantity.name()))
        })?;
        if quantity.is_positive() && (prior.is_nan() || prior <= 0.0) {
            return Err(Error::Data(format!(
                "robot `{}` has {key} = {prior}, and {} is estimated as a factor on it; write a positive number.",
                robot.name,
                quantity.name()
            )));
        }
        let named = selected && selection.named;
        list.push(Unknown { quantity, prior, spread: spread(quantity, robot, named, quality), named, key });
    }
    Ok(list)
}

fn spread(quantity: Quantity, robot: &Robot, named: bool, quality: &Quality) -> f64 {
    let kind = |j: usize| robot.joints.get(j).map_or(JointType::Revolute, |joint| joint.kind);
    let by_kind = |j: usize, revolute: f64, prismatic: f64| if kind(j) == JointType::Revolute { revolute } else { prismatic };
    let tolerances = &robot.tolerances;
    match quantity {
        Quantity::PulleyRadius(_) => RADIUS,
        Quantity::HardStop(j) if named => by_kind(j, HARD_STOP_RAD, HARD_STOP_M),
        Quantity::HardStop(j) => tolerances.hard_stop_of(kind(j)),
        Quantity::Coupling(_, to) => by_kind(to, COUPLING_RAD, COUPLING_M),
        Quantity::Stiffness(_) | Quantity::Damping(_) | Quantity::Coulomb(_) | Quantity::Rounding(_) => FACTOR,
        Quantity::Hysteresis(j) => by_kind(j, HYSTERESIS_RAD, HYSTERESIS_M),
        Quantity::StraightPart(_) => STRAIGHT_PART,
        Quantity::Latency => LATENCY_S,
        Quantity::Rotation(axis) => {
            quality.registration_rotation_std_rad.map_or(REGISTRATION_RAD, |std| std[axis]).max(tolerances.camera_rotation_rad)
        }
        Quantity::Translation(axis) => {
            quality.registration_translation_std_m.map_or(REGISTRATION_M, |std| std[axis]).max(tolerances.camera_translation_m)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use raven::robot::nominal;

    fn find(list: &[Unknown], quantity: Quantity) -> &Unknown {
        list.iter().find(|u| u.quantity == quantity).unwrap()
    }

    #[test]
    fn an_unnamed_hard_stop_is_known_to_its_tolerance() {
        let robot = nominal::gold();
        let along = unknowns(&robot, &Selection::default(), &Quality::default()).unwrap();
        assert_eq!(along.len(), 11);
        assert_eq!(find(&along, Quantity::HardStop(0)).prior_std(), robot.tolerances.hard_stop);
        assert_eq!(find(&along, Quantity::HardStop(2)).prior_std(), robot.tolerances.hard_stop_of(JointType::Prismatic));
        let named = unknowns(&robot, &Selection::named(&["offset_1".to_owned()]).unwrap(), &Quality::default()).unwrap();
        assert_eq!(find(&named, Quantity::HardStop(0)).prior_std(), 3.0_f64.to_radians());
    }

    #[test]
    fn the_registration_is_known_as_its_calibration_says_but_not_better_than_tolerances() {
        let robot = nominal::gold();
        let quality = Quality { registration_rotation_std_rad: Some([0.01, 1e-6, 0.01]), ..Quality::default() };
        let list = unknowns(&robot, &Selection::default(), &quality).unwrap();
        assert_eq!(find(&list, Quantity::Rotation(0)).spread, 0.01);
        assert_eq!(find(&list, Quantity::Rotation(1)).spread, robot.tolerances.camera_rotation_rad);
        assert_eq!(find(&list, Quantity::Translation(1)).spread, REGISTRATION_M);
    }

    #[test]
    fn a_value_is_as_many_prior_deviations_away_as_its_unknown_says() {
        let all = Selection::named(&["all".to_owned()]).unwrap();
        for unknown in unknowns(&nominal::gold(), &all, &Quality::default()).unwrap() {
            for z in [-0.7, 0.0, 1.1] {
                let value = unknown.value(z);
                assert_relative_eq!(unknown.z(value), z, epsilon = 1e-9);
                let slope = (unknown.value(z + 1e-6) - unknown.value(z - 1e-6)) / 2e-6;
                assert_relative_eq!(unknown.std(value, 1.0), slope, max_relative = 1e-6);
            }
        }
    }

    #[test]
    fn a_straight_part_ends_where_all_or_nothing_is_straight() {
        let selection = Selection::named(&["rounding_2".to_owned()]).unwrap();
        let list = unknowns(&nominal::gold(), &selection, &Quality::default()).unwrap();
        let straight = find(&list, Quantity::StraightPart(1));
        assert!(straight.named);
        assert_eq!([-9.0, 0.0, 9.0].map(|z| straight.value(z)), [-1.0, 0.0, 1.0]);
        assert_eq!([-9.0, 9.0].map(|z| straight.value(straight.bounded(z))), [-1.0, 1.0]);
    }

    #[test]
    fn a_number_the_file_lacks_is_named() {
        let mut robot = nominal::gold();
        robot.cable_coupling.clear();
        let selection = Selection::named(&["coupling_12".to_owned()]).unwrap();
        let error = unknowns(&robot, &selection, &Quality::default()).unwrap_err().to_string();
        assert!(error.contains("cable_coupling.shoulder.elbow") && error.contains("coupling_12"), "{error}");
    }
}
