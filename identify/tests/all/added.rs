//! Effects that a report names, put into the robot file from the command line.

use std::path::{Path, PathBuf};

use approx::assert_relative_eq;
use clap::Parser;
use raven::robot::{Robot, nominal};
use raven_identify::{Args, run};
use serde_json::json;

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        nominal::gold().write(&folder.path("robot.yaml")).unwrap();
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// `raven-identify` with `{file}` in the folder.
    fn identify(&self, arguments: &str) -> Result<String, String> {
        let word = |word: &str| match word.strip_prefix('{').and_then(|word| word.strip_suffix('}')) {
            Some(name) => self.path(name).display().to_string(),
            None => word.to_owned(),
        };
        let typed = std::iter::once("raven-identify".to_owned()).chain(arguments.split_whitespace().map(word));
        let mut out = Vec::new();
        run(Args::try_parse_from(typed).map_err(|e| e.to_string())?, &mut out).map_err(|e| e.to_string())?;
        Ok(String::from_utf8(out).unwrap())
    }

    fn report(&self, effects: &serde_json::Value) {
        let recordings = ["logs/rich.mcap"];
        let report =
            json!({"format": "raven-diagnosis/1", "verdict": "explained", "effects": effects, "gap": [], "recordings": recordings});
        std::fs::write(self.path("report.json"), report.to_string()).unwrap();
    }

    fn robot(&self, name: &str) -> Robot {
        Robot::read(&self.path(name)).unwrap()
    }
}

fn blamed(id: &str, joint: Option<&str>, parameters: &[(&str, f64, f64, &str)]) -> serde_json::Value {
    let parameter = |&(name, value, std, unit): &(&str, f64, f64, &str)| json!({"name": name, "value": value, "std": std, "unit": unit});
    let parameters: Vec<_> = parameters.iter().map(parameter).collect();
    json!({"id": id, "joint": joint, "probability": 0.99, "evidence_nats": 800.0, "parameters": parameters, "ties": []})
}

#[test]
fn an_effect_is_added_once() {
    let folder = Folder::new();
    let twice = "--add-effect pulley-radius:elbow=0.01 --add-effect pulley-radius:elbow=0.01 --robot {robot.yaml} -o {new.yaml}";
    let said = folder.identify(twice).unwrap_err();
    assert!(said.contains("--add-effect pulley-radius:elbow is given twice"), "{said}");
    assert!(!folder.path("new.yaml").exists());
}

#[test]
fn a_report_is_added_once_and_to_the_file_that_it_is_about() {
    let folder = Folder::new();
    let sha256 = raven::files::sha256(&folder.path("robot.yaml")).unwrap();
    let report = |robot: &str, effects_of: &str| {
        let effects = [blamed("pulley-radius", Some("shoulder"), &[("relative_error", -0.05, 4e-4, "1")])];
        let against = (!effects_of.is_empty()).then(|| json!({"effects_of": effects_of}));
        let robot = json!({"file": robot, "sha256": sha256});
        let report =
            json!({"format": "raven-diagnosis/1", "effects": effects, "recordings": ["rich.mcap"], "against": against, "robot": robot});
        std::fs::write(folder.path("report.json"), report.to_string()).unwrap();
    };
    let typed = |robot: &str, new: &str| format!("--add-effect pulley-radius --diagnosis {{report.json}} --robot {{{robot}}} -o {{{new}}}");
    report("robot.yaml", "simulation");
    let said = folder.identify(&typed("robot.yaml", "new.yaml")).unwrap_err();
    assert!(said.contains("report.json: against.effects_of is `simulation`"), "{said}");
    for effects_of in ["", "robot"] {
        report("robot.yaml", effects_of);
        folder.identify(&typed("robot.yaml", "new.yaml")).unwrap();
        let said = folder.identify(&typed("new.yaml", "newer.yaml")).unwrap_err();
        assert!(said.contains("new.yaml: pulley-radius:shoulder is in it already") && said.contains("against robot.yaml"), "{said}");
    }
    assert!(!folder.path("newer.yaml").exists());
}

#[test]
fn effects_are_added_to_arms() {
    let folder = Folder::new();
    let bench = concat!(env!("CARGO_MANIFEST_DIR"), "/../diagnose/tests/slide.yaml");
    let said = folder.identify(&format!("--add-effect motor-coulomb-friction:carriage=2 --robot {bench} -o {{new.yaml}}")).unwrap_err();
    assert!(said.contains("slide.yaml: it is a bench"), "{said}");
}

#[test]
fn values_come_from_the_report() {
    let folder = Folder::new();
    folder.report(&json!([
        blamed("pulley-radius", Some("shoulder"), &[("relative_error", -0.05, 4e-4, "1")]),
        blamed("joint-offset", Some("elbow"), &[("offset", 1.0, 0.1, "deg")]),
        blamed("creep", Some("elbow"), &[("ratio", 2.5, 0.2, "1"), ("time", 30.0, 5.0, "s"), ("fresh_part", 0.8, 0.1, "1")]),
    ]));
    let typed = "--add-effect pulley-radius --add-effect joint-offset:elbow --add-effect creep --diagnosis {report.json} \
                 --robot {robot.yaml} -o {new.yaml}";
    folder.identify(typed).unwrap();
    let (old, new) = (nominal::gold(), folder.robot("new.yaml"));
    let radius_m = old.joints[0].link_pulley_radius;
    assert_relative_eq!(new.joints[0].link_pulley_radius, 0.95 * radius_m, epsilon = 1e-12);
    assert_relative_eq!(new.joints[1].hard_stop, old.joints[1].hard_stop + 1_f64.to_radians(), epsilon = 1e-12);
    assert_eq!((new.effects[0].id.as_str(), new.effects[0].joint.as_deref()), ("creep", Some("elbow")));
    // What had crept before the recording is not of the robot.
    assert_eq!((new.effects[0].values["time"], new.effects[0].values["fresh_part"]), (30.0, 0.0));
    // A deviation of the effect's number is one of the file's.
    let radius = new.calibration.iter().find(|line| line.key == "joints.shoulder.link_pulley_radius").unwrap();
    assert_relative_eq!(radius.std, 4e-4 * radius_m, epsilon = 1e-9);
    // It was found among radii that are off by 4 %.
    assert_relative_eq!(radius.prior_std, 0.04 * radius_m, epsilon = 1e-9);
    assert!(radius.identified && radius.logs == ["rich.mcap"] && radius.sha256.len() == 1, "{radius:?}");
    // What the controller believed is what the old file says.
    let believed = |robot: &Robot| robot.before_calibration().arm().unwrap().transmission;
    assert_eq!(believed(&new), believed(&old));
    assert_eq!(new.arm().unwrap().transmission.motor_at_hard_stop, old.arm().unwrap().transmission.motor_at_hard_stop);
}

#[test]
fn what_the_report_does_not_say_is_a_sentence() {
    let folder = Folder::new();
    let ask = |effect: &str| {
        folder.identify(&format!("--add-effect {effect} --diagnosis {{report.json}} --robot {{robot.yaml}} -o {{new.yaml}}")).unwrap_err()
    };
    folder.report(&json!([]));
    assert!(ask("creep").contains("blames nothing"));
    let slip = |joint| blamed("cable-slip", Some(joint), &[("force", 9.0, 1.0, "N"), ("fraction", 1.0, 0.1, "furlong")]);
    folder.report(&json!([slip("elbow"), slip("shoulder"), blamed("creep", Some("elbow"), &[("time", 30.0, 5.0, "s")])]));
    for (effect, about) in [
        ("payload", "payload is not among its effects, which are cable-slip:elbow, cable-slip:shoulder, creep:elbow"),
        ("cable-slip", "at several places; write one of cable-slip:elbow, cable-slip:shoulder"),
        ("cable-slip:elbow", "`fraction` is in furlong, expected 1"),
        ("creep", "no parameter `ratio`"),
    ] {
        let error = ask(effect);
        assert!(error.contains(about) && error.contains("report.json"), "{error}");
    }
    std::fs::write(folder.path("report.json"), r#"{"format": "raven-diagnosis/2"}"#).unwrap();
    assert!(ask("creep").contains("`raven-diagnosis/2`"));
    assert!(!folder.path("new.yaml").exists());
}

#[test]
fn a_number_beyond_the_file_is_a_sentence_and_no_file() {
    let folder = Folder::new();
    let error = folder.identify("--add-effect payload=7 --add-effect stereo-scale=0.01 --robot {robot.yaml} -o {new.yaml}").unwrap_err();
    assert!(error.contains("stereo-scale belongs to the cameras"), "{error}");
    let error = folder.identify("--add-effect joint-offset:insertion=40 --robot {robot.yaml} -o {new.yaml}").unwrap_err();
    assert!(error.contains("`offset` is 40") && error.contains(" m. Is it in SI units?"), "{error}");
    assert!(!folder.path("new.yaml").exists());
}

/// An exported file carries the numbers that were diagnosed, and says that the list stays behind.
#[test]
fn what_a_report_measured_is_exported_and_what_was_typed_is_not() {
    let folder = Folder::new();
    let export = || folder.identify("export {new.yaml} --format rosparam -o {rosparam.yaml}");
    folder.report(&json!([
        blamed("pulley-radius", Some("shoulder"), &[("relative_error", -0.05, 4e-4, "1")]),
        // The shape of its loop is as usual.
        blamed("hysteresis", Some("elbow"), &[("half_loop", 0.01, 1e-3, "rad")]),
    ]));
    let typed = "--add-effect pulley-radius --add-effect hysteresis --add-effect missed-counts:elbow=1000,0.5 --diagnosis {report.json} \
                 --robot {robot.yaml} -o {new.yaml}";
    folder.identify(typed).unwrap();
    export().unwrap();
    let text = std::fs::read_to_string(Path::new(&folder.path("rosparam.yaml"))).unwrap();
    assert!(text.contains("link_pulley_radius: 0.05994"), "{text}");
    folder.identify("--add-effect pulley-radius:shoulder=-0.05 --robot {robot.yaml} -o {new.yaml}").unwrap();
    let error = export().unwrap_err();
    assert!(error.contains("joints.shoulder.link_pulley_radius") && error.contains("typed by hand and not identified"), "{error}");
}

/// What counts is how wide the diagnosis looked, and not what the drawing is good for.
#[test]
fn what_the_diagnosis_determined_is_exported_and_what_it_did_not_is_refused() {
    let folder = Folder::new();
    let export = |std: f64| {
        folder.report(&json!([blamed("pulley-radius", Some("shoulder"), &[("relative_error", -0.0501, std, "1")])]));
        folder.identify("--add-effect pulley-radius --diagnosis {report.json} --robot {robot.yaml} -o {new.yaml}").unwrap();
        folder.identify("export {new.yaml} --format defines -o {new.h}")?;
        Ok::<_, String>(std::fs::read_to_string(folder.path("new.h")).unwrap())
    };
    let header = export(0.0022).unwrap();
    assert!(header.contains(" * Logs:\n *   rich.mcap\n"), "{header}");
    assert!(header.contains("r_l1: 0.0599") && header.contains(" +- 0.00013"), "{header}");
    let error = export(0.03).unwrap_err();
    assert!(
        error.contains("joints.shoulder.link_pulley_radius") && error.contains("was not identified (75 % of its deviation is left)"),
        "{error}"
    );
}

#[test]
fn what_a_diagnosis_doubts_goes_with_the_number_to_the_controller() {
    let folder = Folder::new();
    let mut offset = blamed("joint-offset", Some("insertion"), &[("offset", 0.004, 0.0003, "m")]);
    let add = "--add-effect joint-offset --diagnosis {report.json} --robot {robot.yaml} -o {new.yaml}";
    let exported = |effect: &serde_json::Value| {
        folder.report(&json!([effect]));
        folder.identify(add).unwrap();
        ["defines", "rosparam"].map(|format| {
            folder.identify(&format!("export {{new.yaml}} --format {format} -o {{new}}")).unwrap();
            std::fs::read_to_string(folder.path("new")).unwrap()
        })
    };
    assert!(exported(&offset).iter().all(|text| !text.contains("diagnosis gives")));
    offset["probability"] = json!(0.64);
    offset["ties"] = json!([{"id": "tool-length", "joint": null, "exact": true}, {"id": "backlash", "joint": "insertion", "exact": false}]);
    let doubt = "the diagnosis gives it a probability of 0.64, no recording of motors and tip tells it from tool-length";
    for text in exported(&offset) {
        assert!(text.contains(&format!("joints_insertion_hard_stop: {doubt}\n")), "{text}");
    }
}

/// A factor is known to a part of itself, however large it is.
#[test]
fn a_factor_is_held_against_what_it_was_looked_for_as() {
    let folder = Folder::new();
    for (factor, std, is_identified) in [(0.2, 0.05, true), (0.2, 0.25, false), (4.0, 1.0, true)] {
        folder.report(&json!([blamed("cable-stretch", Some("elbow"), &[("factor", factor, std, "1")])]));
        folder.identify("--add-effect cable-stretch --diagnosis {report.json} --robot {robot.yaml} -o {new.yaml}").unwrap();
        let robot = folder.robot("new.yaml");
        let line = robot.calibration.iter().find(|line| line.key == "joints.elbow.cable.stiffness").unwrap();
        assert_eq!(line.identified, is_identified, "{line:?}");
        assert_relative_eq!(line.std, 88_000.0 * std, max_relative = 1e-2);
        assert_relative_eq!(line.prior_std, 88_000.0 * factor * 1.4, max_relative = 1e-2);
    }
}

/// A coupling that the file has no number for is one of 0.
#[test]
fn a_coupling_that_the_file_lacks_is_exported_if_it_was_measured() {
    let folder = Folder::new();
    let mut old = nominal::gold();
    old.cable_coupling.retain(|coupling| coupling.from != "elbow");
    old.write(&folder.path("robot.yaml")).unwrap();
    let added = |values: &str| {
        folder.identify(&format!("--add-effect cable-coupling:elbow->insertion{values} --robot {{robot.yaml}} -o {{new.yaml}}"))
    };
    let export = || folder.identify("export {new.yaml} --format defines -o {new.h}");

    let table = added("=0.004").unwrap();
    assert!(table.contains("cable_coupling.elbow.insertion"), "{table}");
    let error = export().unwrap_err();
    assert!(error.contains("cable_coupling.elbow.insertion") && error.contains("typed by hand and not identified"), "{error}");

    folder.report(&json!([blamed("cable-coupling", Some("elbow->insertion"), &[("coefficient", 0.004, 1e-4, "m/rad")])]));
    added(" --diagnosis {report.json}").unwrap();
    let new = folder.robot("new.yaml");
    let line = &new.calibration[0];
    assert_eq!((line.key.as_str(), line.value, line.prior, line.identified), ("cable_coupling.elbow.insertion", 0.004, 0.0, true));
    assert_eq!(line.unit, "m/rad");
    assert_eq!(new.before_calibration().cable_coupling_matrix().unwrap(), old.cable_coupling_matrix().unwrap());
    export().unwrap();
    let header = std::fs::read_to_string(folder.path("new.h")).unwrap();
    assert!(header.contains("/* coupling_23: 0.004 +- "), "{header}");
    assert!(header.contains("#define CABLE_COUPLING_12 (float)(0.004)"), "{header}");
}
