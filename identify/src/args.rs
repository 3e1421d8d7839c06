//! The command line.

use std::path::{Path, PathBuf};

use clap::{Parser, ValueEnum};
use raven::{Error, Result};

const EXAMPLES: &str = "\
Examples:
  raven-identify tracked.mcap --robot robot.yaml --cameras cameras.yaml -o identified.yaml
  raven-identify day1.mcap day2.mcap --robot robot.yaml --cameras cameras.yaml --parameters r_l,offset,latency -o identified.yaml

Parameters: r_l1..3, offset_1..3, coupling_12, coupling_13, coupling_23, k_e1..3, F_c1..3, latency, rotation_x..z,
translation_x..z; the groups r_l, offset, coupling, k_e, F_c, registration; all.";

/// Identifies kinematic and cable parameters from recordings
#[derive(Debug, Clone, Parser)]
#[command(name = "raven-identify", version, after_help = EXAMPLES)]
pub struct Args {
    /// Identification.
    #[command(flatten)]
    pub identify: Identify,
}

/// Arguments of an identification.
#[derive(Debug, Clone, clap::Args)]
pub struct Identify {
    /// Recordings with the robot's messages and the tracked tip
    #[arg(value_name = "LOG")]
    pub logs: Vec<PathBuf>,
    /// Robot file to start from
    #[arg(long, value_name = "FILE")]
    pub robot: Option<PathBuf>,
    /// Camera file: how well the registration is known
    #[arg(long, value_name = "FILE")]
    pub cameras: Option<PathBuf>,
    /// How to estimate
    #[arg(long, value_enum, default_value_t = Method::Batch)]
    pub method: Method,
    /// What to look for, separated by commas [default: r_l1, latency, with hard stops and registration along within tolerance]
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    pub parameters: Option<Vec<String>>,
    /// Robot file to write
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Result for scripts; - for standard output
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
}

/// How the parameters are estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Method {
    /// All sightings at once
    Batch,
}

impl Method {
    /// As the robot file names it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Batch => "batch",
        }
    }
}

impl Identify {
    /// The robot file.
    ///
    /// # Errors
    /// If none is given.
    pub fn robot(&self) -> Result<&Path> {
        self.robot.as_deref().ok_or_else(|| Error::Argument("--robot is missing: the robot file to start from.".to_owned()))
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
