//! All calibrated numbers for the ROS parameter server, SI units, under `/raven_calibration/ARM`.

use std::fmt::Write as _;
use std::path::Path;

use raven::robot::Robot;
use raven::{Error, Result, yaml};

use super::calibration::{Calibration, remarks};

/// What stands beside the joints under an arm's name.
const BESIDE_JOINTS: [&str; 5] = ["robot", "cable_coupling", "camera_latency", "identified", "logs"];

/// The text of the file: what `rosparam load` takes. The robot was read from `path`.
///
/// # Errors
/// If a joint is named as one of the other keys.
pub fn yaml(path: &Path, robot: &Robot, calibration: &Calibration) -> Result<String> {
    if let Some(joint) = robot.joints.iter().find(|joint| BESIDE_JOINTS.contains(&joint.name.as_str())) {
        let others = BESIDE_JOINTS.join(", ");
        return Err(Error::file(
            path,
            format!("joints has the name `{}`, and --format rosparam has {others} of its own; rename it.", joint.name),
        ));
    }
    let after = &calibration.after;
    let mut text = format!("# Calibrated Raven-II, {} arm: SI units, motor angles per joint motion.\n", after.arm.name());
    for remark in remarks(&calibration.identified) {
        let _ = writeln!(text, "# {remark}");
    }
    let _ = writeln!(text, "raven_calibration:\n  {}:\n    robot: {}", after.arm.name(), yaml::string(&robot.name));
    for (j, joint) in robot.joints.iter().take(3).enumerate() {
        let _ = writeln!(text, "    {}:", yaml::string(&joint.name));
        let mut key = |name: &str, value: f64| {
            let _ = writeln!(text, "      {name}: {}", yaml::float(value));
        };
        key("transmission_ratio", after.ratio[j]);
        key("gear_ratio", joint.gear_ratio);
        key("motor_capstan_radius", joint.motor_capstan_radius);
        key("link_pulley_radius", joint.link_pulley_radius);
        key("hard_stop", joint.hard_stop);
        if let Some(cable) = joint.cable {
            key("cable_stiffness", cable.stiffness);
            key("cable_damping", cable.damping);
        }
        if let Some(friction) = joint.link_friction {
            key("coulomb_friction", friction.coulomb);
            key("viscous_friction", friction.viscous);
        }
    }
    let _ = writeln!(text, "    cable_coupling: {}  # C01 [rad/rad], C02, C12 [m/rad]", yaml::list(&after.coupling));
    let _ = writeln!(text, "    camera_latency: {}  # [s], beyond the one in cameras.yaml", yaml::float(robot.observation.latency));
    text.push_str("    identified:  # value and standard deviation\n");
    for entry in &calibration.identified {
        let _ = writeln!(text, "      {}: {}", yaml::string(&entry.parameter), yaml::list(&[entry.value, entry.std]));
    }
    text.push_str("    logs:\n");
    for (name, sha256) in calibration.logs() {
        let _ = writeln!(text, "      - {{name: {}, sha256: {}}}", yaml::string(name), yaml::string(sha256));
    }
    Ok(text)
}
