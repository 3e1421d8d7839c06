//! What a program that is stopped from outside leaves behind: nothing that has no name yet.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Files and folders that are to go. Whoever makes one holds the lock until it stands here, so that none is made once the end has begun.
static TEMPORARY: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Makes a temporary file or folder that goes if the program is stopped.
pub(crate) fn temporary<T>(make: impl FnOnce() -> std::io::Result<T>, path: impl FnOnce(&T) -> &Path) -> std::io::Result<T> {
    let mut temporary = TEMPORARY.lock().unwrap_or_else(PoisonError::into_inner);
    // Those that have gone, or have their name, are no more of any interest.
    temporary.retain(|path| path.exists());
    let made = make()?;
    let made_at = path(&made);
    temporary.push(made_at.canonicalize().unwrap_or_else(|_| made_at.to_owned()));
    Ok(made)
}

/// From here on Ctrl-C or a request to terminate ends the program as ever, but what is half written goes first.
///
/// For programs whose results are worth nothing until they are whole and that hold nothing which must be put back, since nothing is dropped: who
/// records, or opens cameras, takes care of itself. A hang-up is left to the system, as
/// whoever starts a program with `nohup` wants it to.
#[cfg(unix)]
pub fn leave_nothing() {
    use signal_hook::consts::{SIGINT, SIGTERM};
    use signal_hook::low_level::emulate_default_handler;

    // Where signals cannot be caught the program is as good as without.
    let Ok(mut signals) = signal_hook::iterator::Signals::new([SIGINT, SIGTERM]) else { return };
    std::thread::spawn(move || {
        for signal in signals.forever() {
            let temporary = TEMPORARY.lock().unwrap_or_else(PoisonError::into_inner);
            temporary.iter().for_each(|path| remove(path));
            let _ends_here = emulate_default_handler(signal);
        }
    });
}

/// From here on a program that is stopped leaves nothing half written, where the system says that it is.
#[cfg(not(unix))]
pub fn leave_nothing() {}

/// Removes a file, or a folder to which others may be writing.
#[cfg(unix)]
fn remove(path: &Path) {
    const TRIALS: usize = 10;
    for _ in 0..TRIALS {
        let removed = if path.is_dir() { std::fs::remove_dir_all(path) } else { std::fs::remove_file(path) };
        if removed.is_ok() || !path.exists() {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_has_gone_is_forgotten() {
        let folder = temporary(tempfile::tempdir, tempfile::TempDir::path).unwrap();
        let at = folder.path().canonicalize().unwrap();
        let stands = || TEMPORARY.lock().unwrap_or_else(PoisonError::into_inner).contains(&at);
        assert!(stands());
        drop(folder);
        let _other = temporary(tempfile::tempdir, tempfile::TempDir::path).unwrap();
        assert!(!stands());
    }
}
