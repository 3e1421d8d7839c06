//! Whole files or none: temporary file beside the target, sync, rename.

use std::io::Write;
use std::path::Path;

use sha2::{Digest, Sha256};

use crate::{Error, Result};

/// Reads a text file.
///
/// # Errors
/// If the file cannot be opened or is not UTF-8.
pub fn read_text(path: &Path) -> Result<String> {
    std::fs::read_to_string(path).map_err(|e| Error::io(path, "read", e))
}

/// Parses YAML that was read from `path`.
///
/// # Errors
/// With line, column and the key, if the text is not YAML or not of the type asked for.
pub fn parse_yaml<T: serde::de::DeserializeOwned>(path: &Path, text: &str) -> Result<T> {
    serde_saphyr::from_str(text).map_err(|error| {
        let place = error.location().map_or_else(String::new, |l| format!("line {}, column {}: ", l.line(), l.column()));
        let sentence = error.without_snippet().to_string();
        Error::file(path, format!("{place}{}.", sentence.lines().next().unwrap_or_default().trim_end_matches('.')))
    })
}

/// A number as every YAML 1.1 reader takes for a float: with a decimal point and no exponent, `720000.0`, never `7.2e5` or `0`.
#[must_use]
pub fn yaml_float(value: f64) -> String {
    if value.is_nan() {
        return ".nan".to_owned();
    }
    if value.is_infinite() {
        return if value > 0.0 { ".inf" } else { "-.inf" }.to_owned();
    }
    let text = value.to_string();
    if text.contains('.') { text } else { text + ".0" }
}

/// A flow sequence of [`yaml_float`]s.
#[must_use]
pub fn yaml_list(values: &[f64]) -> String {
    format!("[{}]", values.iter().map(|&v| yaml_float(v)).collect::<Vec<_>>().join(", "))
}

/// A string as a YAML scalar, quoted where plain text could be read as something else.
#[must_use]
pub fn yaml_string(text: &str) -> String {
    let plain = text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '/')
        && text.chars().all(|c| c.is_ascii_alphanumeric() || "_-./".contains(c))
        && !["true", "false", "yes", "no", "on", "off", "null", "y", "n"].contains(&text.to_ascii_lowercase().as_str());
    if plain { text.to_owned() } else { serde_json::Value::from(text).to_string() }
}

/// Replaces `path` by `contents` in one step; whoever reads it meanwhile sees the old file or the new one, never a part.
///
/// # Errors
/// If the folder does not exist or cannot be written to; the old file then stays.
pub fn write_atomic(path: &Path, contents: &[u8]) -> Result<()> {
    let mut file = temporary_beside(path)?;
    file.write_all(contents).map_err(|e| Error::io(path, "write", e))?;
    persist(file, path)
}

/// An empty temporary file in the folder of `path`, removed when dropped.
///
/// # Errors
/// If the folder does not exist or cannot be written to.
pub fn temporary_beside(path: &Path) -> Result<tempfile::NamedTempFile> {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let mut builder = tempfile::Builder::new();
    builder.prefix(".raven-").suffix(".part");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o644));
    }
    builder.tempfile_in(folder).map_err(|e| Error::io(path, "create", e))
}

/// Syncs a temporary file to the disk and gives it its name.
///
/// # Errors
/// If the disk is full or the name cannot be taken.
pub fn persist(file: tempfile::NamedTempFile, path: &Path) -> Result<()> {
    file.as_file().sync_all().map_err(|e| Error::io(path, "sync", e))?;
    file.persist(path).map_err(|e| Error::io(path, "rename to", e.error))?;
    Ok(())
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
