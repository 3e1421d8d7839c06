//! `raven-track`: the tip's position from the coloured marker in both cameras.

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    raven::interrupted::leave_nothing();
    let args = raven_track::Args::parse();
    raven::cli::exit(raven_track::run(args, &mut std::io::stdout().lock()))
}
