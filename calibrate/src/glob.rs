//! File names with `*` and `?`, for shells that do not expand them and patterns in quotes.

use std::path::{Path, PathBuf};

use raven::{Error, Result};

/// The files that patterns name, sorted by name. A pattern may have `*` and `?` in its last part; one without them names one file.
///
/// # Errors
/// If a folder cannot be read, or a pattern matches no file.
pub fn files(patterns: &[String]) -> Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for pattern in patterns {
        let path = Path::new(pattern);
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        if !name.contains(['*', '?']) {
            found.push(path.to_owned());
            continue;
        }
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let entries = std::fs::read_dir(folder).map_err(|e| Error::io(folder, "read", e))?;
        let before = found.len();
        for entry in entries {
            let entry = entry.map_err(|e| Error::io(folder, "read", e))?;
            if matches(name.as_bytes(), entry.file_name().to_string_lossy().as_bytes()) {
                found.push(path.with_file_name(entry.file_name()));
            }
        }
        if found.len() == before {
            return Err(Error::Argument(format!("no file is called `{pattern}`; check the folder and the pattern.")));
        }
    }
    found.sort();
    found.dedup();
    Ok(found)
}

/// Whether a name fits a pattern, byte by byte.
fn matches(pattern: &[u8], name: &[u8]) -> bool {
    match (pattern.split_first(), name.split_first()) {
        (None, None) => true,
        (Some((b'*', rest)), _) => (0..=name.len()).any(|skip| matches(rest, &name[skip..])),
        (Some((b'?', rest)), Some((_, tail))) => matches(rest, tail),
        (Some((a, rest)), Some((b, tail))) => a == b && matches(rest, tail),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stars_and_question_marks() {
        let fits = |pattern: &str, name: &str| matches(pattern.as_bytes(), name.as_bytes());
        assert!(fits("l*.jpg", "left01.jpg") && fits("l*.jpg", "l.jpg") && fits("left??.png", "left07.png") && fits("*", ""));
        assert!(!fits("l*.jpg", "right.jpg") && !fits("left??.png", "left7.png") && !fits("l*.jpg", "left.jpeg"));
    }

    #[test]
    fn files_come_sorted_and_a_pattern_without_files_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b2.png", "b1.png", "a1.png"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let pattern = |name: &str| folder.path().join(name).display().to_string();
        let names: Vec<_> = files(&[pattern("b*.png"), pattern("a1.png")]).unwrap();
        assert_eq!(names.iter().map(|p| p.file_name().unwrap().to_str().unwrap()).collect::<Vec<_>>(), ["a1.png", "b1.png", "b2.png"]);
        assert!(matches!(files(&[pattern("c*")]), Err(Error::Argument(_))));
    }
}
