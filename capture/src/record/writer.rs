//! The writer: one thread that puts what comes out of the queue on the disk, and once a second makes sure that it is there.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use raven::log::{LogWriter, active_name, complete};
use raven::{Error, Result};

use super::source::Entry;
use crate::clock::SessionClock;

/// How often everything is put on the disk, both clocks are read, and free space is looked at: what a power cut costs at most.
const TICK: Duration = Duration::from_secs(1);

/// Where and how to write.
#[derive(Debug, Clone)]
pub struct Plan {
    /// The recording.
    pub path: PathBuf,
    /// Bytes after which the next file is begun.
    pub split_bytes: Option<u64>,
    /// Bytes that must stay free on the disk.
    pub min_space_bytes: u64,
    /// Metadata record `session`.
    pub session: BTreeMap<String, String>,
    /// The clock of all stamps.
    pub clock: SessionClock,
}

impl Plan {
    /// Name of the part with this number from 0: the recording's own if it is not split, otherwise `NAME_000.mcap` and so on.
    fn part(&self, number: usize) -> PathBuf {
        if self.split_bytes.is_none() {
            return self.path.clone();
        }
        let stem = self.path.file_stem().unwrap_or_default().to_string_lossy();
        let extension = self.path.extension().map_or_else(String::new, |extension| format!(".{}", extension.to_string_lossy()));
        self.path.with_file_name(format!("{stem}_{number:03}{extension}"))
    }
}

/// What the writer shows while it works.
#[derive(Debug, Default)]
pub struct Progress {
    bytes: AtomicU64,
    free_bytes: AtomicU64,
    asked_to_end: AtomicBool,
    ended: AtomicBool,
    trouble: Mutex<Option<String>>,
}

impl Progress {
    /// Bytes on the disk, in all parts.
    pub fn bytes(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed)
    }

    /// Bytes free there.
    pub fn free_bytes(&self) -> u64 {
        self.free_bytes.load(Ordering::Relaxed)
    }

    /// Whether the writer has given up before it was told to end.
    pub fn ended(&self) -> bool {
        self.ended.load(Ordering::Relaxed)
    }
}

/// What was written.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Written {
    /// The files.
    pub files: Vec<PathBuf>,
    /// Their bytes.
    pub bytes: u64,
    /// Why the recording ended before it was told to, as a sentence.
    pub trouble: Option<String>,
}

/// How soon the writer notices that it was told to end.
const GLANCE: Duration = Duration::from_millis(50);

/// A running writer.
pub struct Writer {
    progress: Arc<Progress>,
    thread: JoinHandle<Vec<PathBuf>>,
}

impl Writer {
    /// Starts a recording.
    ///
    /// # Errors
    /// If the file exists or cannot be created, or the disk has less free space than must stay free.
    pub fn start(plan: Plan, queue: Receiver<Entry>) -> Result<Self> {
        let free = free_bytes(&plan.path)?;
        if free < plan.min_space_bytes {
            let message = format!(
                "the disk has {:.0} MB free and --min-space keeps {:.0} MB free: make room or choose another disk.",
                megabytes(free),
                megabytes(plan.min_space_bytes)
            );
            return Err(Error::file(&plan.path, message));
        }
        let progress = Arc::new(Progress { free_bytes: free.into(), ..Progress::default() });
        let mut recording =
            Recording { log: Some(begin(&plan, 0)?), plan, files: Vec::new(), earlier_bytes: 0, progress: Arc::clone(&progress) };
        // From here on a cut-off file can be read.
        recording.tick()?;
        let spawned = thread::Builder::new().name("writer".to_owned()).spawn(move || recording.run(&queue));
        Ok(Self { progress, thread: spawned.map_err(|e| Error::Data(format!("no thread for the writer: {e}.")))? })
    }

    /// What the writer has done so far.
    #[must_use]
    pub fn progress(&self) -> &Progress {
        &self.progress
    }

    /// Has everything written that is in the queue, and ends the file. The sources must have ended before.
    ///
    /// # Errors
    /// If the writer itself broke.
    pub fn finish(self) -> Result<Written> {
        self.progress.asked_to_end.store(true, Ordering::Relaxed);
        let files = self.thread.join().map_err(|_| Error::Data("the writer broke; its file has the ending .active.".to_owned()))?;
        let trouble = self.progress.trouble.lock().unwrap_or_else(PoisonError::into_inner).take();
        let bytes = files.iter().filter_map(|file| file.metadata().ok()).map(|file| file.len()).sum();
        Ok(Written { files, bytes, trouble })
    }
}

struct Recording {
    plan: Plan,
    log: Option<LogWriter>,
    files: Vec<PathBuf>,
    earlier_bytes: u64,
    progress: Arc<Progress>,
}

impl Recording {
    fn run(mut self, queue: &Receiver<Entry>) -> Vec<PathBuf> {
        let outcome = self.record(queue).and_then(|()| self.end_part());
        if let Err(error) = outcome {
            self.give_up(&error);
        }
        self.progress.ended.store(true, Ordering::Relaxed);
        self.files
    }

    fn record(&mut self, queue: &Receiver<Entry>) -> Result<()> {
        let mut next_tick = Instant::now() + TICK;
        loop {
            match queue.recv_timeout(next_tick.saturating_duration_since(Instant::now()).min(GLANCE)) {
                Ok(entry) => {
                    if let Some(log) = &mut self.log {
                        entry.write(log)?;
                    }
                }
                Err(RecvTimeoutError::Timeout) if !self.progress.asked_to_end.load(Ordering::Relaxed) => {}
                Err(_) => return self.tick().map(|_| ()),
            }
            if Instant::now() >= next_tick {
                next_tick = Instant::now() + TICK;
                let free = self.tick()?;
                if free < self.plan.min_space_bytes {
                    let (free, least) = (megabytes(free), megabytes(self.plan.min_space_bytes));
                    self.trouble(format!("the disk has {free:.0} MB free, and --min-space keeps {least:.0} MB free"));
                    return Ok(());
                }
            }
        }
    }

    /// Puts everything on the disk with a reading of both clocks, begins the next part where it is time, and returns the free space.
    fn tick(&mut self) -> Result<u64> {
        let Some(log) = &mut self.log else { return Ok(u64::MAX) };
        let (stamp, sample) = self.plan.clock.sample();
        log.clock(stamp, sample)?;
        let bytes = log.flush()?;
        self.progress.bytes.store(self.earlier_bytes + bytes, Ordering::Relaxed);
        let free = free_bytes(&self.plan.path)?;
        self.progress.free_bytes.store(free, Ordering::Relaxed);
        if self.plan.split_bytes.is_some_and(|limit| bytes >= limit) {
            self.end_part()?;
            self.earlier_bytes += bytes;
            self.log = Some(begin(&self.plan, self.files.len())?);
        }
        Ok(free)
    }

    fn end_part(&mut self) -> Result<()> {
        let path = self.plan.part(self.files.len());
        if let Some(log) = self.log.take() {
            log.finish()?;
            self.files.push(path);
        }
        Ok(())
    }

    /// Keeps what is whole of a file that could not be written on.
    fn give_up(&mut self, error: &Error) {
        let path = self.plan.part(self.files.len());
        // The log tries once more to write what it holds when it is dropped; the file is looked at after that.
        drop(self.log.take());
        let words = error.to_string();
        let words = words.trim_end_matches('.');
        match complete(&path) {
            Ok(()) => {
                self.files.push(path);
                self.trouble(words.to_owned());
            }
            Err(_) => {
                let active = active_name(&path);
                self.trouble(format!(
                    "{words}; what was recorded is in {}: save it with `raven-capture check {} --recover -o OUT.mcap`",
                    active.display(),
                    active.display()
                ));
                self.files.push(active);
            }
        }
    }

    fn trouble(&self, why: String) {
        *self.progress.trouble.lock().unwrap_or_else(PoisonError::into_inner) = Some(format!("The recording ended early: {why}."));
    }
}

fn begin(plan: &Plan, part: usize) -> Result<LogWriter> {
    let mut log = LogWriter::live(&plan.part(part))?;
    let mut session = plan.session.clone();
    if plan.split_bytes.is_some() {
        session.insert("part".to_owned(), part.to_string());
    }
    log.metadata("session", &session)?;
    Ok(log)
}

/// Free bytes on the disk of a file that need not exist.
fn free_bytes(path: &Path) -> Result<u64> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let disk = rustix::fs::statvfs(folder).map_err(|e| Error::io(folder, "look at", e.into()))?;
    Ok(disk.f_bavail.saturating_mul(disk.f_frsize))
}

fn megabytes(bytes: u64) -> f64 {
    bytes as f64 * 1e-6
}
