//! Play: a follower that is carried along at either end of a gap, whatever the load (the play operator; Visintin 1994).

/// Positions of the follower of `leader` with `half` the gap on either side; it starts in the middle.
#[must_use]
pub fn play(leader: impl IntoIterator<Item = f64>, half: f64) -> Vec<f64> {
    let mut follower = None;
    let follow = |at: f64| {
        let before: f64 = follower.unwrap_or(at);
        let now = before.clamp(at - half, at + half);
        follower = Some(now);
        now
    };
    leader.into_iter().map(follow).collect()
}
