//! The command line.

use std::path::{Path, PathBuf};

use clap::{Parser, Subcommand, ValueEnum};
use raven::{Error, Result, files};
use serde::Serialize;

use crate::parameters::Selection;
use crate::priors::Unknown;
use crate::recursive::{self, Sharing};

const EXAMPLES: &str = "\
Examples:
  raven-identify tracked.mcap --robot robot.yaml --cameras cameras.yaml -o identified.yaml
  raven-identify export identified.yaml --format r2params --base r2params.yaml -o new.yaml
  raven-identify excite --robot robot.yaml --parameters r_l,k_e --duration 60 -o motion.csv
  raven-identify day1.mcap day2.mcap --robot robot.yaml --parameters r_l,offset,latency
  raven-identify --add-effect pulley-eccentricity:elbow --diagnosis report.json --robot robot.yaml -o new.yaml

Parameters:
  r_l1..3, offset_1..3, coupling_12, coupling_13, coupling_23, k_e1..3, b_e1..3, F_c1..3,
  hysteresis_1..3, rounding_1..3, straight_part_1..3, latency, rotation_x..z, translation_x..z; the groups r_l, offset, coupling,
  k_e, b_e, F_c, hysteresis, registration; all

Exit codes: 0 done, 1 failed, 2 wrong arguments, 3 done with some of the recording left out.";

/// Identify kinematic and cable parameters from recordings.
#[derive(Debug, Clone, Parser)]
#[command(name = "raven-identify", version, after_help = EXAMPLES, args_conflicts_with_subcommands = true)]
pub struct Args {
    /// Something else than an identification.
    #[command(subcommand)]
    pub command: Option<Command>,
    /// Identification.
    #[command(flatten)]
    pub identify: Identify,
}

/// What else the program does.
#[derive(Debug, Clone, Subcommand)]
pub enum Command {
    /// Write what the robot's controller loads.
    Export(Export),
    /// Propose the motion that would identify what is missing.
    Excite(Excite),
}

/// Arguments of a proposal.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "Example:\n  raven-identify excite --robot robot.yaml -o motion.csv")]
pub struct Excite {
    /// Robot file.
    #[arg(long, value_name = "FILE")]
    pub robot: PathBuf,
    /// What is wanted, separated by commas (default: r_l, offset, k_e, b_e, F_c and latency).
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    pub parameters: Option<Vec<String>>,
    /// Length of the motion [s].
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0, allow_negative_numbers = true)]
    pub duration: f64,
    /// Print Cramer-Rao deviations for the lab's motions and the proposal instead.
    #[arg(long)]
    pub table: bool,
    /// Joint set points to write: CSV of time, shoulder, elbow and insertion in s, rad, rad and m; - for standard output.
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Result for scripts; - for standard output.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

/// Arguments of an export.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "Example:\n  raven-identify export identified.yaml --format defines -o defines_calibrated.h")]
pub struct Export {
    /// Robot file that raven-identify wrote.
    #[arg(value_name = "IDENTIFIED")]
    pub identified: PathBuf,
    /// What to write.
    #[arg(long, value_enum)]
    pub format: Format,
    /// The lab's own r2params.yaml, whose other lines stay as they are.
    #[arg(long, value_name = "FILE")]
    pub base: Option<PathBuf>,
    /// File to write; what was there first is kept as FILE.old, later ones as FILE.old2, FILE.old3; - for standard output.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// What was written, for scripts; - for standard output.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

/// What the controller loads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Format {
    /// The controller's parameter file with the calibrated lists added.
    R2params,
    /// A C header that overrides the controller's constants.
    Defines,
    /// All numbers under neutral names for the parameter server.
    Rosparam,
}

/// Arguments of an identification.
#[derive(Debug, Clone, clap::Args)]
pub struct Identify {
    /// Recordings with the robot's messages and the tracked tip.
    #[arg(value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// Robot file to start from.
    #[arg(long, value_name = "FILE")]
    pub robot: Option<PathBuf>,
    /// Camera file: how well the registration is known.
    #[arg(long, value_name = "FILE")]
    pub cameras: Option<PathBuf>,
    /// How to estimate.
    #[arg(long, value_enum, default_value_t = Method::Batch)]
    pub method: Method,
    /// With dual: the time over which the parameters' filter predicts.
    #[arg(long, value_enum)]
    pub horizon: Option<Horizon>,
    /// What to look for, separated by commas (default: r_l1 and latency; hard stops and registration are estimated along).
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    pub parameters: Option<Vec<String>>,
    /// Robot file to write; - for standard output.
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// With dual and joint: the estimates over time with bands of two deviations, as SVG; - for standard output.
    #[arg(long, value_name = "FILE")]
    pub plot: Option<PathBuf>,
    /// Result for scripts; - for standard output.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// Instead of an identification: put an effect that raven-diagnose named into the robot file; may be repeated. Values in SI units; left
    /// off they are those of --diagnosis.
    #[arg(long, value_name = "ID[:JOINT][=VALUE,...]", conflicts_with_all = ["logs", "method", "horizon", "parameters", "plot"])]
    pub add_effect: Vec<String>,
    /// With --add-effect: the report that raven-diagnose --json wrote.
    #[arg(long, value_name = "FILE", requires = "add_effect", conflicts_with = "logs")]
    pub diagnosis: Option<PathBuf>,
}

/// How the parameters are estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Method {
    /// All sightings at once.
    Batch,
    /// As the log goes by, links and parameters in two filters, as in the paper.
    Dual,
    /// As the log goes by, links and parameters in one filter.
    Joint,
}

/// Time over which the dual filter's parameters predict.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Horizon {
    /// From image to image.
    Frame,
    /// One step of integration, as in the paper: needs some 40 s to find a pulley.
    Step,
}

impl Method {
    /// As the robot file names it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Batch => "batch",
            Self::Dual => "dual",
            Self::Joint => "joint",
        }
    }
}

impl Identify {
    /// How a recursive estimation shares the work between filters; `None` of a batch.
    ///
    /// # Errors
    /// If an option does not belong to the method.
    pub fn sharing(&self) -> Result<Option<Sharing>> {
        if self.horizon.is_some() && self.method != Method::Dual {
            return Err(Error::Argument("--horizon belongs to --method dual.".to_owned()));
        }
        if self.plot.is_some() && self.method == Method::Batch {
            return Err(Error::Argument("--plot shows estimates over time, and a batch has none; add --method dual or joint.".to_owned()));
        }
        Ok(match (self.method, self.horizon) {
            (Method::Batch, _) => None,
            (Method::Dual, Some(Horizon::Step)) => Some(Sharing::Dual(recursive::Horizon::Step)),
            (Method::Dual, _) => Some(Sharing::Dual(recursive::Horizon::Frame)),
            (Method::Joint, _) => Some(Sharing::Joint),
        })
    }

    /// What is looked for.
    ///
    /// # Errors
    /// If a name is unknown, or the method cannot estimate what it stands for.
    pub fn selection(&self) -> Result<Selection> {
        let selection = self.parameters.as_deref().map_or_else(|| Ok(Selection::default()), Selection::named)?;
        match selection.quantities.iter().find(|quantity| quantity.is_of_loop()) {
            Some(hysteresis) if self.method != Method::Batch => Err(Error::Argument(format!(
                "--parameters names {}, whose loop needs the whole log at once; take --method batch for it.",
                hysteresis.name()
            ))),
            _ => Ok(selection),
        }
    }

    /// Refuses a plot of nothing: it shows numbers of the robot and the latency.
    ///
    /// # Errors
    /// If a plot is asked for and all `unknowns` are corrections of the registration.
    pub fn plots(&self, unknowns: &[Unknown]) -> Result<()> {
        if self.plot.is_some() && unknowns.iter().all(|unknown| unknown.quantity.is_registration()) {
            return Err(Error::Argument(
                "--plot shows no correction of the registration, and nothing else is estimated; add to --parameters, or leave --plot away."
                    .to_owned(),
            ));
        }
        Ok(())
    }

    /// The robot file.
    ///
    /// # Errors
    /// If none is given.
    pub fn robot(&self) -> Result<&Path> {
        self.robot.as_deref().ok_or_else(|| Error::Argument("--robot is missing: the robot file to start from.".to_owned()))
    }

    /// Refuses to write over what is read.
    ///
    /// # Errors
    /// If a file to write is one of those to read.
    pub fn apart(&self) -> Result<()> {
        let inputs = self.logs.iter().chain(&self.robot).chain(&self.cameras).chain(&self.diagnosis);
        files::apart(inputs, &self.outputs())
    }

    fn outputs(&self) -> [(&str, Option<&Path>); 3] {
        [("-o", self.output.as_deref()), ("--json", self.json.as_deref()), ("--plot", self.plot.as_deref())]
    }

    /// Whether standard output is left for the table.
    ///
    /// # Errors
    /// If two of the outputs are to go there.
    pub fn has_table(&self) -> Result<bool> {
        raven::cli::is_left_for_words(&self.outputs())
    }

    /// The logs.
    ///
    /// # Errors
    /// If none is given.
    pub fn logs(&self) -> Result<&[PathBuf]> {
        if self.logs.is_empty() {
            return Err(Error::Argument("no log is given; name at least one tracked recording.".to_owned()));
        }
        Ok(&self.logs)
    }
}
