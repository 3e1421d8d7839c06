//! Which effects: the hypothesis with the highest evidence, found one effect at a time.
//!
//! Every hypothesis is the nominal model with each of its numbers off by its tolerance, and some effects at their own, wide priors. A number
//! of the nominal model that becomes an effect changes its spike for a slab. Candidates are screened with slopes at the point reached so
//! far, from several starts where an effect is not smooth; the best are refitted by Gauss-Newton with exact residuals.

use raven::Result;
use raven::effects::Scale;

use super::coordinates::{ABSENT, Coordinates};
use super::linear::{Fit, Normal};
use super::rows::Rows;

/// Step of difference quotients, in units of the slab, and at most this part of a spike.
const DIFFERENCE: f64 = 0.02;
/// Candidates that are refitted in each round.
const REFITTED: usize = 6;
/// Most effects.
const EFFECTS_MAX: usize = 3;
/// Rounds of a refit, and the squared step in posterior deviations at which it ends.
const ROUNDS_MAX: usize = 8;
const SETTLED: f64 = 0.01;

/// A hypothesis, fitted.
#[derive(Debug, Clone)]
pub struct Hypothesis {
    /// Effects at their slabs, of [`Coordinates::sited`].
    pub effects: Vec<usize>,
    /// All coordinates.
    pub u: Vec<f64>,
    /// Deviations of the coordinates that are free; 0 of the others.
    pub std: Vec<f64>,
    /// `ln Z` [nat].
    pub evidence: f64,
    /// Whitened residuals there.
    pub residuals: Vec<f64>,
    columns: Vec<Vec<f64>>,
}

/// A candidate as the screen saw it.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Effects.
    pub effects: Vec<usize>,
    /// `ln Z` [nat].
    pub evidence: f64,
    start: Vec<f64>,
}

/// Everything that was looked at, and where it ended.
pub struct Outcome {
    /// The hypothesis without effects.
    pub none: Hypothesis,
    /// The best hypothesis with one, two, three effects.
    pub rounds: Vec<Vec<Hypothesis>>,
    /// All single effects by screen, refitted where they were good, best first.
    pub candidates: Vec<Candidate>,
}

/// The search over recordings.
pub struct Search<'a> {
    rows: &'a Rows<'a>,
    coordinates: &'a Coordinates,
}

impl<'a> Search<'a> {
    /// Over recordings.
    #[must_use]
    pub fn new(rows: &'a Rows<'a>, coordinates: &'a Coordinates) -> Self {
        Self { rows, coordinates }
    }

    /// Prior deviation of a coordinate under a hypothesis; `None` if it is not free.
    fn prior(&self, c: usize, effects: &[usize]) -> Option<f64> {
        let coordinate = self.coordinates.all[c];
        if effects.contains(&coordinate.effect) { Some(1.0) } else { coordinate.spike }
    }

    fn free(&self, effects: &[usize]) -> Vec<usize> {
        (0..self.coordinates.all.len()).filter(|&c| self.prior(c, effects).is_some()).collect()
    }

    fn nowhere(&self) -> Vec<f64> {
        let shape_alone = |c: usize| {
            let coordinate = self.coordinates.all[c];
            let parameters = self.coordinates.sited[coordinate.effect].effect.parameters;
            parameters.len() == 1 && matches!(parameters[0].scale, Scale::Shape { .. })
        };
        (0..self.coordinates.all.len()).map(|c| if shape_alone(c) { ABSENT } else { 0.0 }).collect()
    }

    /// Slopes of the residuals' negative by coordinates at a point, from settled links.
    fn slopes(&self, u: &[f64], coordinates: &[usize]) -> Result<Vec<Vec<f64>>> {
        let step = |c: usize| self.coordinates.all[c].spike.map_or(DIFFERENCE, |spike| spike.min(DIFFERENCE));
        let settings: Vec<_> = coordinates
            .iter()
            .flat_map(|&c| {
                [1.0, -1.0].map(|side| {
                    let mut moved = u.to_vec();
                    moved[c] += side * step(c);
                    self.coordinates.settings(&moved)
                })
            })
            .collect();
        let residuals = self.rows.all(&settings, false)?;
        let slope = |(&c, pair): (&usize, &[Vec<f64>])| {
            pair[0].iter().zip(&pair[1]).map(|(ahead, behind)| (behind - ahead) / (2.0 * step(c))).collect()
        };
        Ok(coordinates.iter().zip(residuals.chunks(2)).map(slope).collect())
    }

    /// Fits a hypothesis from a start by Gauss-Newton. With `columns`, slopes of the nominal numbers are taken from there.
    fn refit(&self, effects: &[usize], start: &[f64], columns: Option<&Hypothesis>) -> Result<Option<Hypothesis>> {
        let free = self.free(effects);
        let mut u = start.to_vec();
        let mut slopes: Vec<Vec<f64>> = match columns {
            None => vec![Vec::new(); free.len()],
            Some(base) => {
                let base_free = self.free(&base.effects);
                let mut kept: Vec<Vec<f64>> = vec![Vec::new(); free.len()];
                for (slot, c) in kept.iter_mut().zip(&free) {
                    if let Some(at) = base_free.iter().position(|b| b == c) {
                        slot.clone_from(&base.columns[at]);
                    }
                }
                kept
            }
        };
        let own: Vec<usize> = (0..free.len()).filter(|&k| effects.contains(&self.coordinates.all[free[k]].effect)).collect();
        let everything: Vec<usize> = (0..free.len()).collect();
        let priors: Vec<f64> = free.iter().filter_map(|&c| self.prior(c, effects)).collect();
        let mut last: Option<Hypothesis> = None;
        for _ in 0..ROUNDS_MAX {
            let anew = if columns.is_some() { &own } else { &everything };
            let of_these: Vec<usize> = anew.iter().map(|&k| free[k]).collect();
            for (&k, slope) in anew.iter().zip(self.slopes(&u, &of_these)?) {
                slopes[k] = slope;
            }
            let residuals = self.rows.residuals(&self.coordinates.settings(&u), true)?;
            let at: Vec<f64> = free.iter().map(|&c| u[c]).collect();
            let borrowed: Vec<&[f64]> = slopes.iter().map(Vec::as_slice).collect();
            let Some(fit) = Normal::new(&borrowed, &residuals).fit(&at, &priors) else { return Ok(None) };
            let mut hypothesis = Hypothesis {
                effects: effects.to_vec(),
                u: u.clone(),
                std: vec![0.0; u.len()],
                evidence: fit.evidence + self.half_spaces(effects),
                residuals,
                columns: slopes.clone(),
            };
            for (k, &c) in free.iter().enumerate() {
                hypothesis.std[c] = fit.covariance[(k, k)].max(0.0).sqrt();
            }
            let moved = fit.step.iter().enumerate().map(|(k, s)| s * s / fit.covariance[(k, k)].max(1e-12)).fold(0.0, f64::max);
            let worse = last.as_ref().is_some_and(|last| hypothesis.evidence < last.evidence - 1e-3);
            if worse && last.is_some() {
                break;
            }
            for (k, &c) in free.iter().enumerate() {
                u[c] = self.kept_inside(c, u[c], fit.step[k]);
            }
            last = Some(hypothesis);
            if moved < SETTLED {
                break;
            }
        }
        Ok(last)
    }

    /// A step of a coordinate: not through zero where the number cannot be negative, not out of the recording, not further than a size.
    fn kept_inside(&self, c: usize, u: f64, step: f64) -> f64 {
        let coordinate = self.coordinates.all[c];
        match self.coordinates.sited[coordinate.effect].effect.parameters[coordinate.parameter].scale {
            Scale::Magnitude(_) => (u + step.clamp(-2.0, 2.0)).max(1e-3),
            Scale::Shape { .. } => (u + step.clamp(-0.7, 0.7)).clamp(-4.0, 4.0),
            Scale::Moment => (u + step.clamp(-0.02, 0.02)).clamp(0.0, 1.0),
            Scale::Offset(_) | Scale::Factor(_) => u + step.clamp(-3.0, 3.0),
        }
    }

    /// A magnitude's prior is half a normal distribution.
    fn half_spaces(&self, effects: &[usize]) -> f64 {
        let magnitudes =
            effects.iter().flat_map(|&e| self.coordinates.sited[e].effect.parameters).filter(|p| matches!(p.scale, Scale::Magnitude(_)));
        magnitudes.count() as f64 * std::f64::consts::LN_2
    }

    /// Where to start looking for an effect.
    fn starts(&self, effect: usize) -> Vec<Vec<f64>> {
        let parameters = self.coordinates.sited[effect].effect.parameters;
        let mut starts: Vec<Vec<f64>> = vec![Vec::new()];
        for parameter in parameters {
            let values: &[f64] = match parameter.scale {
                Scale::Factor(_) if parameters.len() == 1 => &[-1.5, 0.0, 1.5],
                Scale::Offset(_) if parameters.len() == 1 => &[0.0],
                // Beside a shape the size must not vanish, or the shape has no slope.
                Scale::Offset(_) | Scale::Factor(_) if parameters.iter().any(|p| !matches!(p.scale, Scale::Offset(_))) => &[-0.5, 0.5],
                Scale::Offset(_) | Scale::Factor(_) => &[0.0],
                Scale::Magnitude(_) => &[0.3, 1.0, 2.0],
                Scale::Shape { .. } if parameters.len() == 1 => &[-2.5, -1.5, -0.5, 0.5, 1.5],
                Scale::Shape { .. } => &[-1.0, 0.0, 1.0],
                Scale::Moment => &[0.05, 0.15, 0.25, 0.35, 0.45, 0.55, 0.65, 0.75, 0.85, 0.95],
            };
            starts = starts.iter().flat_map(|start| values.iter().map(move |v| [start.as_slice(), &[*v]].concat())).collect();
        }
        starts
    }

    /// Evidence of every effect beside those of `base`, best first.
    fn screen(&self, base: &Hypothesis) -> Result<Vec<Candidate>> {
        let settled_base = self.rows.residuals(&self.coordinates.settings(&base.u), false)?;
        let base_free = self.free(&base.effects);
        let mut candidates = Vec::new();
        for effect in (0..self.coordinates.sited.len()).filter(|e| !base.effects.contains(e)) {
            let effects = [base.effects.as_slice(), &[effect]].concat();
            let free = self.free(&effects);
            let priors: Vec<f64> = free.iter().filter_map(|&c| self.prior(c, &effects)).collect();
            let own: Vec<usize> = self.coordinates.of(effect).collect();
            let mut best: Option<Candidate> = None;
            for start in self.starts(effect) {
                let mut u = base.u.clone();
                own.iter().zip(&start).for_each(|(&c, &value)| u[c] = value);
                let nominal = own.iter().all(|c| base_free.contains(c)) && start.iter().all(|&v| v == 0.0);
                let (own_slopes, residuals) = if nominal {
                    u.clone_from(&base.u);
                    (Vec::new(), base.residuals.clone())
                } else {
                    let settled = self.rows.residuals(&self.coordinates.settings(&u), false)?;
                    let shifted = base.residuals.iter().zip(settled.iter().zip(&settled_base)).map(|(r, (there, here))| r + there - here);
                    (self.slopes(&u, &own)?, shifted.collect())
                };
                let column = |c: &usize| match own.iter().position(|o| o == c).and_then(|at| own_slopes.get(at)) {
                    Some(slope) => slope.as_slice(),
                    None => base_free.iter().position(|b| b == c).map_or(&[] as &[f64], |at| base.columns[at].as_slice()),
                };
                let columns: Vec<&[f64]> = free.iter().map(column).collect();
                let at: Vec<f64> = free.iter().map(|&c| u[c]).collect();
                let Some(Fit { evidence, step, .. }) = Normal::new(&columns, &residuals).fit(&at, &priors) else { continue };
                let evidence = evidence + self.half_spaces(&effects);
                for (k, &c) in free.iter().enumerate() {
                    u[c] = self.kept_inside(c, u[c], step[k]);
                }
                if best.as_ref().is_none_or(|best| evidence > best.evidence) {
                    best = Some(Candidate { effects: effects.clone(), evidence, start: u });
                }
            }
            candidates.extend(best);
        }
        candidates.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
        Ok(candidates)
    }

    /// Leaves out effects that a later one has made needless: without which the evidence falls by less than `gain_min`.
    fn without_needless(&self, mut best: Hypothesis, gain_min: f64) -> Result<Hypothesis> {
        while best.effects.len() > 1 {
            let mut smaller: Option<Hypothesis> = None;
            for left_out in best.effects.clone() {
                let effects: Vec<usize> = best.effects.iter().copied().filter(|&e| e != left_out).collect();
                let mut start = best.u.clone();
                let nowhere = self.nowhere();
                self.coordinates.of(left_out).for_each(|c| start[c] = nowhere[c]);
                let Some(hypothesis) = self.refit(&effects, &start, Some(&best))? else { continue };
                if smaller.as_ref().is_none_or(|smaller| hypothesis.evidence > smaller.evidence) {
                    smaller = Some(hypothesis);
                }
            }
            match smaller.filter(|smaller| best.evidence - smaller.evidence <= gain_min) {
                Some(smaller) => best = smaller,
                None => break,
            }
        }
        Ok(best)
    }

    /// Adds effects one at a time while the evidence grows by more than `gain_min` nats.
    ///
    /// # Errors
    /// If the robot is no arm.
    pub fn run(&self, gain_min: f64) -> Result<Option<Outcome>> {
        let Some(none) = self.refit(&[], &self.nowhere(), None)? else { return Ok(None) };
        let mut outcome = Outcome { none: none.clone(), rounds: Vec::new(), candidates: Vec::new() };
        let mut base = none;
        for round in 0..EFFECTS_MAX {
            let mut candidates = self.screen(&base)?;
            let mut refitted: Vec<Hypothesis> = Vec::new();
            for candidate in candidates.iter_mut().take(REFITTED) {
                let Some(hypothesis) = self.refit(&candidate.effects, &candidate.start, Some(&base))? else { continue };
                candidate.evidence = hypothesis.evidence;
                refitted.push(hypothesis);
            }
            refitted.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
            if round == 0 {
                candidates.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
                outcome.candidates = candidates;
            }
            let Some(best) = refitted.first().cloned() else { break };
            let gain = best.evidence - base.evidence;
            outcome.rounds.push(refitted);
            if gain <= gain_min {
                break;
            }
            let best = self.without_needless(best, gain_min)?;
            base = self.refit(&best.effects, &best.u, None)?.unwrap_or(best);
        }
        Ok(Some(outcome))
    }
}
