//! The program `raven-capture`, whose webcams are replayed: `replayed_lab record --left serial:L1 --right serial:R1 ... -o session.mcap` records
//! pictures from memory at 30 frames per second for the cameras that are named, whatever they are called.

#[path = "../tests/lab/mod.rs"]
mod lab;

use std::process::ExitCode;

use clap::Parser;
use lab::film::Webcam;
use raven::cli;
use raven::log::Side;
use raven_capture::{Args, Command, record};

fn main() -> ExitCode {
    let args = Args::parse();
    let Command::Record(args) = args.command else { return cli::exit(raven_capture::run(args, &mut std::io::stdout())) };
    let chosen = [(Side::Left, &args.left), (Side::Right, &args.right)].into_iter().filter(|(_, camera)| camera.is_some());
    let cameras = chosen.map(|(side, _)| (side, Webcam::driver(side))).collect();
    cli::exit(record::record(&args, cameras, &mut std::io::stdout()))
}
