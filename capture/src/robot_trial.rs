//! A robot tried before it is recorded: whether its messages come, and whether its clock and this machine's agree.
//!
//! A message takes a time of its own to arrive, but never a negative one, and over a local network one of many is always quick. So the least time
//! from stamp to arrival is the offset between the clocks, up to a fraction of a millisecond.

use std::process::{Command, Stdio};
use std::sync::mpsc::RecvTimeoutError;
use std::sync::{Arc, mpsc};
use std::time::{Duration, Instant};

use raven::Result;

use crate::clock::SessionClock;
use crate::devices::Stopped;
use crate::record::source::{Counters, Counts, Feed};
use crate::record::topic::{Shared, TopicSource};
use crate::ros1::{Node, Subscription, TopicAddress};

/// A stamp cannot be so much later than its arrival (s).
const AHEAD_S: f64 = 1e-3;
/// The quickest of many messages is not under way for so long (s).
const BEHIND_S: f64 = 0.05;

/// How soon the trial notices that it is to end.
const GLANCE: Duration = Duration::from_millis(100);

/// Takes a topic's messages for so long, or until it is stopped, and throws them away.
///
/// # Errors
/// If the master cannot be reached.
pub fn robot_trial(address: &TopicAddress, time: Duration, stopped: &Stopped) -> Result<Counts> {
    let (feed, queue) = Feed::new();
    let (notices, _nobody) = mpsc::channel();
    let (counters, clock, until) = (Arc::new(Counters::default()), SessionClock::start(), Instant::now() + time);
    let said = Default::default();
    let source =
        TopicSource { recorded_as: address.topic.clone(), counters: Arc::clone(&counters), feed, clock, notices: notices.clone(), said };
    let wanted = Subscription { topic: address.topic.clone(), listener: Arc::new(Shared(Arc::new(source))) };
    let node = Node::start(address.master.clone(), vec![wanted], notices)?;
    let left = || until.saturating_duration_since(Instant::now());
    while !left().is_zero() && !stopped() && !matches!(queue.recv_timeout(left().min(GLANCE)), Err(RecvTimeoutError::Disconnected)) {}
    drop(node);
    Ok(counters.read())
}

/// A sentence about a topic whose stamps and the recorder's clock disagree, by the least time from stamp to arrival.
#[must_use]
pub fn disagreement(topic: &str, least_lag_s: Option<f64>) -> Option<String> {
    let lag_s = least_lag_s?;
    let (size_ms, words) = match lag_s {
        _ if lag_s < -AHEAD_S => (-1e3 * lag_s, "later than their arrival: the clock of the machine that stamps them is ahead"),
        _ if lag_s > BEHIND_S => (1e3 * lag_s, "before their arrival at the least: the clock of the machine that stamps them is behind"),
        _ => return None,
    };
    Some(format!("{topic}: its stamps are {size_ms:.1} ms {words}; let one time service keep both clocks (chrony, or systemd-timesyncd)."))
}

/// Whether a time service keeps this machine's clock, as the kernel knows and systemd tells; `None` where nobody tells.
#[must_use]
pub fn is_clock_kept() -> Option<bool> {
    let asked = Command::new("timedatectl").args(["show", "--property=NTPSynchronized", "--value"]).stderr(Stdio::null()).output().ok()?;
    match String::from_utf8_lossy(&asked.stdout).trim() {
        "yes" => Some(true),
        "no" => Some(false),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clocks_that_disagree_are_told_from_messages_on_their_way() {
        let said = |lag_s: Option<f64>| disagreement("/ravenstate", lag_s);
        assert_eq!([said(None), said(Some(2e-4)), said(Some(0.02)), said(Some(-5e-4))], [None, None, None, None]);
        assert!(said(Some(-0.25)).unwrap().starts_with("/ravenstate: its stamps are 250.0 ms later than their arrival"));
        assert!(said(Some(0.5)).unwrap().starts_with("/ravenstate: its stamps are 500.0 ms before their arrival"));
    }
}
