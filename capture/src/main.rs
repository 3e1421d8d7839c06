//! `raven-capture`: records, simulates and checks sessions.

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    let args = raven_capture::Args::parse();
    raven::cli::exit(raven_capture::run(args, &mut std::io::stdout().lock()))
}
