//! The program on log files: what it writes, what it refuses and why.

use std::path::{Path, PathBuf};

use clap::{Parser, ValueEnum};
use nalgebra::{Matrix3, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use raven::cli::Outcome;
use raven::log::{LogWriter, Stamp, TipObservation, TipStatus, topics};
use raven::observation::TipCorrection;
use raven::robot::{ListedEffect, MotorTrack, Robot, nominal};
use raven_identify::args::Method;
use raven_identify::motion::Motion;
use raven_identify::prediction::Predictor;
use raven_identify::recording::Recordings;
use raven_identify::{Args, run};
use raven_tests::shared;

const START: Stamp = Stamp(1_700_000_000_000_000_000);
const NAMES: [&str; 3] = ["shoulder", "elbow", "insertion"];

/// The nominal robot, its motors on `/motor/joint_states`.
fn believed() -> Robot {
    let text = nominal::GOLD_YAML.replace("/ravenstate", topics::MOTOR_JOINT_STATES).replace("format: raven_state", "format: joint_state");
    Robot::parse(Path::new("robot.yaml"), &text).unwrap()
}

/// What a log holds, and what is wrong with it.
struct Script {
    duration_s: f64,
    /// Joint positions over time, as the controller believes them.
    path: fn(f64) -> Vector3<f64>,
    /// Robot messages that are there.
    robot: fn(f64) -> bool,
    /// What becomes of an observation at a time.
    tip: fn(f64, &mut TipObservation),
    /// Seconds by which the cameras' clock is ahead.
    clock_s: f64,
}

fn workspace(t: f64) -> Vector3<f64> {
    Vector3::new(0.8 + 0.45 * (0.9 * t).sin(), 1.6 + 0.4 * (0.7 * t).sin(), 0.33 + 0.06 * (0.5 * t).sin())
}

impl Script {
    fn good() -> Self {
        Self { duration_s: 20.0, path: workspace, robot: |_| true, tip: |_, _| (), clock_s: 0.0 }
    }

    fn write(&self, file: &Path) {
        let believed = believed();
        let mut truth = believed.clone();
        let transmission = believed.arm().unwrap().transmission;
        for (joint, &motor) in truth.joints.iter_mut().zip(transmission.motor_at_hard_stop.iter()) {
            joint.motor_at_hard_stop = Some(motor);
        }
        truth.joints[0].link_pulley_radius = 0.0598;
        truth.observation.latency = 0.04;
        let time_s: Vec<f64> = (0..(self.duration_s * 200.0) as usize).map(|i| i as f64 / 200.0).collect();
        let angle: Vec<Vector3<f64>> = time_s.iter().map(|&t| transmission.motor_from_joint(&(self.path)(t))).collect();
        let mut log = LogWriter::computed(file).unwrap();
        for (&t, angle) in time_s.iter().zip(&angle).filter(|(t, _)| (self.robot)(**t)) {
            log.joint_states(topics::MOTOR_JOINT_STATES, START.plus_seconds(t), &NAMES, angle.as_slice(), None).unwrap();
        }
        let predictor = Predictor::new(&truth).unwrap();
        let motion = Motion::new(MotorTrack { time_s, angle }, 0.02).unwrap();
        let driving = predictor.driving(&motion);
        let mut random = ChaCha8Rng::seed_from_u64(7);
        for i in 0..(self.duration_s * 15.0) as usize {
            let t = (i as f64 + 0.5) / 15.0;
            let noise = Vector3::from_fn(|_, _| 2e-4 * Distribution::<f64>::sample(&StandardNormal, &mut random));
            let mut tip = TipObservation {
                stamp: START.plus_seconds(t + self.clock_s),
                frame_id: "frame0_gold".to_owned(),
                status: TipStatus::Seen,
                left_px: [f64::NAN; 2],
                right_px: [f64::NAN; 2],
                position_m: predictor.seen_m(&driving, t) + noise,
                covariance_m2: Matrix3::identity() * 4e-8,
            };
            (self.tip)(t, &mut tip);
            log.tip(&tip).unwrap();
        }
        log.finish().unwrap();
    }
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        believed().write(&folder.path("robot.yaml")).unwrap();
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn run(&self, arguments: &[&str]) -> Result<(Outcome, String), String> {
        let inside = |a: &&str| if a.contains('.') { self.path(a).into_os_string() } else { a.into() };
        let line = std::iter::once("raven-identify".into()).chain(arguments.iter().map(inside));
        let mut out = Vec::new();
        let outcome = run(Args::try_parse_from(line).map_err(|e| e.to_string())?, &mut out).map_err(|e| e.to_string())?;
        Ok((outcome, String::from_utf8(out).unwrap()))
    }

    /// The sentence with which every method refuses a log, and writes nothing.
    fn refusal(&self, script: &Script) -> String {
        script.write(&self.path("log.mcap"));
        let refuse = |method: &Method| {
            let line = ["log.mcap", "--robot", "robot.yaml", "--method", method.name(), "-o", "new.yaml", "--json", "result.json"];
            let refusal = self.run(&line).unwrap_err();
            assert!(refusal.contains("log.mcap") && !refusal.contains('\n') && refusal.ends_with('.'), "{refusal}");
            assert!(!self.path("new.yaml").exists() && !self.path("result.json").exists(), "{refusal}");
            refusal
        };
        let refusals: Vec<String> = Method::value_variants().iter().map(refuse).collect();
        assert!(refusals.iter().all(|r| *r == refusals[0]), "{refusals:?}");
        refusals.into_iter().next().unwrap()
    }
}

#[test]
fn a_recording_becomes_a_table_a_result_and_a_robot_file() {
    let folder = Folder::new();
    Script::good().write(&folder.path("log.mcap"));
    let arguments = ["log.mcap", "--robot", "robot.yaml", "-o", "new.yaml", "--json", "result.json"];
    let (outcome, table) = folder.run(&arguments).unwrap();
    assert_eq!(outcome, Outcome::Done);
    assert!(table.lines().any(|l| l.starts_with("r_l1 ") && l.contains("shoulder") && l.contains("-5.2")), "{table}");

    let result: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(folder.path("result.json")).unwrap()).unwrap();
    let first = &result["parameters"][0];
    assert_eq!(
        (first["name"].as_str(), first["joint"].as_str(), first["identified"].as_bool()),
        (Some("r_l1"), Some("shoulder"), Some(true))
    );
    let number = |key: &str| first[key].as_f64().unwrap();
    assert!((number("value") - 0.0598).abs() < 4.0 * number("std"), "{first}");
    assert_eq!((number("prior"), number("prior_std")), (0.063095, 0.0063095));
    assert!((2.5..3.5).contains(&result["nis_mean"].as_f64().unwrap()), "{result}");
    assert!(result["realtime_factor"].as_f64().unwrap() > 0.0 && result["seconds"].as_f64().unwrap() > 0.0);

    let robot = Robot::read(&folder.path("new.yaml")).unwrap();
    assert!((robot.joints[0].link_pulley_radius / number("value") - 1.0).abs() < 1e-14);
    assert!((robot.observation.latency - 0.04).abs() < 2e-3);
    let entry = &robot.calibration[0];
    assert_eq!(
        (entry.logs.as_slice(), &entry.sha256),
        (["log.mcap".to_owned()].as_slice(), &vec![raven::files::sha256(&folder.path("log.mcap")).unwrap()])
    );
    assert_eq!(robot.before_calibration(), believed());

    // The same input gives the same file, whatever the threads do.
    let once = std::fs::read(folder.path("new.yaml")).unwrap();
    folder.run(&arguments).unwrap();
    assert_eq!(std::fs::read(folder.path("new.yaml")).unwrap(), once);
}

/// A reader of the file alone must know, too.
#[test]
fn a_misfit_stands_in_the_robot_file() {
    let folder = Folder::new();
    for (script, is_misfit) in [(Script::good(), false), (Script { tip: |_, tip| tip.covariance_m2 *= 0.1, ..Script::good() }, true)] {
        script.write(&folder.path("log.mcap"));
        folder.run(&["log.mcap", "--robot", "robot.yaml", "-o", "new.yaml"]).unwrap();
        let robot = Robot::read(&folder.path("new.yaml")).unwrap();
        for entry in &robot.calibration {
            let said = entry.method.strip_prefix("batch").unwrap();
            assert!(if is_misfit { said.starts_with("; the residuals are ") } else { said.is_empty() }, "{}", entry.method);
        }
        std::fs::remove_file(folder.path("log.mcap")).unwrap();
    }
}

#[test]
fn a_dash_is_standard_output_and_the_table_makes_way() {
    let folder = Folder::new();
    Script::good().write(&folder.path("log.mcap"));
    let (_, text) = folder.run(&["log.mcap", "--robot", "robot.yaml", "-o", "-"]).unwrap();
    assert_eq!(Robot::parse(Path::new("-"), &text).unwrap().calibration[0].parameter, "r_l1");
    let error = folder.run(&["log.mcap", "--robot", "robot.yaml", "-o", "-", "--json", "-"]).unwrap_err();
    assert!(error.contains("-o and --json are both `-`"), "{error}");
    let added = ["--add-effect", "payload=0", "--robot", "robot.yaml", "-o", "-", "--json", "result.json"];
    let (_, text) = folder.run(&added).unwrap();
    assert!(Robot::parse(Path::new("-"), &text).is_ok() && folder.path("result.json").exists(), "{text}");
}

#[test]
fn gaps_cost_the_sightings_next_to_them() {
    let folder = Folder::new();
    Script { robot: |t| !(5.0..6.5).contains(&t), ..Script::good() }.write(&folder.path("log.mcap"));
    let (outcome, table) = folder.run(&["log.mcap", "--robot", "robot.yaml", "--json", "result.json"]).unwrap();
    assert_eq!(outcome, Outcome::DataLost);
    let sightings: usize = table.lines().last().unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!((265..275).contains(&sightings), "300 less 1.7 s of 15 Hz and the ends: {table}");
    let result: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(folder.path("result.json")).unwrap()).unwrap();
    let found = &result["parameters"][0];
    let number = |key: &str| found[key].as_f64().unwrap();
    assert!((number("value") - 0.0598).abs() < 4.0 * number("std") && number("std") < 1e-4, "{found}");
}

/// Clocks that run apart: the motion must be known where an image shows it.
#[test]
fn the_motion_is_known_wherever_a_sighting_is_used() {
    let folder = Folder::new();
    let mut robot = believed();
    robot.effects.push(ListedEffect { id: "clock-drift".to_owned(), joint: None, values: [("rate".to_owned(), 1e-3)].into() });
    Script { duration_s: 200.0, robot: |t| !(190.0..191.5).contains(&t), ..Script::good() }.write(&folder.path("log.mcap"));
    let read = Recordings::read(&[folder.path("log.mcap")], &robot, None).unwrap();
    let correction = TipCorrection::of(&robot, &robot.arm().unwrap()).unwrap();
    let session = &read.sessions[0];
    for sighting in &session.sightings {
        let shown_s = correction.shown_at_s(sighting.time_s);
        assert!(session.motion.covers(shown_s - 0.1, shown_s + 0.1), "the image of {} s shows {shown_s} s", sighting.time_s);
    }
    assert!((2970..2976).contains(&session.sightings.len()), "3000 less 1.7 s of 15 Hz and the ends: {}", session.sightings.len());
}

/// Estimates can leave what a robot file may hold.
#[test]
fn a_file_that_could_not_be_read_again_is_not_written() {
    let folder = Folder::new();
    let mut robot = believed();
    robot.observation.latency = 9.99;
    robot.write(&folder.path("robot.yaml")).unwrap();
    Script { duration_s: 30.0, clock_s: 10.0, ..Script::good() }.write(&folder.path("log.mcap"));
    let error = folder.run(&["log.mcap", "--robot", "robot.yaml", "-o", "new.yaml", "--json", "result.json"]).unwrap_err();
    assert!(error.contains("new.yaml") && error.contains("observation.latency is 10.0"), "{error}");
    assert!(error.contains("nothing is written"), "{error}");
    assert!(!folder.path("new.yaml").exists() && !folder.path("result.json").exists());
}

#[test]
fn what_carries_no_estimate_is_refused_in_a_sentence() {
    let folder = Folder::new();
    let occluded = folder.refusal(&Script { tip: |_, tip| tip.status = TipStatus::Occluded, ..Script::good() });
    assert!(occluded.contains("not seen in any of 300"), "{occluded}");
    let nan = folder.refusal(&Script { tip: |_, tip| tip.position_m.x = f64::NAN, ..Script::good() });
    assert!(nan.contains("not seen"), "{nan}");
    let short = folder.refusal(&Script { duration_s: 1.5, ..Script::good() });
    assert!(short.contains("fewer than the 30"), "{short}");
    let still = folder.refusal(&Script { path: |_| Vector3::new(0.8, 1.6, 0.33), ..Script::good() });
    assert!(still.contains("no joint moved"), "{still}");
    let stop = folder.refusal(&Script { path: |_| Vector3::new(0.0, 137.5_f64.to_radians(), 0.562), ..Script::good() });
    assert!(stop.contains("never left its hard stop"), "{stop}");
    let clock = folder.refusal(&Script { clock_s: 3600.0, ..Script::good() });
    assert!(clock.contains("clocks disagree") && clock.contains("3600"), "{clock}");
    let gaps = folder.refusal(&Script { robot: |t| t.fract() < 0.15, ..Script::good() });
    assert!(gaps.contains("0 usable sightings"), "{gaps}");
    let covariance = folder.refusal(&Script { tip: |_, tip| tip.covariance_m2 *= f64::NAN, ..Script::good() });
    assert!(covariance.contains("0 usable sightings") || covariance.contains("not seen"), "{covariance}");
    let silent = folder.refusal(&Script { robot: |_| false, ..Script::good() });
    assert!(silent.contains("motor positions"), "{silent}");
}

#[test]
fn some_observations_without_numbers_are_left_out() {
    let folder = Folder::new();
    let spoil = |t: f64, tip: &mut TipObservation| {
        if (5.0..7.0).contains(&t) {
            tip.position_m.y = f64::NAN;
        }
    };
    Script { tip: spoil, ..Script::good() }.write(&folder.path("log.mcap"));
    for method in Method::value_variants() {
        let (_, table) = folder.run(&["log.mcap", "--robot", "robot.yaml", "--method", method.name()]).unwrap();
        let sightings: usize = table.lines().last().unwrap().split(' ').next().unwrap().parse().unwrap();
        assert!((264..270).contains(&sightings) && table.contains("-5.2") && !table.contains("NaN"), "{table}");
    }
}

#[test]
fn wrong_arguments_are_named() {
    let folder = Folder::new();
    Script::good().write(&folder.path("log.mcap"));
    let wrong = |arguments: &[&str]| folder.run(arguments).unwrap_err();
    assert!(wrong(&["--robot", "robot.yaml"]).contains("no log"));
    assert!(wrong(&["log.mcap"]).contains("--robot is missing"));
    assert!(wrong(&["log.mcap", "--robot", "robot.yaml", "--parameters", "r_l1,b_x"]).contains("`b_x`"));
    assert!(wrong(&["other.mcap", "--robot", "robot.yaml"]).contains("other.mcap"));
    assert!(wrong(&["log.mcap", "--robot", "robot.yaml", "--cameras", "robot.yaml"]).contains("robot.yaml"));
    // Before any log is read.
    let wrong_of_method = |more: &[&str]| wrong(&[&["other.mcap", "--robot", "robot.yaml"], more].concat());
    assert!(wrong_of_method(&["--horizon", "step"]).contains("--horizon belongs to --method dual"));
    assert!(wrong_of_method(&["--plot", "plot.svg"]).contains("a batch has none"));
    for method in ["dual", "joint"] {
        let whole = wrong_of_method(&["--method", method, "--parameters", "r_l1,rounding_3"]);
        assert!(whole.contains("--parameters names rounding_3"), "{whole}");
        let empty = wrong_of_method(&["--method", method, "--parameters", "registration", "--plot", "plot.svg"]);
        assert!(empty.contains("--plot shows no correction of the registration"), "{empty}");
    }
    // What the log hides is known only then.
    let hidden = wrong(&["log.mcap", "--robot", "robot.yaml", "--method", "dual", "--parameters", "b_e1", "--plot", "plot.svg"]);
    assert!(hidden.contains("--plot shows no correction of the registration") && !folder.path("plot.svg").exists(), "{hidden}");
    let bench = "format: raven-robot/1\nname: bench\nkinematics: {kind: bench}\nsource: {topic: /x, format: joint_state}\njoints: []\n";
    std::fs::write(folder.path("bench.yaml"), bench).unwrap();
    assert!(wrong(&["log.mcap", "--robot", "bench.yaml"]).contains("bench.yaml"));
}

/// Independent recordings, where they are: another rigid-body engine, stiction and camera.
#[test]
fn the_practice_recordings_read_as_their_labels_say() {
    let Some(practice) = shared("data/practice") else { return };
    let folder = Folder::new();
    nominal::gold().write(&folder.path("robot.yaml")).unwrap();
    let (robot, cameras, result) = (folder.path("robot.yaml"), practice.join("cameras.yaml"), folder.path("result.json"));
    let identify = |log: &str| -> serde_json::Value {
        let line = [
            Path::new("raven-identify"),
            &practice.join(log),
            "--robot".as_ref(),
            &robot,
            "--cameras".as_ref(),
            &cameras,
            "--json".as_ref(),
            &result,
        ];
        run(Args::parse_from(line), &mut Vec::new()).unwrap();
        serde_json::from_str(&std::fs::read_to_string(&result).unwrap()).unwrap()
    };
    for (log, truth_m) in [("p01.mcap", 0.063095 * 1.063), ("null-exact-p1.mcap", 0.063095)] {
        let result = identify(log);
        for parameter in result["parameters"].as_array().unwrap() {
            let number = |key: &str| parameter[key].as_f64().unwrap();
            let truth = if parameter["name"] == "r_l1" { truth_m } else { number("prior") };
            assert!((number("value") - truth).abs() < 4.0 * number("std"), "{log}: {parameter}");
        }
        assert!((2.7..3.3).contains(&result["nis_mean"].as_f64().unwrap()), "{log}: {result}");
    }
}
