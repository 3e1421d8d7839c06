//! A camera as a source of a recording: a thread that takes its frames, and opens it again whenever it comes back.

use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use raven::log::{FrameMeta, LogWriter, Side, Times};
use raven::{Error, Result};

use super::judge::Judge;
use super::{CameraFault, Driver, Encoding, Frame, Mode, Opened};
use crate::clock::SessionClock;
use crate::record::source::{Counters, Feed, Sample};

/// How soon the end is noticed.
const GLANCE: Duration = Duration::from_millis(200);
/// A camera that delivers nothing for so long, and for so many of its intervals, is opened again.
const SILENT: Duration = Duration::from_secs(2);
const SILENT_INTERVALS: f64 = 10.0;
/// How often a camera that is away is looked for.
const RETRY: Duration = Duration::from_millis(300);

/// Where the frames of a camera go.
#[derive(Clone)]
pub struct Sink {
    /// Which camera.
    pub side: Side,
    /// What it has done so far.
    pub counters: Arc<Counters>,
    /// The recording.
    pub feed: Feed,
    /// The clock of all stamps.
    pub clock: SessionClock,
    /// Where sentences for the user go.
    pub notices: Sender<String>,
    /// Frames before this is raised are not recorded.
    pub rolling: Arc<AtomicBool>,
}

/// What is known of a camera when it delivers.
#[derive(Debug, Clone)]
pub struct Ready {
    /// What it delivers.
    pub mode: Mode,
    /// What the log should know of it.
    pub record: std::collections::BTreeMap<String, String>,
}

/// A camera with its thread. Dropping it stops the camera.
pub struct CameraSource {
    side: Side,
    ready: Receiver<Result<Ready, CameraFault>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl CameraSource {
    /// Starts the thread, which opens the camera.
    ///
    /// # Errors
    /// If there is no thread to be had.
    pub fn start(driver: Box<dyn Driver>, sink: Sink) -> Result<Self> {
        let (sender, ready) = channel();
        let (side, stop) = (sink.side, Arc::new(AtomicBool::new(false)));
        let source = Source { sink, stop: Arc::clone(&stop), said: Mutex::default() };
        let spawned = thread::Builder::new().name(format!("{} camera", side.name())).spawn(move || source.run(driver, &sender));
        let thread = Some(spawned.map_err(|e| Error::Data(format!("no thread for the {} camera: {e}.", side.name())))?);
        Ok(Self { side, ready, stop, thread })
    }

    /// Waits until the camera delivers.
    ///
    /// # Errors
    /// If it cannot be opened as asked.
    pub fn ready(&self) -> Result<Ready> {
        let opened = self.ready.recv().unwrap_or(Err(CameraFault::Broken));
        opened.map_err(|fault| Error::Data(format!("{} camera: {fault}.", self.side.name())))
    }
}

impl Drop for CameraSource {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        // A thread that panicked has nothing left to say.
        let _panicked = self.thread.take().map(JoinHandle::join);
    }
}

struct Source {
    sink: Sink,
    stop: Arc<AtomicBool>,
    said: Mutex<BTreeSet<String>>,
}

impl Source {
    fn run(&self, mut driver: Box<dyn Driver>, ready: &Sender<Result<Ready, CameraFault>>) {
        let opened = match guarded(|| driver.open()) {
            Ok(opened) => opened,
            // Whoever waits hears the reason; if nobody does, it is over anyway.
            Err(fault) => return drop(ready.send(Err(fault))),
        };
        let mode = opened.mode;
        opened.notices.iter().for_each(|notice| self.say(notice));
        let _over = ready.send(Ok(Ready { mode, record: opened.record.clone() }));
        let mut opened = Some(opened);
        while !self.stopped() {
            match opened.take() {
                Some(running) => {
                    let Err(fault) = self.stream(running) else { return };
                    self.sink.counters.interrupted();
                    self.say(&format!("{fault}; trying again"));
                }
                None => opened = self.reopen(&mut *driver, mode),
            }
        }
    }

    /// Takes frames until it is told to stop.
    fn stream(&self, opened: Opened) -> Result<(), CameraFault> {
        let (mode, mut stream) = (opened.mode, opened.stream);
        let mut judge = Judge::new(mode);
        let mut last = Instant::now();
        let result = loop {
            if self.stopped() {
                break Ok(());
            }
            match guarded(|| stream.next(GLANCE)) {
                Ok(Some(frame)) => {
                    last = Instant::now();
                    if self.sink.rolling.load(Ordering::Relaxed) {
                        self.take(frame, mode, &mut judge);
                    }
                }
                Ok(None) => {
                    let usual =
                        judge.pace().median_s().map_or(Duration::ZERO, |median_s| Duration::from_secs_f64(SILENT_INTERVALS * median_s));
                    let seconds = last.elapsed().as_secs_f64();
                    if last.elapsed() > SILENT.max(usual) {
                        break Err(CameraFault::Silent { seconds });
                    }
                }
                Err(fault) => break Err(fault),
            }
        };
        // A driver that has failed may fail once more when it is stopped.
        let _stopped = guarded(|| {
            drop(stream);
            Ok(())
        });
        result
    }

    fn reopen(&self, driver: &mut dyn Driver, mode: Mode) -> Option<Opened> {
        match guarded(|| driver.open()) {
            Ok(opened) if opened.mode == mode => {
                self.said.lock().unwrap_or_else(PoisonError::into_inner).clear();
                self.say("it is back");
                opened.notices.iter().for_each(|notice| self.say(notice));
                return Some(opened);
            }
            Ok(opened) => self.say(&format!("it has come back with {} instead of {mode}; trying again", opened.mode)),
            Err(fault) => self.say(&format!("{fault}; trying again")),
        }
        thread::sleep(RETRY);
        None
    }

    fn take(&self, frame: Frame, mode: Mode, judge: &mut Judge) {
        let sink = &self.sink;
        let meta = judge.take(&frame);
        let times = Times { measured: sink.clock.stamp(frame.monotonic_ns()), arrived: sink.clock.stamp(frame.dequeued.monotonic_ns) };
        sink.counters.frame(times.measured, &meta);
        let arrival = frame.dequeued;
        let sample = FrameSample { side: sink.side, mode, times, meta, bytes: frame.bytes };
        sink.feed.send(&sink.counters, arrival, times.measured, Box::new(sample));
    }

    /// Says something of the camera, once.
    fn say(&self, what: &str) {
        let sentence = format!("{} camera: {what}.", self.sink.side.name());
        if self.said.lock().unwrap_or_else(PoisonError::into_inner).insert(sentence.clone()) {
            // Nobody listens any more when everything ends.
            let _ended = self.sink.notices.send(sentence);
        }
    }

    fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

/// The library under a driver panics at what it does not know; one camera's driver must not end the recording of the others.
fn guarded<T>(work: impl FnOnce() -> Result<T, CameraFault>) -> Result<T, CameraFault> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or(Err(CameraFault::Broken))
}

/// A frame on its way to the log: its pixels as they came, and what was noted of it.
struct FrameSample {
    side: Side,
    mode: Mode,
    times: Times,
    meta: FrameMeta,
    bytes: Vec<u8>,
}

impl Sample for FrameSample {
    fn bytes(&self) -> usize {
        self.bytes.len()
    }

    fn write(&self, log: &mut LogWriter) -> Result<()> {
        log.frame_meta(self.side, self.times, self.meta.clone())?;
        match self.mode.encoding {
            // What the driver calls damaged would be taken for a picture; a raw frame with too few bytes is none.
            _ if self.meta.is_damaged() => Ok(()),
            Encoding::Mjpg => log.compressed_image(self.side, self.times, self.meta.sequence, &self.bytes),
            Encoding::Yuyv if self.meta.truncated => Ok(()),
            Encoding::Yuyv => {
                let layout = ("yuv422_yuy2", self.mode.size_px, self.mode.stride_bytes);
                log.raw_image(self.side, self.times, self.meta.sequence, layout, &self.bytes)
            }
        }
    }
}
