//! `raven-capture import`: ROS 1 bags and folders of image pairs as recordings.

pub mod bag;
pub mod chunk;
pub mod from_bag;
pub mod images;

use std::collections::BTreeMap;
use std::io::Write;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use raven::cli::{self, Outcome};
use raven::{Error, Result, files};
use serde::Serialize;

use crate::number::within;
use crate::record::args::with_extension;
use crate::ros1::topic_name;

/// Pairs of pictures per second, from one in three hours on: stamps in nanoseconds hold them, and tell one pair from the next.
const RATES_HZ: RangeInclusive<f64> = 1e-4..=1e3;

/// Arguments of `raven-capture import`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  raven-capture import session.bag -o session.mcap\n  \
                        raven-capture import session.bag --rename /cam0/image_raw/compressed=/stereo/left/image_raw/compressed -o session.mcap\n  \
                        raven-capture import boards/ -o boards.mcap      (boards/left01.png, boards/right01.png, ...)\n\n\
                        Exit codes: 0 imported, 1 failed, 2 wrong arguments, 3 imported up to where the bag is damaged, without pictures that have no\n\
                        other or are of neither camera by their names, with pictures that are cut off, or with messages that do not fit their\n\
                        definition.")]
pub struct Args {
    /// A ROS 1 bag (format 2.0), or a folder of JPEG or PNG pictures of both cameras: left*, right* or folders left, right; pairs have the same
    /// number at the end of their names.
    pub input: PathBuf,
    /// Another name for a topic of the bag; may be repeated.
    #[arg(long, value_name = "TOPIC=TOPIC", value_parser = renaming)]
    pub rename: Vec<(String, String)>,
    /// Pairs of pictures per second; a number of 16 digits or more at the end of their names is their time [ns] instead.
    #[arg(long, value_name = "N", default_value = "1", value_parser = rate_hz, allow_negative_numbers = true)]
    pub fps: f64,
    /// Write the result as JSON; `-` is standard output.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// The recording; .mcap is added if it is left off.
    #[arg(short, long, value_name = "NAME")]
    pub output: PathBuf,
}

/// What was imported.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Imported {
    /// Messages in the recording.
    pub messages: u64,
    /// Topics, or cameras.
    pub topics: Vec<String>,
    /// Sentences about what was left out, or does not fit its definition; empty if nothing is wrong.
    pub lost: Vec<String>,
    /// Sentences about stamps that cannot be read; the bytes are in the recording all the same.
    pub notices: Vec<String>,
}

/// Metadata record `session` of what is imported.
fn session(input: &Path) -> BTreeMap<String, String> {
    BTreeMap::from([
        ("tool".to_owned(), concat!("raven-capture ", env!("CARGO_PKG_VERSION")).to_owned()),
        ("imported from".to_owned(), input.file_name().unwrap_or(input.as_os_str()).to_string_lossy().into_owned()),
    ])
}

/// Imports a bag or a folder.
///
/// # Errors
/// If the input cannot be read or holds nothing to import, or the recording cannot be written.
pub fn run(args: &Args, out: &mut dyn Write) -> Result<Outcome> {
    let output = with_extension(&args.output);
    files::unused(&output)?;
    if let (Some((from, to)), true) = (args.rename.first(), args.input.is_dir()) {
        let folder = args.input.display();
        return Err(Error::Argument(format!("--rename {from}={to}: {folder} is a folder, and a folder has no topics; leave it away.")));
    }
    let pictures = args.input.is_dir().then(|| images::pictures(&args.input)).transpose()?;
    let outputs = [("-o", Some(output.as_path())), ("--json", args.json.as_deref())];
    files::apart(pictures.iter().flatten().chain([&args.input]), &outputs)?;
    let imported = match pictures {
        Some(pictures) => images::import(&args.input, pictures, args.fps, &output)?,
        None => from_bag::import(&args.input, &args.rename, &output)?,
    };
    imported.notices.iter().chain(&imported.lost).for_each(|sentence| cli::warn(sentence));
    let text = format!("{}: {} messages on {}\n", output.display(), imported.messages, imported.topics.join(", "));
    cli::results(out, &text, args.json.as_deref(), &imported)?;
    Ok(if imported.lost.is_empty() { Outcome::Done } else { Outcome::DataLost })
}

fn rate_hz(text: &str) -> Result<f64, String> {
    within(&RATES_HZ, text)
}

fn renaming(text: &str) -> Result<(String, String), String> {
    let (from, to) = text.split_once('=').ok_or("expected TOPIC=TOPIC")?;
    Ok((topic_name(from)?, topic_name(to)?))
}
