//! The writer: one thread that puts what comes out of the queue in the file, as the sources see it.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::Receiver;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};

use raven::log::unrecorded;
use raven::{Error, Result, files};

use super::recording::Recording;
use super::source::Entry;
use crate::clock::SessionClock;

/// Where and how to write.
#[derive(Debug, Clone)]
pub struct Plan {
    /// The recording.
    pub path: PathBuf,
    /// Bytes after which the next file is begun.
    pub split_bytes: Option<u64>,
    /// Bytes that must stay free on the disk.
    pub min_space_bytes: u64,
    /// Metadata records by name; the first is `session`.
    pub records: Vec<(String, BTreeMap<String, String>)>,
    /// The clock of all stamps.
    pub clock: SessionClock,
}

impl Plan {
    /// Name of the part with this number from 0: the recording's own if it is not split, otherwise `NAME_000.mcap` and so on.
    pub(super) fn part(&self, number: usize) -> PathBuf {
        if self.split_bytes.is_none() {
            return self.path.clone();
        }
        let stem = self.path.file_stem().unwrap_or_default().to_string_lossy();
        let extension = self.path.extension().map_or_else(String::new, |extension| format!(".{}", extension.to_string_lossy()));
        self.path.with_file_name(format!("{stem}_{number:03}{extension}"))
    }

    /// Refuses a recording of which a part, however late, would find its name taken.
    fn parts_unrecorded(&self) -> Result<()> {
        if self.split_bytes.is_none() {
            return Ok(());
        }
        let folder = files::folder_of(&self.path);
        let failed = |e| Error::io(folder, "read", e);
        for entry in fs::read_dir(folder).map_err(failed)? {
            let name = entry.map_err(failed)?.file_name();
            let name = name.to_string_lossy();
            let name = Path::new(name.strip_suffix(".active").unwrap_or(&name));
            let number = name.file_stem().and_then(|stem| stem.to_str()?.rsplit_once('_')?.1.parse().ok());
            if let Some(part) = number.map(|number| self.part(number)).filter(|part| part.file_name() == name.file_name()) {
                unrecorded(&part)?;
            }
        }
        Ok(())
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

    /// Says how much is on the disk, in all parts, and how much is free there.
    pub(super) fn set(&self, bytes: u64, free_bytes: u64) {
        self.bytes.store(bytes, Ordering::Relaxed);
        self.free_bytes.store(free_bytes, Ordering::Relaxed);
    }

    /// Whether the writer was told to end.
    pub(super) fn asked_to_end(&self) -> bool {
        self.asked_to_end.load(Ordering::Relaxed)
    }

    /// Says that the recording is over.
    pub(super) fn end(&self) {
        self.ended.store(true, Ordering::Relaxed);
    }

    /// Says why the recording ended early.
    pub(super) fn trouble(&self, why: &str) {
        *self.trouble.lock().unwrap_or_else(PoisonError::into_inner) = Some(format!("The recording ended early: {why}."));
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

/// A running writer.
pub struct Writer {
    progress: Arc<Progress>,
    thread: JoinHandle<Vec<PathBuf>>,
}

impl Writer {
    /// Starts a recording.
    ///
    /// # Errors
    /// If the file, or one of its parts, exists or cannot be created, or the disk has less free space than must stay free.
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
        plan.parts_unrecorded()?;
        let progress = Arc::new(Progress { free_bytes: free.into(), ..Progress::default() });
        let recording = Recording::begin(plan, Arc::clone(&progress))?;
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

/// Free bytes on the disk of a file that need not exist.
pub(crate) fn free_bytes(path: &Path) -> Result<u64> {
    let folder = files::folder_of(path);
    let disk = rustix::fs::statvfs(folder).map_err(|e| Error::io(folder, "look at", e.into()))?;
    Ok(disk.f_bavail.saturating_mul(disk.f_frsize))
}

pub(super) fn megabytes(bytes: u64) -> f64 {
    bytes as f64 * 1e-6
}
