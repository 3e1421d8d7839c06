//! What a diagnosis says, as scripts read it: `raven-diagnosis/1`.

use raven::cli;
use raven::robot::{KinematicsKind, Robot};
use raven::{Error, Result};
use serde::Serialize;

use crate::against::Against;
use crate::attribution::Attribution;
use crate::evidence::numbers::spread::Spread;
use crate::gap::{Gap, MotorMotion};
use crate::residual::{Channels, Residuals};
use crate::whereabouts::Place;
use crate::{Args, report};

/// The report, `raven-diagnosis/1`.
#[derive(Debug, Serialize)]
pub struct Report {
    format: &'static str,
    #[serde(flatten, serialize_with = "with_every_key")]
    pub(crate) attribution: Option<Attribution>,
    pub(crate) no_diagnosis: Option<String>,
    #[serde(rename = "where")]
    pub(crate) places: Vec<Place>,
    pub(crate) where_in_words: Vec<String>,
    pub(crate) model_gap: Vec<Gap>,
    pub(crate) against: Option<Against>,
    pub(crate) motor_motion: Vec<MotorMotion>,
    pub(crate) controller: Vec<ControllerDifference>,
    pub(crate) recordings: Vec<String>,
    /// SHA-256 of each.
    pub(crate) recordings_sha256: Vec<String>,
    /// Those that say how far the file's numbers are off.
    pub(crate) beside: Vec<String>,
    pub(crate) robot: RobotFile,
    /// What of the recordings could not be used, in sentences.
    pub(crate) lost: Vec<String>,
    /// Why recordings may not belong to the robot or the cameras, in sentences.
    pub(crate) warnings: Vec<String>,
    pub(crate) unreachable: usize,
    /// Whether an arm's recordings have images, which may show the tip.
    #[serde(skip)]
    pub(crate) has_images: bool,
    /// Whether the robot is a bench, whose table has no model beyond transmission kinematics.
    #[serde(skip)]
    pub(crate) is_bench: bool,
}

/// The robot file that the recordings were held against.
#[derive(Debug, Serialize)]
pub(crate) struct RobotFile {
    pub file: String,
    pub sha256: String,
}

/// An [`Attribution`] where causes were not looked for: scripts find the same keys.
#[derive(Serialize, Default)]
struct NotLookedFor {
    verdict: (),
    effects: [(); 0],
    misfit_accounted: (),
    candidates: [(); 0],
    not_observable: [(); 0],
    minimum_detectable: [(); 0],
    probability_too_small: (),
    probability_outside: (),
    file_numbers: [(); 0],
    tolerance_parts: Spread,
    gap: [(); 0],
    remarks: [(); 0],
}

fn with_every_key<S: serde::Serializer>(attribution: &Option<Attribution>, serializer: S) -> std::result::Result<S::Ok, S::Error> {
    match attribution {
        Some(attribution) => attribution.serialize(serializer),
        None => NotLookedFor::default().serialize(serializer),
    }
}

/// How far the controller's logged joint angles are from transmission kinematics by the numbers it then had.
#[derive(Debug, Serialize)]
pub(crate) struct ControllerDifference {
    pub joint: String,
    pub unit: &'static str,
    pub largest: f64,
}

impl Report {
    /// Takes in what recordings say of causes, or why they say nothing.
    pub(crate) fn add(&mut self, found: Result<Attribution>) -> Result<()> {
        match found {
            Ok(mut attribution) => {
                if let Some((against, side)) = self.against.as_mut().zip(attribution.side) {
                    against.effects_of = Some(side);
                    attribution.remarks.push(against.remark(side));
                }
                self.attribution = Some(attribution);
            }
            Err(Error::Data(because)) => self.no_diagnosis = Some(because),
            Err(error) => return Err(error),
        }
        Ok(())
    }

    /// The page of the gap with what else there is to say.
    pub(crate) fn page(&self, of_gap: report::Page, robot: &Robot, args: &Args) -> report::Page {
        let mut page = of_gap;
        page.motors.clone_from(&self.motor_motion);
        page.is_against = self.against.is_some();
        page.remarks.extend(self.warnings.iter().chain(&self.lost).chain(&self.no_diagnosis).cloned());
        if let Some(attribution) = &self.attribution {
            let json = args.json.as_deref().filter(|json| json.as_os_str() != cli::STANDARD_OUTPUT);
            let files = report::Files { robot: &args.robot, cameras: args.cameras.as_deref(), json };
            report::add_causes(&mut page, attribution, robot, files);
        }
        page
    }

    pub(crate) fn new(robot: &Robot, file: RobotFile, recordings: &[Channels]) -> Self {
        let mut report = Self {
            format: "raven-diagnosis/1",
            attribution: None,
            no_diagnosis: None,
            places: Vec::new(),
            where_in_words: Vec::new(),
            model_gap: gaps(robot, recordings),
            against: None,
            motor_motion: Vec::new(),
            controller: Vec::new(),
            recordings: Vec::new(),
            recordings_sha256: Vec::new(),
            beside: Vec::new(),
            robot: file,
            lost: Vec::new(),
            warnings: Vec::new(),
            unreachable: recordings.iter().map(|r| r.unreachable).sum(),
            has_images: false,
            is_bench: matches!(robot.kinematics, KinematicsKind::Bench),
        };
        for (j, joint) in robot.joints.iter().enumerate() {
            let (unit, scale) = joint.display_unit();
            let differences = recordings.iter().filter_map(|r| r.controller_difference.as_ref()?.get(j));
            if let Some(largest) = differences.copied().reduce(f64::max) {
                report.controller.push(ControllerDifference { joint: joint.name.clone(), unit, largest: largest * scale });
            }
        }
        report
    }
}

/// The gap of every joint and of the tip.
pub(crate) fn gaps(robot: &Robot, recordings: &[Channels]) -> Vec<Gap> {
    let of_joint = |(j, joint): (usize, &raven::robot::Joint)| {
        let (unit, scale) = joint.display_unit();
        let residuals: Vec<&Residuals> = recordings.iter().filter_map(|r| r.joints.get(j)).collect();
        Gap::new(&joint.name, unit, scale, &together(&residuals))
    };
    let tips: Vec<&Residuals> = recordings.iter().map(|r| &r.tip).collect();
    let joints = robot.joints.iter().enumerate().filter_map(of_joint);
    joints.chain(Gap::new("tip", "mm", 1e3, &together(&tips))).collect()
}

fn together(recordings: &[&Residuals]) -> Residuals {
    let mut all = Residuals::default();
    for residuals in recordings {
        all.extend(residuals);
    }
    all
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;
    use crate::attribution::Word;

    #[test]
    fn a_report_without_a_diagnosis_has_the_keys_of_one_with() {
        let file = RobotFile { file: "robot.yaml".to_owned(), sha256: String::new() };
        let mut report = Report::new(&raven::robot::nominal::gold(), file, &[]);
        let without = json!(report);
        report.attribution = Some(Attribution::without_findings(Word::Explained));
        let with = json!(report);
        let keys = |report: &Value| report.as_object().unwrap().keys().cloned().collect::<Vec<_>>();
        assert_eq!(keys(&without), keys(&with));
        assert_eq!((&without["verdict"], &without["effects"], &without["motor_motion"]), (&Value::Null, &json!([]), &json!([])));
        assert_eq!(with["verdict"], "explained");
    }
}
