//! Tensions of cables, remembered for hypotheses that differ in their drives alone: what motors and drives take shows in torque, and the links
//! that they move are the same.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use raven::Result;
use raven::effects::{Stage, WhereKnown};

use super::rows::Links;
use super::settings::Setting;

/// How many are remembered: hypotheses are fitted side by side, and each is held against others.
const REMEMBERED: usize = 8;

/// Per recording, tension differences [N] at each torque sample.
pub(super) type Tensions = Arc<Vec<WhereKnown>>;

/// Those asked for last.
#[derive(Debug, Clone, Default)]
pub(super) struct Remembered(Arc<Mutex<VecDeque<Entry>>>);

/// Tensions, if links can be followed there.
#[derive(Debug, Clone)]
struct Entry {
    key: Key,
    tensions: Option<Tensions>,
}

impl Remembered {
    /// Tensions with effects built in, as they are remembered for those that move links, or else taken; `None` where links cannot be followed.
    ///
    /// # Errors
    /// As `take`.
    pub(super) fn or_take(
        &self,
        settings: &[Setting],
        links: Links,
        take: impl FnOnce() -> Result<Option<Vec<WhereKnown>>>,
    ) -> Result<Option<Tensions>> {
        let key = Key::new(settings, links);
        if let Some(known) = self.known(&key) {
            return Ok(known.tensions);
        }
        let tensions = take()?.map(Arc::new);
        self.remember(Entry { key, tensions: tensions.clone() });
        Ok(tensions)
    }

    fn known(&self, key: &Key) -> Option<Entry> {
        let mut all = self.all();
        let at = all.iter().position(|entry| entry.key == *key)?;
        let known = all.remove(at)?;
        all.push_back(known.clone());
        Some(known)
    }

    fn remember(&self, entry: Entry) {
        let mut all = self.all();
        all.push_back(entry);
        if all.len() > REMEMBERED {
            all.pop_front();
        }
    }

    fn all(&self) -> MutexGuard<'_, VecDeque<Entry>> {
        // What a thread that panicked has left is whole: entries are put in and taken out in one piece.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// What tensions go by.
#[derive(Debug, Clone)]
struct Key {
    settings: Vec<Setting>,
    links: Links,
}

impl Key {
    fn new(settings: &[Setting], links: Links) -> Self {
        let moves_links = |(sited, _): &&Setting| sited.effect.stage != Stage::Motor;
        Self { settings: settings.iter().filter(moves_links).cloned().collect(), links }
    }
}

impl PartialEq for Key {
    fn eq(&self, other: &Self) -> bool {
        let same = |((a, at), (b, there)): (&Setting, &Setting)| a.effect.id == b.effect.id && a.place == b.place && at == there;
        self.links == other.links && self.settings.len() == other.settings.len() && self.settings.iter().zip(&other.settings).all(same)
    }
}
