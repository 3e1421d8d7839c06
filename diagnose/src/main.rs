//! `raven-diagnose`.

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    let args = raven_diagnose::Args::parse();
    raven::cli::exit(raven_diagnose::run(args, &mut std::io::stdout()))
}
