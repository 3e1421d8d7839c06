//! What `raven-identify export` writes for the controller, loaded as the controller loads it.

mod determined;
mod files;
mod header;
mod parameters;

use std::path::{Path, PathBuf};

use clap::Parser;
use raven::cli::Outcome;
use raven::robot::{Provenance, Robot, nominal};
use raven_identify::{Args, run};

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
