//! `raven-capture`: records, simulates and checks sessions.

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    let args = raven_capture::Args::parse();
    if !args.command.opens_cameras() {
        raven::interrupted::leave_nothing();
    }
    raven::cli::exit(raven_capture::run(args, &mut std::io::stdout().lock()))
}
