//! The files of a recording: chunk by chunk, with everything on the disk once a second, and ended properly whatever happens.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};

use raven::log::{LogWriter, active_name, complete};
use raven::{Error, Result};

use super::disk::Disk;
use super::source::{Counters, Entry};
use super::writer::{Plan, Progress, free_bytes, megabytes};

/// How often everything is put on the disk, both clocks are read, and free space is looked at: what a power cut costs at most.
const TICK: Duration = Duration::from_secs(1);
/// How often everything is handed to the operating system: what a kill costs, and on a busy machine half of what it may cost.
const FLUSH: Duration = Duration::from_millis(500);
/// Bytes after which a chunk is ended, just below the container's own limit: so it is known which messages are in the file for good.
const CHUNK_BYTES: usize = 900_000;
/// How soon the end is noticed.
const GLANCE: Duration = Duration::from_millis(50);

/// A recording under way.
pub(super) struct Recording {
    plan: Plan,
    log: Option<LogWriter>,
    disk: Option<Disk>,
    /// The part being written, from its creation to its end.
    open: Option<PathBuf>,
    files: Vec<PathBuf>,
    /// Bytes of the parts that have ended, and of this part up to its last whole chunk.
    earlier_bytes: u64,
    good_bytes: u64,
    /// The open chunk: its bytes, and whose messages are in it.
    chunk_bytes: usize,
    chunk: Vec<(Arc<Counters>, u64)>,
    progress: Arc<Progress>,
}

impl Recording {
    /// Creates the first file.
    ///
    /// # Errors
    /// If it exists or cannot be written.
    pub(super) fn begin(plan: Plan, progress: Arc<Progress>) -> Result<Self> {
        let (files, chunk) = (Vec::new(), Vec::new());
        let mut recording =
            Self { plan, log: None, disk: None, open: None, files, earlier_bytes: 0, good_bytes: 0, chunk_bytes: 0, chunk, progress };
        match recording.begin_part() {
            Ok(()) => Ok(recording),
            Err(error) => {
                recording.discard();
                Err(error)
            }
        }
    }

    /// Records until everything asked for is written or nothing more can be; gives the files.
    pub(super) fn run(mut self, queue: &Receiver<Entry>) -> Vec<PathBuf> {
        let outcome = self.record(queue).and_then(|()| self.end_part());
        if let Err(error) = outcome {
            self.give_up(&error);
        }
        self.progress.end();
        self.files
    }

    fn record(&mut self, queue: &Receiver<Entry>) -> Result<()> {
        let (mut next_flush, mut next_tick) = (Instant::now() + FLUSH, Instant::now() + TICK);
        loop {
            match queue.recv_timeout(next_flush.saturating_duration_since(Instant::now()).min(GLANCE)) {
                Ok(entry) => self.take(&entry)?,
                Err(RecvTimeoutError::Timeout) if !self.progress.asked_to_end() => {}
                Err(_) => return self.tick().map(|_| ()),
            }
            let now = Instant::now();
            if now < next_flush {
                continue;
            }
            next_flush = now + FLUSH;
            if now < next_tick {
                self.end_chunk()?;
                continue;
            }
            next_tick = now + TICK;
            let free = self.tick()?;
            if free < self.plan.min_space_bytes {
                let (free, least) = (megabytes(free), megabytes(self.plan.min_space_bytes));
                self.progress.trouble(&format!("the disk has {free:.0} MB free, and --min-space keeps {least:.0} MB free"));
                return Ok(());
            }
            if self.plan.split_bytes.is_some_and(|limit| self.good_bytes >= limit) {
                self.end_part()?;
                self.begin_part()?;
            }
        }
    }

    fn take(&mut self, entry: &Entry) -> Result<()> {
        let Some(log) = &mut self.log else { return Ok(()) };
        self.chunk_bytes += entry.write(log)?;
        match self.chunk.iter_mut().find(|(counters, _)| Arc::ptr_eq(counters, entry.counters())) {
            Some((_, messages)) => *messages += 1,
            None => self.chunk.push((Arc::clone(entry.counters()), 1)),
        }
        if self.chunk_bytes >= CHUNK_BYTES { self.end_chunk() } else { Ok(()) }
    }

    /// Only now are the messages of the chunk in the file, and count.
    fn end_chunk(&mut self) -> Result<()> {
        if let Some(log) = &mut self.log {
            self.good_bytes = log.flush()?;
            self.chunk.drain(..).for_each(|(counters, messages)| counters.wrote(messages));
            self.chunk_bytes = 0;
        }
        Ok(())
    }

    /// Has everything put on the disk with a reading of both clocks, and returns the free space.
    fn tick(&mut self) -> Result<u64> {
        if let Some(log) = &mut self.log {
            let (stamp, sample) = self.plan.clock.sample();
            log.clock(stamp, sample)?;
        }
        self.end_chunk()?;
        if let Some(disk) = &self.disk {
            disk.sync()?;
        }
        let free = free_bytes(&self.plan.path)?;
        self.progress.set(self.earlier_bytes + self.good_bytes, free);
        Ok(free)
    }

    fn begin_part(&mut self) -> Result<()> {
        let path = self.plan.part(self.files.len());
        let mut log = LogWriter::live(&path)?;
        let active = active_name(&path);
        self.open = Some(path);
        self.disk = Some(Disk::of(&active)?);
        let mut records = self.plan.records.clone();
        if let (Some((_, session)), Some(_)) = (records.first_mut(), self.plan.split_bytes) {
            session.insert("part".to_owned(), self.files.len().to_string());
        }
        for (name, record) in &records {
            log.metadata(name, record)?;
        }
        self.log = Some(log);
        // From here on the file can be read if it is cut off.
        self.tick().map(|_| ())
    }

    fn end_part(&mut self) -> Result<()> {
        if let Some(log) = self.log.take() {
            log.finish()?;
            self.files.extend(self.open.take());
            self.earlier_bytes += std::mem::take(&mut self.good_bytes);
        }
        Ok(())
    }

    /// Keeps what is whole of a file that could not be written on.
    fn give_up(&mut self, error: &Error) {
        let words = error.to_string();
        let words = words.trim_end_matches('.');
        // A log that is dropped tries once more to write what it holds; the file is cut to what is good after that.
        drop(self.log.take());
        if self.good_bytes == 0 {
            self.discard();
        }
        let Some(path) = self.open.take() else { return self.progress.trouble(words) };
        if complete(&path, self.good_bytes).is_ok() {
            self.files.push(path);
            return self.progress.trouble(words);
        }
        let active = active_name(&path);
        let name = active.display();
        self.progress.trouble(&format!("{words}; {name} holds what was recorded: `raven-capture check {name} --recover -o OUT.mcap`"));
        self.files.push(active);
    }

    /// Takes away a file in which there is nothing yet.
    fn discard(&mut self) {
        drop(self.log.take());
        if let Some(path) = self.open.take() {
            // What cannot be removed is in nobody's way but that of the next recording, which says so.
            let _stays = std::fs::remove_file(active_name(&path));
        }
    }
}
