//! The loop is closed: an effect that a lab hides makes a gap, and the gap goes once the effect is in the robot file.

use std::path::Path;
use std::sync::LazyLock;

use raven::cli::Outcome;
use raven::log::Recording;
use raven::robot::{Robot, nominal};
use raven_replay::chain::{self, Program};

/// Runs `name arguments`, `{file}` being in the folder.
fn step(folder: &Path, name: &str, program: Program, arguments: &str) {
    let typed = chain::typed(folder, name, arguments);
    let mut printed = Vec::new();
    let outcome = program(&typed, &mut printed).unwrap_or_else(|error| panic!("{typed:?}: {error}"));
    assert!(matches!(outcome, Outcome::Done), "{typed:?}");
}

fn json(folder: &Path, name: &str) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(folder.join(name)).unwrap()).unwrap()
}

/// What is between a recording and a robot file as a mean square.
struct Gaps {
    /// At the tip, for `raven-diagnose` [mm^2].
    tip: f64,
    /// At each joint against its encoder, for `raven-replay`'s transmission kinematics [deg^2, mm^2].
    kinematic: [f64; 3],
}

impl Gaps {
    fn between(folder: &Path, log: &str, robot: &str) -> Self {
        step(folder, "raven-diagnose", chain::diagnose, &format!("{{{log}}} --robot {{{robot}}} --gap-only --json {{gap.json}}"));
        step(folder, "raven-replay", chain::replay, &format!("{{{log}}} --robot {{{robot}}} --json {{replay.json}}"));
        let (gap, replay) = (json(folder, "gap.json"), json(folder, "replay.json"));
        let tip = gap["model_gap"].as_array().unwrap().iter().find(|gap| gap["channel"] == "tip").unwrap()["model"].as_f64().unwrap();
        let kinematic = |joint: usize| replay["joints"][joint]["rms_kinematic_identified"].as_f64().unwrap().powi(2);
        Self { tip: tip * tip, kinematic: std::array::from_fn(kinematic) }
    }

    fn of_joint(&self, joint: usize) -> [f64; 2] {
        [self.tip, self.kinematic[joint]]
    }
}

/// Records the robot of a file in the lab, which may hide an effect.
fn simulate(folder: &Path, robot: &str, effect: &str, log: &str) {
    let arguments = format!("simulate --robot {{{robot}}} --motion rich --duration 40 {effect} -o {{{log}}}");
    step(folder, "raven-capture", chain::capture, &arguments);
}

/// A folder with the robot's file.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    nominal::gold().write(&folder.path().join("robot.yaml")).unwrap();
    folder
}

/// The gaps of a lab that hides nothing, the same for every effect.
static NOTHING_HIDDEN: LazyLock<Gaps> = LazyLock::new(|| {
    let folder = folder();
    simulate(folder.path(), "robot.yaml", "", "log.mcap");
    Gaps::between(folder.path(), "log.mcap", "robot.yaml")
});

/// Hides `hidden` in a lab, puts `added` into the robot file, and gives the part of the excess gap that is left, of the two [`Gaps`].
fn left_over(hidden: &str, added: &str, joint: usize) -> [f64; 2] {
    let folder = folder();
    let at = folder.path();
    simulate(at, "robot.yaml", &format!("--effect {hidden}"), "log.mcap");
    step(at, "raven-identify", chain::identify, &format!("--add-effect {added} --robot {{robot.yaml}} -o {{new.yaml}}"));
    let null = NOTHING_HIDDEN.of_joint(joint);
    let [before, after] = ["robot.yaml", "new.yaml"].map(|robot| Gaps::between(at, "log.mcap", robot).of_joint(joint));

    // The user's own simulation now shows what the recording shows, where its controller winds the cables by the same numbers.
    let listed = Robot::read(&at.join("new.yaml")).unwrap();
    if listed.arm().unwrap().transmission == nominal::gold().arm().unwrap().transmission {
        simulate(at, "new.yaml", "", "own.mcap");
        let tips = |log: &str| Recording::read(&at.join(log), &(&listed).into()).unwrap().tip;
        let (recorded, own) = (tips("log.mcap"), tips("own.mcap"));
        assert_eq!(recorded.len(), own.len());
        let apart_m = recorded.iter().zip(&own).map(|(a, b)| (a.position_m - b.position_m).norm()).filter(|m| m.is_finite());
        let apart_m = apart_m.fold(0.0, f64::max);
        assert!(apart_m < 2e-6, "{hidden}: the own simulation is another robot's, by {apart_m} m");
    }
    std::array::from_fn(|k| {
        println!("{hidden}, gap {k} squared: without {:.5}, before {:.5}, after {:.5}", null[k], before[k], after[k]);
        (after[k] - null[k]) / (before[k] - null[k])
    })
}

#[test]
fn a_hidden_eccentricity_goes_once_it_is_in_the_file() {
    let (sine, cosine) = (4e-4 * 0.7_f64.cos(), 4e-4 * 0.7_f64.sin());
    let left = left_over("pulley-eccentricity:elbow=0.0004,0.7", &format!("pulley-eccentricity:elbow={sine},{cosine}"), 1);
    assert!(left.iter().all(|left| *left < 0.1), "{left:?}");
}

#[test]
fn missed_counts_go_once_they_are_in_the_file() {
    let left = left_over("missed-counts:shoulder=3000,0.4", "missed-counts:shoulder=3000,0.4", 0);
    assert!(left.iter().all(|left| *left < 0.1), "{left:?}");
}

/// Creep that has settled before the recording starts: the lab moves to the start for 3.5 s.
#[test]
fn creep_goes_once_it_is_in_the_file() {
    let left = left_over("creep:insertion=20,2", "creep:insertion=20,2", 2);
    assert!(left.iter().all(|left| *left < 0.1), "{left:?}");
}

#[test]
fn a_pulley_goes_once_it_is_in_the_file() {
    let left = left_over("pulley-radius:shoulder=-0.05", "pulley-radius:shoulder=-0.05", 0);
    assert!(left.iter().all(|left| *left < 0.1), "{left:?}");
}

/// The clock is the cameras': transmission kinematics knows nothing of it.
#[test]
fn a_drifting_clock_goes_once_it_is_in_the_file() {
    let [tip, _] = left_over("clock-drift=0.001", "clock-drift=0.001", 0);
    assert!(tip < 0.1, "{tip}");
}

#[test]
fn late_images_go_once_they_are_in_the_file() {
    let [tip, _] = left_over("time-offset=0.03", "time-offset=0.03", 0);
    assert!(tip < 0.1, "{tip}");
}

/// A sharp play turns its lag in proportion to the travel, all of it.
#[test]
fn a_hysteresis_goes_once_it_is_in_the_file() {
    let [tip, _] = left_over("hysteresis:elbow=0.008", "hysteresis:elbow=0.008,1,10000", 1);
    assert!(tip < 0.1, "{tip}");
}

/// The paper's switch stands in with the motors as the listed effects have them: with counts that were missed, hiding the marker costs little.
#[test]
fn a_hidden_tip_is_replaced_by_one_without_what_is_in_the_file() {
    let folder = folder();
    let at = folder.path();
    simulate(at, "robot.yaml", "--effect missed-counts:shoulder=3000,0.4", "log.mcap");
    step(at, "raven-identify", chain::identify, "--add-effect missed-counts:shoulder=3000,0.4 --robot {robot.yaml} -o {new.yaml}");
    let occluded = "--occlude 0.6 --occlusion kinematics";
    step(at, "raven-replay", chain::replay, &format!("{{log.mcap}} --robot {{new.yaml}} {occluded} --json {{replay.json}}"));
    let rms_deg = json(at, "replay.json")["joints"][0]["rms_smoother"].as_f64().unwrap();
    assert!(rms_deg < 0.02, "{rms_deg}");
}

#[test]
fn replay_says_what_it_leaves_out() {
    let folder = folder();
    let at = folder.path();
    step(at, "raven-identify", chain::identify, "--add-effect stereo-desync=0.01 --robot {robot.yaml} -o {new.yaml}");
    step(at, "raven-capture", chain::capture, "simulate --motion rich --duration 5 -o {log.mcap}");
    let typed = chain::typed(at, "raven-replay", "{log.mcap} --robot {new.yaml} --json {replay.json}");
    let mut printed = Vec::new();
    chain::replay(&typed, &mut printed).unwrap();
    let printed = String::from_utf8(printed).unwrap();
    assert!(printed.contains("stereo-desync is in the robot file's list of effects and left out here"), "{printed}");
    assert_eq!(json(at, "replay.json")["left_out"][0], "stereo-desync");
}
