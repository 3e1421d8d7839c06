//! Which pixels are marker, edge or background, and the background near each of them.

use crate::bits::Bits;
use crate::surroundings::REACH_PX;

/// Depth from which on a pixel of the mask is all marker [px]: optical blur and chroma at half the resolution smear an edge over 3 px.
const CORE_DEPTH_PX: usize = 3;
/// Distance from which on a pixel is all background [px].
const OUTSIDE_PX: u32 = 4;
/// Half the window in which a pixel at the edge looks for background [px]; it grows until there is some.
const WINDOW_PX: i32 = 3;
/// Fewest pixels that make a background.
const FEWEST: f64 = 6.0;

/// What a pixel, or a sample of some, is, from within to without.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Kind {
    Core,
    Edge,
    Outside,
    /// Farther out: not looked at.
    Far,
}

/// What each pixel of a mask is, by its distance to the mask's edge.
pub(crate) fn kinds(mask: &Bits) -> Vec<Kind> {
    let mut core = mask.clone();
    for _ in 1..CORE_DEPTH_PX {
        let deeper = core.erode3();
        if deeper.any() {
            core = deeper;
        }
    }
    let wider = |by: u32| (0..by).fold(mask.clone(), |mask, _| mask.dilate3());
    let (near, reached) = (wider(OUTSIDE_PX - 1), wider(REACH_PX));
    let kind = |x: i32, y: i32| match () {
        () if core.get(x, y) => Kind::Core,
        () if near.get(x, y) => Kind::Edge,
        () if reached.get(x, y) => Kind::Outside,
        () => Kind::Far,
    };
    (0..mask.height() as i32).flat_map(|y| (0..mask.width() as i32).map(move |x| (x, y))).map(|(x, y)| kind(x, y)).collect()
}

/// Pixels or samples in two coordinates of colour, row by row.
pub(crate) struct Plane {
    pub(crate) width: i32,
    pub(crate) height: i32,
    pub(crate) colour: Vec<[f64; 2]>,
    pub(crate) kinds: Vec<Kind>,
    /// Over all pixels of the background above and to the left of a corner between pixels.
    sums: Vec<Sums>,
}

/// Number of pixels, sums of chroma and luma, and of their squares.
type Sums = [f64; 5];

impl Plane {
    pub(crate) fn new(width: i32, height: i32, colour: Vec<[f64; 2]>, kinds: Vec<Kind>) -> Self {
        let corners = width as usize + 1;
        let mut sums: Vec<Sums> = vec![[0.0; 5]; corners * (height as usize + 1)];
        for (row, (kinds, colours)) in kinds.chunks_exact(corners - 1).zip(colour.chunks_exact(corners - 1)).enumerate() {
            let mut along = [0.0; 5];
            for (column, (kind, &[c, l])) in kinds.iter().zip(colours).enumerate() {
                if *kind == Kind::Outside {
                    along = plus(along, [1.0, c, l, c * c, l * l], 1.0);
                }
                sums[(row + 1) * corners + column + 1] = plus(along, sums[row * corners + column + 1], 1.0);
            }
        }
        Self { width, height, colour, kinds, sums }
    }

    /// Mean and variance of all the background.
    pub(crate) fn everywhere(&self) -> Option<[[f64; 2]; 2]> {
        self.background(0, 0, self.width.max(self.height))
    }

    /// Mean and variance of the background near a pixel at the edge.
    pub(crate) fn nearby(&self, x: i32, y: i32) -> Option<[[f64; 2]; 2]> {
        (WINDOW_PX..2 * REACH_PX as i32).find_map(|half| self.background(x, y, half))
    }

    /// Mean and variance of the background within `half` of a pixel; `None` if there is too little.
    fn background(&self, x: i32, y: i32, half: i32) -> Option<[[f64; 2]; 2]> {
        let corner = |x: i32, y: i32| self.sums[(y.clamp(0, self.height) * (self.width + 1) + x.clamp(0, self.width)) as usize];
        let (left, top, right, bottom) = (x - half, y - half, x + half + 1, y + half + 1);
        let lower = plus(corner(right, bottom), corner(left, bottom), -1.0);
        let [count, chroma, luma, chroma2, luma2] = plus(lower, plus(corner(right, top), corner(left, top), -1.0), -1.0);
        let mean = [chroma / count, luma / count];
        let variance = [chroma2 / count - mean[0] * mean[0], luma2 / count - mean[1] * mean[1]];
        (count >= FEWEST).then(|| [mean, variance.map(|v| v.max(0.0))])
    }
}

fn plus(a: Sums, b: Sums, factor: f64) -> Sums {
    std::array::from_fn(|i| a[i] + factor * b[i])
}
