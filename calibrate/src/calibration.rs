//! From sightings to two calibrated cameras: each alone, then both and all boards together.

use nalgebra::{Isometry3, Vector2};
use raven::camera::Pinhole;
use raven::{Error, Result};

use crate::board::Board;
use crate::bundle::{self, Free, Solution};
use crate::corners::Sighting;
use crate::grid::{Grid, Relabel};
use crate::linear::{Block, Corner, Huber, Rig, View};
use crate::pairing::{self, Pair};
use crate::start;
use crate::uncertainty::Deviations;

/// What both cameras saw at one instant.
#[derive(Debug, Clone)]
pub struct Shot {
    /// How to name it to the user: a file or a time.
    pub name: String,
    /// Left and right; `None` where no board was found.
    pub sightings: [Option<Sighting>; 2],
}

/// Cameras calibrated together.
#[derive(Debug, Clone)]
pub struct Calibration {
    /// Cameras, the pose between them, and the boards.
    pub rig: Rig,
    /// Each camera alone.
    pub mono: [Mono; 2],
    /// Reprojection RMS of both cameras with one pose per board [px].
    pub rms_px: f64,
    /// Covariance of the shared parameters; `None` if one board alone determines some.
    pub deviations: Option<Deviations>,
    /// Index of the shot and RMS [px] of each pair that was used as one.
    pub pairs: Vec<(usize, f64)>,
    /// Shots whose two grids could not be matched; both were used, each with a pose of its own.
    pub unmatched: Vec<usize>,
    /// Largest cosine between residuals and a column of their Jacobian: 0 at the optimum.
    pub gradient: f64,
    /// What the cameras together were fitted to: first the pairs, then boards seen by one camera alone; as the rig's boards.
    pub views: Vec<View>,
    /// Index of the shot of each view.
    pub shot_of_view: Vec<usize>,
    /// Normal equations at the optimum, one block per view.
    pub blocks: Vec<Block>,
    /// What was solved for.
    pub free: Free,
    /// Loss at the end.
    pub huber: Huber,
    /// Boards whose place on the bowed board is not known, for they are cut off; they were taken for flat.
    pub unplaced: usize,
}

/// What to solve for beyond the ordinary.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Options {
    /// The sixth-order radial distortion.
    pub k3: bool,
    /// The board's bow.
    pub bow: bool,
}

impl Calibration {
    /// Standard deviation of a shared parameter, if it is known.
    #[must_use]
    pub fn std(&self, parameter: usize) -> Option<f64> {
        Some(self.deviations.as_ref()?.covariance[(parameter, parameter)].sqrt())
    }
}

impl Options {
    fn free(self, pair: bool) -> Free {
        Free { shared: true, pair, k3: self.k3, bow: self.bow }
    }
}

/// One camera calibrated alone.
#[derive(Debug, Clone)]
pub struct Mono {
    /// The camera.
    pub camera: Pinhole,
    /// Reprojection RMS [px].
    pub rms_px: f64,
    /// `x_camera = pose x_label`, by shot; `None` where no board was seen.
    pub poses: Vec<Option<Isometry3<f64>>>,
    /// RMS of each board [px], by shot.
    pub board_rms_px: Vec<Option<f64>>,
}

/// Fewest boards that determine a camera with its distortion and leave something to check it by.
pub const FEWEST_BOARDS: usize = 3;
/// From how many standard deviations on a corner is an outlier.
const OUTLIER_SIGMAS: f64 = 4.0;

/// Calibrates two cameras from what they saw of a board.
///
/// # Errors
/// If a camera saw fewer than three boards, no board was seen by both, or the boards do not determine the cameras.
pub fn calibrate(shots: &[Shot], sizes_px: [(u32, u32); 2], board: &Board, options: Options) -> Result<Calibration> {
    let mono = [calibrate_alone(shots, 0, sizes_px[0], board, options)?, calibrate_alone(shots, 1, sizes_px[1], board, options)?];
    let both: Vec<(usize, Pair<'_>)> = shots.iter().enumerate().filter_map(|(i, shot)| Some((i, pair(shot, i, &mono)?))).collect();
    let (indices, pairs): (Vec<usize>, Vec<Pair<'_>>) = both.into_iter().unzip();
    let matched = pairing::matched(&pairs, &mono[1].camera, board.square_m).ok_or_else(|| {
        Error::Data("no board was seen by both cameras at once, so the pose between them is unknown; show the board to both.".to_owned())
    })?;
    let (mut views, mut boards, mut shots_of_pairs, mut unmatched) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut unplaced = 0;
    for (&shot, relabel) in indices.iter().zip(&matched.relabel) {
        let Some(relabel) = relabel else {
            unmatched.push(shot);
            continue;
        };
        let (Some(left), Some(right), Some(pose)) = (&shots[shot].sightings[0], &shots[shot].sightings[1], mono[0].poses[shot]) else {
            continue;
        };
        let places: Vec<Relabel> = left.placements.iter().filter(|l| right.placements.contains(&l.after(relabel))).copied().collect();
        let seen = [corners(&left.grid, None, &places, board), corners(&right.grid, Some(relabel), &places, board)];
        unplaced += usize::from(seen.iter().any(|s| !s.1));
        views.push(seen.map(|s| s.0));
        boards.push(pose);
        shots_of_pairs.push(shot);
    }
    if views.len() < FEWEST_BOARDS.min(indices.len()) {
        return Err(Error::Data(format!(
            "{} of the {} boards that both cameras saw agree on the pose between the cameras, and {FEWEST_BOARDS} are needed; give pictures of left and \
             right that were taken at one instant.",
            views.len(),
            indices.len()
        )));
    }
    let mut shot_of_view = shots_of_pairs.clone();
    let alone = |shot: usize| !shots_of_pairs.contains(&shot);
    for (shot, _) in shots.iter().enumerate().filter(|(i, _)| alone(*i)) {
        for (camera, mono) in mono.iter().enumerate() {
            let (Some(sighting), Some(pose)) = (&shots[shot].sightings[camera], mono.poses[shot]) else { continue };
            let (seen, placed) = corners(&sighting.grid, None, &sighting.placements, board);
            unplaced += usize::from(!placed);
            shot_of_view.push(shot);
            views.push(if camera == 0 { [seen, Vec::new()] } else { [Vec::new(), seen] });
            boards.push(if camera == 0 { pose } else { matched.right_from_left.inverse() * pose });
        }
    }
    let rig = Rig { cameras: [mono[0].camera, mono[1].camera], right_from_left: matched.right_from_left, bow_m: Vector2::zeros(), boards };
    let free = options.free(true);
    let (solution, huber) = robust(rig, &views, free).ok_or_else(undetermined)?;
    let residuals = residuals(&solution.rig, &views);
    let pairs = shots_of_pairs.into_iter().zip(residuals.iter().map(|both| rms(both.iter().flatten()))).collect();
    Ok(Calibration {
        rms_px: rms(residuals.iter().flatten().flatten()),
        deviations: Deviations::of(&solution.blocks, free),
        pairs,
        unmatched,
        gradient: solution.gradient,
        rig: solution.rig,
        mono,
        views,
        shot_of_view,
        blocks: solution.blocks,
        free,
        huber,
        unplaced: if options.bow { unplaced } else { 0 },
    })
}

fn pair<'a>(shot: &'a Shot, index: usize, mono: &[Mono; 2]) -> Option<Pair<'a>> {
    let [Some(left), Some(right)] = &shot.sightings else { return None };
    Some(Pair { left, right, left_from_label: mono[0].poses[index]?, right_from_label: mono[1].poses[index]? })
}

/// Calibrates one camera from all boards that it saw.
fn calibrate_alone(shots: &[Shot], camera: usize, (width, height): (u32, u32), board: &Board, options: Options) -> Result<Mono> {
    let name = ["left", "right"][camera];
    let mut used = Vec::new();
    let mut seen: Vec<Vec<Corner>> = Vec::new();
    for (shot, sighting) in shots.iter().enumerate().filter_map(|(i, s)| Some((i, s.sightings[camera].as_ref()?))) {
        used.push(shot);
        seen.push(corners(&sighting.grid, None, &sighting.placements, board).0);
    }
    if used.len() < FEWEST_BOARDS {
        return Err(Error::Data(format!(
            "the {name} camera saw {} of {FEWEST_BOARDS} boards needed, in {} images; check --board (inner corners, not squares) and the light.",
            used.len(),
            shots.len()
        )));
    }
    let views: Vec<View> = seen.iter().map(|corners| [corners.clone(), Vec::new()]).collect();
    let slices: Vec<&[Corner]> = seen.iter().map(Vec::as_slice).collect();
    let told = start::focal_px(width, height, &slices);
    let guesses = [0.7, 1.0, 1.5, 2.5].map(|f| f * f64::from(width));
    let free = options.free(false);
    let solve_from = |focal: f64| {
        let plain = start::plain_camera(width, height, focal);
        let boards = slices.iter().map(|c| start::board_pose(&plain, c)).collect::<Option<Vec<_>>>()?;
        let rig = Rig { cameras: [plain; 2], right_from_left: Isometry3::identity(), bow_m: Vector2::zeros(), boards };
        robust(rig, &views, free).map(|(solution, _)| solution)
    };
    let solutions = told.iter().chain(if told.is_some() { &[][..] } else { &guesses }).filter_map(|&f| solve_from(f)).filter(plausible);
    let best = solutions.min_by(|a, b| a.cost.total_cmp(&b.cost)).ok_or_else(undetermined)?;
    let residuals = residuals(&best.rig, &views);
    let mut poses = vec![None; shots.len()];
    let mut board_rms_px = vec![None; shots.len()];
    for ((&shot, pose), residuals) in used.iter().zip(&best.rig.boards).zip(&residuals) {
        poses[shot] = Some(*pose);
        board_rms_px[shot] = Some(rms(&residuals[0]));
    }
    Ok(Mono { camera: best.rig.cameras[0], rms_px: rms(residuals.iter().flatten().flatten()), poses, board_rms_px })
}

fn plausible(solution: &Solution) -> bool {
    let camera = &solution.rig.cameras[0];
    let numbers = [camera.fx, camera.fy, camera.cx, camera.cy];
    camera.fx > 0.0 && camera.fy > 0.0 && numbers.iter().chain(&camera.distortion).all(|v| v.is_finite())
}

fn undetermined() -> Error {
    Error::Data("the boards do not determine the cameras; show the board tilted, near and far, and in all parts of the image.".to_owned())
}

/// Least squares first, then with Huber's loss at four standard deviations of the bulk of the corners.
fn robust(rig: Rig, views: &[View], free: Free) -> Option<(Solution, Huber)> {
    let mut huber = Huber { threshold_px: f64::INFINITY };
    let mut solution = bundle::solve(rig, views, free, huber)?;
    for _ in 0..2 {
        let distances: Vec<f64> = residuals(&solution.rig, views).iter().flatten().flatten().map(Vector2::norm).collect();
        // The median of the length of a two-dimensional normal deviate is 1.1774 standard deviations.
        let sigma = raven::stats::median(&distances)? / 1.1774;
        // Corners without noise would make rounding an outlier.
        huber = Huber { threshold_px: OUTLIER_SIGMAS * sigma.max(1e-6) };
        solution = bundle::solve(solution.rig, views, free, huber)?;
    }
    Some((solution, huber))
}

/// Projected less measured pixels of every view, by camera.
#[must_use]
pub fn residuals(rig: &Rig, views: &[View]) -> Vec<[Vec<Vector2<f64>>; 2]> {
    views.iter().enumerate().filter_map(|(i, view)| rig.residuals(i, view)).collect()
}

/// Root of the mean squared length.
pub fn rms<'a>(residuals: impl IntoIterator<Item = &'a Vector2<f64>>) -> f64 {
    let (sum, count) = residuals.into_iter().fold((0.0, 0.0), |(s, n), r| (s + r.norm_squared(), n + 1.0));
    (sum / count).sqrt()
}

/// Corners as the solver takes them, and whether it is known where on the board they are: a cut-off board may sit at several `places`.
fn corners(grid: &Grid, relabel: Option<&Relabel>, places: &[Relabel], board: &Board) -> (Vec<Corner>, bool) {
    let at = |label| relabel.map_or(label, |r: &Relabel| r.apply(label));
    let bow = |label| {
        let mut bows = places.iter().map(|place| board.bow(place.apply(at(label))));
        let first = bows.next()?;
        bows.all(|other| (other - first).amax() < 1e-9).then_some(first)
    };
    let bows: Option<Vec<Vector2<f64>>> = grid.corners.keys().map(|&label| bow(label)).collect();
    let bow_at = |i: usize| bows.as_ref().map_or_else(Vector2::zeros, |b| b[i]);
    let corner = |(i, (&label, &pixel)): (usize, (&_, &_))| Corner { point: board.point(at(label)), bow: bow_at(i), pixel };
    (grid.corners.iter().enumerate().map(corner).collect(), bows.is_some())
}
