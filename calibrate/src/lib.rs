//! Calibrates the two cameras, and registers them to the robot.

mod align;
mod anywhere;
mod board;
mod bundle;
mod calibration;
mod cameras;
mod corners;
mod desync;
mod export;
mod figures;
mod film;
mod folds;
mod from_motion;
mod glimpses;
mod glob;
mod grid;
mod hard_stop;
mod homography;
mod junction;
mod linear;
mod map;
mod mount;
mod moving;
mod page;
mod pairing;
mod pictures;
mod register;
mod registration;
mod saddle;
mod start;
mod stills;
mod summary;
mod uncertainty;
mod verdict;

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
