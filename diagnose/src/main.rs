//! `raven-diagnose`.

use std::process::ExitCode;

use clap::Parser;

/// Prints the library of effects, as docs/effects.md has it.
///
/// Example:
///   raven-diagnose effects > effects.md
#[derive(Debug, Parser)]
#[command(bin_name = "raven-diagnose effects", no_binary_name = true, version, verbatim_doc_comment)]
struct EffectsArgs {}

fn main() -> ExitCode {
    raven::interrupted::leave_nothing();
    let out = &mut std::io::stdout();
    // A word in front, as in `raven-diagnose check DIR`; anything else is a recording.
    let word = std::env::args_os().nth(1).unwrap_or_default();
    let after_word = || std::env::args_os().skip(2);
    let outcome = match word.to_str() {
        Some("check") => raven_diagnose::check::run(raven_diagnose::check::Args::parse_from(after_word()), out),
        Some("effects") => {
            let EffectsArgs {} = EffectsArgs::parse_from(after_word());
            raven_diagnose::print_library(out)
        }
        _ => raven_diagnose::run(raven_diagnose::Args::parse(), out),
    };
    raven::cli::exit(outcome)
}
