//! Effects that a virtual robot can hide: named, physical departures of the machine from its parameter file.
//!
//! Written `ID[:TARGET]=VALUE[,VALUE]`, as in `pulley-radius:shoulder=-0.05` or `camera-rotation=0.02,0,0`. Every value is what the machine
//! has over what the file says: relative errors and offsets are added, factors multiply.

use std::fmt;
use std::str::FromStr;

use serde::Serialize;

use crate::robot::{KinematicsKind, Robot};
use crate::{Error, Result};

use EffectKind::*;
use Scope::*;

/// One effect with its size.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Effect {
    /// Which one.
    #[serde(rename = "id", serialize_with = "id")]
    pub kind: EffectKind,
    /// Joint, `from->to` of a coupling, `12` or `23` of a link angle; none for the whole robot or rig.
    #[serde(rename = "joint")]
    pub target: Option<String>,
    /// Its numbers, in the order of [`EffectKind::values`].
    #[serde(rename = "magnitude", serialize_with = "magnitude")]
    pub values: Vec<f64>,
}

fn id<S: serde::Serializer>(kind: &EffectKind, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(kind.row().id)
}

/// One number alone, several as a list.
fn magnitude<S: serde::Serializer>(values: &[f64], serializer: S) -> Result<S::Ok, S::Error> {
    match values {
        [value] => value.serialize(serializer),
        several => several.serialize(serializer),
    }
}

/// What an effect belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scope {
    /// A joint of the robot file.
    Joint,
    /// Two joints, `from->to`.
    Pair,
    /// `12` or `23`.
    LinkAngle,
    /// The whole robot or the camera rig.
    Whole,
}

/// One number of an effect.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Value {
    /// Name.
    pub name: &'static str,
    /// Unit; `joint` is rad or m.
    pub unit: &'static str,
    /// Smallest and largest value that makes sense.
    pub range: [f64; 2],
    /// Value where it is not given; without one it must be.
    pub default: Option<f64>,
}

/// Identifier, scope and numbers of one kind of effect.
#[derive(Debug, Clone, Copy)]
struct Row {
    kind: EffectKind,
    id: &'static str,
    scope: Scope,
    values: &'static [Value],
}

macro_rules! effects {
    ($($(#[$doc:meta])* $kind:ident, $id:literal, $scope:ident, [$($name:literal $unit:literal $low:literal..$high:literal $(= $default:literal)?),+];)+) => {
        /// Every effect of the virtual lab.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum EffectKind { $($(#[$doc])* $kind),+ }

        const TABLE: &[Row] = &[$(Row {
            kind: $kind,
            id: $id,
            scope: $scope,
            values: &[$(Value { name: $name, unit: $unit, range: [$low, $high], default: effects!(@default $($default)?) }),+],
        }),+];
    };
    (@default) => { None };
    (@default $default:literal) => { Some($default) };
}

effects! {
    /// Radius of the pulley at the link, or as well the capstan's.
    PulleyRadius, "pulley-radius", Joint, ["relative_error" "1" -0.3..0.3];
    /// The hard stop is not where it is believed.
    JointOffset, "joint-offset", Joint, ["offset" "joint" -0.2..0.2];
    /// A joint moves another's cable more or less than believed.
    CableCoupling, "cable-coupling", Pair, ["coefficient" "rad/rad or m/rad" -0.5..0.5];
    /// Softer or stiffer cable.
    CableStretch, "cable-stretch", Joint, ["factor" "1" 0.001..100.0];
    /// Cable that stiffens over a length: `2 k_e x0 sinh(x / x0)`.
    CableStiffening, "cable-stiffening", Joint, ["length" "m" 0.000001..10.0];
    /// Damping of the cable.
    CableDamping, "cable-damping", Joint, ["factor" "1" 0.0..100.0];
    /// Dead zone in the transmission, total width at the joint.
    Backlash, "backlash", Joint, ["width" "joint" 0.0..0.2];
    /// Play between capstan and cable, half the loop at the joint.
    Hysteresis, "hysteresis", Joint, ["half_loop" "joint" 0.0..0.1];
    /// Slow stretch: its final size over the immediate one, and its time constant.
    Creep, "creep", Joint, ["ratio" "1" 0.0..100.0, "time" "s" 0.01..100000.0 = 20.0];
    /// Capstan slip: above this tension difference, this part of the capstan's travel is lost in the direction of the load.
    CableSlip, "cable-slip", Joint, ["force" "N" 0.0..100000.0, "fraction" "1" 0.0..1.0 = 0.01];
    /// Eccentric capstan: `r_mc + e sin(q_mc + p)`.
    PulleyEccentricity, "pulley-eccentricity", Joint, ["eccentricity" "m" -0.003..0.003, "phase" "rad" -7.0..7.0 = 0.0];
    /// Coulomb friction of the joint.
    LinkCoulombFriction, "link-coulomb-friction", Joint, ["factor" "1" 0.0..100.0];
    /// Viscous friction of the joint.
    LinkViscousFriction, "link-viscous-friction", Joint, ["factor" "1" 0.0..100000.0];
    /// Friction of the joint that grows with the cable's force: this times the force at the joint.
    LoadDependentFriction, "load-dependent-friction", Joint, ["coefficient" "1" 0.0..2.0];
    /// Mass at the tracked point.
    Payload, "payload", Whole, ["mass" "kg" 0.0..5.0];
    /// Rotational inertia of a link about its centre of mass; a prismatic joint's mass against acceleration.
    LinkInertia, "link-inertia", Joint, ["factor" "1" 0.1..10.0];
    /// Coulomb friction of the motor.
    MotorCoulombFriction, "motor-coulomb-friction", Joint, ["factor" "1" 0.0..100.0];
    /// Viscous friction of the motor.
    MotorViscousFriction, "motor-viscous-friction", Joint, ["factor" "1" 0.0..1000.0];
    /// More Coulomb friction of the motor at low speed: `tau_c (1 + d exp(-(v / v_s)^2))`, speed at the motor.
    StribeckFriction, "stribeck-friction", Joint, ["depth" "1" 0.0..10.0, "speed" "rad/s" 0.001..1000.0 = 5.0];
    /// Inertia of the motor.
    MotorInertia, "motor-inertia", Joint, ["factor" "1" 0.1..100.0];
    /// Torque per command.
    TorqueConstant, "torque-constant", Joint, ["factor" "1" 0.1..10.0];
    /// The drive clips below its command, after the gear box.
    TorqueSaturation, "torque-saturation", Joint, ["limit" "N m or N" 0.001..100000.0];
    /// `a sin(n q_m)` on the motor shaft.
    TorqueRipple, "torque-ripple", Joint, ["amplitude" "N m" -1000.0..1000.0, "per_turn" "1" 1.0..200.0 = 7.0];
    /// Longer or shorter tool.
    ToolLength, "tool-length", Whole, ["length" "m" -0.05..0.05];
    /// Angle between neighbouring joint axes.
    LinkAngleError, "link-angle", LinkAngle, ["angle" "rad" -0.2..0.2];
    /// The rig is turned about the tip's position at the hard stop; rotation vector in the left camera's frame.
    CameraRotation, "camera-rotation", Whole, ["x" "rad" -0.5..0.5, "y" "rad" -0.5..0.5, "z" "rad" -0.5..0.5];
    /// The rig is moved; left camera's frame.
    CameraTranslation, "camera-translation", Whole, ["x" "m" -0.1..0.1, "y" "m" -0.1..0.1, "z" "m" -0.1..0.1];
    /// Baseline.
    StereoScale, "stereo-scale", Whole, ["relative_error" "1" -0.2..0.2];
    /// First radial coefficient of both lenses.
    LensDistortion, "lens-distortion", Whole, ["k1" "1" -0.3..0.3];
    /// Images show the past of their stamps by this.
    TimeOffset, "time-offset", Whole, ["delay" "s" -0.5..0.5];
    /// The delay grows by this much per second.
    ClockDrift, "clock-drift", Whole, ["rate" "s/s" -0.01..0.01];
    /// The right image shows the past by this much more than the left.
    StereoDesync, "stereo-desync", Whole, ["delay" "s" -0.1..0.1];
    /// Time from the first row of an image to its last; the stamp belongs to the middle row.
    RollingShutter, "rolling-shutter", Whole, ["readout" "s" 0.0..0.1];
    /// The encoder reads this much more from one moment on, as a part of the recording's duration.
    MissedCounts, "missed-counts", Joint, ["counts" "counts" -100000.0..100000.0, "at" "1" 0.0..1.0 = 0.5];
}

impl EffectKind {
    fn row(self) -> &'static Row {
        // The table is made from the same list as the kinds, in the same order.
        &TABLE[self as usize]
    }

    /// All kinds.
    pub fn all() -> impl Iterator<Item = Self> {
        TABLE.iter().map(|row| row.kind)
    }

    /// Identifier, as in `pulley-radius`.
    #[must_use]
    pub fn id(self) -> &'static str {
        self.row().id
    }

    /// What it belongs to.
    #[must_use]
    pub fn scope(self) -> Scope {
        self.row().scope
    }

    /// Its numbers, in order.
    #[must_use]
    pub fn values(self) -> &'static [Value] {
        self.row().values
    }
}

impl Effect {
    /// An effect on a joint or on the whole; numbers left off take their defaults.
    ///
    /// # Errors
    /// If a number is missing, too many or out of its range, or if the target does not fit the scope.
    pub fn new(kind: EffectKind, target: Option<&str>, values: &[f64]) -> Result<Self> {
        let row = kind.row();
        let fail = |message: String| Err(Error::Argument(format!("--effect {}: {message}", row.id)));
        let placed = match row.scope {
            Joint => target.is_some(),
            Pair => target.is_some_and(|t| t.contains("->")),
            LinkAngle => target.is_some_and(|t| ["12", "23"].contains(&t)),
            Whole => target.is_none(),
        };
        if !placed {
            let given = target.map_or_else(|| "nothing".to_owned(), |t| format!("`{t}`"));
            return fail(format!("it belongs to {}, and {given} is given; write {}.", row.scope, usage(row)));
        }
        if values.len() > row.values.len() {
            return fail(format!("{} numbers are given, it takes {}; write {}.", values.len(), row.values.len(), usage(row)));
        }
        let mut complete = values.to_vec();
        for value in &row.values[values.len()..] {
            match value.default {
                Some(default) => complete.push(default),
                None => return fail(format!("`{}` is missing; write {}.", value.name, usage(row))),
            }
        }
        for (given, value) in complete.iter().zip(row.values) {
            let [low, high] = value.range;
            if !(low..=high).contains(given) {
                return fail(format!("`{}` is {given}, expected {low} to {high} {}.", value.name, value.unit));
            }
        }
        Ok(Self { kind, target: target.map(str::to_owned), values: complete })
    }

    /// Refuses a joint that the robot does not have, and on a bench what is not of one joint.
    ///
    /// # Errors
    /// With the joints there are.
    pub fn check_target(&self, robot: &Robot) -> Result<()> {
        if matches!(robot.kinematics, KinematicsKind::Bench) && self.kind.scope() != Joint {
            let (name, joints) = (&robot.name, robot.joints.iter().map(|joint| joint.name.as_str()).collect::<Vec<_>>().join(", "));
            return Err(Error::Argument(format!(
                "--effect {self}: robot `{name}` is a bench, which has no tip, no cameras and joints that do not move each other's cables; an                  effect there is on one of its joints ({joints})."
            )));
        }
        match (self.kind.scope(), self.target.as_deref()) {
            (Joint, Some(joint)) => robot.joint_index(joint).map(|_| ()),
            (Pair, Some(pair)) => self.pair_names(pair).and_then(|(from, to)| {
                if from == to {
                    return Err(Error::Argument(format!("--effect {self}: it couples `{from}` to itself.")));
                }
                let (first, second) = (robot.joint_index(from)?, robot.joint_index(to)?);
                if first > second && !robot.cable_coupling.iter().any(|coupling| (&*coupling.from, &*coupling.to) == (from, to)) {
                    return Err(Error::Argument(format!(
                        "--effect {self}: a cable runs over the joints before its own, and robot `{}` has no other coupling; write {to}->{from}.",
                        robot.name
                    )));
                }
                Ok(())
            }),
            _ => Ok(()),
        }
    }

    /// The two joints of a coupling.
    ///
    /// # Errors
    /// If this effect has no pair.
    pub fn pair(&self) -> Result<(&str, &str)> {
        self.pair_names(self.target.as_deref().unwrap_or_default())
    }

    fn pair_names<'a>(&self, pair: &'a str) -> Result<(&'a str, &'a str)> {
        pair.split_once("->").ok_or_else(|| Error::Argument(format!("--effect {self}: `{pair}` is no pair of joints; write from->to.")))
    }
}

impl FromStr for Effect {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let known = || TABLE.iter().map(usage).collect::<Vec<_>>().join("\n  ");
        let Some((name, numbers)) = text.split_once('=') else {
            return Err(Error::Argument(format!("--effect `{text}` has no `=`; write ID[:JOINT]=VALUE, one of\n  {}", known())));
        };
        let (id, target) = match name.split_once(':') {
            Some((id, target)) => (id, Some(target)),
            None => (name, None),
        };
        let Some(row) = TABLE.iter().find(|row| row.id == id) else {
            return Err(Error::Argument(format!("--effect `{id}` is not known; there are\n  {}", known())));
        };
        let values = numbers
            .split(',')
            .map(|number| {
                let parsed = number.trim().parse::<f64>().ok().filter(|v| v.is_finite());
                parsed.ok_or_else(|| Error::Argument(format!("--effect {id}: `{number}` is no number; write {}.", usage(row))))
            })
            .collect::<Result<Vec<f64>>>()?;
        Self::new(row.kind, target, &values)
    }
}

impl fmt::Display for Effect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.kind.id())?;
        if let Some(target) = &self.target {
            write!(f, ":{target}")?;
        }
        let values: Vec<String> = self.values.iter().map(f64::to_string).collect();
        write!(f, "={}", values.join(","))
    }
}

impl fmt::Display for Scope {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Joint => "a joint",
            Pair => "a pair of joints",
            LinkAngle => "the link angle 12 or 23",
            Whole => "the whole robot or rig, not to a joint",
        })
    }
}

fn usage(row: &Row) -> String {
    let target = match row.scope {
        Joint => ":JOINT",
        Pair => ":JOINT->JOINT",
        LinkAngle => ":12|23",
        Whole => "",
    };
    let values: Vec<String> = row
        .values
        .iter()
        .map(|v| match v.default {
            None => format!("{} [{}]", v.name, v.unit),
            Some(default) => format!("{} [{}, {default} if left off]", v.name, v.unit),
        })
        .collect();
    format!("{}{target}={}", row.id, values.join(","))
}
