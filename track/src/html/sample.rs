//! A few of many, chosen as they come, in bounded memory.

/// Items spread evenly over all that were offered, however many those are.
///
/// Of the offered ones each `stride`-th is kept; when twice the wanted number is there, every other goes and the stride doubles.
#[derive(Debug, Clone)]
pub struct Spread<T> {
    wanted: usize,
    stride: usize,
    offered: usize,
    kept: Vec<T>,
}

impl<T> Spread<T> {
    /// Nothing offered yet, of which `wanted` are to remain.
    #[must_use]
    pub const fn new(wanted: usize) -> Self {
        Self { wanted, stride: 1, offered: 0, kept: Vec::new() }
    }

    /// Offers one, which is made only if it is kept.
    pub fn offer(&mut self, make: impl FnOnce() -> T) {
        if self.offered.is_multiple_of(self.stride) {
            if self.kept.len() == 2 * self.wanted {
                halve(&mut self.kept);
                self.stride *= 2;
            }
            if self.offered.is_multiple_of(self.stride) {
                self.kept.push(make());
            }
        }
        self.offered += 1;
    }

    /// How many were offered.
    #[must_use]
    pub const fn offered(&self) -> usize {
        self.offered
    }

    /// At most `wanted` of them, from the first to the last.
    #[must_use]
    pub fn into_chosen(self) -> Vec<T> {
        let (count, wanted) = (self.kept.len(), self.wanted.min(self.kept.len()));
        let chosen = |i: usize| wanted > 0 && (i * wanted) / count != ((i + 1) * wanted) / count;
        self.kept.into_iter().enumerate().filter_map(|(i, item)| chosen(i).then_some(item)).collect()
    }
}

/// Every other, the first kept.
fn halve<T>(items: &mut Vec<T>) {
    let mut keep = false;
    items.retain(|_| {
        keep = !keep;
        keep
    });
}

/// The items with the largest scores.
#[derive(Debug, Clone)]
pub struct Largest<T> {
    wanted: usize,
    /// The largest first.
    kept: Vec<(f64, T)>,
}

impl<T> Largest<T> {
    /// Nothing offered yet, of which `wanted` are to remain.
    #[must_use]
    pub const fn new(wanted: usize) -> Self {
        Self { wanted, kept: Vec::new() }
    }

    /// Offers one, which is made only if it is kept.
    pub fn offer(&mut self, score: f64, make: impl FnOnce() -> T) {
        let place = self.kept.partition_point(|(other, _)| *other >= score);
        if score.is_finite() && place < self.wanted {
            self.kept.truncate(self.wanted - 1);
            self.kept.insert(place, (score, make()));
        }
    }

    /// Those that remain, the largest first.
    #[must_use]
    pub fn into_chosen(self) -> Vec<T> {
        self.kept.into_iter().map(|(_, item)| item).collect()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn few_of_many_are_spread_evenly(wanted in 1_usize..30, count in 0_usize..3000) {
            let mut spread = Spread::new(wanted);
            for i in 0..count {
                spread.offer(|| i);
                prop_assert!(spread.kept.len() <= 2 * wanted);
            }
            prop_assert_eq!(spread.offered(), count);
            let chosen = spread.into_chosen();
            prop_assert_eq!(chosen.len(), wanted.min(count));
            // Steps between the chosen differ by the strides they are made of, twice at most.
            let even = count as f64 / wanted as f64;
            prop_assert!(chosen.windows(2).all(|w| w[1] > w[0] && (w[1] - w[0]) as f64 <= 3.0 * even.max(1.0)), "{:?}", chosen);
        }

        #[test]
        fn the_largest_remain(scores in prop::collection::vec(-1e3..1e3, 0..200), wanted in 1_usize..9) {
            let mut largest = Largest::new(wanted);
            scores.iter().for_each(|&score| largest.offer(score, || score));
            largest.offer(f64::NAN, || f64::NAN);
            let mut expected = scores;
            expected.sort_by(|a, b| b.total_cmp(a));
            expected.truncate(wanted);
            prop_assert_eq!(largest.into_chosen(), expected);
        }
    }
}
