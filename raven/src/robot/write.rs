//! Writing `robot.yaml`: the layout of the nominal file, numbers as every YAML 1.1 reader takes for floats.

use std::fmt::Write as _;
use std::path::Path;

use super::{Hysteresis, Joint, JointType, KinematicsKind, ListedEffect, Observation, Provenance, Robot, SourceFormat};
use crate::{Result, files, yaml};

impl Robot {
    /// Writes the file in one step; the old one stays until the new one is whole.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        files::write_atomic(path, self.to_yaml().as_bytes())
    }

    /// The file's text.
    #[must_use]
    pub fn to_yaml(&self) -> String {
        let mut text =
            String::from("# SI units throughout: m, rad, kg, s, N, N m. `calibration` says where each changed value came from.\n");
        let mut line = |s: String| {
            text.push_str(&s);
            text.push('\n');
        };
        line("format: raven-robot/1".to_owned());
        line(format!("name: {}", yaml::string(&self.name)));
        match &self.kinematics {
            KinematicsKind::Bench => line("kinematics: {kind: bench}".to_owned()),
            KinematicsKind::Raven(k) => {
                line("kinematics:".to_owned());
                line("  kind: raven".to_owned());
                line(format!("  arm: {}", k.arm.name()));
                line(format!("  link_angle_12: {}", yaml::float(k.link_angle_12)));
                line(format!("  link_angle_23: {}", yaml::float(k.link_angle_23)));
                line(format!("  wrist_offset: {}", yaml::float(k.wrist_offset)));
                line(format!("  gravity: {}", yaml::list(&k.gravity_array())));
            }
        }
        let format = match self.source.format {
            SourceFormat::RavenState => "raven_state",
            SourceFormat::JointState => "joint_state",
        };
        line(format!("source: {{topic: {}, format: {format}}}", yaml::string(&self.source.topic)));
        if let Some(encoder) = self.encoder {
            line(format!("encoder: {{counts_per_revolution: {}}}", yaml::float(encoder.counts_per_revolution)));
        }
        line("joints:".to_owned());
        for joint in &self.joints {
            line(joint_yaml(joint));
        }
        if self.cable_coupling.is_empty() {
            line("cable_coupling: []".to_owned());
        } else {
            line("cable_coupling:".to_owned());
        }
        for c in &self.cable_coupling {
            let coefficient = yaml::float(c.coefficient);
            line(format!("  - {{from: {}, to: {}, coefficient: {coefficient}}}", yaml::string(&c.from), yaml::string(&c.to)));
        }
        line(if self.links.is_empty() { "links: []" } else { "links:" }.to_owned());
        for link in &self.links {
            let (mass, center, inertia) = (yaml::float(link.mass), yaml::list(&link.center_of_mass), yaml::list(&link.inertia));
            line(format!("  - {{mass: {mass}, center_of_mass: {center}, inertia: {inertia}}}"));
        }
        if self.payload != 0.0 {
            line(format!("payload: {}", yaml::float(self.payload)));
        }
        line(self.tolerances_yaml());
        if self.observation != Observation::default() {
            line(observation_yaml(&self.observation));
        }
        if !self.effects.is_empty() {
            line("effects:              # what no number above can say; raven-diagnose names them".to_owned());
        }
        self.effects.iter().for_each(|effect| line(listed_yaml(effect)));
        if !self.calibration.is_empty() {
            line("calibration:".to_owned());
        }
        for change in &self.calibration {
            line(provenance_yaml(change));
        }
        text
    }

    fn tolerances_yaml(&self) -> String {
        let mut text = String::from("tolerances:");
        for (key, value, _) in self.tolerances.numbers() {
            let _ = write!(text, "\n  {key}: {}", yaml::float(value));
        }
        text
    }
}

fn joint_yaml(joint: &Joint) -> String {
    let kind = match joint.kind {
        JointType::Revolute => "revolute",
        JointType::Prismatic => "prismatic",
    };
    let mut text = format!("  - name: {}\n    type: {kind}", yaml::string(&joint.name));
    let mut key = |name: &str, value: f64| {
        let _ = write!(text, "\n    {name}: {}", yaml::float(value));
    };
    key("gear_ratio", joint.gear_ratio);
    key("motor_capstan_radius", joint.motor_capstan_radius);
    key("link_pulley_radius", joint.link_pulley_radius);
    key("hard_stop", joint.hard_stop);
    if let Some(motor) = joint.motor_at_hard_stop {
        key("motor_at_hard_stop", motor);
    }
    if joint.hysteresis != Hysteresis::default() {
        let Hysteresis { half_loop, length, straight_part, lag_at_start } = joint.hysteresis;
        let more = [("straight_part", straight_part, 0.0), ("lag_at_start", lag_at_start, 0.0)].map(departure).concat();
        let _ = write!(text, "\n    hysteresis: {{half_loop: {}, length: {}{more}}}", yaml::float(half_loop), yaml::float(length));
    }
    if let Some(limits) = joint.limits {
        let _ = write!(text, "\n    limits: {}", yaml::list(&limits));
    }
    if let Some(c) = joint.cable {
        let more = [("exponent_length", c.exponent_length, 1.0), ("slack", c.slack, 0.0), ("fresh_part", c.fresh_part, 0.0)];
        let more = more.map(departure).concat();
        let _ = write!(text, "\n    cable: {{stiffness: {}, damping: {}{more}}}", yaml::float(c.stiffness), yaml::float(c.damping));
    }
    if let Some(m) = joint.motor {
        let (inertia, coulomb, viscous) = (yaml::float(m.inertia), yaml::float(m.coulomb_friction), yaml::float(m.viscous_friction));
        let _ = write!(text, "\n    motor: {{inertia: {inertia}, coulomb_friction: {coulomb}, viscous_friction: {viscous}}}");
    }
    if let Some(f) = joint.link_friction {
        let mut more =
            [("per_load", f.per_load, 0.0), ("held_part", f.held_part, 0.0), ("lag_at_start", f.lag_at_start, 0.0)].map(departure).concat();
        more.extend(f.stiction_speed.map(|speed| format!(", stiction_speed: {}", yaml::float(speed))));
        let _ = write!(text, "\n    link_friction: {{coulomb: {}, viscous: {}{more}}}", yaml::float(f.coulomb), yaml::float(f.viscous));
    }
    text
}

/// A key that stands in the file only where it says something.
fn departure((key, value, usual): (&str, f64, f64)) -> String {
    if value == usual { String::new() } else { format!(", {key}: {}", yaml::float(value)) }
}

fn observation_yaml(observation: &Observation) -> String {
    let covariance = observation.covariance.map_or_else(String::new, |of_pose| {
        format!(
            "\n  covariance: {}   # of rotation and translation, what cameras have wrong alike with them: lower triangle",
            yaml::list(&of_pose)
        )
    });
    format!(
        "observation:            # the tip at stamp t is the robot's at t - latency, turned about the tip at the hard stop, and moved\n  \
         latency: {}\n  rotation: {}\n  translation: {}{covariance}",
        yaml::float(observation.latency),
        yaml::list(&observation.rotation),
        yaml::list(&observation.translation)
    )
}

fn listed_yaml(effect: &ListedEffect) -> String {
    let joint = effect.joint.as_ref().map_or_else(String::new, |joint| format!(", joint: {}", yaml::string(joint)));
    let values: Vec<String> = effect.values.iter().map(|(name, &value)| format!("{name}: {}", yaml::float(value))).collect();
    format!("  - {{id: {}{joint}, values: {{{}}}}}", yaml::string(&effect.id), values.join(", "))
}

fn provenance_yaml(change: &Provenance) -> String {
    let strings = |values: &[String]| format!("[{}]", values.iter().map(|v| yaml::string(v)).collect::<Vec<_>>().join(", "));
    format!(
        "  - parameter: {}\n    key: {}\n    unit: {}\n    value: {}\n    std: {}\n    prior: {}\n    prior_std: {}\n    identified: {}\n    \
         method: {}\n    logs: {}\n    sha256: {}",
        yaml::string(&change.parameter),
        yaml::string(&change.key),
        yaml::string(&change.unit),
        yaml::float(change.value),
        yaml::float(change.std),
        yaml::float(change.prior),
        yaml::float(change.prior_std),
        change.identified,
        yaml::string(&change.method),
        strings(&change.logs),
        strings(&change.sha256),
    )
}
