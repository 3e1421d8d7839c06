//! From the hypotheses that were looked at to what a report says: the verdict, the causes, what ties with them, what could not show.

mod channels;
mod closure;
mod conclusion;
mod detectable;
mod file_numbers;
mod findings;
mod fitness;
mod information;
mod remaining;
mod ties;
mod unknown;
mod verdict;
mod words;

pub use closure::Closure;
pub use detectable::Detectable;
pub use file_numbers::FileNumber;
pub use findings::{Attribution, Blamed, Candidate, Estimate, NONE, NotObservable, Point, Side};
pub(crate) use fitness::moves;
pub use fitness::{check_bench_fitness, check_fitness};
pub use remaining::{Remaining, Run};
pub use ties::Tied;
pub use verdict::Word;
pub use words::{EVIDENCE_IS, SET_ASIDE_IS, at, off, percent, sentence, size, tied, together, words};

use raven::Result;
use raven::camera::Cameras;
use raven::log::Recording;
use raven::robot::{KinematicsKind, Robot};

use self::channels::Sampled;
use self::conclusion::attribution;
use crate::evidence::fit::linear::dot;
use crate::evidence::fit::{Fitter, Hypothesis};
use crate::evidence::numbers::coordinates::Coordinates;
use crate::evidence::numbers::spread::Spread;
use crate::evidence::outcome::Outcome;
use crate::evidence::recorded::bench::Bench;
use crate::evidence::recorded::data::Data;
use crate::evidence::recorded::rows::{ALL, Links, Observed, Rows};

/// The nominal model: what recordings are held against.
#[derive(Debug, Clone)]
pub struct Nominal<'a> {
    /// Its numbers, and their tolerances.
    pub robot: &'a Robot,
    /// Those the tips were tracked with.
    pub cameras: Option<&'a Cameras>,
    /// By what part of those they are off, as other recordings of the rig show.
    pub spread: Spread,
}

impl<'a> Nominal<'a> {
    /// Whose numbers are off by their tolerances, as nothing else is known of them.
    #[must_use]
    pub fn new(robot: &'a Robot, cameras: Option<&'a Cameras>) -> Self {
        Self { robot, cameras, spread: Spread::default() }
    }
}

/// What recordings of an arm say, as far as it weighs anything.
///
/// # Errors
/// If a recording has no motor angles.
pub(crate) fn data(recordings: &[Recording], cameras: Option<&Cameras>) -> Result<Vec<Data>> {
    recordings.iter().map(|recording| Ok(Data::new(recording, cameras)?.weighed())).collect()
}

/// Says what causes the gap of recordings of an arm or a bench. `each` hears of every step.
///
/// # Errors
/// If the recordings cannot carry a diagnosis.
pub fn attribute(nominal: &Nominal, recordings: &[Recording], each: impl FnMut()) -> Result<Attribution> {
    let Nominal { robot, cameras, spread } = nominal;
    if matches!(robot.kinematics, KinematicsKind::Bench) {
        let bench = Bench::new(robot, recordings)?;
        check_bench_fitness(robot, &bench)?;
        let remarks = bench.remarks().into_iter().map(str::to_owned).collect();
        return Ok(Attribution { remarks, ..attributed(&bench, spread, each)? });
    }
    let data = data(recordings, *cameras)?;
    check_fitness(robot, &data)?;
    attributed(&Rows::new(robot, *cameras, &data)?, spread, each)
}

/// What causes the gap of recordings of either kind, and how far it closes.
fn attributed(rows: &dyn Sampled, spread: &Spread, mut each: impl FnMut()) -> Result<Attribution> {
    let coordinates = Coordinates::new(rows.robot(), rows).with_spread(spread);
    let fitter = Fitter::new(rows, &coordinates);
    let outcome = followed(rows, fitter.search(&mut each)?)?;
    // Friction that was found makes samples near rest doubtful that were not: the likely hypotheses are judged anew.
    let Some(rows) = rows.reweighted(&coordinates.settings(&fitter.effects_alone(&outcome.best)))? else {
        return concluded(rows, &coordinates, &outcome);
    };
    let fitter = Fitter::new(&*rows, &coordinates);
    let outcome = followed(&*rows, fitter.search_again(&outcome, each)?)?;
    concluded(&*rows, &coordinates, &outcome)
}

fn followed(rows: &dyn Sampled, outcome: Option<Outcome>) -> Result<Outcome> {
    outcome.ok_or_else(|| {
        raven::Error::Data(format!(
            "robot `{}`: the model does not follow the recorded motors; check that file and recordings belong together.",
            rows.robot().name
        ))
    })
}

fn concluded(rows: &dyn Sampled, coordinates: &Coordinates, outcome: &Outcome) -> Result<Attribution> {
    let (mut attribution, closing) = attribution(&Fitter::new(rows, coordinates), outcome)?;
    (attribution.gap, attribution.remaining) = closure::closures(rows, coordinates, closing)?;
    Ok(attribution)
}

/// What a diagnosis that knows the effects makes of recordings.
#[derive(Debug, Clone, Default)]
pub struct Told {
    /// How far the gap closes.
    pub gap: Vec<Closure>,
    /// Evidence that each effect adds beside the others, at least [nat].
    pub evidence_nats: f64,
}

/// What recordings of an arm say when it is told which effects there are, by identifier and place; `None` where the model cannot be fitted, or an
/// effect is not in the library or cannot show in the recordings.
///
/// # Errors
/// As [`attribute`].
pub fn when_told(nominal: &Nominal, recordings: &[Recording], effects: &[(&str, Option<&str>)]) -> Result<Option<Told>> {
    let Nominal { robot, cameras, spread } = nominal;
    let data = data(recordings, *cameras)?;
    let rows = Rows::new(robot, *cameras, &data)?;
    let coordinates = Coordinates::new(robot, &rows).with_spread(spread);
    let of_name = |&(id, joint): &(&str, Option<&str>)| {
        coordinates.sited.iter().position(|sited| sited.effect.id == id && sited.joint(robot).as_deref() == joint)
    };
    let Some(told) = effects.iter().map(of_name).collect::<Option<Vec<usize>>>() else { return Ok(None) };
    let fitter = Fitter::new(&rows, &coordinates);
    let fitted = |rows: &Rows| Fitter::new(rows, &coordinates).told(&told);
    let closed = |rows: &Rows, (hypothesis, evidence_nats): (Hypothesis, f64)| {
        Ok(Told { gap: closure::closures(rows, &coordinates, &hypothesis)?.0, evidence_nats })
    };
    let Some(first) = fitted(&rows)? else { return Ok(None) };
    let Some(reweighted) = rows.reweighted(&coordinates.settings(&fitter.effects_alone(&first.0)))? else {
        return closed(&rows, first).map(Some);
    };
    fitted(&reweighted)?.map(|again| closed(&reweighted, again)).transpose()
}

/// Evidence, with their priors, of two searches that each had their own readings of an arm on the same path [nat], but for half a nat that noise alone
/// takes per reading: one may have more of them. Samples count the same for both: those near rest as the one with more friction has them.
///
/// # Errors
/// As [`attribute`].
pub fn evidence_of_both(nominal: &Nominal, both: [(&[Recording], &Point); 2]) -> Result<[f64; 2]> {
    let Nominal { robot, cameras, .. } = nominal;
    let evidence = |(recordings, own): (&[Recording], &Point)| {
        let data = data(recordings, *cameras)?;
        let mut rows = Rows::new(robot, *cameras, &data)?;
        for (_, point) in both {
            rows = rows.reweighted(&point.settings)?.unwrap_or(rows);
        }
        let left = rows.residuals(&own.settings, Links::RolledOut, &ALL)?;
        let readings = left.iter().filter(|row| **row != 0.0).count() as f64;
        Ok(own.beside_misfit_nats - 0.5 * (dot(&left, &left) - readings))
    };
    let [one, other] = both;
    Ok([evidence(one)?, evidence(other)?])
}
