//! `raven-identify`: kinematic and cable parameters from recordings, and what the controller loads of them.

use std::process::ExitCode;

use clap::Parser;
use raven_identify::{Args, run};

fn main() -> ExitCode {
    raven::interrupted::leave_nothing();
    raven::cli::exit(run(Args::parse(), &mut std::io::stdout().lock()))
}
