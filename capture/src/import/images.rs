//! A folder of pictures of both cameras as a recording of pairs.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use raven::log::{CameraFrame, FrameData, LogWriter, Side, Stamp, topics};
use raven::{Error, Result};

use super::{Imported, session};

/// A number with so many digits is a time in nanoseconds: 1e15 ns is the 12th of January 1970.
const DIGITS_OF_A_TIME: usize = 16;
/// Time of the first pair where the names say none (ns): recordings have no zero stamp.
const START_NS: u64 = 1_000_000_000;

/// Imports every pair among the pictures of a folder, `rate_hz` pairs per second where their names hold no time.
///
/// # Errors
/// If there is no pair, or a file cannot be read or written.
pub fn import(folder: &Path, pictures: Vec<PathBuf>, rate_hz: f64, output: &Path) -> Result<Imported> {
    let mut pairs: BTreeMap<u128, [Option<PathBuf>; 2]> = BTreeMap::new();
    let mut nameless = Vec::new();
    for path in pictures {
        let Some((side, number)) = which(folder, &path) else {
            nameless.push(path);
            continue;
        };
        let place = &mut pairs.entry(number).or_default()[side as usize];
        if let Some(other) = place {
            let (other, path) = (other.display(), path.display());
            return Err(Error::file(folder, format!("{other} and {path} are both number {number} of the {} camera.", side.name())));
        }
        *place = Some(path);
    }
    let (mut imported, mut alone, mut unreadable) = (Imported::default(), Vec::new(), Vec::new());
    let mut log = LogWriter::create(output)?;
    log.metadata("session", &session(folder))?;
    for (i, (number, pair)) in pairs.into_iter().enumerate() {
        let [Some(left), Some(right)] = pair else {
            alone.extend(pair.into_iter().flatten());
            continue;
        };
        let named = u64::try_from(number).ok().filter(|number| number.to_string().len() >= DIGITS_OF_A_TIME);
        let stamp = named.map_or_else(|| Stamp(START_NS).plus_seconds(i as f64 / rate_hz), Stamp);
        for (side, path) in [(Side::Left, left), (Side::Right, right)] {
            let bytes = fs::read(&path).map_err(|e| Error::io(&path, "read", e))?;
            log.compressed_image(side, stamp, 0, &bytes)?;
            if !is_picture(side, stamp, bytes) {
                unreadable.push(path);
            }
            imported.messages += 1;
        }
    }
    if imported.messages == 0 {
        return Err(Error::file(
            folder,
            "no pair of pictures: expected names as in left01.png and right01.png, or folders left and right.",
        ));
    }
    imported.topics = Side::BOTH.map(|side| topics::compressed(side).to_owned()).to_vec();
    imported.lost =
        alone.iter().map(|path| format!("{}: the other camera has no picture of this number; it is left out.", path.display())).collect();
    if !nameless.is_empty() {
        let names: Vec<String> = nameless.iter().map(|path| path.display().to_string()).collect();
        let sentence = format!(
            "{} pictures are left out, as their names do not say left or right, or have no number; name them as in left01.png and right01.png: {}.",
            names.len(),
            names.join(", ")
        );
        imported.lost.push(sentence);
    }
    if let Some(first) = unreadable.first() {
        let (count, all) = (unreadable.len(), imported.messages);
        let sentence = format!(
            "{count} of {all} pictures are cut off or no JPEG or PNG and cannot be decoded; they are in the recording as they are. The first of \
             them: {}.",
            first.display()
        );
        imported.lost.push(sentence);
    }
    log.finish()?;
    Ok(imported)
}

/// Whether a picture is whole, as far as its ends tell.
fn is_picture(side: Side, stamp: Stamp, bytes: Vec<u8>) -> bool {
    let data = FrameData::Jpeg(bytes);
    let frame = CameraFrame { side, stamp, log_time: stamp, frame_id: String::new(), sequence: None, data };
    frame.size().is_ok() && !frame.is_truncated()
}

/// JPEG and PNG files in a folder and in its folders `left` and `right`.
///
/// # Errors
/// If a folder cannot be read.
pub fn pictures(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut paths = Vec::new();
    let inside = Side::BOTH.map(|side| folder.join(side.name())).into_iter().filter(|folder| folder.is_dir());
    for folder in std::iter::once(folder.to_owned()).chain(inside) {
        let failed = |e| Error::io(&folder, "read", e);
        for entry in fs::read_dir(&folder).map_err(failed)? {
            let path = entry.map_err(failed)?.path();
            let extension = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
            if path.is_file() && extension.is_some_and(|extension| ["jpg", "jpeg", "png"].contains(&extension.as_str())) {
                paths.push(path);
            }
        }
    }
    paths.sort();
    Ok(paths)
}

/// Camera and number of a picture: by its folder, or else by the first letter of its name, and by the last digits of its name.
fn which(folder: &Path, path: &Path) -> Option<(Side, u128)> {
    let stem = path.file_stem()?.to_str()?;
    let parent = path.parent().filter(|parent| *parent != folder).and_then(|parent| parent.file_name()?.to_str());
    let side = match parent.unwrap_or(stem).chars().next()? {
        'l' | 'L' => Side::Left,
        'r' | 'R' => Side::Right,
        _ => return None,
    };
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let start = stem.get(..end)?.rfind(|c: char| !c.is_ascii_digit()).map_or(0, |last| last + 1);
    Some((side, stem.get(start..end)?.parse().ok()?))
}
