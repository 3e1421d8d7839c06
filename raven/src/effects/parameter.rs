//! What is believed of an effect's number before a recording is looked at.
//!
//! Hypotheses are compared in a coordinate `u` in which the effect's own prior, the slab, is `N(0, 1)` and no effect is `u = 0`. A number
//! of the nominal model is off by its tolerance in any case: in `u` that is the spike `N(0, tolerance^2)`.

use super::Measure;
use crate::robot::{JointType, Robot};

/// How a number goes with `u`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Scale {
    /// `size u`, 0 without the effect.
    Offset(Size),
    /// `exp(size u)`: a factor on the nominal value.
    Factor {
        /// Deviation of its logarithm.
        size: f64,
        /// What is believed of one above 1.
        above: Above,
    },
    /// `size |u|`: cannot be negative, 0 without the effect.
    Magnitude(Size),
    /// `|u|`, 1 at most: a part of what the model has, 0 without the effect.
    Part,
    /// `middle exp(size u)`: belongs to an effect whose other number says whether there is one.
    Shape {
        /// Value at `u = 0`.
        middle: f64,
        /// Deviation of its logarithm.
        size: f64,
    },
    /// `size u`, 0 for none: what the motion before the recording left.
    State {
        /// Value at `u = 1`.
        size: f64,
        /// Largest value of either sign: motion leaves no more.
        most: f64,
    },
    /// `u` from 0 to 1 along the recording.
    Moment,
    /// A whole number from 1 to `most`, all as probable, spread over `u` with mean 0 and variance 1: looked for one by one.
    Whole {
        /// The largest.
        most: u32,
    },
}

/// What is believed of a factor above 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Above {
    /// It is as probable as one below.
    AsBelow,
    /// It is one in twenty: what is not as stated is less as a rule.
    Seldom,
    /// More than so much would change nothing.
    UpTo(f64),
}

impl Scale {
    /// A factor that is as probable above 1 as below, by the deviation of its logarithm.
    #[must_use]
    pub const fn factor(size: f64) -> Self {
        Self::Factor { size, above: Above::AsBelow }
    }

    /// Whether it is what the motion before a recording left: no number of the robot.
    #[must_use]
    pub fn is_state(self) -> bool {
        matches!(self, Self::State { .. })
    }

    /// Whether the number says what an effect is like whose other number says whether there is one.
    #[must_use]
    pub fn is_shape(self) -> bool {
        matches!(self, Self::Shape { .. })
    }

    /// Whether it is a factor on the nominal value.
    #[must_use]
    pub fn is_factor(self) -> bool {
        matches!(self, Self::Factor { .. })
    }

    /// Whether the number says how large an effect is, as against what it is like.
    #[must_use]
    pub fn is_size(self) -> bool {
        self.is_factor() || matches!(self, Self::Offset(_) | Self::Magnitude(_) | Self::Part)
    }

    /// Least and largest `u` of what a fit looks at: beyond, values mirror or no longer change.
    #[must_use]
    pub fn limits_u(self) -> [f64; 2] {
        match self {
            Self::Magnitude(_) => [0.0, f64::INFINITY],
            Self::Part | Self::Moment => [0.0, 1.0],
            Self::State { size, most } => [-most / size, most / size],
            Self::Factor { size, above: Above::UpTo(most) } => [f64::NEG_INFINITY, most.ln() / size],
            Self::Offset(_) | Self::Factor { .. } | Self::Shape { .. } | Self::Whole { .. } => [f64::NEG_INFINITY, f64::INFINITY],
        }
    }

    /// `u` of every whole number; empty for other scales.
    #[must_use]
    pub fn whole(self) -> Vec<f64> {
        let Self::Whole { most } = self else { return Vec::new() };
        let (middle, spread) = spread(most);
        (1..=most).map(|n| (f64::from(n) - middle) / spread).collect()
    }
}

/// Mean and deviation of the whole numbers from 1 to `most`.
fn spread(most: u32) -> (f64, f64) {
    let most = f64::from(most);
    (0.5 * (most + 1.0), ((most * most - 1.0) / 12.0).sqrt().max(1.0))
}

/// A typical size on a Raven [unit of the parameter], which may depend on the kind of the joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Size {
    /// Of a revolute joint, or of anything else.
    pub revolute: f64,
    /// Of a prismatic joint.
    pub prismatic: f64,
}

/// One number of an effect.
#[derive(Debug, Clone, Copy)]
pub struct Parameter {
    /// Name.
    pub name: &'static str,
    /// Unit; one that a [`Measure`] knows, such as `joint` or `shaft torque`, stands for what it is at the place.
    pub unit: &'static str,
    /// Its slab.
    pub scale: Scale,
    /// What the nominal value is good for, in the unit of `size`; `None` where the nominal model has no such thing.
    pub tolerance: Option<fn(&Robot, super::Place) -> f64>,
}

impl Size {
    /// The same for all.
    #[must_use]
    pub const fn of(size: f64) -> Self {
        Self { revolute: size, prismatic: size }
    }

    /// For [rad] and [m].
    #[must_use]
    pub const fn per_kind(revolute: f64, prismatic: f64) -> Self {
        Self { revolute, prismatic }
    }

    /// Of a joint.
    #[must_use]
    pub fn at(&self, kind: JointType) -> f64 {
        match kind {
            JointType::Revolute => self.revolute,
            JointType::Prismatic => self.prismatic,
        }
    }
}

impl Parameter {
    /// The value at `u`.
    #[must_use]
    pub fn value(&self, u: f64, measure: Measure) -> f64 {
        let [least, largest] = self.scale.limits_u();
        match self.scale {
            Scale::Offset(size) => self.size(size, measure) * u,
            Scale::State { size, most } => (size * u).clamp(-most, most),
            Scale::Part => u.abs().min(largest),
            Scale::Factor { size, .. } => (size * u.min(largest)).exp(),
            Scale::Magnitude(size) => self.size(size, measure) * u.abs(),
            Scale::Shape { middle, size } => measure.times(self.unit) * middle * (size * u).exp(),
            Scale::Moment => u.clamp(least, largest),
            Scale::Whole { most } => {
                let (middle, spread) = spread(most);
                (middle + spread * u).round().clamp(1.0, f64::from(most))
            }
        }
    }

    /// The `u` of a value; of a magnitude the one that is not negative.
    #[must_use]
    pub fn u(&self, value: f64, measure: Measure) -> f64 {
        match self.scale {
            Scale::Offset(size) | Scale::Magnitude(size) => value / self.size(size, measure),
            Scale::State { size, .. } => value / size,
            Scale::Factor { size, .. } => value.ln() / size,
            Scale::Shape { middle, size } => (value / (measure.times(self.unit) * middle)).ln() / size,
            Scale::Moment | Scale::Part => value,
            Scale::Whole { most } => {
                let (middle, spread) = spread(most);
                (value - middle) / spread
            }
        }
    }

    /// Deviation of the value where `u` has the deviation `std`.
    #[must_use]
    pub fn std(&self, u: f64, std: f64, measure: Measure) -> f64 {
        match self.scale {
            Scale::Offset(size) | Scale::Magnitude(size) => self.size(size, measure) * std,
            Scale::Factor { size, .. } | Scale::Shape { size, .. } => self.value(u, measure) * size * std,
            Scale::State { size, .. } => size * std,
            Scale::Moment | Scale::Part => std,
            Scale::Whole { .. } => 0.0,
        }
    }

    /// The spike's deviation in `u`: what the nominal value's tolerance amounts to.
    #[must_use]
    pub fn tolerance_u(&self, robot: &Robot, place: super::Place, measure: Measure) -> Option<f64> {
        let tolerance = self.tolerance?(robot, place);
        Some(match self.scale {
            Scale::Offset(size) | Scale::Magnitude(size) => tolerance / self.size(size, measure),
            Scale::Factor { size, .. } | Scale::Shape { size, .. } | Scale::State { size, .. } => tolerance / size,
            Scale::Part | Scale::Moment | Scale::Whole { .. } => tolerance,
        })
    }

    /// What such hardware can have at most: beyond it a value is in another unit.
    #[must_use]
    pub fn range(&self, measure: Measure) -> [f64; 2] {
        /// Typical sizes that are still believed.
        const REACH: f64 = 40.0;
        /// And factors.
        const FACTOR: f64 = 1e4;
        let reach = match self.scale {
            Scale::Factor { size, .. } | Scale::Shape { size, .. } => REACH.min(FACTOR.ln() / size),
            _ => REACH,
        };
        let [least, largest] = self.scale.limits_u();
        [least.max(-reach), largest.min(reach)].map(|u| self.value(u, measure))
    }

    /// The value that a shape or a second factor has where nothing is said of it; nothing where it must be said.
    #[must_use]
    pub fn usual(&self, measure: Measure) -> Option<f64> {
        match self.scale {
            _ if self.scale.is_factor() => Some(1.0),
            Scale::State { .. } => Some(0.0),
            Scale::Magnitude(_) | Scale::Part if self.tolerance.is_some() => Some(0.0),
            Scale::Shape { middle, .. } => Some(measure.times(self.unit) * middle),
            _ => None,
        }
    }

    /// Unit in a report.
    #[must_use]
    pub fn unit_at(&self, measure: Measure) -> &'static str {
        measure.unit(self.unit)
    }

    fn size(&self, size: Size, measure: Measure) -> f64 {
        size.at(measure.joint) * measure.times(self.unit)
    }
}
