//! What is wrong with a recording, by lot: one effect, two, none, or a cause that the library does not hold.
//!
//! A sealed set of `n` recordings has a fifth without any effect, a fifth with two, a tenth with a cause outside the library, and one
//! effect in the rest, every effect at every joint in turn.

use std::fmt;
use std::str::FromStr;

use rand::seq::SliceRandom;
use rand::{Rng, RngExt};

use super::effect::{Effect, EffectKind};
use super::motion::Motion;
use super::outside::Outside;
use super::sizes::{draw_effect, places};
use super::truth::stream;
use crate::robot::{JointType, Robot};
use crate::{Error, Result};

/// Shortest and longest recording [s].
const DURATION_S: [f64; 2] = [40.0, 75.0];
/// Part of the recordings whose motion is `rich`; the others are `fls`.
const RICH: f64 = 0.7;
/// Webcams give one or the other [Hz].
const RATES_HZ: [f64; 2] = [15.0, 30.0];
/// Scatter of a tracked coordinate, from raw frames near by to compressed ones [px].
const NOISE_PX: [f64; 2] = [0.1, 0.3];

/// What a recording is to hide.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lot {
    /// One effect of the library.
    Single,
    /// Two of them.
    Pair,
    /// Nothing: a robot within its tolerances.
    None,
    /// A cause outside the library.
    Outside,
    /// Any of these, as often as in a sealed set.
    Any,
}

/// One recording to be made.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// Name of the recording, which says nothing.
    pub name: String,
    /// Hidden effects.
    pub effects: Vec<Effect>,
    /// Hidden cause outside the library.
    pub outside: Option<Outside>,
    /// Motion.
    pub motion: Motion,
    /// [s].
    pub duration_s: f64,
    /// Frames per second.
    pub rate_hz: f64,
    /// Standard deviation of a tracked coordinate [px].
    pub noise_px: f64,
    /// Everything else about the recording follows from it.
    pub seed: u64,
}

impl FromStr for Lot {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        Ok(match text {
            "single" => Self::Single,
            "pair" => Self::Pair,
            "none" => Self::None,
            "outside" => Self::Outside,
            "any" => Self::Any,
            _ => return Err(Error::Argument(format!("--lot `{text}` is not known; there are single, pair, none, outside and any."))),
        })
    }
}

impl fmt::Display for Lot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Single => "single",
            Self::Pair => "pair",
            Self::None => "none",
            Self::Outside => "outside",
            Self::Any => "any",
        })
    }
}

impl Case {
    /// A recording whose content is drawn from a seed.
    ///
    /// # Errors
    /// If the robot is no arm.
    pub fn draw(robot: &Robot, name: &str, lot: Lot, seed: u64) -> Result<Self> {
        let mut rng = stream(seed, "lot");
        let lot = match lot {
            Lot::Any => any(&mut rng),
            other => other,
        };
        let mut deck = Deck::shuffled(robot, &mut rng);
        let mut case = Self::empty(name, seed, &mut rng);
        let kind = rng.random_range(0..Outside::KINDS);
        case.fill(robot, lot, &mut deck, kind, &mut rng)?;
        Ok(case)
    }

    fn empty(name: &str, seed: u64, rng: &mut impl Rng) -> Self {
        let motion = if rng.random_bool(RICH) { Motion::Rich } else { Motion::Fls(0) };
        // Whole seconds, as people record.
        let duration_s = rng.random_range(DURATION_S[0]..=DURATION_S[1]).round();
        let rate_hz = RATES_HZ[rng.random_range(0..RATES_HZ.len())];
        let noise_px = rng.random_range(NOISE_PX[0]..=NOISE_PX[1]);
        Self { name: name.to_owned(), effects: Vec::new(), outside: None, motion, duration_s, rate_hz, noise_px, seed }
    }

    fn fill(&mut self, robot: &Robot, lot: Lot, deck: &mut Deck, outside: usize, rng: &mut impl Rng) -> Result<()> {
        match lot {
            Lot::None | Lot::Any => {}
            Lot::Outside => self.outside = Some(Outside::draw(robot, outside, rng)?),
            Lot::Single => self.effects.push(deck.next(robot, rng)?),
            Lot::Pair => {
                let first = deck.next(robot, rng)?;
                let mut second = deck.next(robot, rng)?;
                while second.kind == first.kind || exactly_tied(robot, &first, &second) {
                    second = deck.next(robot, rng)?;
                }
                self.effects = vec![first, second];
            }
        }
        Ok(())
    }
}

/// The recordings of a sealed set. The same seed gives the same set.
///
/// # Errors
/// If the robot is no arm.
pub fn sealed_set(robot: &Robot, seed: u64, count: usize) -> Result<Vec<Case>> {
    let mut rng = stream(seed, "sealed set");
    let (none, pairs, outside) = (count.div_ceil(5), count / 5, count / 10);
    let mut lots = vec![Lot::Single; count];
    for (at, lot) in lots.iter_mut().enumerate() {
        if at < none {
            *lot = Lot::None;
        } else if at < none + pairs {
            *lot = Lot::Pair;
        } else if at < none + pairs + outside {
            *lot = Lot::Outside;
        }
    }
    lots.shuffle(&mut rng);
    // Singles have a deck of their own, so that pairs do not take an effect's turn.
    let (mut singles, mut others) = (Deck::shuffled(robot, &mut rng), Deck::shuffled(robot, &mut rng));
    let first_kind = rng.random_range(0..Outside::KINDS);
    let mut outsides = 0;
    let mut cases = Vec::with_capacity(count);
    for (at, lot) in lots.into_iter().enumerate() {
        let mut case = Case::empty(&format!("r{:03}", at + 1), rng.random(), &mut rng);
        let deck = if lot == Lot::Single { &mut singles } else { &mut others };
        case.fill(robot, lot, deck, first_kind + outsides, &mut rng)?;
        outsides += usize::from(lot == Lot::Outside);
        cases.push(case);
    }
    Ok(cases)
}

fn any(rng: &mut impl Rng) -> Lot {
    match rng.random_range(0..10_u32) {
        0 | 1 => Lot::None,
        2 | 3 => Lot::Pair,
        4 => Lot::Outside,
        _ => Lot::Single,
    }
}

/// Two numbers of which no recording shows more than the sum: the tool's length and the prismatic joint's hard stop.
fn exactly_tied(robot: &Robot, a: &Effect, b: &Effect) -> bool {
    let prismatic = |effect: &Effect| {
        effect.kind == EffectKind::JointOffset
            && robot.joints.iter().any(|joint| joint.kind == JointType::Prismatic && Some(&joint.name) == effect.target.as_ref())
    };
    let tool = |effect: &Effect| effect.kind == EffectKind::ToolLength;
    (tool(a) && prismatic(b)) || (tool(b) && prismatic(a))
}

/// Every effect once in a round, each round at the effect's next place.
struct Deck {
    kinds: Vec<(EffectKind, Vec<Option<String>>)>,
    drawn: usize,
}

impl Deck {
    fn shuffled(robot: &Robot, rng: &mut impl Rng) -> Self {
        let mut kinds: Vec<_> = EffectKind::all().map(|kind| (kind, places(robot, kind))).filter(|(_, p)| !p.is_empty()).collect();
        kinds.shuffle(rng);
        for (_, places) in &mut kinds {
            places.shuffle(rng);
        }
        Self { kinds, drawn: 0 }
    }

    fn next(&mut self, robot: &Robot, rng: &mut impl Rng) -> Result<Effect> {
        let round = self.drawn / self.kinds.len();
        let (kind, places) = &self.kinds[self.drawn % self.kinds.len()];
        self.drawn += 1;
        draw_effect(robot, *kind, places[round % places.len()].as_deref(), rng)
    }
}
