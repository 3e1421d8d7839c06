//! What the controller loads, loaded: by `rosparam` against a ROS master, and by a C compiler.

use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use approx::assert_relative_eq;
use clap::Parser;
use raven::camera::Quality;
use raven::cli::Outcome;
use raven::robot::{Provenance, Robot, nominal};
use raven_identify::identified::{Finding, identified as with_findings};
use raven_identify::parameters::{ALL, Selection};
use raven_identify::{Args, priors, run};

/// A lab's own file: gains in both styles, comments, odd spacing.
const BASE: &str = "# our gains\n#   order matters\ngains_gold_kp:\n- 0.300\n- 0.300\n- 0.150\n- 0.00\n- 0.09\n- 0.05\n- 0.05\n- 0.05\n\n\
                    gains_gold_kd: [.008, .008, .012, .00, .001, 0.0, 0.0, 0.0]   # tuned in spring\n\ngains_gold_ki:\n- 0.00\n- 0.00\n- 0.00\n\
                    - 0.00\n- 0.05\n- 0.05\n- 0.05\n- 0.05\n";

fn provenance(parameter: &str, key: &str, value: f64, prior: f64) -> Provenance {
    let (std, prior_std) = (1e-3 * prior.abs().max(0.01), 0.1 * prior.abs().max(0.01));
    Provenance {
        parameter: parameter.to_owned(),
        key: key.to_owned(),
        unit: "m".to_owned(),
        value,
        std,
        prior,
        prior_std,
        identified: true,
        method: "batch".to_owned(),
        logs: vec!["sinusoid.mcap".to_owned()],
        sha256: vec!["00ff".repeat(16)],
    }
}

/// The paper's 59 mm shoulder, an elbow pulley, a hard stop and a coupling.
fn identified(arm: &str) -> Robot {
    let text = nominal::GOLD_YAML.replace("arm: gold", &format!("arm: {arm}"));
    let mut robot = Robot::parse(Path::new("raven2.yaml"), &text).unwrap();
    change(&mut robot, "r_l1", "joints.shoulder.link_pulley_radius", 0.059);
    change(&mut robot, "r_l2", "joints.elbow.link_pulley_radius", 0.057);
    change(&mut robot, "r_l3", "joints.insertion.link_pulley_radius", 1.01);
    change(&mut robot, "offset_2", "joints.elbow.hard_stop", 2.41);
    change(&mut robot, "coupling_12", "cable_coupling.shoulder.elbow", 0.15);
    robot
}

fn change(robot: &mut Robot, parameter: &str, key: &str, value: f64) {
    let place = robot.value_mut(key).unwrap();
    let prior = std::mem::replace(place, value);
    robot.calibration.push(provenance(parameter, key, value, prior));
}

struct Folder(tempfile::TempDir);

impl Folder {
    fn new(robot: &Robot) -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        robot.write(&folder.path("identified.yaml")).unwrap();
        std::fs::write(folder.path("r2params.yaml"), BASE).unwrap();
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    fn export(&self, format: &str, base: Option<&str>, output: &str) -> Result<String, String> {
        let base: Vec<&str> = base.into_iter().flat_map(|base| ["--base", base]).collect();
        self.run(format, output, &base).map(|_| self.read(output))
    }

    /// What an export with further arguments prints; those with a dot, and `output`, are files of the folder.
    fn run(&self, format: &str, output: &str, more: &[&str]) -> Result<String, String> {
        let inside = |word: &&str| if word.contains('.') { self.path(word).into_os_string() } else { word.into() };
        let line = ["raven-identify", "export", "identified.yaml", "--format", format, "-o"];
        let output = if output == "-" { output.into() } else { self.path(output).into_os_string() };
        let line = line.iter().map(inside).chain([output]).chain(more.iter().map(inside));
        let mut out = Vec::new();
        match run(Args::try_parse_from(line).map_err(|e| e.to_string())?, &mut out) {
            Ok(Outcome::Done) => Ok(String::from_utf8(out).unwrap()),
            Ok(Outcome::DataLost) => Err("data lost".to_owned()),
            Err(error) => Err(error.to_string()),
        }
    }
}

/// A ROS master of our own on a free port, ended with the test.
struct Master {
    process: Child,
    uri: String,
    home: tempfile::TempDir,
}

impl Master {
    /// `None`, loudly, where ROS is not installed.
    fn start() -> Option<Self> {
        if Command::new("rosparam").arg("--help").stdout(Stdio::null()).stderr(Stdio::null()).status().is_err() {
            eprintln!("SKIPPED: rosparam is not on PATH (Debian: python3-rosparam python3-roslaunch python3-rosmaster).");
            return None;
        }
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let home = tempfile::tempdir().unwrap();
        let uri = format!("http://127.0.0.1:{port}");
        let mut command = Command::new("rosmaster");
        command.args(["--core", "-p", &port.to_string()]).stdout(Stdio::null()).stderr(Stdio::null());
        let process = Self::environment(&mut command, &uri, &home).spawn().expect("rosparam is there, so rosmaster should be");
        let master = Self { process, uri, home };
        let deadline = Instant::now() + Duration::from_secs(60);
        while TcpStream::connect(("127.0.0.1", port)).is_err() {
            assert!(Instant::now() < deadline, "the ROS master did not come up");
            std::thread::sleep(Duration::from_millis(50));
        }
        Some(master)
    }

    fn environment<'c>(command: &'c mut Command, uri: &str, home: &tempfile::TempDir) -> &'c mut Command {
        command.env("ROS_MASTER_URI", uri).env("ROS_IP", "127.0.0.1").env("ROS_LOG_DIR", home.path()).env("HOME", home.path())
    }

    fn rosparam(&self, arguments: &[&std::ffi::OsStr]) -> String {
        let output = Self::environment(Command::new("rosparam").args(arguments), &self.uri, &self.home).output().unwrap();
        assert!(output.status.success(), "rosparam {arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }

    fn load(&self, file: &Path) {
        self.rosparam(&["load".as_ref(), file.as_os_str()]);
    }

    fn list(&self, name: &str) -> Vec<f64> {
        let text = self.rosparam(&["get".as_ref(), name.as_ref()]);
        // What the controller casts to double must have come as one: PyYAML prints those with a point.
        assert!(text.lines().filter(|l| !l.trim().is_empty()).all(|l| l.contains('.')), "{name} is no list of doubles: {text}");
        raven::files::parse_yaml(Path::new(name), &text).unwrap()
    }
}

impl Drop for Master {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

#[test]
fn the_parameter_server_takes_what_is_written() {
    let Some(master) = Master::start() else { return };
    let robot = identified("gold");
    let folder = Folder::new(&robot);
    let transmission = robot.arm().unwrap().transmission;

    folder.export("r2params", Some("r2params.yaml"), "new.yaml").unwrap();
    master.load(&folder.path("new.yaml"));
    assert_eq!(master.list("/gains_gold_kp"), [0.3, 0.3, 0.15, 0.0, 0.09, 0.05, 0.05, 0.05]);
    assert_eq!(master.list("/gains_gold_kd"), [0.008, 0.008, 0.012, 0.0, 0.001, 0.0, 0.0, 0.0]);
    let ratio = master.list("/tr_gold");
    assert_eq!((ratio.len(), &ratio[..3], ratio[3]), (8, transmission.ratio.as_slice(), 0.0));
    assert_relative_eq!(ratio[0], 12.25 * 59.0 / 5.675, max_relative = 1e-12);
    let stops = master.list("/max_position_gold");
    assert_eq!((stops.len(), stops[0], stops[1], stops[2], stops[3]), (8, 0.0, 2.41, 0.562, 0.0));
    assert_eq!(master.list("/cable_coupling_gold"), [0.15, 0.0077973826, 0.008077387]);

    folder.export("rosparam", None, "neutral.yaml").unwrap();
    master.load(&folder.path("neutral.yaml"));
    let number = |name: &str| master.list(&format!("/raven_calibration/gold/{name}"));
    assert_eq!(number("cable_coupling"), [0.15, 0.0077973826, 0.008077387]);
    assert_eq!(number("identified/r_l1")[0], 0.059);
    let shoulder = master.rosparam(&["get".as_ref(), "/raven_calibration/gold/shoulder/link_pulley_radius".as_ref()]);
    assert_eq!(shoulder.trim(), "0.059");
}

#[test]
fn every_other_line_of_the_labs_file_stays() {
    let folder = Folder::new(&identified("gold"));
    let text = folder.export("r2params", Some("r2params.yaml"), "new.yaml").unwrap();
    assert!(text.starts_with(BASE));
    assert_eq!(text[BASE.len()..].lines().count(), 3, "{text}");

    // Lists that are there already, in block style and in the middle, are replaced where they stand.
    let (head, tail) = BASE.split_at(BASE.find("gains_gold_ki").unwrap());
    let old = "tr_gold:\n- 1.0\n# not the last\n- 2.0\n  # nor this\n";
    let windows = format!("{head}{old}# about ki\n{tail}").replace('\n', "\r\n");
    std::fs::write(folder.path("windows.yaml"), &windows).unwrap();
    let text = folder.export("r2params", Some("windows.yaml"), "new.yaml").unwrap();
    let list = text.lines().find(|line| line.starts_with("tr_gold")).unwrap();
    assert_eq!(text.replace(&format!("{list}\r\n"), &old.replace('\n', "\r\n")).split("cable_coupling_gold").next().unwrap(), windows);

    // Once more changes nothing.
    std::fs::rename(folder.path("new.yaml"), folder.path("again.yaml")).unwrap();
    assert_eq!(folder.export("r2params", Some("again.yaml"), "new.yaml").unwrap(), text);
}

#[test]
fn a_base_that_cannot_be_kept_is_refused() {
    let folder = Folder::new(&identified("gold"));
    let refused = |base: &str| {
        std::fs::write(folder.path("base.yaml"), base).unwrap();
        folder.export("r2params", Some("base.yaml"), "new.yaml").unwrap_err()
    };
    assert!(refused(&format!("{BASE}tr_gold: [1.0]\nx: 1\ntr_gold: [2.0]\n")).contains("tr_gold"));
    let flow = "{gains_gold_kp: [1.0], gains_gold_kd: [1.0], gains_gold_ki: [1.0], tr_gold: [2.0]}\n";
    assert!(refused(flow).contains("base.yaml"));
    for (base, lacks) in [
        (String::new(), "it lacks gains_gold_kp, gains_gold_kd, gains_gold_ki, lists"),
        ("tr_gold: [2.0]\n".to_owned(), "it lacks gains_gold_kp, gains_gold_kd, gains_gold_ki, lists"),
        (BASE.replace("gains_gold_kd", "gains_green_kd"), "it lacks gains_gold_kd, lists"),
        (BASE.replace("[.008, .008, .012, .00, .001, 0.0, 0.0, 0.0]", "0.5"), "it lacks gains_gold_kd, lists"),
    ] {
        let error = refused(&base);
        assert!(error.contains("base.yaml") && error.contains(lacks), "{error}");
    }
    assert!(refused("- a list\n").contains("base.yaml"));
    let ours = folder.export("r2params", Some("identified.yaml"), "new.yaml").unwrap_err();
    assert!(ours.contains("identified.yaml: `format` stands in it as in a robot file; --base is the controller's own"), "{ours}");
    assert!(folder.export("r2params", None, "new.yaml").unwrap_err().contains("--base"));
    assert!(folder.export("defines", Some("r2params.yaml"), "new.h").unwrap_err().contains("--base"));
    assert!(!folder.path("new.yaml").exists());
}

/// What was not identified is written as the base has it, or else as the controller compiles it in, and the robot file must not differ.
#[test]
fn what_was_not_identified_stays_in_the_labs_file() {
    let export = |robot: &Robot, base: &str| {
        let folder = Folder::new(robot);
        std::fs::write(folder.path("base.yaml"), base).unwrap();
        folder.export("r2params", Some("base.yaml"), "new.yaml")
    };
    let mut robot = nominal::gold();
    change(&mut robot, "r_l1", "joints.shoulder.link_pulley_radius", 0.059);
    let text = export(&robot, BASE).unwrap();
    assert!(text.contains("# r_l1 by raven-identify from sinusoid.mcap, the rest as before\n"), "{text}");
    assert!(text.contains("cable_coupling_gold: [0.14545, 0.0077973826, 0.008077387]  # as before\n"), "{text}");

    // The lab rounds, and has another tool.
    let lists = "tr_gold: [1.0, 121.52, 2158.6, 0.0, 5.0, 9.0, 9.0, 9.0]\ncable_coupling_gold: [0.1454, 0.0078, 0.00808]\n";
    let own = format!("{BASE}{lists}");
    let text = export(&robot, &own).unwrap();
    assert!(text.contains(", 121.52, 2158.6, 0.0, 5.0, 9.0, 9.0, 9.0]") && !text.contains("tr_gold: [1.0"), "{text}");
    assert!(text.contains("cable_coupling_gold: [0.1454, 0.0078, 0.00808]  # as before\n"), "{text}");

    for (key, value) in
        [("joints.elbow.link_pulley_radius", 0.0498), ("cable_coupling.shoulder.elbow", 0.2), ("joints.insertion.hard_stop", 0.55)]
    {
        let mut edited = robot.clone();
        *edited.value_mut(key).unwrap() = value;
        for base in [BASE, own.as_str()] {
            let error = export(&edited, base).unwrap_err();
            assert!(error.contains("base.yaml") && error.contains(&format!("{key}, which was not identified")), "{error}");
        }
    }
    // A lab whose controller has it may say so.
    *robot.value_mut("cable_coupling.shoulder.elbow").unwrap() = 0.2;
    let text = export(&robot, &format!("{BASE}cable_coupling_gold: [0.2, 0.0077973826, 0.008077387]\n")).unwrap();
    assert!(text.contains("cable_coupling_gold: [0.2, 0.0077973826, 0.008077387]  # as before\n"), "{text}");
}

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

#[test]
fn names_that_yaml_reads_as_something_else_are_quoted() {
    let named = |joint: &str, parameter: &str| {
        let mut robot = nominal::gold();
        robot.joints[0].name = joint.to_owned();
        robot.cable_coupling.retain(|coupling| coupling.from != "shoulder");
        change(&mut robot, parameter, &format!("joints.{joint}.link_pulley_radius"), 0.059);
        Folder::new(&robot).export("rosparam", None, "neutral.yaml")
    };
    let text = named("on", "a: b").unwrap();
    assert!(text.contains("\n    \"on\":\n") && text.contains("\n      \"a: b\": [0.059, "), "{text}");
    let error = named("logs", "r_l1").unwrap_err();
    assert!(error.contains("`logs`") && error.contains("identified.yaml"), "{error}");
}

#[test]
fn what_the_hardware_cannot_be_is_refused() {
    let refused = |parameter: &str, key: &str, value: f64| {
        let mut robot = nominal::gold();
        change(&mut robot, parameter, key, value);
        let folder = Folder::new(&robot);
        ["r2params", "defines", "rosparam"].map(|format| {
            let base = (format == "r2params").then_some("r2params.yaml");
            folder.export(format, base, "new").expect_err(&format!("{key} = {value} was exported as {format}"))
        })
    };
    for message in refused("r_l1", "joints.shoulder.link_pulley_radius", 0.063095 * 1.16) {
        assert!(message.contains("+16.0 %") && message.contains("shoulder"), "{message}");
    }
    assert!(refused("r_l1", "joints.shoulder.link_pulley_radius", -0.063)[0].contains("link_pulley_radius is -0.063"));
    assert!(refused("k_e2", "joints.elbow.cable.stiffness", -88_000.0)[1].contains("stiffness is -88000"));
    assert!(refused("offset_3", "joints.insertion.hard_stop", 0.62)[2].contains("hard_stop is 0.62"));
    assert!(refused("coupling_12", "cable_coupling.shoulder.elbow", 0.5)[0].contains("cable_coupling from shoulder to elbow is 0.5"));
}

#[test]
fn what_the_data_did_not_identify_is_refused() {
    let refused = |edit: &dyn Fn(&mut Robot)| {
        let mut robot = identified("gold");
        edit(&mut robot);
        Folder::new(&robot).export("rosparam", None, "new.yaml").unwrap_err()
    };
    let flag = refused(&|robot| robot.calibration[0].identified = false);
    assert!(flag.contains("r_l1") && flag.contains("not identified"), "{flag}");
    let wide = refused(&|robot| robot.calibration[0].std = 0.6 * robot.calibration[0].prior_std);
    assert!(wide.contains("r_l1") && wide.contains("not identified"), "{wide}");
    for wrong in [f64::NAN, -1.0, f64::INFINITY] {
        let std = refused(&|robot| robot.calibration[0].std = wrong);
        assert!(std.contains("calibration has std: ") && std.contains("r_l1") && std.contains("no standard deviation"), "{std}");
        assert!(refused(&|robot| robot.calibration[0].prior_std = wrong).contains("calibration has prior_std: "));
    }
    let typed = refused(&|robot| (robot.calibration[0].identified, robot.calibration[0].std) = (false, 0.0));
    assert!(typed.contains("r_l1") && typed.contains("it was typed by hand and not identified, yet it is 0.059"), "{typed}");
    assert!(refused(&|robot| robot.joints[0].link_pulley_radius = 0.06).contains("its calibration found 0.059"));
    assert!(refused(&|robot| robot.calibration.clear()).contains("it has no calibration"));
    let nothing = refused(&|robot| {
        *robot = nominal::gold();
        let mut entry = provenance("r_l1", "joints.shoulder.link_pulley_radius", 0.063095, 0.063095);
        (entry.identified, entry.std) = (false, entry.prior_std);
        robot.calibration.push(entry);
    });
    assert!(nothing.contains("nothing to export") && nothing.contains("100 %"), "{nothing}");
    // Of no deviation nothing can be left.
    for std in [0.0, 1e-3] {
        let fixed = refused(&|robot| {
            *robot = nominal::gold();
            let mut entry = provenance("r_l1", "joints.shoulder.link_pulley_radius", 0.063095, 0.063095);
            (entry.std, entry.prior_std) = (std, 0.0);
            robot.calibration.push(entry);
        });
        assert!(fixed.contains("nothing to export: r_l1 was not identified (it has no deviation from before)"), "{fixed}");
    }
}

/// A factor is known to a part of itself: of one that went up, more is left in SI units than half of what there was before.
#[test]
fn what_an_identification_determined_is_exported_whichever_way_it_went() {
    let robot = nominal::gold();
    let selection = Selection { quantities: ALL.into_iter().filter(|q| q.is_positive()).collect(), named: true };
    let unknowns = priors::unknowns(&robot, &selection, &Quality::default()).unwrap();
    let unknowns: Vec<_> = unknowns.into_iter().filter(|unknown| unknown.named).collect();
    let export = |z: f64, std_z: f64, is_identified: bool| {
        let finding = |unknown: &priors::Unknown| {
            let value = if is_identified { unknown.value(z) } else { unknown.prior };
            Finding { value, std: unknown.std(value, std_z), identified: is_identified, unknown: unknown.clone() }
        };
        let findings: Vec<Finding> = unknowns.iter().map(finding).collect();
        Folder::new(&with_findings(&robot, &findings, &[], "batch", &[]).unwrap()).export("rosparam", None, "new.yaml")
    };
    for z in [0.8, 0.3, -0.8] {
        let text = export(z, 0.49, true).unwrap();
        assert!(unknowns.iter().all(|unknown| text.contains(&format!("      {}: [", unknown.quantity.name()))), "{text}");
        // What a hand says of it does not count.
        let error = export(z, 0.51, true).unwrap_err();
        assert!(error.contains("r_l1 (joints.shoulder.link_pulley_radius) was not identified ("), "{error}");
    }
    assert!(export(0.0, 0.9, false).unwrap_err().contains("r_l1 was not identified (the log left 90 % of its deviation)"));
}

/// A log that says nothing of a number leaves what a log before it found.
#[test]
fn what_a_log_before_determined_is_exported() {
    let mut robot = identified("gold");
    let mut again = provenance("r_l1", "joints.shoulder.link_pulley_radius", 0.059, 0.059);
    (again.identified, again.std) = (false, again.prior_std);
    robot.calibration.insert(0, again);
    let folder = Folder::new(&robot);
    let header = folder.export("defines", None, "new.h").unwrap();
    assert!(header.contains("/* r_l1: 0.059 +- "), "{header}");
    folder.export("r2params", Some("r2params.yaml"), "new.yaml").unwrap();
}

/// What a model cannot explain is said wherever its numbers go.
#[test]
fn exports_say_how_badly_the_model_explained_the_log() {
    let mut robot = identified("gold");
    for entry in &mut robot.calibration[..2] {
        entry.method = "batch; the residuals are 18.9 times what */ says.".to_owned();
    }
    let folder = Folder::new(&robot);
    let said = "r_l1, r_l2: the residuals are 18.9 times what";
    let header = folder.export("defines", None, "new.h").unwrap();
    assert!(header.contains(&format!("\n * {said} * / says.\n")), "{header}");
    let neutral = folder.export("rosparam", None, "new.yaml").unwrap();
    assert!(neutral.contains(&format!("\n# {said} */ says.\n")), "{neutral}");
    let own = folder.export("r2params", Some("r2params.yaml"), "own.yaml").unwrap();
    let line = own.lines().find(|line| line.starts_with("tr_gold: ")).unwrap();
    assert!(line.ends_with(&format!("# r_l1, r_l2, r_l3 by raven-identify from sinusoid.mcap; {said} */ says.")), "{line}");
}

#[test]
fn the_old_file_stays_or_is_kept() {
    let mut robot = identified("gold");
    let folder = Folder::new(&robot);
    std::fs::write(folder.path("new.yaml"), "old").unwrap();
    folder.export("rosparam", None, "new.yaml").unwrap();
    assert_eq!(folder.read("new.yaml.old"), "old");
    let good = folder.read("new.yaml");
    robot.calibration[0].identified = false;
    robot.write(&folder.path("identified.yaml")).unwrap();
    folder.export("rosparam", None, "new.yaml").unwrap_err();
    assert_eq!((folder.read("new.yaml"), folder.read("new.yaml.old")), (good, "old".to_owned()));
}

#[test]
fn what_is_there_is_never_lost() {
    let mut robot = identified("gold");
    let folder = Folder::new(&robot);
    let original = folder.read("r2params.yaml");
    let error = folder.export("r2params", Some("r2params.yaml"), "r2params.yaml").unwrap_err();
    assert!(error.contains("nothing that is read is written over"), "{error}");
    assert_eq!(folder.read("r2params.yaml"), original);

    std::fs::write(folder.path("new.yaml"), "the lab's").unwrap();
    let first = folder.export("rosparam", None, "new.yaml").unwrap();
    robot.name = "again".to_owned();
    robot.write(&folder.path("identified.yaml")).unwrap();
    let second = folder.export("rosparam", None, "new.yaml").unwrap();
    assert_ne!(first, second);
    assert_eq!((folder.read("new.yaml.old"), folder.read("new.yaml.old2")), ("the lab's".to_owned(), first.clone()));
    // What is kept already is not kept twice, and the same file is written as it is.
    std::fs::write(folder.path("new.yaml"), &first).unwrap();
    assert_eq!(folder.export("rosparam", None, "new.yaml").unwrap(), second);
    folder.export("rosparam", None, "new.yaml").unwrap();
    assert_eq!(std::fs::read_dir(folder.0.path()).unwrap().count(), 5);
    // Nor does the result for scripts take the place of what is kept.
    std::fs::write(folder.path("new.yaml"), "another").unwrap();
    let error = folder.run("rosparam", "new.yaml", &["--json", "new.yaml.old3"]).unwrap_err();
    assert!(error.contains("--json") && error.contains("new.yaml.old3"), "{error}");
}

#[cfg(unix)]
#[test]
fn a_pipe_is_written_to_and_not_read() {
    let folder = Folder::new(&identified("gold"));
    let pipe = folder.path("pipe.yaml");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let (send, receive) = std::sync::mpsc::channel();
    std::thread::spawn(move || {
        let ended = folder.run("rosparam", "pipe.yaml", &[]);
        let _ = send.send((ended, folder.path("pipe.yaml.old").exists()));
    });
    let text = std::thread::spawn(move || std::fs::read_to_string(pipe).unwrap());
    let (ended, is_kept) = receive.recv_timeout(Duration::from_secs(10)).expect("the export waits for the pipe");
    assert!(ended.is_ok() && !is_kept && text.join().unwrap().contains("raven_calibration:"));
}

#[test]
fn a_script_reads_what_was_written() {
    let mut robot = identified("gold");
    change(&mut robot, "k_e2", "joints.elbow.cable.stiffness", 80_000.0);
    robot.calibration.push(Provenance { identified: false, ..provenance("offset_1", "joints.shoulder.hard_stop", 0.0, 0.0) });
    let folder = Folder::new(&robot);
    let result = |arguments: &[&str]| -> serde_json::Value {
        let printed = folder.run("defines", "new.h", arguments).unwrap();
        let is_file = arguments[1] != "-";
        assert!(printed.is_empty() == is_file, "{printed}");
        serde_json::from_str(&if is_file { folder.read(arguments[1]) } else { printed }).unwrap()
    };
    let written = result(&["--json", "result.json"]);
    let names: Vec<&str> = written["numbers"].as_array().unwrap().iter().map(|n| n["parameter"].as_str().unwrap()).collect();
    assert_eq!(names, ["r_l1", "r_l2", "r_l3", "offset_2", "coupling_12"]);
    let first = &written["numbers"][0];
    assert_eq!((first["key"].as_str(), first["unit"].as_str()), (Some("joints.shoulder.link_pulley_radius"), Some("m")));
    assert_eq!((first["value"].as_f64(), first["prior"].as_f64(), first["std"].as_f64()), (Some(0.059), Some(0.063095), Some(6.3095e-5)));
    assert_eq!((written["format"].as_str(), written["kept"].as_str()), (Some("defines"), None));
    assert_eq!(written["output"].as_str(), folder.path("new.h").to_str());
    assert_eq!(written["logs"][0]["name"].as_str(), Some("sinusoid.mcap"));
    let warnings = written["warnings"].to_string();
    assert!(warnings.contains("offset_1 was not identified") && warnings.contains("no constant for k_e2"), "{warnings}");

    std::fs::write(folder.path("new.h"), "old").unwrap();
    assert_eq!(result(&["--json", "-"])["kept"].as_str(), folder.path("new.h.old").to_str());
    let error = folder.run("defines", "-", &["--json", "-"]).unwrap_err();
    assert!(error.contains("-o and --json are both `-`"), "{error}");
}
