//! A log that is recorded while it is written: it must be readable whatever happens to program or machine.
//!
//! It is called `NAME.mcap.active` until it is complete. Its chunks are written whole, never patched afterwards, so what has been flushed stays
//! good. Behind it stands the end of a file without an index, over which the next chunk is written: whenever the program is killed, readers that
//! can do without an index take what is there for a whole file. Only a kill in the middle of a write leaves a part of a chunk, and a file that
//! they take up to there.

use std::ffi::OsString;
use std::fs::{File, OpenOptions};
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use mcap::records::op;

use super::writer::{LIBRARY, LogWriter, Place, fault};
use crate::{Error, Result, files};

/// The name of a log until it is complete.
#[must_use]
pub fn active_name(path: &Path) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(".active");
    name.into()
}

/// Refuses to record where there is a recording of that name, complete or not.
///
/// # Errors
/// If there is one.
pub fn unrecorded(path: &Path) -> Result<()> {
    files::unused(path)?;
    let active = active_name(path);
    if active.exists() { Err(under_way(&active)) } else { Ok(()) }
}

fn under_way(active: &Path) -> Error {
    let what = "this recording is under way or was cut off; save it with `raven-capture check FILE --recover -o OUT.mcap`, then remove it.";
    Error::file(active, what)
}

impl LogWriter {
    /// Starts a log that grows under its active name and gets `path` for a name from [`LogWriter::finish`].
    ///
    /// # Errors
    /// If a recording of that name exists, complete or not, or the folder cannot be written to.
    pub fn live(path: &Path) -> Result<Self> {
        files::unused(path)?;
        let active = active_name(path);
        let file = OpenOptions::new().write(true).create_new(true).open(&active).map_err(|e| match e.kind() {
            std::io::ErrorKind::AlreadyExists => under_way(&active),
            _ => Error::io(&active, "create", e),
        })?;
        Self::start(path, "", LIBRARY, Place::Active(active), file)
    }

    /// Ends the chunk and hands everything written so far to the operating system, which keeps it if this program is killed. Returns the bytes
    /// of the file that are good for ever; what ends a live log for now stands behind them.
    ///
    /// # Errors
    /// If the disk is full.
    pub fn flush(&mut self) -> Result<u64> {
        self.writer.flush().map_err(|e| fault(&self.path, e))?;
        let failed = |e| Error::io(&self.path, "write", e);
        // Both handles share their place in the file, so the writer goes on where this one leaves it.
        let good_bytes = self.file.stream_position().map_err(failed)?;
        if matches!(self.place, Place::Active(_)) {
            self.file.write_all(&ending()).map_err(failed)?;
            self.file.seek(SeekFrom::Start(good_bytes)).map_err(failed)?;
        }
        Ok(good_bytes)
    }
}

/// Completes a live log that could not be written on, as on a full disk: takes off what is beyond its good bytes, ends it there without an index,
/// and gives it its name. `good_bytes` is what [`LogWriter::flush`] said last; the writer must be dropped before.
///
/// # Errors
/// If the file cannot be changed or renamed; it then keeps its active name, and can be recovered.
pub fn complete(path: &Path, good_bytes: u64) -> Result<()> {
    let active = active_name(path);
    let failed = |e| Error::io(&active, "complete", e);
    let mut file = OpenOptions::new().write(true).open(&active).map_err(failed)?;
    file.set_len(good_bytes).map_err(failed)?;
    file.seek(SeekFrom::End(0)).map_err(failed)?;
    file.write_all(&ending()).map_err(failed)?;
    file.sync_all().map_err(failed)?;
    rename(&active, path)
}

pub(super) fn rename(active: &Path, path: &Path) -> Result<()> {
    std::fs::rename(active, path).map_err(|e| Error::io(path, "rename to", e))?;
    // The name is on the disk when its folder is.
    File::open(files::folder_of(path)).and_then(|folder| folder.sync_all()).map_err(|e| Error::io(path, "sync", e))
}

/// The end of a file without an index: the end of its data, a footer that points nowhere, and the magic bytes.
fn ending() -> Vec<u8> {
    let record = |opcode: u8, body: &[u8]| [&[opcode], (body.len() as u64).to_le_bytes().as_slice(), body].concat();
    [record(op::DATA_END, &[0; 4]), record(op::FOOTER, &[0; 20]), mcap::MAGIC.to_vec()].concat()
}
