//! ROS's own master, where it is installed.

use std::net::TcpListener;
use std::path::Path;
use std::process::{Child, Command, Stdio};

use raven_capture::ros1::{Endpoint, call_ros};

use super::{aloud, wait_for};

/// A `rosmaster` that ends with the test.
pub struct RosMaster {
    child: Child,
    pub at: Endpoint,
}

impl RosMaster {
    /// One on a port that is free; `None`, with a word about it, where it is not installed.
    pub fn start(folder: &Path) -> Option<Self> {
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        Self::start_at(Endpoint { host: "127.0.0.1".to_owned(), port }, folder)
    }

    /// One at an address; as [`Self::start`].
    pub fn start_at(at: Endpoint, folder: &Path) -> Option<Self> {
        let mut command = Command::new("rosmaster");
        command.args(["--core", "-p", &at.port.to_string()]).env("ROS_HOME", folder).env("ROS_LOG_DIR", folder);
        let Ok(child) = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn() else {
            aloud("SKIPPED: rosmaster is not installed (Debian: python3-rosmaster): nothing is tested against ROS itself");
            return None;
        };
        wait_for("rosmaster", || call_ros("rosmaster", &at, "getPid", &["/test".into()]).is_ok());
        Some(Self { child, at })
    }
}

impl Drop for RosMaster {
    fn drop(&mut self) {
        let _gone = self.child.kill();
        let _gone = self.child.wait();
    }
}
