//! The information on a size, which takes a fit's slopes to compute, by the sizes of which it is known.

/// What a size changes is known well enough from one that is off by no more than this factor.
pub(super) const CLOSE: f64 = 1.1;

/// What is known of `S` by size, in rising order.
pub(super) struct Information(pub(super) Vec<(f64, f64)>);

impl Information {
    /// Between sizes that are known as a power of the size, and beyond them as at the next.
    pub(super) fn at(&self, u: f64) -> f64 {
        let after = self.0.partition_point(|(known, _)| *known < u);
        let [before, after] = [after.checked_sub(1).map(|k| self.0[k]), self.0.get(after).copied()];
        match (before, after) {
            (Some((u0, s0)), Some((u1, s1))) if s0.min(s1) > 0.0 => s0 * (s1 / s0).powf((u / u0).ln() / (u1 / u0).ln()),
            (Some((u0, s0)), Some((u1, s1))) => s0 + (s1 - s0) * (u - u0) / (u1 - u0),
            (Some((_, s)), None) | (None, Some((_, s))) => s,
            (None, None) => 0.0,
        }
    }

    /// That of a size that is close.
    pub(super) fn near(&self, u: f64) -> Option<f64> {
        let off = |(known, _): &(f64, f64)| (known / u).ln().abs();
        self.0.iter().filter(|known| off(known) <= CLOSE.ln()).min_by(|a, b| off(a).total_cmp(&off(b))).map(|(_, s)| *s)
    }

    /// The geometric mean of the two known sizes that one lies between: where little is changed from some size on, the way there is short.
    pub(super) fn middle(&self, u: f64) -> f64 {
        let after = self.0.partition_point(|(known, _)| *known < u);
        let beside = after.checked_sub(1).and_then(|k| self.0.get(k..k + 2));
        beside.map_or(u, |pair| (pair[0].0 * pair[1].0).sqrt())
    }

    /// That of one more size.
    pub(super) fn learn(&mut self, u: f64, information: f64) {
        let at = self.0.partition_point(|(known, _)| *known < u);
        self.0.insert(at, (u, information));
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;

    #[test]
    fn information_is_a_power_of_the_size_between_those_that_are_known() {
        let mut information = Information(vec![(1.0, 9.0)]);
        information.learn(0.01, 0.09);
        assert_relative_eq!(information.at(0.1), 0.9, epsilon = 1e-12);
        assert_eq!([0.001, 5.0].map(|u| information.at(u)), [0.09, 9.0]);
        assert_eq!([0.0105, 0.1].map(|u| information.near(u)), [Some(0.09), None]);
        assert_relative_eq!(information.middle(0.03), 0.1, epsilon = 1e-12);
        information.learn(0.1, 0.0);
        assert_relative_eq!(information.at(0.055), 0.045, epsilon = 1e-12);
    }
}
