//! Records, simulates and checks sessions.

pub mod camera;
pub mod check;
pub mod clock;
pub mod cut;
pub mod devices;
pub mod import;
mod number;
pub mod record;
pub mod robot_trial;
pub mod ros1;
pub mod seal;
pub mod simulate;
pub mod steps;
mod table;

use std::io::Write;

use clap::{Parser, Subcommand};
use raven::Result;
use raven::cli::Outcome;

/// Record, simulate and check sessions of a cable-driven robot.
#[derive(Debug, Parser)]
#[command(version, arg_required_else_help = true)]
pub struct Args {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Say what is in a log, what is missing, and repair one that was cut off.
    Check(check::Args),
    /// Cut a part out of a log.
    Cut(cut::Args),
    /// Turn a ROS 1 bag, or a folder of image pairs, into a recording.
    Import(import::Args),
    /// Record cameras and topics of a ROS 1 robot, byte for byte.
    Record(Box<record::Args>),
    /// Record a virtual lab: a robot that hides what you ask it to, and two webcams.
    Simulate(simulate::Args),
}

impl Command {
    /// Whether cameras are opened, which must be put back: such a command ends by itself when it is stopped.
    #[must_use]
    pub const fn opens_cameras(&self) -> bool {
        match self {
            Self::Record(_) => true,
            Self::Check(args) => args.devices.devices,
            Self::Cut(_) | Self::Import(_) | Self::Simulate(_) => false,
        }
    }
}

/// Runs the program; the result goes to `out`.
///
/// # Errors
/// A sentence for the user.
pub fn run(args: Args, out: &mut dyn Write) -> Result<Outcome> {
    match args.command {
        Command::Check(args) => check::run(&args, out),
        Command::Cut(args) => cut::run(&args, out),
        Command::Import(args) => import::run(&args, out),
        Command::Record(args) => record::run(&args, out),
        Command::Simulate(args) => simulate::run(&args, out),
    }
}
