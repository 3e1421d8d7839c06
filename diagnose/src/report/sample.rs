//! A page with made-up numbers for the tests.

use crate::gap::MotorMotion;

use super::{Candidate, Detectable, GapBar, Page, PhaseBar, PhaseBars, Trace};

/// A page with every part on it.
pub fn sample() -> Page {
    let gap = |channel: &str, unit: &str, noise_floor, before, after, closed| GapBar {
        channel: channel.to_owned(),
        unit: unit.to_owned(),
        noise_floor,
        before,
        after: Some(after),
        closed: Some(closed),
        retuned: Some(noise_floor),
    };
    let candidate = |effect: &str, joint: Option<&str>, probability, evidence_nats, chosen: bool| Candidate {
        effect: effect.to_owned(),
        joint: joint.map(str::to_owned),
        probability,
        together: chosen.then(|| "0.996 together with capstan-radius, which is the same".to_owned()),
        evidence_nats,
        parameters: if chosen { vec!["relative_error -0.0518 +- 0.0004".to_owned()] } else { Vec::new() },
        chosen,
        set_aside: false,
    };
    let trace = |channel: &str, unit: &str, size: f64| {
        let time_s: Vec<f64> = (0..1100).map(|k| f64::from(k) / 15.0).filter(|t| !(40.0..43.0).contains(t)).collect();
        let rough = |t: f64| 0.2 * ((91.7 * t).sin() + (53.3 * t).sin() + (131.1 * t).cos());
        Trace {
            channel: channel.to_owned(),
            unit: unit.to_owned(),
            noise_floor: 0.25,
            before: time_s.iter().map(|&t| size * (0.6 + (0.7 * t).sin() * (0.11 * t).cos()) + rough(t)).collect(),
            after: time_s.iter().map(|&t| rough(t)).collect(),
            time_s,
        }
    };
    let phases = |channel: &str, unit: &str, scale: f64| PhaseBars {
        channel: channel.to_owned(),
        unit: unit.to_owned(),
        phases: [("reversal", 0.09, 2.1), ("hold", 0.21, 0.5), ("cruise", 0.58, 0.8), ("acceleration", 0.12, 1.1)]
            .map(|(phase, share_of_time, before)| PhaseBar {
                phase: phase.to_owned(),
                share_of_time,
                noise_floor: 0.25,
                before: before * scale,
                after: Some(0.3),
            })
            .to_vec(),
    };
    let detectable = |effect: &str, joint: Option<&str>, size: &str| Detectable {
        effect: effect.to_owned(),
        joint: joint.map(str::to_owned),
        size: size.to_owned(),
    };
    Page {
        title: "raven2-gold".to_owned(),
        verdict: "explained".to_owned(),
        verdict_sentence: "The shoulder's link pulley is 5.2 % smaller than the model has it; that closes 97 % of the gap at the tip."
            .to_owned(),
        remarks: vec!["carriage: the joint side counts against the motor side; its sign was turned.".to_owned()],
        recordings: vec!["fls-tracked.mcap".to_owned(), "sinusoid-tracked.mcap".to_owned()],
        gaps: vec![
            gap("shoulder", "deg", 0.22, 2.26, 0.24, (0.97, [0.95, 0.98])),
            gap("elbow", "deg", 0.08, 0.41, 0.2, (0.78, [0.7, 0.84])),
            gap("insertion", "mm", 0.23, 1.28, 0.26, (0.96, [0.93, 0.98])),
            gap("tip", "mm", 0.55, 5.29, 0.58, (0.97, [0.95, 0.98])),
        ],
        candidates: vec![
            candidate("pulley-radius", Some("shoulder"), 0.991, 812.4, true),
            candidate("joint-offset", Some("shoulder"), 0.008, 807.6, false),
            candidate("camera-rotation", None, 0.0009, 805.1, false),
            candidate("cable-coupling", Some("shoulder->elbow"), 0.00001, 640.2, false),
        ],
        places: vec!["68 % of the elbow's excess error sits within 150 ms of reversals, which are 9 % of the time (p < 0.001).".to_owned()],
        motors: [(0.05, 0.00412), (0.2, 0.049), (1.0, 0.794), (5.0, 44.9)]
            .map(|(horizon_s, rms)| MotorMotion { joint: "shoulder".to_owned(), unit: "deg", horizon_s, rms, observations: 400 })
            .to_vec(),
        traces: vec![trace("shoulder", "deg", 2.0), trace("elbow", "deg", 0.7), trace("insertion", "mm", 1.1)],
        phases: vec![phases("shoulder", "deg", 1.0), phases("elbow", "deg", 0.5), phases("insertion", "mm", 1.4)],
        ties: vec![
            "pulley-radius and the radius of the motor's capstan are one number to motors and tip: no recording tells them apart."
                .to_owned(),
        ],
        is_against: false,
        file_numbers: vec!["motor-coulomb-friction at the elbow: factor 0.62 +- 0.05, 3.1 of its tolerances off.".to_owned()],
        tolerance_parts: vec![("joint-offset".to_owned(), 0.52), ("tool-length".to_owned(), 0.31)],
        next_steps: vec![
            "Write the radius into robot.yaml: raven-identify --parameters r_l1.".to_owned(),
            "Record 20 s with the shoulder over its whole range; expected evidence 40 nat against joint-offset.".to_owned(),
        ],
        detectable: vec![
            detectable("pulley-radius", Some("shoulder"), "0.31 %"),
            detectable("backlash", Some("elbow"), "0.00209 rad"),
            detectable("time-offset", None, "0.0042 s"),
        ],
        not_observable: vec![("torque-ripple".to_owned(), "the recordings have no motor torque".to_owned())],
    }
}
