//! Sealed recordings: what is drawn, that nothing gives it away, and that labels cannot be changed.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::*;
use crate::files;
use crate::log::{MotorSource, Recording};
use crate::robot::Robot;

#[test]
fn a_set_has_its_shares_and_takes_every_effect_at_every_joint_in_turn() {
    let robot = nominal::gold();
    // Half the set are singles: six rounds of 34 effects.
    let cases = sealed_set(&robot, 3, 408).unwrap();
    let count = |filter: fn(&Case) -> bool| cases.iter().filter(|case| filter(case)).count();
    assert_eq!(count(|c| c.effects.is_empty() && c.outside.is_none()), 82);
    assert_eq!(count(|c| c.effects.len() == 2), 81);
    assert_eq!(count(|c| c.outside.is_some()), 40);
    let singles: Vec<&Case> = cases.iter().filter(|c| c.effects.len() == 1).collect();
    assert_eq!(singles.len(), 205);
    let drawn: BTreeSet<(&str, Option<&str>)> = singles.iter().map(|c| (c.effects[0].kind.id(), c.effects[0].target.as_deref())).collect();
    for kind in EffectKind::all() {
        for place in places(&robot, kind) {
            assert!(drawn.contains(&(kind.id(), place.as_deref())), "{} at {place:?} was not drawn", kind.id());
        }
    }
    for pair in cases.iter().filter(|c| c.effects.len() == 2) {
        assert_ne!(pair.effects[0].kind, pair.effects[1].kind);
    }
    let outsides: BTreeSet<&str> = cases.iter().filter_map(|c| c.outside.as_ref().map(Outside::id)).collect();
    assert_eq!(outsides.len(), Outside::KINDS);
    let rich = count(|c| c.motion == Motion::Rich) as f64 / 408.0;
    assert!((0.6..0.8).contains(&rich), "{rich}");
    assert!(cases.iter().all(|c| (40.0..=75.0).contains(&c.duration_s)));
    assert_eq!(sealed_set(&robot, 3, 40).unwrap(), sealed_set(&robot, 3, 40).unwrap());
    assert_ne!(sealed_set(&robot, 3, 40).unwrap(), sealed_set(&robot, 4, 40).unwrap());
}

#[test]
fn sizes_spread_over_their_range_with_both_signs() {
    let robot = nominal::gold();
    let mut rng = rng(5);
    let mut spread = |kind, target| -> (f64, f64, f64) {
        let sizes: Vec<f64> = (0..2000).map(|_| draw_effect(&robot, kind, target, &mut rng).unwrap().values[0]).collect();
        let negative = sizes.iter().filter(|size| **size < 0.0).count() as f64 / 2000.0;
        let sizes = sizes.iter().map(|size| size.abs());
        (sizes.clone().fold(f64::INFINITY, f64::min), sizes.fold(0.0, f64::max), negative)
    };
    let (least, most, negative) = spread(EffectKind::PulleyRadius, Some("elbow"));
    assert!((0.01..0.0103).contains(&least) && (0.068..0.07).contains(&most) && (negative - 0.5).abs() < 0.06);
    let (least, most, negative) = spread(EffectKind::Hysteresis, Some("insertion"));
    assert!((0.5e-3..0.51e-3).contains(&least) && (1.95e-3..2e-3).contains(&most) && negative == 0.0);
    let (least, most, _) = spread(EffectKind::CableStretch, Some("shoulder"));
    assert!((0.02..0.021).contains(&least) && (0.49..0.5).contains(&most));
    // Every kind at every place makes an effect that the machine takes.
    for kind in EffectKind::all() {
        for place in places(&robot, kind) {
            // A drive's limit follows from a simulation, which takes its time.
            for _ in 0..if kind == EffectKind::TorqueSaturation { 1 } else { 50 } {
                let effect = draw_effect(&robot, kind, place.as_deref(), &mut rng).unwrap();
                assert!(Machine::new(&robot, &[effect]).is_ok());
            }
        }
    }
}

/// A folder with short recordings of one effect, of nothing and of an outside cause.
fn sealed(robot: &Robot, folder: &Path) -> SealedFolder {
    let mut sealed = SealedFolder::open(folder).unwrap();
    let hidden = [
        (effects(&["pulley-radius:shoulder=0.063"]), None),
        (Vec::new(), None),
        (Vec::new(), Some(Outside::draw(robot, 0, &mut rng(1)).unwrap())),
    ];
    for (effects, outside) in hidden {
        let name = sealed.free_name();
        let seed = 0x5eed_0000_0000 + u64::from(name.as_bytes()[3]);
        let case = Case { name, effects, outside, motion: Motion::Rich, duration_s: 2.0, rate_hz: 15.0, noise_px: 0.1, seed };
        sealed.add(robot, &case, &SealedFolder::options(), |_| {}).unwrap();
    }
    sealed
}

#[test]
fn a_sealed_recording_gives_nothing_away() {
    let robot = nominal::gold();
    let folder = tempfile::tempdir().unwrap();
    let sealed = sealed(&robot, folder.path());
    let labels = SealedFolder::labels(folder.path()).unwrap();
    assert_eq!(labels.keys().collect::<Vec<_>>(), ["r001", "r002", "r003"]);
    let cameras = files::read_text(&folder.path().join("cameras.yaml")).unwrap();
    let metadata: BTreeMap<String, String> = [
        ("arm", "gold"),
        ("motion", "rich"),
        ("robot", "raven2-gold"),
        ("tool", concat!("raven-capture simulate ", env!("CARGO_PKG_VERSION"))),
    ]
    .map(|(key, value)| (key.to_owned(), value.to_owned()))
    .into();
    for (name, label) in &labels {
        let log = Recording::read(&sealed.recording(name), &MotorSource::from(&robot)).unwrap();
        // All that the file says beyond its messages, word for word: no more and no less.
        assert_eq!(log.session, metadata);
        assert_eq!(log.attachments.keys().collect::<Vec<_>>(), ["cameras.yaml", "robot.yaml"]);
        assert_eq!(log.attachments["robot.yaml"], robot.to_yaml().as_bytes());
        assert_eq!(log.attachments["cameras.yaml"], cameras.as_bytes());
        assert!(log.joint_encoders.is_none(), "encoders at the joints tell the truth");
        let bytes = std::fs::read(sealed.recording(name)).unwrap();
        let holds = |text: &str| bytes.windows(text.len()).any(|window| window == text.as_bytes());
        assert!(!holds(label.salt.as_ref().unwrap()) && !holds(label.seed.as_ref().unwrap()));
        assert!(label.effects.iter().all(|effect| !holds(&effect.id)));
        assert_eq!(label.salt.as_ref().unwrap().len(), 32);
    }
    assert_eq!(labels["r001"].effects[0].magnitude, Magnitude::One(0.063));
    assert!(labels["r002"].effects.is_empty());
    assert_eq!(labels["r003"].effects[0].id, "swaying-base");
}

#[test]
fn labels_that_were_changed_are_refused() {
    let robot = nominal::gold();
    let folder = tempfile::tempdir().unwrap();
    let mut sealed = sealed(&robot, folder.path());
    let path = folder.path().join(LABELS);
    let bytes = std::fs::read(&path).unwrap();
    for at in [0, bytes.len() / 2, bytes.len() - 1] {
        let mut changed = bytes.clone();
        changed[at] ^= 1;
        std::fs::write(&path, changed).unwrap();
        let error = SealedFolder::labels(folder.path()).unwrap_err().to_string();
        assert!(error.contains("not the labels sealed with the recordings"), "{error}");
        assert!(SealedFolder::open(folder.path()).is_err(), "a recording must not be added to labels that were changed");
    }
    std::fs::write(&path, bytes).unwrap();
    // A name is sealed once.
    let case = Case::draw(&robot, "r002", Lot::None, 1).unwrap();
    assert!(sealed.add(&robot, &case, &SealedFolder::options(), |_| {}).is_err());
}

/// Labels of another generator, with keys that this one does not write.
#[test]
fn the_practice_labels_read() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data/practice"));
    if !folder.exists() {
        eprintln!("skipped: {} is not there", folder.display());
        return;
    }
    let labels = SealedFolder::labels(folder).unwrap();
    assert!(labels["null-p2"].effects.is_empty());
    assert_eq!(labels["p10"].effects.len(), 2);
    assert_eq!(labels["p08"].effects[0].magnitude.values().len(), 3);
}
