//! What users do by accident: every program answers with one sentence that names the file, and leaves nothing half written.

use std::path::Path;
use std::sync::LazyLock;

use clap::Parser;
use raven::robot::nominal;
use raven_tests::{Run, typed};

/// A short session without images and its files, simulated once.
static SESSION: LazyLock<tempfile::TempDir> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    std::fs::write(at.join("robot.yaml"), nominal::GOLD_YAML).unwrap();
    let simulate = [
        "simulate",
        "--robot",
        "{robot.yaml}",
        "--motion",
        "sinusoid",
        "--duration",
        "3",
        "--cameras-out",
        "{cameras.yaml}",
        "-o",
        "{log.mcap}",
    ];
    typed(at, raven_capture::run, &simulate).unwrap();
    let log = std::fs::read(at.join("log.mcap")).unwrap();
    std::fs::write(at.join("cut.mcap"), &log[..log.len() * 2 / 3]).unwrap();
    std::fs::write(at.join("text.mcap"), "this is no log").unwrap();
    std::fs::write(at.join("empty.mcap"), "").unwrap();
    let millimetres = nominal::GOLD_YAML.replace("link_pulley_radius: 63.095e-3", "link_pulley_radius: 63.095");
    std::fs::write(at.join("millimetres.yaml"), millimetres).unwrap();
    std::fs::write(at.join("green.yaml"), nominal::GOLD_YAML.replace("arm: gold", "arm: green")).unwrap();
    std::fs::write(at.join("key.yaml"), nominal::GOLD_YAML.replace("hard_stop: 0.0\n", "hardstop: 0.0\n")).unwrap();
    folder
});

/// Runs a program that must fail, checks what it says, and that it left nothing behind.
fn fails<A: Parser>(run: Run<A>, arguments: &[&str], must_say: &[&str]) {
    let at = SESSION.path();
    let files = |at: &Path| {
        let mut names: Vec<_> = std::fs::read_dir(at).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        names.sort();
        names
    };
    let before = files(at);
    let said = typed(at, run, arguments).expect_err(&format!("{arguments:?} should fail"));
    for words in must_say {
        assert!(said.contains(words), "{arguments:?} says `{said}`, not `{words}`");
    }
    assert!(!said.trim_end().contains('\n') || said.contains("Usage"), "{arguments:?} says more than a sentence: {said}");
    assert_eq!(files(at), before, "{arguments:?} left a file behind");
}

/// The programs that take a log and a robot file, each with the rest of its arguments.
fn each_program(log: &str, robot: &str, must_say: &[&str]) {
    fails(raven_track::run, &[log, "--robot", robot, "--cameras", "{cameras.yaml}", "-o", "{never.mcap}"], must_say);
    fails(raven_identify::run, &[log, "--robot", robot, "--cameras", "{cameras.yaml}", "-o", "{never.yaml}"], must_say);
    fails(raven_replay::run, &[log, "--robot", robot, "-o", "{never.mcap}"], must_say);
    fails(raven_diagnose::run, &[log, "--robot", robot, "--json", "{never.json}"], must_say);
}

#[test]
fn a_missing_log() {
    each_program("{nowhere.mcap}", "{robot.yaml}", &["nowhere.mcap", "cannot read"]);
    fails(raven_capture::run, &["check", "{nowhere.mcap}"], &["nowhere.mcap"]);
    fails(
        raven_calibrate::run,
        &["cameras", "{nowhere.mcap}", "--board", "9x6", "--square", "0.012", "-o", "{never.yaml}"],
        &["nowhere.mcap"],
    );
}

#[test]
fn a_missing_robot_file() {
    each_program("{log.mcap}", "{nobody.yaml}", &["nobody.yaml", "cannot read"]);
}

#[test]
fn a_log_cut_off() {
    each_program("{cut.mcap}", "{robot.yaml}", &["cut.mcap", "recover"]);
}

#[test]
fn a_file_that_is_no_log() {
    each_program("{text.mcap}", "{robot.yaml}", &["text.mcap"]);
    each_program("{empty.mcap}", "{robot.yaml}", &["empty.mcap"]);
}

#[test]
fn a_radius_in_millimetres() {
    each_program("{log.mcap}", "{millimetres.yaml}", &["millimetres.yaml", "joints.shoulder.link_pulley_radius is 63.095", "millimetres?"]);
}

#[test]
fn the_robot_file_of_the_other_arm() {
    let says = ["log.mcap", "the gold arm's, in `frame0_gold`", "the green arm's"];
    let fixed = ["{log.mcap}", "--robot", "{green.yaml}"];
    fails(raven_identify::run, &[&fixed[..], &["--cameras", "{cameras.yaml}", "-o", "{never.yaml}"]].concat(), &says);
    fails(raven_replay::run, &[&fixed[..], &["-o", "{never.mcap}"]].concat(), &says);
    fails(raven_diagnose::run, &fixed, &says);
}

#[test]
fn a_key_that_is_not_in_the_format() {
    each_program("{log.mcap}", "{key.yaml}", &["key.yaml", "hardstop", "line"]);
}

#[test]
fn a_log_without_the_needed_topic() {
    fails(
        raven_track::run,
        &["{log.mcap}", "--robot", "{robot.yaml}", "--cameras", "{cameras.yaml}", "-o", "{never.mcap}"],
        &["log.mcap", "image"],
    );
    fails(raven_calibrate::run, &["cameras", "{log.mcap}", "--board", "9x6", "--square", "0.012", "-o", "{never.yaml}"], &["log.mcap"]);
}

#[test]
fn a_log_that_cannot_carry_a_diagnosis() {
    let (_, said) =
        typed(SESSION.path(), raven_diagnose::run, &["{log.mcap}", "--robot", "{robot.yaml}", "--cameras", "{cameras.yaml}"]).unwrap();
    assert!(said.contains("No diagnosis: ") && said.contains("at least 5 s are needed") && !said.contains("Verdict"), "{said}");
}

#[test]
fn an_empty_selection() {
    let parameters = ["{log.mcap}", "--robot", "{robot.yaml}", "--cameras", "{cameras.yaml}", "--parameters", "", "-o", "{never.yaml}"];
    fails(raven_identify::run, &parameters, &["parameter"]);
    let unknown = ["{log.mcap}", "--robot", "{robot.yaml}", "--cameras", "{cameras.yaml}", "--parameters", "r_l9", "-o", "{never.yaml}"];
    fails(raven_identify::run, &unknown, &["r_l9"]);
}

#[test]
fn cameras_of_another_size_than_the_log_was_tracked_with() {
    let cameras = std::fs::read_to_string(SESSION.path().join("cameras.yaml")).unwrap();
    let larger = cameras.replace("image_width: 640", "image_width: 1280");
    assert_ne!(larger, cameras);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("larger.yaml");
    std::fs::write(&path, larger).unwrap();
    let arguments = ["{log.mcap}", "--robot", "{robot.yaml}", "--cameras", path.to_str().unwrap()];
    let must_say = ["larger.yaml", "left.image_width", "1280 x 480", "log.mcap", "640 x 480", "track it anew"];
    fails(raven_replay::run, &arguments, &must_say);
    fails(raven_identify::run, &arguments, &must_say);
    fails(raven_diagnose::run, &arguments, &must_say);
}

#[test]
fn an_output_that_would_be_lost_is_refused_before_anything_is_computed() {
    let [log, others] = ["{nowhere.mcap}", "{text.mcap}"];
    fails(raven_replay::run, &[log, "--robot", "{robot.yaml}", "-o", others], &["text.mcap", "would be lost"]);
    let track = [log, "--robot", "{robot.yaml}", "--cameras", "{cameras.yaml}", "-o", others];
    fails(raven_track::run, &track, &["text.mcap", "would be lost"]);
}

#[test]
fn what_is_read_is_never_written_over() {
    let (robot, cameras) = (["--robot", "{robot.yaml}"], ["--cameras", "{cameras.yaml}"]);
    let both = [robot, cameras].concat();
    for onto in ["{robot.yaml}", "{cameras.yaml}"] {
        for option in ["--json", "--html"] {
            let said = [option, "written over", "yaml"];
            let tail = ["-o", "{never.mcap}", option, onto];
            fails(raven_track::run, &[["{log.mcap}"].as_slice(), &both, &tail].concat(), &said);
            fails(raven_diagnose::run, &[["{log.mcap}", "--gap-only"].as_slice(), &both, &tail[2..]].concat(), &said);
        }
        for option in ["-o", "--json", "--plot"] {
            let arguments = [["{log.mcap}"].as_slice(), &both, &[option, onto]].concat();
            fails(raven_replay::run, &arguments, &[option, "written over"]);
            fails(raven_identify::run, &arguments, &[option, "written over"]);
        }
        let added = ["--add-effect", "pulley-radius:shoulder=-0.05", "-o", onto];
        fails(raven_identify::run, &[both.as_slice(), &added].concat(), &["-o", "written over"]);
        let registered = [["register", "{log.mcap}"].as_slice(), &both, &["--json", onto]].concat();
        fails(raven_calibrate::run, &registered, &["--json", "written over"]);
    }
    fails(
        raven_track::run,
        &[["colour", "{log.mcap}"].as_slice(), &cameras, &["--json", "{cameras.yaml}"]].concat(),
        &["--json", "written over"],
    );
    fails(raven_calibrate::run, &[["register", "{log.mcap}"].as_slice(), &both, &["-o", "{robot.yaml}"]].concat(), &["-o", "written over"]);
    fails(raven_identify::run, &[["excite"].as_slice(), &robot, &["-o", "{robot.yaml}"]].concat(), &["-o", "written over"]);
    fails(raven_identify::run, &["export", "{robot.yaml}", "--format", "defines", "-o", "{robot.yaml}"], &["-o", "written over"]);
    for option in ["--truth", "--cameras-out"] {
        let simulated = ["simulate", "--motion", "hardstop", "--duration", "1", "-o", "{never.mcap}", option, "{robot.yaml}"];
        fails(raven_capture::run, &[simulated.as_slice(), &robot].concat(), &[option, "written over"]);
    }
    fails(raven_capture::run, &["cut", "{log.mcap}", "-o", "{log.mcap}"], &["-o", "written over"]);
    fails(raven_capture::run, &["cut", "{log.mcap}", "-o", "{never.mcap}", "--json", "{log.mcap}"], &["--json", "written over"]);
    fails(raven_diagnose::check::run, &[["--verdicts", "{robot.yaml}"], robot].concat(), &["--verdicts", "written over"]);
}
