//! Sessions of the virtual lab, whose plant shares no equations with the fitted model, and what the program finds in them.

use std::path::Path;

use clap::Parser;
use raven::robot::nominal;
use raven::simulation::{Motion, Options, Session};
use raven::stats::chi_square_quantile;
use raven_identify::{Args, run};
use serde_json::Value;

/// What is found of one session with more arguments, as scripts read it. The folder then has its cameras in `cameras.yaml`.
pub fn identified(options: Options, motion: Motion, duration_s: f64, arguments: &[&str], folder: &Path) -> Value {
    let robot = nominal::gold();
    let session = Session::new(&robot, options).unwrap();
    let (log, file, result) = (folder.join("log.mcap"), folder.join("robot.yaml"), folder.join("result.json"));
    session.record(motion, duration_s, &log, |_| ()).unwrap();
    session.cameras().unwrap().write(&folder.join("cameras.yaml")).unwrap();
    robot.write(&file).unwrap();
    let line = [Path::new("raven-identify"), &log, "--robot".as_ref(), &file, "--json".as_ref(), &result];
    let more = arguments.iter().map(Path::new);
    run(Args::parse_from(line.into_iter().chain(more)), &mut Vec::new()).unwrap();
    serde_json::from_str(&std::fs::read_to_string(&result).unwrap()).unwrap()
}

/// What a result says of a number.
pub fn found<'a>(result: &'a Value, name: &str) -> Option<&'a Value> {
    result["parameters"].as_array()?.iter().find(|found| found["name"] == name)
}

/// Below which 99 % of the means of so many squared normals lie.
pub fn mean_square_max(count: u64) -> f64 {
    chi_square_quantile(count as usize, 0.99).unwrap() / count as f64
}
