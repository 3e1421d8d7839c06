//! Rate-independent hysteresis: a follower that lags behind its leader by up to `h`, whatever the load.
//!
//! ```text
//! dz / d|x| = (h sign(dx) - z) / l
//! ```
//!
//! The lag `z` approaches `h` over a length `l` of travel after each reversal (Dahl 1968 with exponent one; the Duhem class of Visintin
//! 1994). A sharp play of the same half loop has its whole lag after `2 h`.

/// Lags of the follower behind `leader`, starting with none.
pub fn lag(leader: impl IntoIterator<Item = f64>, half: f64, length: f64) -> Vec<f64> {
    let mut before: Option<(f64, f64)> = None;
    let follow = |at: f64| {
        let (last, lag) = before.unwrap_or((at, 0.0));
        let target = half * (at - last).signum();
        let lag = if at == last { lag } else { target + (lag - target) * (-(at - last).abs() / length).exp() };
        before = Some((at, lag));
        lag
    };
    leader.into_iter().map(follow).collect()
}
