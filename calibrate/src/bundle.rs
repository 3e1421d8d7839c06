//! Bundle adjustment: cameras, the pose between them and all boards at once, by Levenberg and Marquardt's method.
//!
//! Each board's pose appears in its own corners only, so it is eliminated from the normal equations (Schur's complement), which leaves a
//! system of the 26 shared parameters whatever the number of boards:
//!
//! ```text
//! S = sum_b A_b - B_b C_b^-1 B_b',   s = sum_b a_b - B_b C_b^-1 c_b,   S d = -s,   d_b = -C_b^-1 (c_b + B_b' d)
//! ```

use nalgebra::{SMatrix, SVector, Vector6};

use crate::linear::{BOW, Block, CAMERA, Huber, PAIR, Rig, SHARED, View};

/// Which of the shared parameters are solved for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Free {
    /// Any at all; without them each board is placed before cameras that stay.
    pub shared: bool,
    /// Right camera and the pose between the cameras; without them this calibrates the left camera alone.
    pub pair: bool,
    /// The distortion's sixth-order term.
    pub k3: bool,
    /// The board's bow.
    pub bow: bool,
}

impl Free {
    /// Whether a shared parameter is solved for.
    #[must_use]
    pub fn parameter(self, index: usize) -> bool {
        let k3 = index == CAMERA - 1 || index == PAIR - 1;
        let bow = index >= BOW;
        self.shared && (self.k3 || !k3) && if bow { self.bow } else { self.pair || index < CAMERA }
    }
}

/// Where the solver came to rest.
#[derive(Debug, Clone)]
pub struct Solution {
    /// Cameras and boards.
    pub rig: Rig,
    /// Cost [px^2].
    pub cost: f64,
    /// Largest cosine between the residuals and a column of their Jacobian: 0 at the optimum.
    pub gradient: f64,
    /// Normal equations there, one block per view, fixed parameters struck out.
    pub blocks: Vec<Block>,
}

/// Iterations after which a calibration that has not come to rest is given up: ordinary ones need 10 to 30.
const MOST_ITERATIONS: usize = 300;

/// Moves `rig` to the least robust cost; `None` if a board is behind a camera at the start, or the corners do not determine it.
#[must_use]
pub fn solve(mut rig: Rig, views: &[View], free: Free, huber: Huber) -> Option<Solution> {
    let mut blocks = linearise(&rig, views, free, huber)?;
    let mut cost: f64 = blocks.iter().map(|b| b.cost).sum();
    let mut damping = 1e-4;
    let mut iterations = 1;
    while iterations < MOST_ITERATIONS {
        let (shared, boards) = step(&blocks, free, damping)?;
        let trial = rig.moved(&shared, &boards);
        let trial_cost: f64 = views.iter().enumerate().map(|(i, view)| trial.cost(i, view, huber)).sum();
        // What is left to gain is beneath the rounding of the cost: nothing moves any more.
        let gain = expected_gain(&blocks, &shared, &boards);
        if gain <= 1e-15 * cost + 1e-26 {
            if trial_cost < cost {
                rig = trial;
                blocks = linearise(&rig, views, free, huber)?;
            }
            break;
        }
        if trial_cost < cost {
            rig = trial;
            damping = (damping * 0.05).max(1e-12);
            blocks = linearise(&rig, views, free, huber)?;
            cost = blocks.iter().map(|b| b.cost).sum();
            iterations += 1;
        } else if damping > 1e8 {
            break;
        } else {
            damping *= 10.0;
        }
    }
    let gradient = steepest(&blocks, cost);
    Some(Solution { rig, cost, gradient, blocks })
}

/// Normal equations of all views, the rows and columns of fixed parameters struck out.
fn linearise(rig: &Rig, views: &[View], free: Free, huber: Huber) -> Option<Vec<Block>> {
    let strike = |mut block: Block| {
        for index in (0..SHARED).filter(|&i| !free.parameter(i)) {
            block.shared[index] = 0.0;
            block.shared_shared.row_mut(index).fill(0.0);
            block.shared_shared.column_mut(index).fill(0.0);
            block.shared_pose.row_mut(index).fill(0.0);
        }
        block
    };
    views.iter().enumerate().map(|(i, view)| rig.linearise(i, view, huber).map(strike)).collect()
}

impl Block {
    /// Gradient and curvature of the shared parameters once the board's pose follows them, with Marquardt's damping.
    #[must_use]
    pub fn reduced(&self, damping: f64) -> Option<(SVector<f64, SHARED>, SMatrix<f64, SHARED, SHARED>)> {
        let mut pose = self.pose_pose;
        (0..6).for_each(|i| pose[(i, i)] *= 1.0 + damping);
        let mut shared = self.shared_shared;
        (0..SHARED).for_each(|i| shared[(i, i)] *= 1.0 + damping);
        let solved = pose.cholesky()?.solve(&self.shared_pose.transpose());
        Some((self.shared - solved.tr_mul(&self.pose), shared - self.shared_pose * solved))
    }
}

/// Puts a one where a fixed parameter left an empty row, so that the matrix can be factored and the parameter stays.
pub fn hold(curvature: &mut SMatrix<f64, SHARED, SHARED>, free: Free) {
    (0..SHARED).filter(|&i| !free.parameter(i)).for_each(|i| curvature[(i, i)] = 1.0);
}

fn step(blocks: &[Block], free: Free, damping: f64) -> Option<(SVector<f64, SHARED>, Vec<Vector6<f64>>)> {
    let mut gradient = SVector::zeros();
    let mut curvature = SMatrix::zeros();
    for block in blocks {
        let (g, c) = block.reduced(damping)?;
        gradient += g;
        curvature += c;
    }
    hold(&mut curvature, free);
    let shared = -curvature.cholesky()?.solve(&gradient);
    let board = |block: &Block| {
        let mut pose = block.pose_pose;
        (0..6).for_each(|i| pose[(i, i)] *= 1.0 + damping);
        Some(-pose.cholesky()?.solve(&(block.pose + block.shared_pose.tr_mul(&shared))))
    };
    Some((shared, blocks.iter().map(board).collect::<Option<_>>()?))
}

/// By how much the cost falls along a step to first order [px^2].
fn expected_gain(blocks: &[Block], shared: &SVector<f64, SHARED>, boards: &[Vector6<f64>]) -> f64 {
    -blocks.iter().zip(boards).map(|(block, board)| block.shared.dot(shared) + block.pose.dot(board)).sum::<f64>()
}

fn steepest(blocks: &[Block], cost: f64) -> f64 {
    let shared = blocks.iter().fold(SVector::<f64, SHARED>::zeros(), |sum, b| sum + b.shared);
    let curvature = blocks.iter().fold(SVector::<f64, SHARED>::zeros(), |sum, b| sum + b.shared_shared.diagonal());
    let cosine = |gradient: f64, curvature: f64| if gradient == 0.0 { 0.0 } else { gradient.abs() / (curvature * cost).sqrt() };
    let of_shared = shared.iter().zip(&curvature).map(|(&g, &c)| cosine(g, c));
    let of_boards = blocks.iter().flat_map(|b| {
        b.pose.iter().zip(b.pose_pose.diagonal().iter().copied().collect::<Vec<_>>()).map(|(&g, c)| cosine(g, c)).collect::<Vec<_>>()
    });
    of_shared.chain(of_boards).fold(0.0, f64::max)
}
