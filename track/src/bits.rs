//! Binary images of 64 pixels a word, and the paper's clean-up of a thresholded image on them: median over 5x5 pixels, erosion by 3x3,
//! dilation by 3x3.
//!
//! The median of 25 pixels that are black or white is white where 13 are. All 64 pixels of a word are counted at once: bit `i` of three words
//! holds the number of white pixels among five neighbours in a row, and binary adders of five rows give the number among 25. As in OpenCV,
//! the median repeats the pixels at the edge, and erosion and dilation leave out what lies beyond it.

/// Pixels in a word.
const WORD: usize = 64;

/// A binary image; pixel `x` of a row is bit `x % 64` of its word `x / 64`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Bits {
    width: usize,
    height: usize,
    /// Words of a row.
    stride: usize,
    /// Row by row; what is beyond the width is 0.
    words: Vec<u64>,
}

/// What lies beyond the left and right edge.
#[derive(Debug, Clone, Copy)]
enum Beyond {
    /// The pixels at the edge, repeated.
    Same,
    White,
    Black,
}

/// Number of white pixels among five in a row, 64 at a time: ones, twos, fours.
type Count = [u64; 3];

impl Bits {
    /// A black image.
    #[must_use]
    pub fn black(width: usize, height: usize) -> Self {
        let stride = width.div_ceil(WORD);
        Self { width, height, stride, words: vec![0; stride * height] }
    }

    /// Columns.
    #[must_use]
    pub const fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    #[must_use]
    pub const fn height(&self) -> usize {
        self.height
    }

    /// Whether a pixel is white; what is beyond the edge is not.
    #[must_use]
    pub fn get(&self, x: i32, y: i32) -> bool {
        let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) else { return false };
        x < self.width && self.row(y).get(x / WORD).is_some_and(|word| (word >> (x % WORD)) & 1 == 1)
    }

    /// Words of a row; none where there is no such row.
    #[must_use]
    pub fn row(&self, y: usize) -> &[u64] {
        self.words.get(y * self.stride..(y + 1) * self.stride).unwrap_or_default()
    }

    /// All rows, to be written to. Bits beyond the width must stay 0.
    pub(crate) fn rows_mut(&mut self) -> impl Iterator<Item = &mut [u64]> {
        self.words.chunks_exact_mut(self.stride.max(1))
    }

    /// A rectangle of the image; what of it lies beyond the edge is black.
    #[must_use]
    pub fn crop(&self, left: i32, top: i32, width: u32, height: u32) -> Self {
        let mut part = Self::black(width as usize, height as usize);
        for (y, row) in (top..).zip(part.rows_mut()) {
            for (x, word) in (left..).step_by(WORD).zip(row) {
                let white = (0..WORD as i32).filter(|&i| self.get(x + i, y));
                *word = white.fold(0, |word, i| word | (1 << i));
            }
        }
        part.blacken_beyond();
        part
    }

    /// The paper's clean-up: median, erosion, dilation. It removes what is narrower than 3 px.
    #[must_use]
    pub fn clean(&self) -> Self {
        self.median5().erode3().dilate3()
    }

    /// Median over 5x5 pixels.
    #[must_use]
    pub fn median5(&self) -> Self {
        let mut counts: Vec<Count> = vec![[0; 3]; self.words.len()];
        let mut fringed = Vec::new();
        for (row, counts) in self.rows().zip(counts.chunks_exact_mut(self.stride.max(1))) {
            if row.iter().any(|&word| word != 0) {
                self.fringe(row, Beyond::Same, &mut fringed);
                for (count, words) in counts.iter_mut().zip(fringed.array_windows()) {
                    *count = among_five(*words);
                }
            }
        }
        let mut out = Self::black(self.width, self.height);
        let last = self.height.saturating_sub(1);
        for (y, row) in out.rows_mut().enumerate() {
            let near = [y.saturating_sub(2), y.saturating_sub(1), y, (y + 1).min(last), (y + 2).min(last)];
            let near = near.map(|y| counts.get(y * self.stride..(y + 1) * self.stride).unwrap_or_default());
            for (x, word) in row.iter_mut().enumerate() {
                *word = at_least_13(near.map(|counts| counts.get(x).copied().unwrap_or_default()));
            }
        }
        out.blacken_beyond();
        out
    }

    /// Whether any pixel is white.
    #[must_use]
    pub fn any(&self) -> bool {
        self.words.iter().any(|&word| word != 0)
    }

    /// White where all of 3x3 pixels are.
    #[must_use]
    pub fn erode3(&self) -> Self {
        self.by_three(Beyond::White, |a, b| a & b)
    }

    /// White where any of 3x3 pixels is.
    #[must_use]
    pub fn dilate3(&self) -> Self {
        self.by_three(Beyond::Black, |a, b| a | b)
    }

    /// Combines each pixel with its eight neighbours.
    fn by_three(&self, beyond: Beyond, combine: impl Fn(u64, u64) -> u64) -> Self {
        let mut across = Self::black(self.width, self.height);
        let mut fringed = Vec::new();
        for (row, out) in self.rows().zip(across.rows_mut()) {
            // A black row stays black, whatever the combination.
            if row.iter().any(|&word| word != 0) {
                self.fringe(row, beyond, &mut fringed);
                for (out, &[before, here, after]) in out.iter_mut().zip(fringed.array_windows()) {
                    let (left, right) = ((here << 1) | (before >> (WORD - 1)), (here >> 1) | (after << (WORD - 1)));
                    *out = combine(combine(left, here), right);
                }
            }
        }
        let mut out = across.clone();
        for (y, row) in out.rows_mut().enumerate() {
            for near in [y.checked_sub(1), Some(y + 1).filter(|&y| y < self.height)].into_iter().flatten() {
                for (word, &other) in row.iter_mut().zip(across.row(near)) {
                    *word = combine(*word, other);
                }
            }
        }
        out.blacken_beyond();
        out
    }

    fn rows(&self) -> impl Iterator<Item = &[u64]> {
        self.words.chunks_exact(self.stride.max(1))
    }

    /// A row with a word more at either end.
    fn fringe(&self, row: &[u64], beyond: Beyond, fringed: &mut Vec<u64>) {
        let used = (self.width - 1) % WORD + 1;
        let (first, last) = (row.first().copied().unwrap_or(0), row.last().copied().unwrap_or(0));
        let [left, right] = match beyond {
            Beyond::Same => [first & 1, (last >> (used - 1)) & 1].map(|bit| bit.wrapping_neg()),
            Beyond::White => [u64::MAX; 2],
            Beyond::Black => [0; 2],
        };
        fringed.clear();
        fringed.push(left);
        fringed.extend_from_slice(row);
        if let Some(word) = fringed.last_mut().filter(|_| used < WORD) {
            *word |= right << used;
        }
        fringed.push(right);
    }

    fn blacken_beyond(&mut self) {
        let used = self.width % WORD;
        if used > 0 {
            for word in self.rows_mut().filter_map(|row| row.last_mut()) {
                *word &= (1 << used) - 1;
            }
        }
    }
}

/// White pixels among each pixel of the middle word and two to either side.
const fn among_five([before, here, after]: [u64; 3]) -> Count {
    let (left2, left1) = ((here << 2) | (before >> (WORD - 2)), (here << 1) | (before >> (WORD - 1)));
    let (right1, right2) = ((here >> 1) | (after << (WORD - 1)), (here >> 2) | (after << (WORD - 2)));
    let (three, carry3) = add3(left2, left1, here);
    let (ones, carry5) = add3(three, right1, right2);
    [ones, carry3 ^ carry5, carry3 & carry5]
}

/// Where five counts are together 13 or more.
const fn at_least_13([a, b, c, d, e]: [Count; 5]) -> u64 {
    // Ones: their sum has one, and two carries of two.
    let (s, two1) = add3(a[0], b[0], c[0]);
    let (ones, two2) = add3(s, d[0], e[0]);
    // Twos: seven of them.
    let (s, four1) = add3(a[1], b[1], c[1]);
    let (t, four2) = add3(d[1], e[1], two1);
    let (u, four3) = add3(s, t, two2);
    let twos = u;
    // Fours: eight of them.
    let (s, eight1) = add3(a[2], b[2], c[2]);
    let (t, eight2) = add3(d[2], e[2], four1);
    let (u, eight3) = add3(s, t, four2);
    let (fours, eight4) = (u ^ four3, u & four3);
    // Eights: four of them. 25 at most, so two and more are 16 at least.
    let (s, sixteen1) = add3(eight1, eight2, eight3);
    let (eights, sixteen2) = (s ^ eight4, s & eight4);
    (sixteen1 | sixteen2) | (eights & fours & (twos | ones))
}

/// Sum and carry of three bits.
const fn add3(a: u64, b: u64, c: u64) -> (u64, u64) {
    let half = a ^ b;
    (half ^ c, (a & b) | (half & c))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn image(width: usize, height: usize, white: impl Fn(i32, i32) -> bool) -> Bits {
        let mut bits = Bits::black(width, height);
        for (y, row) in bits.rows_mut().enumerate() {
            for x in (0..width).filter(|&x| white(x as i32, y as i32)) {
                row[x / WORD] |= 1 << (x % WORD);
            }
        }
        bits
    }

    /// How many pixels of a square about one are white, and how many there are, the edge repeated or left out.
    fn count(bits: &Bits, x: i32, y: i32, reach: i32, repeat: bool) -> (usize, usize) {
        let (w, h) = (bits.width as i32, bits.height as i32);
        let square = (y - reach..=y + reach).flat_map(|v| (x - reach..=x + reach).map(move |u| (u, v)));
        let near: Vec<(i32, i32)> = if repeat {
            square.map(|(u, v)| (u.clamp(0, w - 1), v.clamp(0, h - 1))).collect()
        } else {
            square.filter(|(u, v)| (0..w).contains(u) && (0..h).contains(v)).collect()
        };
        (near.iter().filter(|(u, v)| bits.get(*u, *v)).count(), near.len())
    }

    proptest! {
        #[test]
        fn every_pixel_is_what_its_neighbours_say(width in 1_usize..200, height in 1_usize..12, seed: u64, density in 1_u64..8) {
            let hash = |x: i32, y: i32| (seed ^ (x as u64 * 0x9E37_79B9) ^ (y as u64 * 0x85EB_CA6B_0001)).wrapping_mul(0xD134_2543_DE82_EF95) >> 61;
            let bits = image(width, height, |x, y| hash(x, y) < density);
            let (median, eroded, dilated) = (bits.median5(), bits.erode3(), bits.dilate3());
            for y in 0..height as i32 {
                for x in 0..width as i32 {
                    prop_assert_eq!(median.get(x, y), count(&bits, x, y, 2, true).0 >= 13, "median at {} {}", x, y);
                    let (white, all) = count(&bits, x, y, 1, false);
                    prop_assert_eq!(eroded.get(x, y), white == all, "erosion at {} {}", x, y);
                    prop_assert_eq!(dilated.get(x, y), white > 0, "dilation at {} {}", x, y);
                }
            }
            for image in [median, eroded, dilated] {
                let beyond = image.rows().filter(|_| width % WORD > 0).all(|row| row[width / WORD] >> (width % WORD) == 0);
                prop_assert!(beyond, "white beyond the edge");
            }
        }
    }

    #[test]
    fn speckles_go_and_discs_stay() {
        let bits = image(100, 40, |x, y| (x - 60).pow(2) + (y - 20).pow(2) <= 49 || (x, y) == (3, 3));
        let clean = bits.clean();
        assert!(!clean.get(3, 3) && clean.get(60, 20) && clean.get(54, 20));
        let part = clean.crop(50, 10, 70, 20);
        assert!(part.get(10, 10) && part.get(4, 10) && !part.get(2, 10) && !part.get(51, 0));
    }
}
