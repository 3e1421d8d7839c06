//! Exposure, focus and white balance, held still while a camera is recorded.
//!
//! A camera that exposes longer in the dark halves its own frame rate, and one that focuses anew is another camera than the calibrated one. So
//! the automatics settle on the scene, are then switched off with the values they found, and are put back afterwards. Numbers are those of
//! `v4l2-controls.h`.

use std::collections::BTreeMap;
use std::io;

/// Controls of a camera, by number.
pub trait Panel {
    /// The value; `None` if the camera has no such control.
    fn get(&self, id: u32) -> Option<i64>;

    /// Sets a value.
    ///
    /// # Errors
    /// What the operating system says.
    fn set(&self, id: u32, value: i64) -> io::Result<()>;
}

/// Lets the camera lower its rate for a longer exposure.
const RATE_FOLLOWS_EXPOSURE: u32 = 0x009a_0903;
/// Exposure time in units of 100 us.
const EXPOSURE_TIME: u32 = 0x009a_0902;

/// What adjusts itself: number, value that switches it off, name.
const AUTOMATIC: [(u32, i64, &str); 5] = [
    (0x009a_0901, 1, "exposure_auto"),
    (RATE_FOLLOWS_EXPOSURE, 0, "exposure_dynamic_framerate"),
    (0x009a_090c, 0, "focus_auto"),
    (0x0098_090c, 0, "white_balance_auto"),
    (0x0098_0912, 0, "gain_auto"),
];
/// What they adjust, and what is held.
const HELD: [(u32, &str); 4] = [
    (EXPOSURE_TIME, "exposure_time_100us"),
    (0x009a_090a, "focus_absolute"),
    (0x0098_091a, "white_balance_temperature"),
    (0x0098_0913, "gain"),
];
/// What else changes a picture: recorded, never touched.
const NOTED: [(u32, &str); 8] = [
    (0x0098_0900, "brightness"),
    (0x0098_0901, "contrast"),
    (0x0098_0902, "saturation"),
    (0x0098_0903, "hue"),
    (0x0098_0910, "gamma"),
    (0x0098_0918, "power_line_frequency"),
    (0x0098_091b, "sharpness"),
    (0x0098_091c, "backlight_compensation"),
];

/// The controls of a camera as they were found.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Controls {
    before: BTreeMap<u32, i64>,
}

/// Values that a camera was locked at, by number; a camera that was unplugged is locked at the same again.
pub type Held = BTreeMap<u32, i64>;

impl Controls {
    /// Reads what the camera has.
    #[must_use]
    pub fn read(panel: &dyn Panel) -> Self {
        let ids = AUTOMATIC.iter().map(|(id, ..)| *id).chain(HELD.iter().map(|(id, _)| *id));
        Self { before: ids.filter_map(|id| Some((id, panel.get(id)?))).collect() }
    }

    /// Whether anything adjusts itself.
    #[must_use]
    pub fn adjusts_itself(&self) -> bool {
        AUTOMATIC.iter().any(|(id, off, _)| self.before.get(id).is_some_and(|value| value != off))
    }

    /// Forbids the camera to lower its rate, which has to be said before it starts.
    pub fn keep_rate(&self, panel: &dyn Panel) {
        if self.before.contains_key(&RATE_FOLLOWS_EXPOSURE) {
            // Reported by `lock` if it does not hold.
            let _refused = panel.set(RATE_FOLLOWS_EXPOSURE, 0);
        }
    }

    /// Switches everything off that adjusts itself, and holds `held`; what is not in it keeps the value that the camera has found. Returns the
    /// values that are held, and a sentence about each that could not be.
    #[must_use]
    pub fn lock(&self, panel: &dyn Panel, held: &Held) -> (Held, Vec<String>) {
        let mut sentences = Vec::new();
        let mut values: Held = HELD.iter().filter_map(|(id, _)| Some((*id, panel.get(*id)?))).collect();
        values.extend(held.iter().filter(|(id, _)| self.before.contains_key(id)).map(|(id, value)| (*id, *value)));
        for (id, off, name) in AUTOMATIC.iter().filter(|(id, ..)| self.before.contains_key(id)) {
            let refused = panel.set(*id, *off).err().map(|e| format!(" ({e})")).unwrap_or_default();
            if panel.get(*id) != Some(*off) {
                sentences.push(format!("{name} cannot be switched off{refused}: the picture may change while it is recorded"));
            }
        }
        for (id, name) in HELD {
            let Some(&value) = values.get(&id) else { continue };
            let refused = panel.set(id, value).err().map(|e| format!(" ({e})")).unwrap_or_default();
            match panel.get(id) {
                Some(now) if now == value => {}
                now => {
                    let now = now.map_or("unknown".to_owned(), |now| now.to_string());
                    sentences.push(format!("{name} cannot be held at {value}{refused}: it is {now}"));
                }
            }
        }
        (values, sentences)
    }

    /// Puts everything back as it was found. A camera that is gone is none to put back.
    pub fn restore(&self, panel: &dyn Panel) {
        // Values first: what adjusts itself takes no value.
        let (automatic, values): (Vec<_>, Vec<_>) =
            self.before.iter().partition(|(id, _)| AUTOMATIC.iter().any(|(other, ..)| other == *id));
        for (id, value) in values.into_iter().chain(automatic) {
            if panel.get(*id) != Some(*value) {
                let _gone = panel.set(*id, *value);
            }
        }
    }

    /// Whether the camera, found like this once, is now as a lock leaves it: every automatic is as it was found or switched off, and something is
    /// not as it was found. What automatics move while they are on does not count, and a camera with its own values again is not left locked.
    #[must_use]
    pub fn are_left_locked(&self, panel: &dyn Panel) -> bool {
        let moved = |id: u32| self.before.get(&id).is_some_and(|before| panel.get(id) != Some(*before));
        let switched_off = |(id, off, _): &(u32, i64, &str)| moved(*id) && panel.get(*id) == Some(*off);
        let automatics = || AUTOMATIC.iter().filter(|(id, ..)| moved(*id));
        let held = || !self.adjusts_itself() && HELD.iter().any(|(id, _)| moved(*id));
        automatics().all(switched_off) && (automatics().next().is_some() || held())
    }

    /// What the log should know: every control as it is now, and as it was found where that differs.
    #[must_use]
    pub fn record(&self, panel: &dyn Panel) -> BTreeMap<String, String> {
        let names = AUTOMATIC.iter().map(|(id, _, name)| (*id, *name)).chain(HELD).chain(NOTED);
        let entry = |(id, name): (u32, &str)| {
            let now = panel.get(id)?.to_string();
            let before = self.before.get(&id).map(i64::to_string).filter(|before| *before != now);
            Some((format!("control {name}"), before.map_or_else(|| now.clone(), |before| format!("{now} (found at {before})"))))
        };
        names.filter_map(entry).collect()
    }
}

/// What holds this exposure time.
#[must_use]
pub fn exposure(milliseconds: f64) -> Held {
    Held::from([(EXPOSURE_TIME, (10.0 * milliseconds).round() as i64)])
}

#[cfg(test)]
pub(super) mod tests {
    use std::cell::RefCell;

    use super::*;

    /// A camera whose automatics move what they adjust, and refuse to have it set.
    pub struct Fake(pub RefCell<BTreeMap<u32, i64>>);

    impl Panel for Fake {
        fn get(&self, id: u32) -> Option<i64> {
            self.0.borrow().get(&id).copied()
        }

        fn set(&self, id: u32, value: i64) -> io::Result<()> {
            let automatic = self.get(0x009a_0901) == Some(3) && id == EXPOSURE_TIME;
            match self.0.borrow_mut().get_mut(&id) {
                Some(now) if !automatic => *now = value,
                _ => return Err(io::Error::from_raw_os_error(13)),
            }
            Ok(())
        }
    }

    fn webcam() -> Fake {
        Fake(RefCell::new(BTreeMap::from([
            (0x009a_0901, 3),
            (RATE_FOLLOWS_EXPOSURE, 1),
            (EXPOSURE_TIME, 250),
            (0x0098_090c, 1),
            (0x0098_091a, 4000),
        ])))
    }

    #[test]
    fn what_the_automatics_found_is_held_and_everything_put_back() {
        let camera = webcam();
        let found = camera.0.borrow().clone();
        let controls = Controls::read(&camera);
        assert!(controls.adjusts_itself());
        controls.keep_rate(&camera);
        // The exposure moves while the camera settles.
        camera.0.borrow_mut().insert(EXPOSURE_TIME, 312);
        let (held, sentences) = controls.lock(&camera, &Held::new());
        assert!(sentences.is_empty(), "{sentences:?}");
        assert_eq!(held, Held::from([(EXPOSURE_TIME, 312), (0x0098_091a, 4000)]));
        assert_eq!(camera.get(0x009a_0901), Some(1));
        assert!(!Controls::read(&camera).adjusts_itself());
        let record = controls.record(&camera);
        assert_eq!(record["control exposure_time_100us"], "312 (found at 250)");
        assert_eq!(record["control white_balance_temperature"], "4000");
        controls.restore(&camera);
        assert_eq!(*camera.0.borrow(), found);
    }

    #[test]
    fn a_camera_that_was_left_locked_is_known_from_one_with_its_own_values() {
        let camera = webcam();
        let found = Controls::read(&camera);
        camera.0.borrow_mut().insert(EXPOSURE_TIME, 312);
        assert!(!found.are_left_locked(&camera), "its automatics are on, and move what they adjust");
        found.keep_rate(&camera);
        assert!(found.are_left_locked(&camera), "killed before all was locked");
        let _held = found.lock(&camera, &Held::new());
        assert!(found.are_left_locked(&camera));
        found.restore(&camera);
        assert!(!found.are_left_locked(&camera));
        // Somebody has chosen another automatic since.
        let _held = found.lock(&camera, &Held::new());
        camera.set(0x009a_0901, 2).unwrap();
        assert!(!found.are_left_locked(&camera));
        // Without automatics, an exposure that was asked for is what is left.
        let manual = Fake(RefCell::new(BTreeMap::from([(0x009a_0901, 1), (EXPOSURE_TIME, 250)])));
        let found = Controls::read(&manual);
        let _held = found.lock(&manual, &exposure(8.0));
        assert!(found.are_left_locked(&manual));
    }

    #[test]
    fn a_camera_that_was_unplugged_is_held_at_the_same_again() {
        let camera = webcam();
        let held = Held::from([(EXPOSURE_TIME, 80), (0x0098_091a, 5200)]);
        assert_eq!(Controls::read(&camera).lock(&camera, &held).0, held);
        assert_eq!((camera.get(EXPOSURE_TIME), camera.get(0x0098_091a)), (Some(80), Some(5200)));
        assert_eq!(exposure(8.0), Held::from([(EXPOSURE_TIME, 80)]));
    }

    #[test]
    fn what_cannot_be_held_is_said_and_a_camera_without_controls_is_left_alone() {
        let mut stubborn = webcam();
        stubborn.0.get_mut().remove(&0x0098_090c);
        stubborn.0.get_mut().insert(0x009a_0901, 3);
        struct Deaf(Fake);
        impl Panel for Deaf {
            fn get(&self, id: u32) -> Option<i64> {
                self.0.get(id)
            }
            fn set(&self, _: u32, _: i64) -> io::Result<()> {
                Err(io::Error::from_raw_os_error(5))
            }
        }
        let deaf = Deaf(stubborn);
        let (_, sentences) = Controls::read(&deaf).lock(&deaf, &exposure(8.0));
        assert_eq!(sentences.len(), 3, "{sentences:?}");
        assert!(
            sentences[2].starts_with("exposure_time_100us cannot be held at 80") && sentences[2].ends_with("it is 250"),
            "{sentences:?}"
        );

        let bare = Fake(RefCell::default());
        let controls = Controls::read(&bare);
        assert!(!controls.adjusts_itself() && controls.record(&bare).is_empty());
        assert_eq!(controls.lock(&bare, &exposure(8.0)), (Held::new(), Vec::new()));
    }
}
