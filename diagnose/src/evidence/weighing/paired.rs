//! How much better one hypothesis follows the recordings than another, where residuals may be alike over time.
//!
//! ```text
//! D = (|r'|^2 - |r|^2) / 2,   d = r' - r,   k = min(1, |d|^2 / sum_b (d_b' r_b)^2)
//! ```
//!
//! Of two models of which one is right, with residuals `r` that are independent and of their stated deviations, the log-likelihood ratio `D`
//! scatters by `d' r`, of variance `|d|^2`. Where the residuals of a block `b` of time add up to more along `d` than they should, rows hold
//! less than they claim, and `k D` is the ratio whose variance is what its size asks for (the magnitude adjustment of composite likelihoods;
//! Pauli, Racugno and Ventura 2011, with the clustered variance of Liang and Zeger 1986).

use std::ops::Range;

use crate::evidence::fit::linear::dot;

/// Log-likelihood ratio of residuals `r` over the larger `others` [nat]: as stated, and as far as blocks of time allow.
#[must_use]
pub fn ratio(r: &[f64], others: &[f64], blocks: &[Range<usize>]) -> [f64; 2] {
    let stated = 0.5 * (dot(others, others) - dot(r, r));
    let apart: Vec<f64> = others.iter().zip(r).map(|(other, r)| other - r).collect();
    let along = |block: &Range<usize>| apart.get(block.clone()).zip(r.get(block.clone())).map_or(0.0, |(d, r)| dot(d, r).powi(2));
    let scatter: f64 = blocks.iter().map(along).sum();
    let kept = if scatter > 0.0 { (dot(&apart, &apart) / scatter).min(1.0) } else { 1.0 };
    [stated, kept * stated]
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn residuals_that_are_alike_hold_less() {
        const ROWS: usize = 6000;
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let effect: Vec<f64> = (0..ROWS).map(|k| 0.1 * (k as f64 / 400.0).sin()).collect();
        let blocks: Vec<_> = (0..ROWS).step_by(90).map(|start| start..(start + 90).min(ROWS)).collect();
        let mut kept = |carry: f64| {
            let (mut noise, push) = (0.0, (1.0 - carry * carry).sqrt());
            let r: Vec<f64> = (0..ROWS)
                .map(|_| {
                    let fresh: f64 = StandardNormal.sample(&mut rng);
                    noise = carry * noise + push * fresh;
                    noise
                })
                .collect();
            let others: Vec<f64> = r.iter().zip(&effect).map(|(r, d)| r + d).collect();
            let [stated, agreed] = ratio(&r, &others, &blocks);
            agreed / stated
        };
        let [white, alike] = [kept(0.0), kept(0.9)];
        // Sums of an AR(1) have (1 + a) / (1 - a) = 19 times the variance.
        assert!(white > 0.7 && (0.03..0.12).contains(&alike), "{white} {alike}");
    }
}
