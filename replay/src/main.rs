//! `raven-replay`.

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    raven::interrupted::leave_nothing();
    let args = raven_replay::Args::parse();
    raven::cli::exit(raven_replay::run(args, &mut std::io::stdout()))
}
