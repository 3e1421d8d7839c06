//! The table of `docs/identifiability.md`: Cramer-Rao deviations of every unknown, all of them estimated, for the lab's motions and the
//! proposal.

use std::fmt::Write as _;

use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use raven::Result;
use raven::simulation::{Motion, Trajectory};

use super::score::Sensor;
use super::{CAMERA_HZ, Lab, Proposal};
use crate::identifiability::cramer_rao::{Scaled, beside_known};

/// Any one point-to-point motion is as good as another.
const SEED: u64 = 7;

/// The table in Markdown; percent of a positive quantity's value, its unit otherwise.
pub fn table(lab: &Lab<'_>, proposal: &Proposal, duration_s: f64) -> Result<String> {
    let hard_stop = lab.robot.arm()?.hard_stop;
    let mut columns = Vec::new();
    for motion in [Motion::Sinusoid, Motion::Fls(0), Motion::Rich] {
        let path = Trajectory::of(motion, duration_s, &lab.limits, hard_stop, &mut ChaCha8Rng::seed_from_u64(SEED));
        columns.push((motion.to_string(), bounds(lab, duration_s, |t| path.at(t).joint)?));
    }
    columns.push(("proposal".to_owned(), bounds(lab, proposal.plan.duration_s(), |t| proposal.plan.at(t))?));
    let mut text = String::from("| parameter | unit |");
    columns.iter().for_each(|(name, _)| text.push_str(&format!(" {name} |")));
    text.push_str("\n|---|---|");
    columns.iter().for_each(|_| text.push_str("---|"));
    text.push('\n');
    for (k, unknown) in lab.unknowns.iter().enumerate() {
        let (unit, factor) = if unknown.quantity.is_positive() { ("%", 100.0 / unknown.prior) } else { unknown.quantity.shown(lab.robot) };
        let _ = write!(text, "| `{}` | {unit} |", unknown.quantity.name());
        for (_, bound) in &columns {
            let value = unknown.std(unknown.prior, bound[k]) * factor;
            let _ = if value.is_finite() { write!(text, " {value:.2e} |") } else { write!(text, " hidden |") };
        }
        text.push('\n');
    }
    Ok(text)
}

fn bounds(lab: &Lab<'_>, duration_s: f64, set_point: impl Fn(f64) -> Vector3<f64>) -> Result<Vec<f64>> {
    let information = lab.information(duration_s, Sensor::Camera(CAMERA_HZ), set_point)?;
    Ok(Scaled::new(&beside_known(&information, lab.unknowns.len())).with_all())
}
