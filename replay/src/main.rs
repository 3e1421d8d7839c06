//! `raven-replay`.

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    let args = raven_replay::Args::parse();
    raven::cli::exit(raven_replay::run(args, &mut std::io::stdout()))
}
