//! `raven-diagnose`.

use std::process::ExitCode;

use clap::Parser;

fn main() -> ExitCode {
    let out = &mut std::io::stdout();
    // A word in front, as in `raven-diagnose check DIR`; anything else is a recording.
    if std::env::args_os().nth(1).is_some_and(|word| word == "check") {
        let args = raven_diagnose::check::Args::parse_from(std::env::args_os().skip(2));
        return raven::cli::exit(raven_diagnose::check::run(args, out));
    }
    raven::cli::exit(raven_diagnose::run(raven_diagnose::Args::parse(), out))
}
