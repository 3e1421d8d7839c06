//! Whole files or none: temporary file beside the target, sync, rename.

use std::io::{Read, Write};
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use crate::cli::STANDARD_OUTPUT;
use crate::{Error, Result, interrupted};

/// Symbolic links that are followed from one to the next, as many as Linux does.
const LINKS_MAX: usize = 40;

/// What a text that is read from standard input is called.
const STANDARD_INPUT: &str = "-";

/// Reads a text file; `-` is standard input.
///
/// # Errors
/// If the file cannot be opened or is not UTF-8.
pub fn read_text(path: &Path) -> Result<String> {
    let text = if path.as_os_str() == STANDARD_INPUT { std::io::read_to_string(std::io::stdin()) } else { std::fs::read_to_string(path) };
    text.map_err(|e| Error::io(path, "read", e))
}

/// Replaces `path` by `contents` in one step; whoever reads it meanwhile sees the old file or the new one, never a part. What a symbolic link
/// points to is replaced, and pipes and devices are written to as they are.
///
/// # Errors
/// If the folder does not exist or cannot be written to, or a recording has that name; the old file then stays.
pub fn write_atomic(path: &Path, contents: &[u8]) -> Result<()> {
    let write = |mut file: &std::fs::File| file.write_all(contents).map_err(|e| Error::io(path, "write", e));
    if is_special(path) {
        return write(&std::fs::OpenOptions::new().write(true).open(path).map_err(|e| Error::io(path, "write", e))?);
    }
    if is_recording(path) {
        return unused(path);
    }
    let file = temporary_beside(path)?;
    write(file.as_file())?;
    persist(file, path)
}

/// Whether there is a pipe or a device.
fn is_special(path: &Path) -> bool {
    path.metadata().is_ok_and(|there| !there.is_file() && !there.is_dir())
}

/// Whether there is an MCAP file.
#[must_use]
pub fn is_recording(path: &Path) -> bool {
    let mut first = [0; 5];
    let mut read = || std::fs::File::open(path)?.read_exact(&mut first);
    path.is_file() && read().is_ok() && first == *b"\x89MCAP"
}

/// What a write to `path` replaces: what a symbolic link points to, be it there or not; a link that leads in a circle is replaced itself.
fn replaced(path: &Path) -> PathBuf {
    let mut target = path.to_owned();
    for _ in 0..LINKS_MAX {
        match target.read_link() {
            Ok(next) => target = folder_of(&target).join(next),
            Err(_) => return target.canonicalize().unwrap_or(target),
        }
    }
    path.to_owned()
}

/// An empty temporary file in the folder of what a write to `path` replaces, removed when dropped.
///
/// # Errors
/// If the folder does not exist or cannot be written to, or `path` is no regular file.
pub fn temporary_beside(path: &Path) -> Result<tempfile::NamedTempFile> {
    no_stream(path)?;
    if path.exists() && !path.is_file() {
        return Err(Error::file(path, "this is a folder or a device; name a file to write."));
    }
    let replaced = replaced(path);
    let folder = folder_of(&replaced);
    require_folder(folder).map_err(|sentence| Error::file(path, sentence))?;
    let mut builder = tempfile::Builder::new();
    builder.prefix(".raven-").suffix(".part");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o644));
    }
    let made = interrupted::temporary(|| builder.tempfile_in(folder), tempfile::NamedTempFile::path);
    made.map_err(|e| Error::io(path, "create", e))
}

/// An empty file in a folder that has no name there: nothing of it is left, however the program ends.
///
/// # Errors
/// If the folder does not exist or cannot be written to.
pub fn nameless_in(folder: &Path) -> Result<std::fs::File> {
    require_folder(folder).map_err(|sentence| Error::file(folder, sentence))?;
    tempfile::tempfile_in(folder).map_err(|e| Error::io(folder, "write in", e))
}

fn require_folder(folder: &Path) -> Result<(), String> {
    if folder.is_dir() {
        return Ok(());
    }
    Err(format!("the folder {} does not exist; make it first.", folder.display()))
}

/// An empty folder among the system's temporary ones, removed when dropped.
///
/// # Errors
/// If there is no room for it.
pub fn temporary_folder() -> Result<tempfile::TempDir> {
    let made = interrupted::temporary(tempfile::tempdir, tempfile::TempDir::path);
    made.map_err(|e| Error::io(&std::env::temp_dir(), "create a folder in", e))
}

/// Syncs a temporary file to the disk and gives it its name.
///
/// # Errors
/// If the disk is full or the name cannot be taken.
pub fn persist(file: tempfile::NamedTempFile, path: &Path) -> Result<()> {
    file.as_file().sync_all().map_err(|e| Error::io(path, "sync", e))?;
    file.persist(replaced(path)).map_err(|e| Error::io(path, "rename to", e.error))?;
    Ok(())
}

/// Refuses to write a recording where something is already.
///
/// # Errors
/// If the file exists.
pub fn unused(recording: &Path) -> Result<()> {
    no_stream(recording)?;
    if recording.exists() {
        return Err(Error::file(recording, "this recording exists, and recordings are never written over; choose another name."));
    }
    Ok(())
}

/// Refuses standard output for what is written as a file, in one step or with an index at its end.
///
/// # Errors
/// If the path is `-`.
pub fn no_stream(path: &Path) -> Result<()> {
    if path.as_os_str() == STANDARD_OUTPUT {
        return Err(Error::Argument("`-` is standard output, which does not take this; name a file.".to_owned()));
    }
    Ok(())
}

/// Refuses to write over what is read, one output over another, and into folders that are not there, before any work is done; outputs come with
/// the options that name them.
///
/// # Errors
/// If an output is one of the inputs or of the other outputs, or a folder, or its folder does not exist.
pub fn apart<P: AsRef<Path>>(inputs: impl IntoIterator<Item = P>, outputs: &[(&str, Option<&Path>)]) -> Result<()> {
    let there: Vec<PathBuf> = inputs.into_iter().filter_map(|input| input.as_ref().canonicalize().ok()).collect();
    let mut taken: Vec<(PathBuf, &str)> = Vec::new();
    for &(option, output) in outputs {
        // A pipe or a device, as /dev/tty, may be any of them, and standard output is no file.
        let is_file = |output: &&Path| output.as_os_str() != STANDARD_OUTPUT && !is_special(output);
        let Some(output) = output.filter(is_file) else { continue };
        let place = place(output);
        if let Some((_, other)) = taken.iter().find(|(known, _)| *known == place) {
            return Err(Error::Argument(format!(
                "{other} and {option} both name {}, and one would be written over the other; give {option} another name.",
                output.display()
            )));
        }
        if there.contains(&place) {
            return Err(Error::Argument(format!(
                "{option} {}: this very file is read, and nothing that is read is written over; give {option} another name.",
                output.display()
            )));
        }
        if output.is_dir() {
            return Err(Error::Argument(format!("{option} {}: this is a folder; name a file to write.", output.display())));
        }
        require_folder(folder_of(&replaced(output)))
            .map_err(|sentence| Error::Argument(format!("{option} {}: {sentence}", output.display())))?;
        taken.push((place, option));
    }
    Ok(())
}

/// The folder that a file is in, or will be.
#[must_use]
pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Where a file is, or will be, by whatever name.
fn place(path: &Path) -> PathBuf {
    let path = replaced(path);
    let beside = || Some(folder_of(&path).canonicalize().ok()?.join(path.file_name()?));
    path.canonicalize().ok().or_else(beside).unwrap_or(path)
}

/// SHA-256 of bytes, in lower-case hexadecimal.
#[must_use]
pub fn sha256_of(bytes: &[u8]) -> String {
    hexadecimal(&Sha256::digest(bytes))
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// SHA-256 of a file, in lower-case hexadecimal: how a parameter names the log it came from.
///
/// # Errors
/// If the file cannot be read.
pub fn sha256(path: &Path) -> Result<String> {
    let mut file = std::fs::File::open(path).map_err(|e| Error::io(path, "read", e))?;
    let mut hash = Sha256::new();
    let mut buffer = vec![0_u8; 1 << 16];
    loop {
        let read = std::io::Read::read(&mut file, &mut buffer).map_err(|e| Error::io(path, "read", e))?;
        if read == 0 {
            return Ok(hexadecimal(&hash.finalize()));
        }
        hash.update(&buffer[..read]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(unix)]
    fn links_stay_links_and_devices_devices() {
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("a.yaml"), folder.path().join("link.yaml"));
        write_atomic(&file, b"old").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        write_atomic(&link, b"new").unwrap();
        assert!(link.is_symlink());
        assert_eq!(read_text(&file).unwrap(), "new");
        let null = Path::new("/dev/null");
        write_atomic(null, b"nothing").unwrap();
        assert!(is_special(null) && temporary_beside(null).unwrap_err().to_string().contains("name a file"));
        assert!(write_atomic(folder.path(), b"x").unwrap_err().to_string().contains("name a file"));
        let said = apart([&file], &[("--json", Some(folder.path()))]).unwrap_err().to_string();
        assert!(said.starts_with("--json") && said.contains("this is a folder"), "{said}");
        for stream in [write_atomic(Path::new("-"), b"x"), unused(Path::new("-"))] {
            assert!(stream.unwrap_err().to_string().contains("`-` is standard output"));
        }
    }

    #[test]
    #[cfg(unix)]
    fn links_to_what_is_not_there_yet_stay_links() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir(at("results")).unwrap();
        symlink("results/latest.yaml", at("link.yaml")).unwrap();
        symlink("../robot.yaml", at("results/latest.yaml")).unwrap();
        let outputs = |other: &str| apart::<&Path>([], &[("-o", Some(&at("link.yaml"))), ("--json", Some(&at(other)))]);
        outputs("other.yaml").unwrap();
        assert!(outputs("robot.yaml").unwrap_err().to_string().contains("-o and --json both name"));
        write_atomic(&at("link.yaml"), b"new").unwrap();
        assert!(at("link.yaml").is_symlink() && at("results/latest.yaml").is_symlink() && !at("robot.yaml").is_symlink());
        assert_eq!(read_text(&at("robot.yaml")).unwrap(), "new");
        symlink("missing/robot.yaml", at("astray.yaml")).unwrap();
        let nowhere = [write_atomic(&at("astray.yaml"), b"x"), apart::<&Path>([], &[("-o", Some(&at("astray.yaml")))])];
        assert!(nowhere.into_iter().all(|refused| refused.unwrap_err().to_string().contains("missing does not exist; make it first")));
        symlink("circle.yaml", at("circle.yaml")).unwrap();
        write_atomic(&at("circle.yaml"), b"x").unwrap();
        assert_eq!(read_text(&at("circle.yaml")).unwrap(), "x");
    }

    #[test]
    fn what_is_read_is_not_written_over() {
        let folder = tempfile::tempdir().unwrap();
        let log = folder.path().join("a.mcap");
        write_atomic(&log, b"images").unwrap();
        let again = folder.path().join(".").join("a.mcap");
        let robot = folder.path().join("robot.yaml");
        let onto = |output: Option<&Path>| apart([&robot, &log], &[("-o", None), ("--json", output)]);
        assert!(onto(Some(&again)).unwrap_err().to_string().contains("give --json another name"));
        onto(None).and_then(|()| onto(Some(&robot))).unwrap();
        assert!(onto(Some(&folder.path().join("new/a.json"))).unwrap_err().to_string().contains("new does not exist; make it first"));
        let both = apart([&log], &[("--json", Some(&robot)), ("--html", Some(&folder.path().join("./robot.yaml")))]);
        assert!(both.unwrap_err().to_string().contains("--json and --html both name"));
        apart([&log], &[("--json", Some(Path::new("/dev/null"))), ("--html", Some(Path::new("/dev/null")))]).unwrap();
        apart([&log], &[("-o", Some(Path::new("-"))), ("--json", Some(Path::new("-")))]).unwrap();
        assert!(unused(&again).unwrap_err().to_string().contains("never written over"));
        assert!(write_atomic(&again, b"{}").is_ok());
        write_atomic(&log, b"\x89MCAP0\r\n").unwrap();
        assert!(write_atomic(&again, b"{}").unwrap_err().to_string().contains("never written over"));
        let other = folder.path().join("b.mcap");
        onto(Some(&other)).and_then(|()| unused(&other)).unwrap();
    }

    #[test]
    fn a_failed_write_keeps_the_old_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("robot.yaml");
        write_atomic(&path, b"old").unwrap();
        write_atomic(&path, b"new").unwrap();
        assert_eq!(read_text(&path).unwrap(), "new");
        assert!(write_atomic(&folder.path().join("missing/robot.yaml"), b"x").is_err());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn sha256_of_abc_is_the_published_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("abc");
        std::fs::write(&path, "abc").unwrap();
        let published = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
        assert_eq!(sha256(&path).unwrap(), published);
        assert_eq!(sha256_of(b"abc"), published);
    }
}
