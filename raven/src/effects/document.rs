//! The library as a document: `docs/effects.md`.

use std::fmt::Write;

use super::measure::UNITS;
use super::{ALL, Above, Channel, Effect, Need, Parameter, Scale, Scope, Stage};

/// The library in Markdown, one section per stage.
#[must_use]
pub fn document() -> String {
    let mut text = String::from(
        "# Effect library\n\n\
         What `raven-diagnose` can name, as it is in the code; `raven-diagnose effects` prints this page.\n\n\
         A prior is what is believed of a number of the effect before a recording is looked at. `+- s`, `x e^(+- s)` and `>= 0, s` are sizes: of \
         either sign, of the logarithm of a factor, above zero. Nine of ten are between 0.2 and 3 times `s`, half of them below 0.8 (log-normal). \
         `5 x e^(+- 0.5)` is a shape about 5 whose logarithm is normal with a deviation of 0.5. Where the nominal model has the number too, it \
         is off by its tolerance in any case, and the effect is what goes beyond. Two sizes are of a revolute and a prismatic joint.\n\n\
         Some units go by the robot. Sizes in them are those of a Raven; on a bench they are larger or smaller as its forces, speeds and capstan \
         are. Reports, `--effect` and robot files have SI units.\n\n\
         | unit | stands for |\n|---|---|\n",
    );
    for (unit, meaning) in UNITS {
        let _ = writeln!(text, "| {unit} | {meaning} |");
    }
    let stages = [
        (Stage::Encoder, "Encoder"),
        (Stage::Motor, "Motor: torque to motor motion"),
        (Stage::Transmission, "Transmission: motor to joint"),
        (Stage::Link, "Loads on the links"),
        (Stage::Kinematics, "Kinematics: joint to tip"),
        (Stage::Camera, "Camera: tip to image"),
        (Stage::Timing, "Timing"),
    ];
    for (stage, title) in stages {
        let _ = write!(text, "\n## {title}\n");
        ALL.iter().filter(|effect| effect.stage == stage).for_each(|effect| section(&mut text, effect));
    }
    text
}

fn section(text: &mut String, effect: &Effect) {
    let per = match effect.scope {
        Scope::Joint => "per joint",
        Scope::Pair => "per pair of joints",
        Scope::LinkAngle => "per link angle",
        Scope::Robot => "of the robot",
        Scope::Rig => "of the cameras",
    };
    let channels: Vec<&str> = effect.channels.iter().map(|channel| channel_name(*channel)).collect();
    let _ = write!(text, "\n### {}\n\n{}; {per}. Shows in: {}.", effect.id, effect.summary, channels.join(", "));
    let needs: Vec<&str> = effect.needs.iter().map(|need| need_name(*need)).collect();
    if !needs.is_empty() {
        let _ = write!(text, " Needs: {}.", needs.join("; "));
    }
    text.push('\n');
    let _ = write!(text, "\n| number | unit | prior |\n|---|---|---|\n");
    for parameter in effect.parameters {
        let _ = writeln!(text, "| {} | {} | {} |", parameter.name, unit(parameter), prior(parameter));
    }
    let ties: Vec<String> =
        effect.ties.iter().map(|tie| format!("{}{}", tie.id, if tie.exact.is_some() { " (exact)" } else { "" })).collect();
    if !ties.is_empty() {
        let _ = write!(text, "\nLooks like: {}. ", ties.join(", "));
    } else {
        text.push('\n');
    }
    let _ = writeln!(text, "Told apart by: {}.", effect.separated_by);
}

fn channel_name(channel: Channel) -> &'static str {
    match channel {
        Channel::Torque => "motor torque",
        Channel::Tip => "tip",
    }
}

fn need_name(need: Need) -> &'static str {
    match need {
        Need::Motor => "a motor in the file",
        Need::Turns => "a motor that turns",
        Need::Cable => "a cable in the file",
        Need::Load => "on a bench, torque that tells the load on the cable",
        Need::JointSide => "on a bench, joint encoders",
        Need::Link => "a link in the file",
        Need::Lenses => "the cameras' calibration",
    }
}

fn unit(parameter: &Parameter) -> &'static str {
    if parameter.unit == "joint" { "rad, m" } else { parameter.unit }
}

fn prior(parameter: &Parameter) -> String {
    let sizes = |size: super::Size| {
        if size.revolute == size.prismatic { size.revolute.to_string() } else { format!("{}, {}", size.revolute, size.prismatic) }
    };
    let beside = if parameter.tolerance.is_some() { ", beside its tolerance" } else { "" };
    match parameter.scale {
        Scale::Offset(size) => format!("+- {}{beside}", sizes(size)),
        Scale::Factor { size, above } => {
            let above = match above {
                Above::AsBelow => String::new(),
                Above::Seldom => ", above 1 one in twenty".to_owned(),
                Above::UpTo(most) => format!(", {most} at most"),
            };
            format!("x e^(+- {size}){above}{beside}")
        }
        Scale::Magnitude(size) => format!(">= 0, {}{beside}", sizes(size)),
        Scale::Part => format!("0 to 1{beside}"),
        Scale::Shape { middle, size } => format!("{middle} x e^(+- {size})"),
        Scale::State { size, most } if most.is_finite() => format!("0 +- {size}, normal, +- {most} at most"),
        Scale::State { size, .. } => format!("0 +- {size}, normal"),
        Scale::Moment => "any moment, as a part of the recording".to_owned(),
        Scale::Whole { most } => format!("a whole number to {most}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_unit_is_of_the_si_or_explained() {
        let si = ["1", "counts", "kg", "m", "rad", "s", "s/s", "1/cable stretch"];
        for parameter in ALL.iter().flat_map(|effect| effect.parameters) {
            let explained = UNITS.iter().any(|(unit, _)| *unit == parameter.unit);
            assert!(explained || si.contains(&parameter.unit), "{}", parameter.unit);
        }
    }

    #[test]
    fn the_page_in_docs_is_the_library_in_the_code() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/effects.md");
        let page = std::fs::read_to_string(path).unwrap();
        assert!(page == document(), "docs/effects.md is not what the code says; write it anew: raven-diagnose effects > docs/effects.md");
    }
}
