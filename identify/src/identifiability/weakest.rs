//! The weakest direction: the change of several unknowns at once that moves the seen tip least.
//!
//! It is the eigenvector of the least eigenvalue of the information with unit diagonal. Along it the unknowns are known worse than each
//! alone by one over the root of that eigenvalue.

use nalgebra::DMatrix;

use super::cramer_rao::{NOTHING, Scaled};
use crate::priors::Unknown;

/// Part of the direction [1] from which an unknown is named.
const NAMED: f64 = 0.3;
/// How many times worse than alone unknowns may be known that do not disturb each other.
const SEPARATE: f64 = 3.0;

/// Unknowns that can stand in for each other.
#[derive(Debug, Clone, PartialEq)]
pub struct Weakest {
    /// The unknowns with a large part in it, largest first, and their parts, the first of which is positive.
    pub parts: Vec<(usize, f64)>,
    /// By how much worse they are known together than each alone; infinite if nothing tells them apart.
    pub worse: f64,
    /// Largest over least eigenvalue; infinite if nothing tells the unknowns apart.
    pub condition: f64,
}

impl Weakest {
    /// Of an information matrix; `None` without unknowns.
    #[must_use]
    pub fn new(scaled: &Scaled) -> Option<Self> {
        let values = &scaled.eigen.eigenvalues;
        let least = (0..values.len()).min_by(|&a, &b| values[a].total_cmp(&values[b]))?;
        let mut parts: Vec<(usize, f64)> = scaled.eigen.eigenvectors.column(least).iter().copied().enumerate().collect();
        parts.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
        let sign = parts[0].1.signum();
        let parts = parts.into_iter().filter(|(_, part)| part.abs() >= NAMED).map(|(k, part)| (k, sign * part)).collect();
        let shown = if values[least] > NOTHING { values[least] } else { 0.0 };
        Some(Self { parts, worse: 1.0 / shown.sqrt(), condition: values.max() / shown })
    }

    /// In words. `information` is per prior deviation of the unknowns, without the prior.
    #[must_use]
    pub fn sentence(&self, unknowns: &[Unknown], information: &DMatrix<f64>) -> String {
        let name = |k: usize| unknowns[k].quantity.name();
        let Some((first, others)) = self.parts.split_first() else { return "no direction stands out.".to_owned() };
        if others.is_empty() || self.worse < SEPARATE {
            return "the unknowns show separately; none stands in for another.".to_owned();
        }
        let list = |same: bool| {
            let names: Vec<String> = others.iter().filter(|(_, part)| (*part > 0.0) == same).map(|&(k, _)| name(k)).collect();
            names.join(" and ")
        };
        let (with, against) = (list(true), list(false));
        let all: Vec<String> = self.parts.iter().map(|&(k, _)| name(k)).collect();
        let mut how = Vec::new();
        if !with.is_empty() {
            how.push(format!("with {with} up"));
        }
        if !against.is_empty() {
            how.push(format!("with {against} down"));
        }
        let (all, how) = (all.join(" and "), format!("{} up {}", name(first.0), how.join(" and ")));
        let said = if self.worse.is_finite() {
            let worse = self.worse;
            format!("{all} move together: {how} leaves the tip almost where it was, {worse:.0} times less visible than one of them alone")
        } else {
            format!("{all} cannot be told apart: {how} leaves the tip where it was")
        };
        format!("{said}; {}.", known(unknowns, information, first.0, others[0].0, others[0].1 > 0.0))
    }
}

/// What is known of two unknowns together, prior included.
fn known(unknowns: &[Unknown], information: &DMatrix<f64>, a: usize, b: usize, same: bool) -> String {
    let (first, second) = (&unknowns[a], &unknowns[b]);
    let (name_a, name_b) = (first.quantity.name(), second.quantity.name());
    let n = information.nrows();
    let Some(posterior) = (information + DMatrix::identity(n, n)).cholesky() else { return "nothing is known of both".to_owned() };
    let covariance = posterior.inverse();
    if first.quantity.is_positive() && second.quantity.is_positive() {
        let sign = if same { -1.0 } else { 1.0 };
        let variance = first.spread.powi(2) * covariance[(a, a)]
            + second.spread.powi(2) * covariance[(b, b)]
            + 2.0 * sign * first.spread * second.spread * covariance[(a, b)];
        let what = if same { "ratio" } else { "product" };
        return format!("the {what} of {name_a} and {name_b} is known to {:.1} %", 100.0 * variance.max(0.0).sqrt());
    }
    let given = |k: usize, l: usize| (covariance[(k, k)] - covariance[(k, l)].powi(2) / covariance[(l, l)]).max(0.0).sqrt();
    let gain = covariance[(a, a)].sqrt() / given(a, b);
    format!("{name_a} would be known {gain:.0} times better if {name_b} were known")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identifiability::cramer_rao::information;
    use crate::parameters::Selection;
    use crate::priors;
    use nalgebra::Vector3;
    use raven::camera::Quality;
    use raven::robot::nominal;

    fn said(names: &[&str], columns: [[f64; 3]; 2]) -> (Weakest, String) {
        let names: Vec<String> = names.iter().map(|s| (*s).to_owned()).collect();
        let unknowns: Vec<Unknown> =
            priors::unknowns(&nominal::gold(), &Selection::named(&names).unwrap(), &Quality::default()).unwrap()[..2].to_vec();
        let information = information(&columns.map(|c| vec![Vector3::from(c)]).to_vec());
        let weakest = Weakest::new(&Scaled::new(&information)).unwrap();
        let sentence = weakest.sentence(&unknowns, &information);
        (weakest, sentence)
    }

    #[test]
    fn twins_are_named_with_their_sense() {
        let (weakest, same) = said(&["k_e1", "b_e1"], [[1000.0, 0.0, 0.0], [-1000.0, 10.0, 0.0]]);
        assert!((weakest.worse - 141.0).abs() < 1.0, "the angle between them is a hundredth, not {}", weakest.worse);
        assert!(same.contains("k_e1") && same.contains("b_e1 up") && same.contains("ratio"), "{same}");
        let (_, opposite) = said(&["k_e1", "b_e1"], [[1000.0, 0.0, 0.0], [1000.0, 10.0, 0.0]]);
        assert!(opposite.contains(" down") && opposite.contains("product"), "{opposite}");
        let (_, mixed) = said(&["offset_1", "k_e1"], [[1000.0, 0.0, 0.0], [1000.0, 10.0, 0.0]]);
        assert!(mixed.contains("times better if"), "{mixed}");
    }

    /// Rounding leaves an eigenvalue of some 1e-17, or less than nothing, of twins.
    #[test]
    fn twins_that_nothing_tells_apart_are_called_so() {
        for column in [[1000.0, 0.0, 0.0], [0.1, 0.7, 0.3], [1.0 / 3.0, 1e4, 7.7]] {
            let (weakest, sentence) = said(&["k_e1", "b_e1"], [column, column.map(|v| 1.1 * v)]);
            assert!(weakest.worse.is_infinite() && weakest.condition.is_infinite(), "{weakest:?}");
            assert!(sentence.contains("cannot be told apart") && sentence.contains("product"), "{sentence}");
            assert!(!sentence.contains("inf") && !sentence.contains("times less visible"), "{sentence}");
        }
        let (weakest, sentence) = said(&["k_e1", "b_e1"], [[1000.0, 0.0, 0.0], [1000.0, 0.1, 0.0]]);
        assert!(weakest.worse.is_finite() && sentence.contains("times less visible"), "{sentence}");
    }

    #[test]
    fn separate_unknowns_are_called_so() {
        let (weakest, sentence) = said(&["k_e1", "b_e1"], [[1000.0, 0.0, 0.0], [0.0, 10.0, 0.0]]);
        assert!((weakest.condition - 1.0).abs() < 1e-9 && sentence.contains("separately"), "{sentence}");
    }
}
