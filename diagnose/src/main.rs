//! `raven-diagnose`.

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    raven::interrupted::leave_nothing();
    let out = &mut std::io::stdout();
    // A word in front, as in `raven-diagnose check DIR`; anything else is a recording.
    let word = std::env::args_os().nth(1).unwrap_or_default();
    let outcome = match word.to_str() {
        Some("check") => raven_diagnose::check::run(raven_diagnose::check::Args::parse_from(std::env::args_os().skip(2)), out),
        Some("effects") => raven_diagnose::print_library(out),
        _ => raven_diagnose::run(raven_diagnose::Args::parse(), out),
    };
    raven::cli::exit(outcome)
}
