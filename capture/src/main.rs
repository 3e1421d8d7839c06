//! `raven-capture`: records, simulates and checks sessions.

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    let args = raven_capture::Args::parse();
    if !matches!(args.command, raven_capture::Command::Record(_)) {
        raven::interrupted::leave_nothing();
    }
    raven::cli::exit(raven_capture::run(args, &mut std::io::stdout().lock()))
}
