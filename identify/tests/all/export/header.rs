//! The controller's header, compiled by a C compiler.

use std::process::{Command, Stdio};

use approx::assert_relative_eq;

use super::{BASE, Folder, identified};

/// The part of the controller's constants that the header touches: names and values as in `defines.h`, gold standing for green.
const CONTROLLER: &str = "#define CABLE_RADIUS_1050 (1.19 / 2.0)\n#define PARTIAL_PULLEY_LINK1_RADIUS (62.5 + CABLE_RADIUS_1050)\n\
#define PARTIAL_PULLEY_LINK2_RADIUS (40.85 + CABLE_RADIUS_1050)\n#define LARGE (7.82 + CABLE_RADIUS_1050)\n\
#define SMALL (5.60 + CABLE_RADIUS_1050)\n#define SHOULDER_TR_GREEN_ARM (float)(PARTIAL_PULLEY_LINK1_RADIUS / 5.675 * 12.25)\n\
#define ELBOW_TR_GREEN_ARM (float)(PARTIAL_PULLEY_LINK2_RADIUS / SMALL * LARGE / 5.675 * 12.25)\n\
#define Z_INS_TR_GREEN_ARM (float)(1000.0 / 5.675 * 12.25)\n#define SHOULDER_TR_GOLD_ARM (SHOULDER_TR_GREEN_ARM)\n\
#define ELBOW_TR_GOLD_ARM (ELBOW_TR_GREEN_ARM)\n#define Z_INS_TR_GOLD_ARM (Z_INS_TR_GREEN_ARM)\n\
#define SHOULDER_TR_BLUE_ARM (SHOULDER_TR_GREEN_ARM)\n\
#define SHOULDER_MAX_ANGLE 0.0\n#define ELBOW_MAX_ANGLE 2.399827721\n#define CABLE_COUPLING_01 (float)(0.14545)\n";

/// The values of macros after the controller's header and, last, the calibrated one.
fn compiled(folder: &Folder, header: &str, macros: &[&str]) -> Vec<f64> {
    let prints: String = macros.iter().map(|name| format!("printf(\"%.9g\\n\", (double)({name}));")).collect();
    let source = format!("#include <stdio.h>\n{CONTROLLER}#include \"{header}\"\nint main(void) {{ {prints} return 0; }}\n");
    std::fs::write(folder.path("main.c"), source).unwrap();
    let program = folder.path("main");
    let output = Command::new("gcc").args(["-Wall", "-Werror", "-o"]).arg(&program).arg(folder.path("main.c")).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let output = Command::new(program).output().unwrap();
    String::from_utf8(output.stdout).unwrap().lines().map(|line| line.parse().unwrap()).collect()
}

fn gcc_is_missing() -> bool {
    let missing = Command::new("gcc").arg("--version").stdout(Stdio::null()).status().is_err();
    if missing {
        eprintln!("SKIPPED: gcc is not on PATH.");
    }
    missing
}

#[test]
fn the_header_compiles_and_changes_one_arm() {
    if gcc_is_missing() {
        return;
    }
    for (arm, own, other) in [("gold", "GOLD", "GREEN"), ("green", "GREEN", "GOLD")] {
        let robot = identified(arm);
        let folder = Folder::new(&robot);
        let header = folder.export("defines", None, "defines_calibrated.h").unwrap();
        assert!(header.contains("was PARTIAL_PULLEY_LINK1_RADIUS (62.5000 + CABLE_RADIUS_1050)"), "{header}");
        let ratio = |joint: &str, arm: &str| format!("{joint}_TR_{arm}_ARM");
        let names = [
            "PARTIAL_PULLEY_LINK1_RADIUS".to_owned(),
            "PARTIAL_PULLEY_LINK2_RADIUS / SMALL * LARGE".to_owned(),
            ratio("SHOULDER", own),
            ratio("ELBOW", own),
            ratio("Z_INS", own),
            ratio("SHOULDER", other),
            ratio("ELBOW", other),
            ratio("Z_INS", other),
            ratio("SHOULDER", "BLUE"),
            "ELBOW_MAX_ANGLE * 2".to_owned(),
            "SHOULDER_MAX_ANGLE".to_owned(),
            "CABLE_COUPLING_01".to_owned(),
        ];
        let values = compiled(&folder, "defines_calibrated.h", &names.each_ref().map(String::as_str));
        let after = robot.arm().unwrap().transmission.ratio;
        let before = robot.before_calibration().arm().unwrap().transmission.ratio;
        let expected = [59.0, 57.0, after[0], after[1], after[2], before[0], before[1], before[2], before[0], 4.82, 0.0, 0.15];
        for ((name, value), expected) in names.iter().zip(&values).zip(expected) {
            assert_relative_eq!(*value, expected, max_relative = 1e-6, epsilon = 1e-9);
            assert!(value.is_finite(), "{name}");
        }
    }
}

#[test]
fn the_header_compiles_alone() {
    if gcc_is_missing() {
        return;
    }
    let folder = Folder::new(&identified("gold"));
    folder.export("defines", None, "defines_calibrated.h").unwrap();
    let header = folder.path("defines_calibrated.h");
    let output = Command::new("gcc").args(["-Wall", "-Werror", "-fsyntax-only", "-x", "c"]).arg(header).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn the_green_arm_has_its_own_names() {
    let folder = Folder::new(&identified("green"));
    std::fs::write(folder.path("r2params.yaml"), BASE.replace("gold", "green")).unwrap();
    let text = folder.export("r2params", Some("r2params.yaml"), "new.yaml").unwrap();
    assert!(["\ntr_green: [", "\ncable_coupling_green: [", "\nmax_position_green: ["].iter().all(|key| text.contains(key)), "{text}");
    assert!(folder.export("rosparam", None, "neutral.yaml").unwrap().contains("  green:\n"));
}
