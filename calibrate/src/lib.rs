//! Calibrates the two cameras, and registers them to the robot.

pub mod align;
pub mod anywhere;
pub mod board;
pub mod bundle;
pub mod calibration;
pub mod cameras;
pub mod corners;
pub mod desync;
pub mod export;
pub mod figures;
pub mod film;
pub mod folds;
pub mod from_motion;
pub mod glimpses;
pub mod glob;
pub mod grid;
pub mod hard_stop;
pub mod homography;
pub mod junction;
pub mod linear;
pub mod map;
pub mod mount;
pub mod moving;
pub mod page;
pub mod pairing;
pub mod pictures;
pub mod register;
pub mod registration;
pub mod saddle;
pub mod start;
pub mod stills;
pub mod summary;
pub mod uncertainty;
pub mod verdict;

use std::io::Write;

use clap::{Parser, Subcommand};
use raven::Result;
use raven::cli::Outcome;

/// Calibrate the cameras, and register them to the robot.
#[derive(Debug, Clone, Parser)]
#[command(version, arg_required_else_help = true)]
pub struct Args {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Clone, Subcommand)]
pub enum Command {
    /// Calibrate both cameras and the pose between them from pictures of a checkerboard.
    Cameras(cameras::CamerasArgs),
    /// Register the cameras to the robot from a recording at the hard stop, and from motion.
    Register(register::RegisterArgs),
}

/// Runs the program; the result goes to `out`.
///
/// # Errors
/// A sentence for the user.
pub fn run(args: Args, out: &mut dyn Write) -> Result<Outcome> {
    match args.command {
        Command::Cameras(args) => cameras::run(&args, out),
        Command::Register(args) => register::run(&args, out),
    }
}

#[cfg(test)]
mod tests;
