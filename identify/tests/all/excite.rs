//! The proposed motion as a file, and that it does what it is for.

use std::path::Path;

use clap::Parser;
use raven::robot::{Robot, nominal};
use raven_identify::{Args, run};

fn excite(folder: &Path, more: &[&str]) -> String {
    excite_arm(&nominal::gold(), folder, more)
}

fn excite_arm(robot_file: &Robot, folder: &Path, more: &[&str]) -> String {
    let robot = folder.join("robot.yaml");
    robot_file.write(&robot).unwrap();
    let line = ["raven-identify", "excite", "--duration", "12", "--robot"].iter().map(|s| (*s).into());
    let line = line.chain([robot.into_os_string()]).chain(more.iter().map(|s| (*s).into()));
    let mut out = Vec::new();
    run(Args::try_parse_from(line).unwrap(), &mut out).unwrap();
    String::from_utf8(out).unwrap()
}

/// Expected ratios of a parameter: sinusoid, proposal, fast cameras, joint encoders.
fn ratios(report: &str, name: &str) -> Vec<f64> {
    let line = report.lines().find(|l| l.starts_with(&format!("{name} "))).unwrap();
    line.split_whitespace().skip(1).take(4).map(|v| v.parse().unwrap()).collect()
}

#[test]
fn the_proposal_knows_more_of_damping_than_the_sinusoid_does() {
    let folder = tempfile::tempdir().unwrap();
    let csv = folder.path().join("motion.csv");
    let report = excite(folder.path(), &["--parameters", "k_e2,b_e1,b_e2", "-o", csv.to_str().unwrap()]);
    let [sinusoid, proposal, faster, encoders] = ratios(&report, "b_e2")[..] else { panic!("{report}") };
    assert!(sinusoid > 0.8 && proposal < 0.5 && faster < proposal && encoders < 0.05, "{report}");
    assert!(report.contains("b_e1 is not identified by cameras of 15 Hz"), "{report}");

    let text = std::fs::read_to_string(&csv).unwrap();
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("time_s,shoulder_rad,elbow_rad,insertion_m"));
    let limits = nominal::gold().arm().unwrap().limits;
    let rows: Vec<Vec<f64>> = lines.map(|l| l.split(',').map(|v| v.parse().unwrap()).collect()).collect();
    for (i, row) in rows.iter().enumerate() {
        assert!((row[0] - i as f64 * 1e-3).abs() < 1e-9);
        for (j, [low, high]) in limits.iter().enumerate() {
            assert!((*low..=*high).contains(&row[j + 1]), "joint {j} at {} after {} s", row[j + 1], row[0]);
        }
    }
    assert!((rows.last().unwrap()[0] - 12.0).abs() < 0.2, "12 s were asked for");
}

#[test]
fn the_table_has_every_unknown_and_motion() {
    let folder = tempfile::tempdir().unwrap();
    let table = excite(folder.path(), &["--parameters", "r_l1,b_e1", "--table"]);
    assert!(table.starts_with("| parameter | unit | sinusoid | fls | rich | proposal |"), "{table}");
    assert_eq!(table.lines().count(), 2 + 2 + 6, "{table}");
    assert!(table.contains("| `b_e1` | % |"), "{table}");
}

#[test]
fn a_script_reads_what_people_do() {
    let folder = tempfile::tempdir().unwrap();
    let json = folder.path().join("result.json");
    let arguments = ["--parameters", "k_e2,b_e1", "--json"];
    let report = excite(folder.path(), &[&arguments[..], &[json.to_str().unwrap()]].concat());
    let text = std::fs::read_to_string(&json).unwrap();
    let result: serde_json::Value = serde_json::from_str(&text).unwrap();
    let parameters = result["parameters"].as_array().unwrap();
    assert_eq!(parameters.len(), 8);
    for parameter in parameters {
        let read = ratios(&report, parameter["name"].as_str().unwrap());
        for (key, read) in ["sinusoid", "proposal", "fast_cameras", "joint_encoders"].into_iter().zip(read) {
            assert!((parameter[key].as_f64().unwrap() - read).abs() < 5.1e-4, "{key} of {parameter}: {report}");
        }
        assert_eq!(parameter["identified"].as_bool(), Some(parameter["proposal"].as_f64().unwrap() <= 0.5));
    }
    let [stiffness, damping] = [0, 1].map(|k| &parameters[k]);
    assert_eq!((stiffness["name"].as_str(), stiffness["joint"].as_str()), (Some("k_e2"), Some("elbow")));
    assert!(
        stiffness["repetitions"].is_null() && report.contains(&format!("it takes {} repetitions", damping["repetitions"])),
        "{damping}"
    );
    assert_eq!(result["pieces"].as_array().unwrap().len(), 1);
    assert!((result["duration_s"].as_f64().unwrap() - 12.0).abs() < 0.2 && result["camera_hz"].as_f64() == Some(15.0));

    assert_eq!(excite(folder.path(), &[&arguments[..], &["-"]].concat()), text);
}

/// A tool that is longer and an insertion that stops earlier are the same: what is known of the stop is what is known of their sum and of the tool.
#[test]
fn nothing_is_expected_to_be_known_better_than_what_stands_in_for_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut robot = nominal::gold();
    let mut known_mm = |tool_m: f64| -> f64 {
        robot.tolerances.tool_length_m = tool_m;
        let table = excite_arm(&robot, folder.path(), &["--parameters", "r_l3,offset_3", "--table"]);
        let line = table.lines().find(|line| line.starts_with("| `offset_3` | mm |")).unwrap();
        line.split('|').nth(3).unwrap().trim().parse().unwrap()
    };
    let [alone, beside] = [1e-7, 5e-4].map(&mut known_mm);
    assert!((0.1..1.0).contains(&alone), "{alone}");
    assert!((beside - alone.hypot(0.5)).abs() < 0.01 * beside, "{beside} beside {alone}");
}
