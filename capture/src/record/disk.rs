//! Puts a file on the disk, on a thread of its own.
//!
//! A sync lasts as long as the disk is busy, with others too: half a minute was seen. The writer must not wait for it, since what comes meanwhile
//! would fill its queue; the operating system takes what is written in the meantime.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, channel, sync_channel};
use std::thread;

use raven::{Error, Result};

/// The thread of one file; it ends, after the sync that is under way, when this is dropped.
pub(super) struct Disk {
    path: PathBuf,
    asked: SyncSender<()>,
    failed: Receiver<io::Error>,
}

impl Disk {
    /// Starts the thread.
    ///
    /// # Errors
    /// If the file cannot be opened.
    pub(super) fn of(path: &Path) -> Result<Self> {
        let file = File::open(path).map_err(|e| Error::io(path, "open", e))?;
        let (asked, orders) = sync_channel(1);
        let (faults, failed) = channel();
        let sync = move || {
            for () in orders {
                // Nobody listens any more when the file has ended.
                let _heard = file.sync_data().map_err(|e| faults.send(e));
            }
        };
        thread::Builder::new().name("disk".to_owned()).spawn(sync).map_err(|e| Error::io(path, "start the syncing of", e))?;
        Ok(Self { path: path.to_owned(), asked, failed })
    }

    /// Has everything written so far put on the disk, as soon as the disk has time, and does not wait for it.
    ///
    /// # Errors
    /// If an earlier sync failed.
    pub(super) fn sync(&self) -> Result<()> {
        if let Ok(error) = self.failed.try_recv() {
            return Err(Error::io(&self.path, "sync", error));
        }
        // Where one is asked for already, it comes after this too.
        let _asked_already = self.asked.try_send(());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(target_os = "linux")]
    #[test]
    fn asking_does_not_wait_and_a_file_that_cannot_be_synced_is_told_at_the_next_time() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let disk = Disk::of(file.path()).unwrap();
        assert!((0..1000).all(|_| disk.sync().is_ok()));
        // The kernel's interface to itself is no file on a disk.
        let disk = Disk::of(Path::new("/proc/self/status")).unwrap();
        disk.sync().unwrap();
        let until = std::time::Instant::now() + std::time::Duration::from_secs(10);
        while disk.sync().is_ok() {
            assert!(std::time::Instant::now() < until, "the failure is never told");
        }
    }
}
