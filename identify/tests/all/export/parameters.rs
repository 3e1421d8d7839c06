//! Parameters of the controller, loaded by `rosparam` against a ROS master and kept in a lab's own file.

use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use approx::assert_relative_eq;
use raven::robot::{Robot, nominal};

use super::{BASE, Folder, change, identified};

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
        raven::yaml::parse(Path::new(name), &text).unwrap()
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
