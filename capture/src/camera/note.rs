//! A note of how a camera was before it was locked, for as long as it is.
//!
//! A recording that is killed cannot put a camera's controls back. The note stays then, and whoever opens the camera next does it instead. It is a
//! file per camera in `$XDG_STATE_HOME/raven-capture`, or `~/.local/state/raven-capture`.

use std::path::{Path, PathBuf};
use std::{env, fs};

use serde::{Deserialize, Serialize};

use super::controls::{Controls, Panel};

/// Where a camera's note is, whether there is one or not.
#[derive(Debug, Clone)]
pub struct Note {
    path: PathBuf,
    camera: String,
}

/// What is in it.
#[derive(Serialize, Deserialize)]
struct Contents {
    camera: String,
    found: Controls,
}

impl Note {
    /// The note of a camera, which is called as on the command line; `None` if this user has no place for it.
    #[must_use]
    pub fn of(camera: &str) -> Option<Self> {
        let absolute = |name| env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
        let state = absolute("XDG_STATE_HOME").or_else(|| Some(absolute("HOME")?.join(".local/state")))?;
        Some(Self::within(&state.join("raven-capture"), camera))
    }

    fn within(folder: &Path, camera: &str) -> Self {
        let name: String = camera.chars().map(|c| if c.is_ascii_alphanumeric() || "-.".contains(c) { c } else { '_' }).collect();
        Self { path: folder.join(format!("{name}.json")), camera: camera.to_owned() }
    }

    /// Puts a camera back as the note says, if it is still as a killed recording left it, and says whether it was. The note is gone then.
    pub fn put_back(&self, panel: &dyn Panel) -> bool {
        let text = fs::read_to_string(&self.path).unwrap_or_default();
        let left = serde_json::from_str(&text).is_ok_and(|Contents { camera, found }| {
            let left = camera == self.camera && found.are_left_locked(panel);
            if left {
                found.restore(panel);
            }
            left
        });
        self.remove();
        left
    }

    /// Notes how the camera was found. Where that cannot be written a kill leaves the camera locked, as it would without notes.
    pub fn write(&self, found: &Controls) {
        let contents = Contents { camera: self.camera.clone(), found: found.clone() };
        let written = || -> raven::Result<()> {
            let failed = |e| raven::Error::io(&self.path, "create the folder of", e);
            fs::create_dir_all(self.path.parent().unwrap_or(Path::new("/"))).map_err(failed)?;
            raven::cli::write_json(&self.path, &contents)
        };
        let _unwritten = written();
    }

    /// Takes the note away: everything is back.
    pub fn remove(&self) {
        let _none = fs::remove_file(&self.path);
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;
    use std::collections::BTreeMap;

    use super::super::controls::Held;
    use super::super::controls::tests::Fake;
    use super::*;

    #[test]
    fn a_camera_is_put_back_once_and_only_its_own() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path().join("none yet");
        // Exposure by itself, for 25 ms.
        let camera = Fake(RefCell::new(BTreeMap::from([(0x009a_0901, 3), (0x009a_0902, 250)])));
        let (before, found, note) = (camera.0.borrow().clone(), Controls::read(&camera), Note::within(&folder, "serial:A/1"));
        note.write(&found);
        let _held = found.lock(&camera, &Held::from([(0x009a_0902, 80)]));
        // Another camera whose name makes the same file name.
        let locked = camera.0.borrow().clone();
        assert!(!Note::within(&folder, "serial:A_1").put_back(&camera));
        assert_eq!(*camera.0.borrow(), locked);
        note.write(&found);
        assert!(note.put_back(&camera));
        assert_eq!(*camera.0.borrow(), before);
        assert!(!note.put_back(&camera) && fs::read_dir(&folder).unwrap().next().is_none());
    }
}
