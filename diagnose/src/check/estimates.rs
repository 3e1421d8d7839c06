//! Sizes of effects that were named rightly, against the label's.

use raven::simulation::LabelEffect;
use serde::Serialize;

use super::metrics::{Share, Z95};
use super::verdict::{Blamed, Estimate};

/// How well sizes and their deviations were told.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Sizes {
    /// Effects compared.
    pub effects: usize,
    /// Median of |estimate - label| / |label|.
    pub median_relative_error: Option<f64>,
    /// Numbers within one stated deviation of the label: 68 % if deviations are as claimed.
    pub within_one_std: Share,
    /// Within 1.96: 95 %.
    pub within_95: Share,
    #[serde(skip)]
    relative_errors: Vec<f64>,
}

impl Sizes {
    /// Compares one effect. Of several numbers the first counts, of a vector all three, of an eccentricity its amplitude.
    pub fn compare(&mut self, label: &LabelEffect, blamed: &Blamed) {
        let truth = label.magnitude.values();
        let vector = label.id.starts_with("camera-") && truth.len() == 3;
        let truth = if vector { truth } else { &truth[..truth.len().min(1)] };
        let estimates: Vec<Estimate> = match &blamed.parameters[..] {
            [sine, cosine, ..] if sine.name == "sine" && cosine.name == "cosine" => vec![amplitude(sine, cosine)],
            parameters => parameters.iter().take(truth.len()).cloned().collect(),
        };
        if estimates.is_empty() || estimates.len() != truth.len() {
            return;
        }
        let norm = |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>().sqrt();
        let size = norm(&mut truth.iter().copied());
        if size > 0.0 {
            let miss = norm(&mut estimates.iter().zip(truth).map(|(estimate, truth)| estimate.value - truth));
            self.effects += 1;
            self.relative_errors.push(miss / size);
            self.median_relative_error = raven::stats::median(&self.relative_errors);
        }
        for (estimate, truth) in estimates.iter().zip(truth) {
            let miss = (estimate.value - truth).abs();
            self.within_one_std.count(miss <= estimate.std);
            self.within_95.count(miss <= Z95 * estimate.std);
        }
    }
}

/// `sqrt(a^2 + b^2)` and its deviation, as if those of `a` and `b` were independent.
fn amplitude(a: &Estimate, b: &Estimate) -> Estimate {
    let value = a.value.hypot(b.value);
    let std = if value > 0.0 { (a.value * a.std).hypot(b.value * b.std) / value } else { a.std.hypot(b.std) };
    Estimate { name: "amplitude".to_owned(), value, std }
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use raven::simulation::Magnitude;

    use super::*;

    fn compare(id: &str, truth: Magnitude, estimates: &[(&str, f64, f64)]) -> Sizes {
        let label = LabelEffect { id: id.to_owned(), joint: None, magnitude: truth };
        let parameters = estimates.iter().map(|&(name, value, std)| Estimate { name: name.to_owned(), value, std }).collect();
        let mut sizes = Sizes::default();
        sizes.compare(&label, &Blamed { id: id.to_owned(), joint: None, probability: 1.0, parameters });
        sizes
    }

    #[test]
    fn one_number_a_vector_and_an_amplitude() {
        let one = compare("pulley-radius", Magnitude::One(-0.05), &[("relative_error", -0.051, 0.0006)]);
        assert_relative_eq!(one.median_relative_error.unwrap(), 0.02, epsilon = 1e-9);
        assert_eq!((one.within_one_std.hits, one.within_95.hits), (0, 1));
        let first = compare("hysteresis", Magnitude::Several(vec![0.01, 0.7]), &[("half_loop", 0.011, 0.002), ("rounding", 9.0, 1.0)]);
        assert_relative_eq!(first.median_relative_error.unwrap(), 0.1, epsilon = 1e-9);
        assert_eq!((first.within_one_std.hits, first.within_one_std.of), (1, 1));
        let three = [("x", 0.03, 0.001), ("y", 0.004, 0.001), ("z", 0.003, 0.001)];
        let vector = compare("camera-rotation", Magnitude::Several(vec![0.03, 0.0, 0.0]), &three);
        assert_relative_eq!(vector.median_relative_error.unwrap(), 0.005 / 0.03, epsilon = 1e-9);
        assert_eq!((vector.within_95.hits, vector.within_95.of), (1, 3));
        let round = compare("pulley-eccentricity", Magnitude::Several(vec![0.5, 1.2]), &[("sine", 0.3, 0.01), ("cosine", 0.4, 0.01)]);
        assert_relative_eq!(round.median_relative_error.unwrap(), 0.0, epsilon = 1e-9);
    }

    #[test]
    fn an_effect_without_numbers_is_not_compared() {
        assert_eq!(compare("payload", Magnitude::One(0.2), &[]).effects, 0);
    }
}
