//! A folder of recordings with sealed labels.
//!
//! ```text
//! NAME.mcap        the recording; nothing in it says what is hidden
//! cameras.yaml     the cameras as a calibration would describe them, the same for all
//! labels.json      {NAME: {"case": NAME, "effects": [{"id", "joint", "magnitude"}], "salt": ...}}
//! labels.sha256    SHA-256 of labels.json, as sha256sum writes it
//! ```
//!
//! Whoever has the sum can check later that the labels were not changed; the salt keeps anyone from trying labels until the sum fits who does not
//! know the seed, from which it follows.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use rand::Rng;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::lot::Case;
use super::off_nominal::SEALED_FACTOR;
use super::options::Options;
use super::session::{Session, Written};
use super::truth::stream;
use crate::camera::Cameras;
use crate::robot::Robot;
use crate::{Error, Result, files};

/// File of the labels.
pub const LABELS: &str = "labels.json";
/// File of their sum.
pub const LABELS_SUM: &str = "labels.sha256";
/// File of the cameras.
pub const CAMERAS: &str = "cameras.yaml";

/// One number or several.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Magnitude {
    /// One.
    One(f64),
    /// In the order of the effect's numbers.
    Several(Vec<f64>),
}

impl Magnitude {
    /// The numbers.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        match self {
            Self::One(value) => std::slice::from_ref(value),
            Self::Several(values) => values,
        }
    }

    fn of(values: &[f64]) -> Self {
        match values {
            [value] => Self::One(*value),
            several => Self::Several(several.to_vec()),
        }
    }
}

/// An effect as a label names it; one that is not in the library is a cause outside it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LabelEffect {
    /// Identifier.
    pub id: String,
    /// Joint, `from->to`, `12` or `23`; none for the whole.
    pub joint: Option<String>,
    /// Its size, in the effect's units.
    pub magnitude: Magnitude,
}

/// What is hidden in a recording. Keys that other generators add are ignored.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Label {
    /// Name of the recording.
    pub case: String,
    /// What is hidden; empty for nothing.
    pub effects: Vec<LabelEffect>,
    /// Makes the label's sum impossible to guess.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub salt: Option<String>,
    /// Seed of the recording, in decimal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<String>,
}

/// Labels by name of the recording.
pub type Labels = BTreeMap<String, Label>;

/// A folder to which recordings are added.
#[derive(Debug)]
pub struct SealedFolder {
    path: PathBuf,
    labels: Labels,
    cameras: Option<Cameras>,
}

impl SealedFolder {
    /// Opens a folder, or makes it.
    ///
    /// # Errors
    /// If it cannot be made, or its labels are not those whose sum it holds.
    pub fn open(path: &Path) -> Result<Self> {
        std::fs::create_dir_all(path).map_err(|e| Error::io(path, "create", e))?;
        let labels = if path.join(LABELS).exists() { Self::labels(path)? } else { Labels::new() };
        let cameras = path.join(CAMERAS);
        let cameras = if cameras.exists() { Some(Cameras::read(&cameras)?) } else { None };
        Ok(Self { path: path.to_owned(), labels, cameras })
    }

    /// Reads the labels of a folder, if they are those that were sealed.
    ///
    /// # Errors
    /// If a file is missing or unreadable, or the sum of the labels is not the one in `labels.sha256`.
    pub fn labels(folder: &Path) -> Result<Labels> {
        let (path, sum_path) = (folder.join(LABELS), folder.join(LABELS_SUM));
        let text = files::read_text(&sum_path)?;
        let sealed = text.split_whitespace().next().unwrap_or_default();
        let bytes = std::fs::read(&path).map_err(|e| Error::io(&path, "read", e))?;
        let sum = files::sha256_of(&bytes);
        if !sum.eq_ignore_ascii_case(sealed) {
            return Err(Error::file(
                &path,
                format!("its SHA-256 is {sum}, but {LABELS_SUM} says `{sealed}`: these are not the labels sealed with the recordings."),
            ));
        }
        serde_json::from_slice(&bytes).map_err(|e| Error::file(&path, format!("line {}, column {}: {e}.", e.line(), e.column())))
    }

    /// The first name of the kind `r001` that is not taken.
    #[must_use]
    pub fn free_name(&self) -> String {
        let taken = |name: &String| self.labels.contains_key(name) || self.recording(name).exists();
        (1_u64..).map(|number| format!("r{number:03}")).find(|name| !taken(name)).unwrap_or_default()
    }

    /// Path of a recording.
    #[must_use]
    pub fn recording(&self, name: &str) -> PathBuf {
        self.path.join(format!("{name}.mcap"))
    }

    /// Records a case and seals its label. `base` says how cameras look; its seed, effects and cameras are the case's and the folder's.
    ///
    /// # Errors
    /// If the name is taken, the case does not fit the robot, or a file cannot be written.
    pub fn add(&mut self, robot: &Robot, case: &Case, base: &Options, progress: impl FnMut(f64)) -> Result<Written> {
        let session = self.session(robot, case, base)?;
        let written = session.record(case.motion, case.duration_s, &self.recording(&case.name), progress)?;
        self.labels.insert(case.name.clone(), Label::of(case));
        self.seal()?;
        Ok(written)
    }

    /// As [`Self::add`] for many, on all processors; `each` hears of every recording.
    ///
    /// # Errors
    /// As [`Self::add`]; then no label is added.
    pub fn add_all(&mut self, robot: &Robot, cases: &[Case], base: &Options, each: impl Fn() + Sync) -> Result<()> {
        let sessions = cases.iter().map(|case| self.session(robot, case, base)).collect::<Result<Vec<_>>>()?;
        sessions.par_iter().zip(cases).try_for_each(|(session, case)| {
            session.record(case.motion, case.duration_s, &self.recording(&case.name), |_| {})?;
            each();
            Ok::<(), Error>(())
        })?;
        self.labels.extend(cases.iter().map(|case| (case.name.clone(), Label::of(case))));
        self.seal()
    }

    /// The lab of a case before the folder's cameras; those of the first case become the folder's.
    fn session(&mut self, robot: &Robot, case: &Case, base: &Options) -> Result<Session> {
        let recording = self.recording(&case.name);
        if self.labels.contains_key(&case.name) || recording.exists() {
            let message = "this recording is already there, and a sealed one is not overwritten; choose another name.";
            return Err(Error::file(&recording, message));
        }
        let options = Options {
            seed: case.seed,
            effects: case.effects.clone(),
            outside: case.outside.clone(),
            rate_hz: case.rate_hz,
            noise_px: case.noise_px,
            cameras: self.cameras.clone(),
            joint_encoders: false,
            ..base.clone()
        };
        let session = Session::new(robot, options)?;
        if self.cameras.is_none() {
            self.cameras = session.cameras().cloned();
            if let Some(cameras) = &self.cameras {
                cameras.write(&self.path.join(CAMERAS))?;
            }
        }
        Ok(session)
    }

    /// Options of a sealed recording unless the caller wants others: a robot within its tolerances.
    #[must_use]
    pub fn options() -> Options {
        Options { off_nominal: SEALED_FACTOR, ..Options::default() }
    }

    fn seal(&self) -> Result<()> {
        let path = self.path.join(LABELS);
        let mut text = serde_json::to_string_pretty(&self.labels).map_err(|e| Error::file(&path, format!("no JSON: {e}.")))?;
        text.push('\n');
        files::write_atomic(&path, text.as_bytes())?;
        let sum = format!("{}  {LABELS}\n", files::sha256_of(text.as_bytes()));
        files::write_atomic(&self.path.join(LABELS_SUM), sum.as_bytes())
    }
}

impl Label {
    /// The label of a case.
    #[must_use]
    pub fn of(case: &Case) -> Self {
        let inside = case.effects.iter().map(|effect| LabelEffect {
            id: effect.kind.id().to_owned(),
            joint: effect.target.clone(),
            magnitude: Magnitude::of(&effect.values),
        });
        let outside = case.outside.iter().map(|outside| LabelEffect {
            id: outside.id().to_owned(),
            joint: outside.joint().map(str::to_owned),
            magnitude: Magnitude::One(outside.magnitude()),
        });
        let mut salt = [0; 16];
        stream(case.seed, "salt").fill_bytes(&mut salt);
        Self {
            case: case.name.clone(),
            effects: inside.chain(outside).collect(),
            salt: Some(salt.iter().map(|byte| format!("{byte:02x}")).collect()),
            seed: Some(case.seed.to_string()),
        }
    }
}
