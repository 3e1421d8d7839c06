//! Pictures of the board: from files or from a log, searched on all cores, and put together in pairs.

use std::collections::{BTreeMap, HashSet};
use std::path::{Path, PathBuf};

use image::GrayImage;
use raven::cli;
use raven::log::{CameraFrame, FrameData, Side, Stamp, frames};
use raven::{Error, Result};
use rayon::prelude::*;

use crate::board::BoardSize;
use crate::calibration::Shot;
use crate::corners::{self, Glimpse, Sighting};
use crate::film::Film;
use crate::glimpses::Glimpses;
use crate::stills;

/// What the pictures showed.
#[derive(Debug, Clone)]
pub struct Pictures {
    /// Left and right at one instant.
    pub shots: Vec<Shot>,
    /// Every picture of a log, left and right; `None` of files.
    pub films: Option<[Film; 2]>,
    /// Width and height of each camera's pictures [px].
    pub sizes_px: [(u32, u32); 2],
    /// Pictures of each camera.
    pub pictures: [usize; 2],
    /// Those with a board in them.
    pub boards_seen: [usize; 2],
    /// Pictures that could not be decoded.
    pub undecodable: usize,
    /// Pictures of a log left out as their camera had taken one with that stamp before.
    pub repeated: usize,
    /// What they showed, board or not.
    pub glimpses: Glimpses,
}

/// One picture, searched.
struct Searched {
    side: Side,
    stamp: Stamp,
    size_px: (u32, u32),
    sighting: Option<Sighting>,
    glimpse: Glimpse,
}

/// Pictures held in memory at a time.
const BATCH: usize = 32;

/// Searches picture files, the left and right ones paired in order.
///
/// # Errors
/// If there are not as many of both, the numbers in their names say that others are pairs, a file cannot be read or is no picture, or a
/// camera's pictures differ in size.
pub fn from_files(left: &[PathBuf], right: &[PathBuf], board: BoardSize) -> Result<Pictures> {
    if left.len() != right.len() {
        let counts = format!("{} left and {} right", left.len(), right.len());
        return Err(Error::Argument(format!("there are {counts} pictures; they are paired in the order of their names, one by one.")));
    }
    if let Some([of_left, paired, own]) = mispaired(left, right) {
        return Err(Error::file(
            of_left,
            format!(
                "in the order of names its pair is {}, but by its number {}; leave pictures out that have no partner.",
                paired.display(),
                own.display()
            ),
        ));
    }
    let bar = cli::progress(2 * left.len() as u64, "looking for boards");
    let search = |side: Side, path: &Path| {
        let image = read(path, side)?;
        let (sighting, glimpse) = corners::search(&image, board);
        let found = Searched { side, stamp: Stamp(0), size_px: image.dimensions(), sighting, glimpse };
        bar.inc(1);
        Ok(found)
    };
    let pairs: Vec<(&PathBuf, &PathBuf)> = left.iter().zip(right).collect();
    let both: Vec<[Searched; 2]> =
        pairs.par_iter().map(|(l, r)| Ok([search(Side::Left, l)?, search(Side::Right, r)?])).collect::<Result<_>>()?;
    bar.finish_and_clear();
    let mut pictures = Pictures::empty();
    for ([l, r], (left, right)) in both.into_iter().zip(pairs) {
        let name = |path: &PathBuf| path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        pictures.count(&l, &name(left)).map_err(|message| Error::file(left, message))?;
        pictures.count(&r, &name(right)).map_err(|message| Error::file(right, message))?;
        let name = name(left);
        pictures.shots.push(Shot { name, sightings: [l.sighting, r.sighting] });
    }
    Ok(pictures)
}

/// The first left picture whose number is that of another right picture than the one in its place: the left one, that in its place, and that of its
/// number. Numbers that are in no name of the other side, as times may be, say nothing.
fn mispaired<'a>(left: &'a [PathBuf], right: &'a [PathBuf]) -> Option<[&'a PathBuf; 3]> {
    let by_number: BTreeMap<u64, &PathBuf> = right.iter().filter_map(|path| Some((number(path)?, path))).collect();
    // One number in all names, as a size may be, is none of the picture's.
    let numbers = left.iter().map(|path| number(path)).collect::<Option<Vec<_>>>().filter(|_| by_number.len() == right.len())?;
    left.iter().zip(right).zip(numbers).find_map(|((left, paired), number)| {
        let own = *by_number.get(&number)?;
        (own != paired).then_some([left, paired, own])
    })
}

/// The last number in a file's name.
fn number(path: &Path) -> Option<u64> {
    let name = path.file_stem()?.to_str()?;
    name.rsplit(|c: char| !c.is_ascii_digit()).find(|digits| !digits.is_empty())?.parse().ok()
}

fn read(path: &Path, side: Side) -> Result<GrayImage> {
    let bytes = std::fs::read(path).map_err(|e| Error::io(path, "read", e))?;
    let frame =
        CameraFrame { side, stamp: Stamp(0), log_time: Stamp(0), frame_id: String::new(), sequence: None, data: FrameData::Jpeg(bytes) };
    if frame.is_truncated() {
        return Err(Error::file(path, "this picture is cut off: it has no end; copy it again, or leave its pair out."));
    }
    frame.decode_gray().map_err(|_| Error::file(path, "this is no picture that can be decoded; JPEG and PNG are read."))
}

/// Searches the pictures of a log. A left and a right one are a pair if each is the other's nearest and they are within half a period; of
/// pictures in quick succession the one is kept in which the board moved least. One that is in the log twice counts once.
///
/// # Errors
/// If the log cannot be read, has no pictures, or a camera's pictures differ in size.
pub fn from_log(path: &Path, board: BoardSize) -> Result<Pictures> {
    let mut pictures = Pictures::empty();
    let mut seen: [Vec<(Stamp, Option<Sighting>)>; 2] = [Vec::new(), Vec::new()];
    let mut stamps = HashSet::new();
    let mut source = frames(path)?;
    let bar = cli::spinner("looking for boards");
    loop {
        let batch: Vec<CameraFrame> = source.by_ref().take(BATCH).collect::<Result<_>>()?;
        if batch.is_empty() {
            break;
        }
        let search = |frame: &CameraFrame| {
            let image = if frame.is_truncated() { None } else { frame.decode_gray().ok() }?;
            let (sighting, glimpse) = corners::search(&image, board);
            Some(Searched { side: frame.side, stamp: frame.stamp, size_px: image.dimensions(), sighting, glimpse })
        };
        let searched: Vec<Searched> = batch.par_iter().filter_map(search).collect();
        pictures.undecodable += batch.len() - searched.len();
        for one in searched {
            if !stamps.insert((one.side, one.stamp)) {
                pictures.repeated += 1;
                continue;
            }
            let name = format!("the {} one of {:.3} s", one.side.name(), 1e-9 * one.stamp.0 as f64);
            pictures.count(&one, &name).map_err(|message| Error::file(path, message))?;
            seen[one.side as usize].push((one.stamp, one.sighting));
        }
        bar.inc(batch.len() as u64);
    }
    bar.finish_and_clear();
    seen.iter_mut().for_each(|side| side.sort_by_key(|(stamp, _)| *stamp));
    let origin = seen.iter().flatten().map(|(stamp, _)| *stamp).min().unwrap_or_default();
    let films = seen.map(|seen| Film::new(origin, seen));
    pictures.shots = stills::shots(&films, 0.0);
    pictures.films = Some(films);
    Ok(pictures)
}

impl Pictures {
    fn empty() -> Self {
        Self {
            shots: Vec::new(),
            films: None,
            sizes_px: [(0, 0); 2],
            pictures: [0; 2],
            boards_seen: [0; 2],
            undecodable: 0,
            repeated: 0,
            glimpses: Glimpses::default(),
        }
    }

    /// Counts a picture; a sentence if its size differs from that of the others of its camera.
    fn count(&mut self, searched: &Searched, name: &str) -> Result<(), String> {
        let camera = searched.side as usize;
        let (size, known) = (searched.size_px, &mut self.sizes_px[camera]);
        if self.pictures[camera] == 0 {
            *known = size;
        } else if *known != size {
            let ((w, h), side) = (size, searched.side.name());
            return Err(format!(
                "a {side} picture is {w} x {h}, the others are {} x {}; calibrate with pictures of one size.",
                known.0, known.1
            ));
        }
        self.pictures[camera] += 1;
        self.glimpses.add(name, searched.glimpse);
        self.boards_seen[camera] += usize::from(searched.sighting.is_some());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_whose_numbers_contradict_their_order_are_no_pairs() {
        let paths = |names: &[&str]| names.iter().map(PathBuf::from).collect::<Vec<_>>();
        let mispaired = |left: &[&str], right: &[&str]| {
            let (left, right) = (paths(left), paths(right));
            super::mispaired(&left, &right).map(|files| files.map(|path| path.display().to_string()))
        };
        let of = |names: [&str; 3]| Some(names.map(str::to_owned));
        assert_eq!(mispaired(&["l01.png", "l02.png"], &["r1.png", "r2.png"]), None);
        assert_eq!(mispaired(&["l01.png", "l03.png"], &["r02.png", "r03.png"]), None);
        assert_eq!(mispaired(&["l01.png", "l02.png"], &["r02.png", "r03.png"]), of(["l02.png", "r03.png", "r02.png"]));
        // Sizes, times and names without numbers say nothing.
        assert_eq!(mispaired(&["l1_640.png", "l2_640.png"], &["r1_640.png", "r2_640.png"]), None);
        assert_eq!(mispaired(&["a.png", "b.png"], &["c.png", "d.png"]), None);
        assert_eq!(mispaired(&["l1700000001.png", "l1700000034.png"], &["r1700000002.png", "r1700000035.png"]), None);
    }
}
