//! What feeds a recording: any number of sources, each on a thread of its own, in front of one bounded queue.
//!
//! A source stamps what it has, hands it over, and never waits: where the queue is full the sample is dropped and counted. Nothing is paired
//! or put in order here; every sample has its own stamp.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};

use raven::Result;
use raven::log::{FrameLosses, FrameMeta, LogWriter, Stamp};

use super::pace::Pace;
use crate::clock::Arrival;

/// Samples that may wait: a minute of a robot at 1 kHz, since a machine that is busy with others may stop a writer for a good part of one.
const QUEUE_SAMPLES: usize = 1 << 16;
/// Bytes that may wait: a minute of that and two MJPG cameras, 7 s of two raw ones.
const QUEUE_BYTES: usize = 256 << 20;
/// Stamps of a camera's latest frames that are kept: some seconds, for the skew between the cameras.
const RECENT: usize = 128;

/// Something to be recorded.
pub trait Sample: Send {
    /// Bytes it takes in memory.
    fn bytes(&self) -> usize;

    /// Puts it in a log, which may be another one than that of the sample before.
    ///
    /// # Errors
    /// If the log cannot be written.
    fn write(&self, log: &mut LogWriter) -> Result<()>;
}

/// A sample on its way to the writer, and whose it is.
pub struct Entry {
    sample: Box<dyn Sample>,
    counters: Arc<Counters>,
    waiting: Arc<AtomicUsize>,
}

impl Entry {
    /// Puts the sample in a log and returns its bytes.
    ///
    /// # Errors
    /// If the log cannot be written.
    pub fn write(&self, log: &mut LogWriter) -> Result<usize> {
        self.sample.write(log)?;
        Ok(self.sample.bytes())
    }

    /// Whose it is.
    #[must_use]
    pub const fn counters(&self) -> &Arc<Counters> {
        &self.counters
    }
}

impl Drop for Entry {
    fn drop(&mut self) {
        self.waiting.fetch_sub(self.sample.bytes(), Ordering::Relaxed);
    }
}

/// What a source has done so far; anybody may look.
#[derive(Debug, Default)]
pub struct Counters {
    received: AtomicU64,
    written: AtomicU64,
    dropped: AtomicU64,
    bytes: AtomicU64,
    interruptions: AtomicU64,
    misfits: AtomicU64,
    times: Mutex<Times>,
    frames: Mutex<Option<Frames>>,
}

/// What is known of a camera's frames.
#[derive(Debug, Default)]
struct Frames {
    losses: FrameLosses,
    recent: VecDeque<Stamp>,
}

/// What is known of the times of a source's messages.
#[derive(Debug, Default)]
struct Times {
    pace: Pace,
    least_lag_s: Option<f64>,
    /// First and last arrival.
    arrivals: Option<[Arrival; 2]>,
}

/// The counters at one moment.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize)]
pub struct Counts {
    /// Messages that arrived.
    pub received: u64,
    /// Messages in the recording.
    pub written: u64,
    /// Messages for which there was no room in the queue.
    pub dropped: u64,
    /// Bytes of the messages that arrived.
    pub bytes: u64,
    /// Times that the connection was lost.
    pub interruptions: u64,
    /// Messages that do not fit their definition; they are in the recording as they came.
    pub misfits: u64,
    /// Intervals longer than 1.5 medians, by the messages' stamps.
    pub gaps: u64,
    /// The longest interval (s).
    pub longest_interval_s: Option<f64>,
    /// System time of the last arrival minus the stamp of that message (s).
    pub lag_s: Option<f64>,
    /// The least of that over all messages (s): below 0 where the clocks of publisher and recorder disagree.
    pub least_lag_s: Option<f64>,
    /// Of a camera: its frames, and what went wrong with them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frames: Option<FrameLosses>,
    /// Median of the latest intervals (s).
    pub median_interval_s: Option<f64>,
    /// Messages per second between the first arrival and the last.
    pub rate_hz: Option<f64>,
    /// When the last message arrived, on the monotonic clock (ns).
    #[serde(skip)]
    pub last_monotonic_ns: Option<u64>,
}

impl Counters {
    /// Counts messages that are in the file for good.
    pub fn wrote(&self, messages: u64) {
        self.written.fetch_add(messages, Ordering::Relaxed);
    }

    /// Counts a lost connection.
    pub fn interrupted(&self) {
        self.interruptions.fetch_add(1, Ordering::Relaxed);
    }

    /// Counts a message that does not fit its definition.
    pub fn misfit(&self) {
        self.misfits.fetch_add(1, Ordering::Relaxed);
    }

    /// Counts a camera's frame by what was noted of it.
    pub fn frame(&self, stamp: Stamp, meta: &FrameMeta) {
        let mut frames = self.frames.lock().unwrap_or_else(PoisonError::into_inner);
        let Frames { losses, recent } = frames.get_or_insert_default();
        losses.take(meta);
        if recent.len() == RECENT {
            recent.pop_front();
        }
        recent.push_back(stamp);
    }

    /// Stamps of a camera's latest frames.
    #[must_use]
    pub fn recent_frames(&self) -> Vec<Stamp> {
        let frames = self.frames.lock().unwrap_or_else(PoisonError::into_inner);
        frames.iter().flat_map(|frames| frames.recent.iter().copied()).collect()
    }

    /// The counters now.
    #[must_use]
    pub fn read(&self) -> Counts {
        let count = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        let times = self.times.lock().unwrap_or_else(PoisonError::into_inner);
        let (received, last) = (count(&self.received), times.arrivals.map(|[_, last]| last));
        let lasted_s = times.arrivals.map(|[first, last]| last.monotonic_ns.saturating_sub(first.monotonic_ns) as f64 * 1e-9);
        Counts {
            received,
            written: count(&self.written),
            dropped: count(&self.dropped),
            bytes: count(&self.bytes),
            interruptions: count(&self.interruptions),
            misfits: count(&self.misfits),
            gaps: times.pace.gaps(),
            longest_interval_s: times.pace.longest_s(),
            lag_s: last.zip(times.pace.last()).map(|(last, stamp)| Stamp(last.realtime_ns).seconds_since(stamp)),
            least_lag_s: times.least_lag_s,
            frames: self.frames.lock().unwrap_or_else(PoisonError::into_inner).as_ref().map(|frames| frames.losses),
            median_interval_s: times.pace.median_s(),
            rate_hz: lasted_s.filter(|lasted_s| *lasted_s > 0.0).map(|lasted_s| received.saturating_sub(1) as f64 / lasted_s),
            last_monotonic_ns: last.map(|last| last.monotonic_ns),
        }
    }
}

/// The input of the queue.
#[derive(Clone)]
pub struct Feed {
    sender: SyncSender<Entry>,
    waiting: Arc<AtomicUsize>,
}

impl Feed {
    /// A queue: its input and its output.
    #[must_use]
    pub fn new() -> (Self, Receiver<Entry>) {
        let (sender, receiver) = sync_channel(QUEUE_SAMPLES);
        (Self { sender, waiting: Arc::default() }, receiver)
    }

    /// Hands a sample over without waiting. `measured` is its own stamp, by which regularity is judged.
    pub fn send(&self, counters: &Arc<Counters>, arrival: Arrival, measured: Stamp, sample: Box<dyn Sample>) {
        let bytes = sample.bytes();
        counters.received.fetch_add(1, Ordering::Relaxed);
        counters.bytes.fetch_add(bytes as u64, Ordering::Relaxed);
        {
            let mut times = counters.times.lock().unwrap_or_else(PoisonError::into_inner);
            times.pace.take(measured);
            let lag_s = Stamp(arrival.realtime_ns).seconds_since(measured);
            times.least_lag_s = Some(times.least_lag_s.map_or(lag_s, |least| least.min(lag_s)));
            times.arrivals = Some([times.arrivals.map_or(arrival, |[first, _]| first), arrival]);
        }
        let before = self.waiting.fetch_add(bytes, Ordering::Relaxed);
        let entry = Entry { sample, counters: Arc::clone(counters), waiting: Arc::clone(&self.waiting) };
        // Dropping the entry takes its bytes off again. One that comes after the end of the file was not dropped for want of room.
        if before + bytes > QUEUE_BYTES || matches!(self.sender.try_send(entry), Err(TrySendError::Full(_))) {
            counters.dropped.fetch_add(1, Ordering::Relaxed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Bytes(usize);

    impl Sample for Bytes {
        fn bytes(&self) -> usize {
            self.0
        }

        fn write(&self, _: &mut LogWriter) -> Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_full_queue_drops_and_counts_and_takes_up_again() {
        let (feed, queue) = Feed::new();
        let counters = Arc::new(Counters::default());
        let send = |bytes| feed.send(&counters, Arrival::now(), Stamp(1), Box::new(Bytes(bytes)));
        (0..QUEUE_SAMPLES + 5).for_each(|_| send(1));
        assert_eq!(counters.read().dropped, 5);
        queue.try_iter().for_each(drop);
        (0..5).for_each(|_| send(QUEUE_BYTES / 4));
        assert_eq!(counters.read().dropped, 6, "the fifth quarter is too much");
        queue.try_iter().for_each(drop);
        send(QUEUE_BYTES);
        let counts = counters.read();
        assert_eq!((counts.dropped, counts.received), (6, QUEUE_SAMPLES as u64 + 11));
    }
}
