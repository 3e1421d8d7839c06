//! `raven-calibrate`: the cameras, and their place before the robot.

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    raven::interrupted::leave_nothing();
    let args = raven_calibrate::Args::parse();
    raven::cli::exit(raven_calibrate::run(args, &mut std::io::stdout().lock()))
}
