//! The checkerboard's corners in one image, to a few hundredths of a pixel.
//!
//! X-junctions by the ChESS response (Bennett and Lasenby 2014), each placed on the saddle of the grey values, then labelled as a grid.
//! The known size of the board does the rest: corners beyond it are cut off, missing ones are looked for where their neighbours say.

use calib_targets_chessboard::{ChessboardDetector, ChessboardParams, GrayImageView, default_chess_config, detect_corners};
use chess_corners::ImageRefiner;
use image::GrayImage;
use nalgebra::Vector2;

use crate::board::BoardSize;
use crate::grid::{Grid, Label, Relabel};
use crate::{homography, junction, saddle};

/// One board in one image.
#[derive(Debug, Clone, PartialEq)]
pub struct Sighting {
    /// Corners found [px]; the labels count from any corner.
    pub grid: Grid,
    /// Where these labels can be on the board; more than one where the image does not say.
    pub placements: Vec<Relabel>,
}

/// What an image showed, board or not, for the sentence that says why there is none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Glimpse {
    /// Places that look like a corner of squares.
    pub junctions: usize,
    /// Columns and rows of the largest grid among them, before it is cut to the board's size; zeros if there is none.
    pub span: (usize, usize),
    /// Mean grey level, 0 to 255.
    pub grey: f64,
}

/// A board with fewer corners says too little to be worth a mistake.
const FEWEST_CORNERS: usize = 12;
/// Half the window of a corner that the detector missed [px].
const WINDOW: i32 = 2;
/// How far such a corner may be from where its neighbours say, in squares.
const REACH_SQUARES: f64 = 0.15;
/// Its contrast relative to that of its neighbours.
const WEAKEST: f64 = 0.35;
/// How many neighbours predict it.
const NEIGHBOURS: usize = 12;
/// Window of the last fit, as a part of the way to the next edge. On rendered boards with blur, noise and distortion the error falls from
/// 0.017 px at 0.3 to 0.0135 px at 0.5 and 0.012 px at 0.7; half the way leaves room for bent boards and uneven light.
const WINDOW_SQUARES: f64 = 0.5;
/// A smaller window does not hold the blur of the edges [px].
const SMALLEST_WINDOW_PX: f64 = 2.5;
/// A larger one only costs time [px].
const LARGEST_WINDOW_PX: f64 = 12.0;

/// Finds the board in an image, `None` if it is not there, or too little of it; and says what the image showed.
#[must_use]
pub fn search(image: &GrayImage, size: BoardSize) -> (Option<Sighting>, Glimpse) {
    let (junctions, grid) = labelled(image);
    let pixels = image.as_raw();
    let grey = pixels.iter().map(|&g| f64::from(g)).sum::<f64>() / pixels.len().max(1) as f64;
    let span = grid.as_ref().map_or((0, 0), Grid::span);
    (grid.and_then(|grid| on_board(grid, image, size)), Glimpse { junctions, span, grey })
}

/// What of a labelled grid is the board, with all its corners.
fn on_board(mut grid: Grid, image: &GrayImage, size: BoardSize) -> Option<Sighting> {
    grid.make_right_handed();
    let strength = |grid: &Grid, label: Label| {
        grid.corners.get(&label).and_then(|&p| saddle::refine(image, p, WINDOW, 1.5)).map_or(0.0, |s| s.strength())
    };
    let all = grid.clone();
    grid.crop(size, |label| strength(&all, label));
    complete(&mut grid, image, size);
    let (columns, rows) = grid.span();
    if grid.corners.len() < FEWEST_CORNERS || columns < 3 || rows < 3 {
        return None;
    }
    sharpen(&mut grid, image);
    let placements = grid.placements(size, grid.even_squares_are_dark(image));
    (!placements.is_empty()).then_some(Sighting { grid, placements })
}

/// The number of junctions in the image, and the largest labelled grid of them.
fn labelled(image: &GrayImage) -> (usize, Option<Grid>) {
    let view = GrayImageView { width: image.width() as usize, height: image.height() as usize, data: image.as_raw() };
    let junctions = detect_corners(&view, &default_chess_config().with_refiner(ImageRefiner::saddle_point()));
    let found = ChessboardDetector::new(ChessboardParams::default()).ok().and_then(|detector| detector.detect(&junctions));
    let grid = found.map(|found| {
        let corners = found.corners.iter().map(|c| ((c.grid.u, c.grid.v), Vector2::new(f64::from(c.position.x), f64::from(c.position.y))));
        Grid { corners: corners.collect() }
    });
    (junctions.len(), grid)
}

/// Adds the corners that the detector missed: first those inside the grid, then whole lines along its edges.
fn complete(grid: &mut Grid, image: &GrayImage, size: BoardSize) {
    let Some(dark) = grid.even_squares_are_dark(image) else { return };
    loop {
        let Some(((c0, r0), (c1, r1))) = grid.extent() else { return };
        let inside: Vec<Label> = (c0..=c1).flat_map(|c| (r0..=r1).map(move |r| (c, r))).collect();
        let mut best = look_for(grid, image, &inside, dark);
        if best.is_empty() {
            let columns = |c: i32| -> Vec<Label> { (r0..=r1).map(|r| (c, r)).collect() };
            let rows = |r: i32| -> Vec<Label> { (c0..=c1).map(|c| (c, r)).collect() };
            let span = grid.span();
            let mut lines = Vec::new();
            if Grid::fits((span.0 + 1, span.1), size) {
                lines.extend([columns(c0 - 1), columns(c1 + 1)]);
            }
            if Grid::fits((span.0, span.1 + 1), size) {
                lines.extend([rows(r0 - 1), rows(r1 + 1)]);
            }
            for line in lines {
                let found = look_for(grid, image, &line, dark);
                // A line of which less than half is there may be something else beside the board.
                if 2 * found.len() >= line.len() && found.len() > best.len() {
                    best = found;
                }
            }
        }
        if best.is_empty() {
            return;
        }
        grid.corners.extend(best);
    }
}

/// Those of the corners at `labels` that the grid lacks and the image has.
fn look_for(grid: &Grid, image: &GrayImage, labels: &[Label], even_squares_are_dark: bool) -> Vec<(Label, Vector2<f64>)> {
    let missing = labels.iter().filter(|l| !grid.corners.contains_key(l));
    missing.filter_map(|&label| Some((label, look_for_one(grid, image, label, even_squares_are_dark)?))).collect()
}

fn look_for_one(grid: &Grid, image: &GrayImage, label: Label, even_squares_are_dark: bool) -> Option<Vector2<f64>> {
    let local = LocalPlane::around(grid, label)?;
    let found = saddle::refine(image, local.here, WINDOW, REACH_SQUARES * local.across.norm().min(local.down.norm()))?;
    let mut strengths: Vec<f64> = local.near.iter().filter_map(|&p| Some(saddle::refine(image, p, WINDOW, 1.5)?.strength())).collect();
    strengths.sort_by(f64::total_cmp);
    let typical = strengths.get(strengths.len() / 2)?;
    // Towards the dark squares grey falls off on both sides, towards the bright ones it rises.
    let towards_own_square = local.across + local.down;
    let rises = (towards_own_square.transpose() * found.curvature * towards_own_square)[0] > 0.0;
    let own_is_dark = ((label.0 + label.1).rem_euclid(2) == 0) == even_squares_are_dark;
    (found.strength() > WEAKEST * typical && rises != own_is_dark).then_some(found.pixel)
}

/// Moves each corner to where two blurred edges fit the grey values best.
fn sharpen(grid: &mut Grid, image: &GrayImage) {
    let fitted = |(&label, &pixel): (&Label, &Vector2<f64>)| {
        let local = LocalPlane::around(grid, label)?;
        let radius_px = (WINDOW_SQUARES * local.clearance_px()).clamp(SMALLEST_WINDOW_PX, LARGEST_WINDOW_PX);
        Some((label, junction::fit(image, pixel, [local.across, local.down], radius_px)?))
    };
    let fitted: Vec<(Label, Vector2<f64>)> = grid.corners.iter().filter_map(fitted).collect();
    grid.corners.extend(fitted);
}

/// What a corner's neighbours say about it.
struct LocalPlane {
    /// Where it is [px].
    here: Vector2<f64>,
    /// From it to the next column [px].
    across: Vector2<f64>,
    /// From it to the next row [px].
    down: Vector2<f64>,
    /// The neighbours [px].
    near: Vec<Vector2<f64>>,
}

impl LocalPlane {
    fn around(grid: &Grid, label: Label) -> Option<Self> {
        let distance = |&(c, r): &Label| (c - label.0).pow(2) + (r - label.1).pow(2);
        let mut near: Vec<(&Label, &Vector2<f64>)> = grid.corners.iter().collect();
        near.sort_by_key(|(l, _)| distance(l));
        near.truncate(NEIGHBOURS);
        let plane = |(c, r): Label| Vector2::new(f64::from(c), f64::from(r));
        let local = homography::fit(&near.iter().map(|&(&l, &p)| (plane(l), p)).collect::<Vec<_>>())?;
        let at = plane(label);
        let here = homography::apply(&local, &at)?;
        let across = homography::apply(&local, &(at + Vector2::x()))? - here;
        let down = homography::apply(&local, &(at + Vector2::y()))? - here;
        Some(Self { here, across, down, near: near.into_iter().map(|(_, &p)| p).collect() })
    }

    /// Distance from the corner to the nearest edge that is not its own [px].
    fn clearance_px(&self) -> f64 {
        self.across.perp(&self.down).abs() / self.across.norm().max(self.down.norm())
    }
}
