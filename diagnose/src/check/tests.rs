//! Scores of verdicts made by hand, and the order of commitment and labels.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;

use approx::assert_relative_eq;
use raven::simulation::{LABELS, LABELS_SUM, Label, LabelEffect, Magnitude, Motion, Options, SealedFolder};

use super::verdict::Retuned;
use super::*;
use crate::evidence::numbers::spread::Departures;

fn effect(id: &str, joint: Option<&str>, magnitude: f64) -> LabelEffect {
    LabelEffect { id: id.to_owned(), joint: joint.map(str::to_owned), magnitude: Magnitude::One(magnitude) }
}

fn label(effects: &[LabelEffect]) -> Label {
    Label { case: String::new(), effects: effects.to_vec(), salt: None, seed: None }
}

fn blamed(id: &str, joint: Option<&str>, probability: f64, value: f64) -> Blamed {
    let parameters = vec![Estimate { name: "size".to_owned(), value, std: 0.001 }];
    Blamed { id: id.to_owned(), joint: joint.map(str::to_owned), probability, parameters }
}

fn verdict(word: Word, effects: &[Blamed], candidates: &[(&str, Option<&str>, f64)]) -> Verdict {
    let candidate = |&(id, joint, probability): &(&str, Option<&str>, f64)| Candidate {
        id: id.to_owned(),
        joint: joint.map(str::to_owned),
        probability,
    };
    Verdict { verdict: word, effects: effects.to_vec(), candidates: candidates.iter().map(candidate).collect(), gap: Vec::new() }
}

/// Scores (label, verdict) pairs.
fn score(cases: Vec<(Label, Result<Verdict, String>)>) -> Score {
    let mut labels = BTreeMap::new();
    let mut answers = Vec::new();
    for (at, (label, verdict)) in cases.into_iter().enumerate() {
        let name = format!("r{at}");
        labels.insert(name.clone(), label);
        answers.push(Answer { name, verdict, seconds: at as f64, told: None });
    }
    Score::of(&answers, &labels, &Names::of(&nominal::gold()))
}

#[test]
fn every_kind_of_recording_is_counted_where_it_belongs() {
    let radius = || label(&[effect("pulley-radius", Some("elbow"), 0.05)]);
    let right = blamed("pulley-radius", Some("elbow"), 0.95, 0.0505);
    let elsewhere = blamed("pulley-radius", Some("shoulder"), 0.85, 0.05);
    let pair = || label(&[effect("payload", None, 0.2), effect("backlash", Some("elbow"), 0.02)]);
    let backlash = blamed("backlash", Some("elbow"), 0.75, 0.021);
    let payload = blamed("payload", None, 0.65, 0.2);
    let outside = || label(&[effect("tool-contact", None, 300.0)]);
    let score = score(vec![
        (radius(), Ok(verdict(Word::Explained, std::slice::from_ref(&right), &[]))),
        (radius(), Ok(verdict(Word::Explained, &[elsewhere], &[("pulley-radius", Some("elbow"), 0.1)]))),
        (radius(), Ok(verdict(Word::None, &[], &[("none", None, 0.6), ("pulley-radius", Some("elbow"), 0.4)]))),
        (radius(), Ok(verdict(Word::Explained, &[right, payload.clone()], &[]))),
        (radius(), Err("unreadable".to_owned())),
        (label(&[]), Ok(verdict(Word::None, &[], &[("payload", None, 0.05)]))),
        (label(&[]), Ok(verdict(Word::Unexplained, &[], &[]))),
        (pair(), Ok(verdict(Word::Explained, &[backlash.clone(), payload], &[]))),
        (pair(), Ok(verdict(Word::PartlyExplained, &[backlash], &[]))),
        (outside(), Ok(verdict(Word::Unexplained, &[], &[]))),
        (outside(), Ok(verdict(Word::None, &[], &[("none", None, 0.9)]))),
    ]);
    assert_eq!((score.recordings, score.failed), (11, 1));
    assert_eq!(score.top1, Share { hits: 2, of: 5 });
    // Named second, and named after "nothing".
    assert_eq!(score.top2, Share { hits: 4, of: 5 });
    assert_eq!(score.single_exact, Share { hits: 1, of: 5 });
    assert_eq!(score.by_effect["pulley-radius"], Share { hits: 2, of: 5 });
    assert_eq!(score.false_alarms, Share { hits: 1, of: 2 });
    assert_eq!(score.pairs_exact, Share { hits: 1, of: 2 });
    assert_eq!(score.outside_recall, Share { hits: 1, of: 2 });
    // 0.95 right, 0.85 wrong, none 0.6 wrong, 0.95 right, 0.65 wrong, none 0.95 right, 0.75 and 0.65 right, 0.75 right, none 0.9 wrong.
    assert_eq!(score.claims, 10);
    let misses = [0.05, 0.85, 0.6, 0.05, 0.65, 0.05, 0.25, 0.35, 0.25, 0.9_f64];
    assert_relative_eq!(score.brier.unwrap(), misses.iter().map(|m| m * m).sum::<f64>() / 10.0, epsilon = 1e-12);
    // Bin 0.9: 0.95 + 0.95 + 0.95 + 0.9 said, 3 right: 0.75; 0.8: 0.85; 0.7: 1.5 said, 2 right: 0.5; 0.6: 1.9 said, 1 right: 0.9.
    assert_relative_eq!(score.ece.unwrap(), 0.30, epsilon = 1e-12);
    // Sizes: 1 %, 1 %, backlash 5 % twice, payload exactly.
    assert_eq!(score.sizes.effects, 5);
    assert_relative_eq!(score.sizes.median_relative_error.unwrap(), 0.01, epsilon = 1e-9);
    assert_relative_eq!(score.seconds_mean.unwrap(), 5.0);
    assert_eq!(score.slowest.as_deref(), Some("r10"));
    assert_eq!(score.confusion["pulley-radius"]["pulley-radius elsewhere"], 1);
    assert_eq!(score.confusion["2 effects"]["1 right, 0 wrong"], 1);
    assert_eq!(score.confusion["outside: tool-contact"]["unexplained"], 1);
    // Wrong: four of the singles, one alarm, one pair, one outside.
    assert_eq!(score.wrong.len(), 7);
    assert!(score.to_string().contains("single effects, first answer right              2 of 5     40.0 %"), "{score}");
}

#[test]
fn exact_ties_count_as_right() {
    let offset = label(&[effect("joint-offset", Some("insertion"), -0.003)]);
    let tool = verdict(Word::Explained, &[blamed("tool-length", None, 0.9, -0.003)], &[]);
    let both = label(&[effect("tool-length", None, 0.004), effect("backlash", Some("elbow"), 0.02)]);
    let named = [blamed("backlash", Some("elbow"), 0.9, 0.02), blamed("joint-offset", Some("insertion"), 0.9, 0.004)];
    let score = score(vec![(offset, Ok(tool)), (both, Ok(verdict(Word::Explained, &named, &[])))]);
    assert_eq!(score.top1, Share { hits: 1, of: 1 });
    assert_eq!(score.pairs_exact, Share { hits: 1, of: 1 });
    assert_eq!(score.confusion["joint-offset"]["joint-offset"], 1);
    assert_relative_eq!(score.sizes.median_relative_error.unwrap(), 0.0, epsilon = 1e-12);
}

#[test]
fn the_gap_is_held_against_what_closes_when_told() {
    let gap = |closed: &[(&str, Option<f64>)]| {
        let of = |&(channel, closed): &(&str, Option<f64>)| {
            let retuned = Retuned { closed: closed.map(|closed| 0.5 * (closed + 1.0)) };
            ChannelGap { channel: channel.to_owned(), closed, retuned }
        };
        closed.iter().map(of).collect::<Vec<_>>()
    };
    let mut said = verdict(Word::Explained, &[blamed("payload", None, 0.9, 0.2)], &[]);
    said.gap = gap(&[("tip", Some(0.9)), ("elbow", Some(0.5)), ("shoulder", None), ("insertion", Some(0.1))]);
    let told = gap(&[("tip", Some(1.0)), ("elbow", Some(0.6)), ("shoulder", Some(0.4)), ("insertion", None)]);
    let answer = Answer { name: "a".to_owned(), verdict: Ok(said), seconds: 1.0, told: Some(Told { gap: told, evidence_nats: 40.0 }) };
    let pair = Answer { name: "b".to_owned(), ..answer.clone() };
    let weak = Answer { name: "c".to_owned(), told: Some(Told { gap: Vec::new(), evidence_nats: 2.0 }), ..answer.clone() };
    let two = [effect("payload", None, 0.2), effect("backlash", Some("elbow"), 0.02)];
    let labels = [("a".to_owned(), label(&two[..1])), ("b".to_owned(), label(&two)), ("c".to_owned(), label(&two))].into();
    let score = Score::of(&[answer, pair, weak], &labels, &Names::of(&nominal::gold()));
    assert_eq!((score.top1_shown, score.pairs_exact), (Share { hits: 1, of: 1 }, Share { hits: 0, of: 2 }));
    assert_eq!(score.pairs_shown, Share { hits: 0, of: 1 });
    assert_relative_eq!(score.gap_closed_of_oracle.unwrap(), 1.4 / 2.0, epsilon = 1e-12);
    assert_relative_eq!(score.gap_closed_of_oracle_retuned.unwrap(), 1.7 / 2.5, epsilon = 1e-12);
}

#[test]
fn a_report_of_the_design_reads() {
    let text = r#"{"format": "raven-diagnosis/1", "verdict": "partly-explained",
        "effects": [{"id": "pulley-radius", "joint": "shoulder", "probability": 0.99, "evidence_nats": 812.4,
          "parameters": [{"name": "relative_error", "value": -0.0518, "std": 0.0004, "unit": "1"}], "ties": []}],
        "candidates": [{"id": "payload", "joint": null, "probability": 0.01, "evidence_nats": 3.0}],
        "not_observable": [], "where": [],
        "gap": [{"channel": "shoulder", "unit": "deg", "noise_floor": 0.1, "before": 2.0, "after": 0.2, "closed": 0.99, "held_out": true}]}"#;
    let verdict: Verdict = serde_json::from_str(text).unwrap();
    assert_eq!(verdict.verdict, Word::PartlyExplained);
    assert_eq!(verdict.effects[0].parameters[0].value, -0.0518);
    assert_eq!(verdict.gap[0].closed, Some(0.99));
}

fn radius_of_the_elbow() -> Verdict {
    verdict(Word::Explained, &[blamed("pulley-radius", Some("elbow"), 0.9, 0.05)], &[])
}

/// A sealed folder with two short recordings: a radius off, and nothing.
fn sealed() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let robot = nominal::gold();
    let case = |name: &str, effects: &[&str]| raven::simulation::Case {
        name: name.to_owned(),
        effects: effects.iter().map(|text| text.parse().unwrap()).collect(),
        outside: None,
        motion: Motion::Rich,
        duration_s: 1.0,
        rate_hz: 15.0,
        noise_px: 0.1,
        seed: 9,
    };
    let cases = [case("r001", &["pulley-radius:elbow=0.05"]), case("r002", &[])];
    SealedFolder::open(folder.path()).unwrap().add_all(&robot, &cases, &Options::default(), || {}).unwrap();
    folder
}

#[test]
fn labels_are_read_after_the_verdicts_are_written() {
    let folder = sealed();
    let verdicts = folder.path().join("verdicts.json");
    let seen = Cell::new(0);
    let diagnose = |log: &Path, _: &Spread| {
        assert!(!verdicts.exists());
        // Whoever reads the labels here cannot: they come later.
        seen.set(seen.get() + 1);
        if log.ends_with("r002.mcap") {
            std::fs::rename(folder.path().join("hidden"), folder.path().join(LABELS)).unwrap();
        }
        Ok(Diagnosed { verdict: radius_of_the_elbow(), departures: None })
    };
    std::fs::rename(folder.path().join(LABELS), folder.path().join("hidden")).unwrap();
    let told = Cell::new(0);
    let oracle = |_: &Path, _: &Spread, effects: &[(&str, Option<&str>)]| {
        assert!(verdicts.exists());
        assert_eq!(effects, [("pulley-radius", Some("elbow"))], "nothing is told of a recording without effects");
        told.set(told.get() + 1);
        Ok(None)
    };
    let mut out = Vec::new();
    let score = check(folder.path(), &Names::of(&nominal::gold()), &diagnose, &oracle, &verdicts, &mut out).unwrap();
    assert_eq!((seen.get(), told.get()), (2, 1));
    assert_eq!((score.top1.hits, score.false_alarms.hits), (1, 1));
    let sum = raven::files::sha256(&verdicts).unwrap();
    assert!(String::from_utf8(out).unwrap().starts_with(&format!("verdicts: SHA-256 {sum}  ")));
}

#[test]
fn recordings_are_diagnosed_beside_the_others_of_their_rig() {
    let folder = sealed();
    // Each finds its hard stops where the file has them; alone a radius is blamed.
    let exact = Departures::of_kind("joint-offset", &[0.0; 3], 1e-3);
    let asked = RefCell::new(Vec::new());
    let diagnose = |log: &Path, spread: &Spread| {
        let part = spread.part("joint-offset");
        asked.borrow_mut().push((log.file_stem().unwrap().to_string_lossy().into_owned(), part));
        let said = if part < 1.0 { verdict(Word::None, &[], &[]) } else { radius_of_the_elbow() };
        Ok(Diagnosed { verdict: said, departures: Some(exact.clone()) })
    };
    let told = |_: &Path, spread: &Spread, _: &[(&str, Option<&str>)]| {
        assert!(spread.part("joint-offset") < 1.0, "what is told goes by the same tolerances");
        Ok(None)
    };
    let verdicts = folder.path().join("verdicts.json");
    let score = check(folder.path(), &Names::of(&nominal::gold()), &diagnose, &told, &verdicts, &mut Vec::new()).unwrap();
    let asked = asked.into_inner();
    assert_eq!(asked.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), ["r001", "r002", "r001", "r002"]);
    assert_eq!((asked[0].1, asked[1].1), (1.0, 1.0));
    // Three that are exact and one that is stated.
    assert_relative_eq!(asked[2].1, 0.5 / 0.7, epsilon = 1e-3);
    assert_eq!((score.top1.hits, score.false_alarms.hits), (0, 0));
}

#[test]
fn an_effect_that_no_recording_of_the_robot_can_show_does_not_end_the_check() {
    let folder = sealed();
    let log = folder.path().join("r001.mcap");
    let backwards = ("cable-coupling", Some("elbow->shoulder"));
    assert!(crate::when_told(&log, &Nominal::new(&nominal::gold(), None), &[backwards]).unwrap().is_none());
}

#[test]
fn changed_labels_are_refused_after_the_commitment() {
    let folder = sealed();
    let path = folder.path().join(LABELS);
    let mut bytes = std::fs::read(&path).unwrap();
    let at = bytes.len() / 3;
    bytes[at] ^= 1;
    std::fs::write(&path, bytes).unwrap();
    let verdicts = folder.path().join("verdicts.json");
    let diagnose = |_: &Path, _: &Spread| Ok(Diagnosed { verdict: verdict(Word::None, &[], &[]), departures: None });
    let mut out = Vec::new();
    let names = Names::of(&nominal::gold());
    let error = check(folder.path(), &names, &diagnose, &|_, _, _| Ok(None), &verdicts, &mut out).unwrap_err().to_string();
    assert!(error.contains("not the labels sealed with the recordings"), "{error}");
    let out = String::from_utf8(out).unwrap();
    assert!(out.starts_with("verdicts: SHA-256 ") && !out.contains("labels:"), "{out}");
    std::fs::remove_file(folder.path().join(LABELS_SUM)).unwrap();
    assert!(check(folder.path(), &names, &diagnose, &|_, _, _| Ok(None), &verdicts, &mut Vec::new()).is_err());
}

#[test]
fn a_check_without_any_verdict_fails_with_the_first_reason() {
    let folder = sealed();
    let diagnose = |log: &Path, _: &Spread| Err(Error::file(log, "no verdict."));
    let verdicts = folder.path().join("verdicts.json");
    let error = check(folder.path(), &Names::of(&nominal::gold()), &diagnose, &|_, _, _| Ok(None), &verdicts, &mut Vec::new()).unwrap_err();
    assert!(error.to_string().contains("r001.mcap: no verdict."));
    assert!(!verdicts.exists());
}
