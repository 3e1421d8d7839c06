//! The pose of cameras that nobody knows, roughly: from where both cameras see the marker while the motors move the tip.
//!
//! With points `p` before the left camera and tips `q` of the robot's kinematics at a latency, the rotation `R` and shift `t` of the least
//! squares `sum w |q - R p - t|^2` follow from means and one singular value decomposition (Kabsch 1976, Umeyama 1991):
//!
//! ```text
//! H = sum w (p - p_mean) (q - q_mean)' = U S V',   R = V diag(1, 1, det(V U')) U',   t = q_mean - R p_mean
//! ```
//!
//! Other things may have the marker's colour, and nobody knows yet which one moves with the robot. So poses of three sightings each are
//! tried, and the one that most sightings agree with is improved by weighted least squares (random sample consensus, Fischler and Bolles
//! 1981), at each latency of a grid. Three singular values of the tips say whether the motion shows a turn at all: one about the axis of a
//! motion along a line does not move anything.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Latencies that are tried: number, first, step [s]. Webcams are 5 to 150 ms late, and clocks may be off by as much.
pub const LATENCIES: usize = 31;
const FIRST_S: f64 = -0.05;
const STEP_S: f64 = 0.01;
/// Poses of three sightings that are tried. Where one sighting in five is of the marker, 24 of them are of the marker alone.
const DRAWS: usize = 3000;
/// A sighting this near to where a pose has it agrees with it [m]: radii off by 5 %, stretch, the motion between two frames.
const NEAR_M: f64 = 0.03;
/// Least extent across the longest axis of the motion, root mean square [m]. Kinematics that are off by 3 mm then turn the cameras by 17 deg
/// at most, from where the refinement still finds its way.
const LEAST_EXTENT_M: f64 = 0.01;
/// Fewest sightings that must agree, and the least part of all.
const FEWEST: usize = 30;
const LEAST_PART: f64 = 0.3;
/// Rounds of weights and pose in turn.
const ROUNDS: usize = 30;
/// Where a distance ceases to count by its square, in robust deviations.
const HUBER: f64 = 1.345;

/// What both cameras saw at one time, and where the robot's tip was.
#[derive(Debug, Clone)]
pub struct Glimpse {
    /// Points that may be the marker, left camera's frame [m].
    pub seen_m: Vec<Vector3<f64>>,
    /// The tip by the motors at each of the latencies, frame 0 [m].
    pub tips_m: Vec<Vector3<f64>>,
}

impl Glimpse {
    /// With the tip as the motors have it at a time; `None` if nothing is seen or the motors are not known all around the time.
    #[must_use]
    pub fn new(seen_m: Vec<Vector3<f64>>, tip_m: impl Fn(f64) -> Option<Vector3<f64>>) -> Option<Self> {
        let tips_m: Option<Vec<Vector3<f64>>> = (0..LATENCIES).map(|k| tip_m(latency_s(k))).collect();
        tips_m.filter(|_| !seen_m.is_empty()).map(|tips_m| Self { seen_m, tips_m })
    }
}

/// Latency of a place on the grid [s].
#[must_use]
pub fn latency_s(place: usize) -> f64 {
    FIRST_S + STEP_S * place as f64
}

/// A pose that the sightings agree on.
#[derive(Debug, Clone)]
pub struct Aligned {
    /// `x_0 = R x_left + t`.
    pub base_from_left: Isometry3<f64>,
    /// The latency of the grid at which they agree best [s].
    pub latency_s: f64,
    /// Distances of the sightings that agree [m].
    pub near_m: Vec<f64>,
}

/// Why there is none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Unaligned {
    /// Too few sightings.
    Few(usize),
    /// The tip moves along a line or not at all: its extents along three axes at right angles, root mean square [m].
    Line([f64; 3]),
    /// No pose agrees with enough sightings: the most that one agrees with.
    NoPose(usize),
}

/// The pose and latency that most glimpses agree on.
///
/// # Errors
/// Why they do not tell.
pub fn align(glimpses: &[Glimpse]) -> Result<Aligned, Unaligned> {
    if glimpses.len() < FEWEST {
        return Err(Unaligned::Few(glimpses.len()));
    }
    let tips: Vec<Vector3<f64>> = glimpses.iter().map(|g| g.tips_m[0]).collect();
    let extents = extents_m(&tips);
    let across_m = extents[1].hypot(extents[2]);
    if across_m < LEAST_EXTENT_M {
        return Err(Unaligned::Line(extents));
    }
    let start = consensus(glimpses, across_m).ok_or(Unaligned::NoPose(0))?;
    let refined = (0..LATENCIES).filter_map(|k| refined(glimpses, k, start));
    let (_, best) = refined.min_by(|a, b| a.0.total_cmp(&b.0)).ok_or(Unaligned::NoPose(0))?;
    let enough = FEWEST.max((LEAST_PART * glimpses.len() as f64) as usize);
    if best.near_m.len() < enough { Err(Unaligned::NoPose(best.near_m.len())) } else { Ok(best) }
}

/// The pose that maps the first points of the pairs to the second ones, with weights; `None` of fewer than three points, or on a line.
#[must_use]
pub fn rigid(pairs: &[(Vector3<f64>, Vector3<f64>, f64)]) -> Option<Isometry3<f64>> {
    let total: f64 = pairs.iter().map(|pair| pair.2).sum();
    let p_mean = pairs.iter().map(|(p, _, w)| p * *w).sum::<Vector3<f64>>() / total;
    let q_mean = pairs.iter().map(|(_, q, w)| q * *w).sum::<Vector3<f64>>() / total;
    let product: Matrix3<f64> = pairs.iter().map(|(p, q, w)| (p - p_mean) * (q - q_mean).transpose() * *w).sum();
    let svd = product.svd(true, true);
    let (u, v) = (svd.u?, svd.v_t?.transpose());
    let turn = v * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, (v * u.transpose()).determinant())) * u.transpose();
    let known = pairs.len() >= 3 && turn.iter().all(|x| x.is_finite()) && svd.singular_values[1] > 1e-9 * svd.singular_values[0];
    known.then(|| {
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turn));
        Isometry3::from_parts(Translation3::from(q_mean - rotation * p_mean), rotation)
    })
}

/// Root mean square extents of points along three axes at right angles, the longest first [m]: their singular values.
#[must_use]
pub fn extents_m(points: &[Vector3<f64>]) -> [f64; 3] {
    let count = points.len().max(1) as f64;
    let mean = points.iter().sum::<Vector3<f64>>() / count;
    let scatter: Matrix3<f64> = points.iter().map(|p| (p - mean) * (p - mean).transpose()).sum::<Matrix3<f64>>() / count;
    let values = scatter.svd(false, false).singular_values;
    [values[0], values[1], values[2]].map(|v| v.max(0.0).sqrt())
}

/// The pose of three sightings that most agree with.
fn consensus(glimpses: &[Glimpse], across_m: f64) -> Option<Isometry3<f64>> {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let (mut best, mut least) = (None, f64::INFINITY);
    for _ in 0..DRAWS {
        let latency = random.random_range(0..LATENCIES);
        let three: [(Vector3<f64>, Vector3<f64>, f64); 3] = std::array::from_fn(|_| {
            let glimpse = &glimpses[random.random_range(0..glimpses.len())];
            (glimpse.seen_m[random.random_range(0..glimpse.seen_m.len())], glimpse.tips_m[latency], 1.0)
        });
        if !is_triangle(&three, across_m) {
            continue;
        }
        let Some(pose) = rigid(&three) else { continue };
        let cost: f64 = glimpses.iter().map(|g| (nearest(g, latency, &pose).1 / NEAR_M).powi(2).min(1.0)).sum();
        if cost < least {
            (best, least) = (Some(pose), cost);
        }
    }
    best
}

/// Whether three sightings may be of one moving marker, and tell a pose: a triangle with a height, and sides of the same length.
fn is_triangle(three: &[(Vector3<f64>, Vector3<f64>, f64); 3], across_m: f64) -> bool {
    let sides = [0, 1, 2].map(|i| {
        let (a, b) = (&three[i], &three[(i + 1) % 3]);
        [(b.0 - a.0).norm(), (b.1 - a.1).norm()]
    });
    let alike = sides.iter().all(|[seen, tip]| (seen - tip).abs() < NEAR_M && *seen > 0.5 * tip);
    let twice_area = (three[1].1 - three[0].1).cross(&(three[2].1 - three[0].1)).norm();
    let longest = sides.iter().map(|side| side[1]).fold(0.0, f64::max);
    alike && twice_area > 0.5 * across_m * longest && longest > 0.0
}

/// The point of a glimpse that a pose puts nearest to the tip, and how far from it [m].
fn nearest(glimpse: &Glimpse, latency: usize, pose: &Isometry3<f64>) -> (Vector3<f64>, f64) {
    let off = |seen: &Vector3<f64>| (pose * nalgebra::Point3::from(*seen) - nalgebra::Point3::from(glimpse.tips_m[latency])).norm();
    let all = glimpse.seen_m.iter().map(|seen| (*seen, off(seen)));
    all.min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((Vector3::zeros(), f64::INFINITY))
}

/// A pose improved at one latency, and what it costs: squared distances, those beyond [`NEAR_M`] cut off.
fn refined(glimpses: &[Glimpse], latency: usize, start: Isometry3<f64>) -> Option<(f64, Aligned)> {
    let mut pose = start;
    for _ in 0..ROUNDS {
        let all = glimpses.iter().map(|g| (nearest(g, latency, &pose), g.tips_m[latency]));
        let near: Vec<_> = all.filter(|((_, off), _)| *off < NEAR_M).collect();
        let scale = raven::stats::robust_std(&near.iter().map(|((_, off), _)| *off).collect::<Vec<f64>>())?;
        let weighed: Vec<_> = near.iter().map(|((p, off), q)| (*p, *q, (HUBER * scale / off.max(1e-9)).min(1.0))).collect();
        let moved = rigid(&weighed)?;
        let settled = (moved.translation.vector - pose.translation.vector).norm() < 1e-7 && moved.rotation.angle_to(&pose.rotation) < 1e-7;
        pose = moved;
        if settled {
            break;
        }
    }
    let distances: Vec<f64> = glimpses.iter().map(|g| nearest(g, latency, &pose).1).collect();
    let near_m = distances.iter().copied().filter(|off| *off < NEAR_M).collect();
    let cost = distances.iter().map(|off| off.min(NEAR_M).powi(2)).sum();
    Some((cost, Aligned { base_from_left: pose, latency_s: latency_s(latency), near_m }))
}
