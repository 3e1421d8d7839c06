//! Which camera is which: by USB serial number or port, never by the number of `/dev/videoN`, which changes when a camera is unplugged.
//!
//! Linux lists its video devices in `/sys/class/video4linux`; each has a link `device` into the tree of its bus. A webcam has two devices or
//! more; the one with the lowest `index` gives the images.

use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use raven::Error;

use super::CameraFault;

/// Where Linux lists its video devices.
pub const SYSFS: &str = "/sys/class/video4linux";

/// How a camera is chosen.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Selector {
    /// By a device that it has now, as in `/dev/video0` or a link in `/dev/v4l/by-id`.
    Device(PathBuf),
    /// By the serial number in its USB descriptor.
    Serial(String),
    /// By the USB port it is plugged into, as the kernel names it: `1-4.2`.
    Port(String),
}

impl FromStr for Selector {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.split_once(':') {
            Some(("serial", serial)) if !serial.is_empty() => Ok(Self::Serial(serial.to_owned())),
            Some(("usb", port)) if !port.is_empty() => Ok(Self::Port(port.to_owned())),
            _ if text.starts_with('/') => Ok(Self::Device(text.into())),
            _ => Err(format!("`{text}` is no camera as in serial:2B4F91C0, usb:1-4.2 or /dev/video0")),
        }
    }
}

impl fmt::Display for Selector {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Device(path) => path.display().fmt(f),
            Self::Serial(serial) => write!(f, "serial:{serial}"),
            Self::Port(port) => write!(f, "usb:{port}"),
        }
    }
}

/// A video device.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Device {
    /// Its file.
    pub path: PathBuf,
    /// Its number among the devices of its camera.
    pub index: u32,
    /// Its name.
    pub name: String,
    /// Serial number of its camera, if it has one.
    pub serial: Option<String>,
    /// USB port of its camera, or the device's name on another bus.
    pub port: String,
}

/// What a camera is known by from one opening to the next.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Identity {
    name: String,
    port: String,
    /// Only if no other camera had the same.
    serial: Option<String>,
}

/// All video devices, cameras in the order of their ports.
#[must_use]
pub fn devices(sysfs: &Path) -> Vec<Device> {
    let entries = fs::read_dir(sysfs).into_iter().flatten().flatten();
    let mut devices: Vec<Device> = entries.filter_map(|entry| device(&entry.path())).collect();
    devices.sort_by(|a, b| (&a.port, &a.name, a.index, &a.path).cmp(&(&b.port, &b.name, b.index, &b.path)));
    devices
}

fn device(entry: &Path) -> Option<Device> {
    let number = entry.file_name()?.to_str().filter(|name| name.starts_with("video"))?;
    let text = |path: PathBuf| fs::read_to_string(path).ok().map(|text| text.trim().to_owned()).filter(|text| !text.is_empty());
    let place = entry.join("device").canonicalize().ok()?;
    // The link leads to an interface, as in `1-4.2:1.0`, of the USB device.
    let folder = place.file_name()?.to_str()?;
    let (port, serial) = match folder.split_once(':') {
        Some((port, _)) => (port, place.parent().and_then(|usb| text(usb.join("serial")))),
        None => (folder, None),
    };
    Some(Device {
        path: Path::new("/dev").join(number),
        index: text(entry.join("index")).and_then(|index| index.parse().ok()).unwrap_or(0),
        name: text(entry.join("name")).unwrap_or_default(),
        serial,
        port: port.to_owned(),
    })
}

impl Selector {
    /// The device that is meant.
    ///
    /// # Errors
    /// If there is none, or cameras at several ports fit.
    pub fn find<'d>(&self, devices: &'d [Device]) -> Result<&'d Device, CameraFault> {
        match self {
            Self::Device(path) => {
                // A link in /dev/v4l leads to the device.
                let path = path.canonicalize().unwrap_or_else(|_| path.clone());
                one(devices, &path.display().to_string(), |device| device.path == path)
            }
            Self::Serial(serial) => one(devices, &format!("with serial number {serial}"), |device| device.serial.as_ref() == Some(serial)),
            Self::Port(port) => one(devices, &format!("at port {port}"), |device| device.port == *port),
        }
    }
}

/// Refuses one camera for both sides, by whatever names; where none is found it is said later.
///
/// # Errors
/// If both are the same.
pub fn two_cameras(left: Option<&Selector>, right: Option<&Selector>, devices: &[Device]) -> Result<(), Error> {
    let (Some(left), Some(right)) = (left, right) else { return Ok(()) };
    let same = left == right || left.find(devices).ok().zip(right.find(devices).ok()).is_some_and(|(left, right)| left.path == right.path);
    if !same {
        return Ok(());
    }
    let names = if left == right { format!("`{left}`") } else { format!("`{left}` and `{right}`") };
    Err(Error::Argument(format!("--left and --right are the same camera, {names}: choose another one for one of them.")))
}

impl Identity {
    /// What this device is known by among all.
    #[must_use]
    pub fn of(device: &Device, devices: &[Device]) -> Self {
        let unique = |serial: &&String| devices.iter().all(|other| other.serial.as_ref() != Some(*serial) || other.port == device.port);
        let serial = device.serial.as_ref().filter(unique).cloned();
        Self { name: device.name.clone(), port: device.port.clone(), serial }
    }

    /// What chooses this camera on the command line, for good.
    #[must_use]
    pub fn selector(&self) -> String {
        self.serial.clone().map_or_else(|| Selector::Port(self.port.clone()), Selector::Serial).to_string()
    }

    /// The device of this camera, whatever its number is now: by serial number at whichever port, without one by port and name.
    ///
    /// # Errors
    /// If it is not there.
    pub fn find<'d>(&self, devices: &'d [Device]) -> Result<&'d Device, CameraFault> {
        match &self.serial {
            Some(serial) => Selector::Serial(serial.clone()).find(devices),
            None => {
                let wanted = format!("{} at port {}", self.name, self.port);
                one(devices, &wanted, |device| device.port == self.port && device.name == self.name)
            }
        }
    }
}

/// The first device of the one camera that fits.
fn one<'d>(devices: &'d [Device], wanted: &str, fits: impl Fn(&Device) -> bool) -> Result<&'d Device, CameraFault> {
    let fitting: Vec<&Device> = devices.iter().filter(|device| fits(device)).collect();
    let first = *fitting.first().ok_or_else(|| CameraFault::NotFound { wanted: wanted.to_owned(), found: list(devices) })?;
    let mut ports: Vec<&str> = fitting.iter().map(|device| device.port.as_str()).collect();
    ports.dedup();
    match ports.as_slice() {
        [_] => Ok(fitting.into_iter().min_by_key(|device| device.index).unwrap_or(first)),
        _ => Err(CameraFault::Ambiguous { wanted: wanted.to_owned(), ports: ports.join(", "), first: first.port.clone() }),
    }
}

fn list(devices: &[Device]) -> String {
    let one = |device: &Device| {
        let serial = device.serial.as_ref().map_or_else(String::new, |serial| format!(", serial:{serial}"));
        format!("{} ({}{serial}, usb:{})", device.path.display(), device.name, device.port)
    };
    let words: Vec<String> = devices.iter().filter(|device| device.index == 0).map(one).collect();
    if words.is_empty() { "none".to_owned() } else { words.join(", ") }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    /// A tree as Linux makes it for these devices: number, index, port, serial number.
    fn tree(root: &Path, devices: &[(u32, u32, &str, Option<&str>)]) {
        for (number, index, port, serial) in devices {
            let entry = root.join(format!("class/video{number}"));
            fs::create_dir_all(&entry).unwrap();
            fs::write(entry.join("index"), format!("{index}\n")).unwrap();
            fs::write(entry.join("name"), "Webcam\n").unwrap();
            let interface = root.join(format!("bus/{port}/{port}:1.0"));
            fs::create_dir_all(&interface).unwrap();
            if let Some(serial) = serial {
                fs::write(root.join(format!("bus/{port}/serial")), format!("{serial}\n")).unwrap();
            }
            symlink(&interface, entry.join("device")).unwrap();
        }
    }

    fn found(root: &Path) -> Vec<Device> {
        devices(&root.join("class"))
    }

    #[test]
    fn a_camera_is_the_same_at_another_number_and_port() {
        let (before, after) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        tree(before.path(), &[(0, 0, "1-1", Some("L1")), (1, 1, "1-1", Some("L1")), (2, 0, "1-2", Some("R1")), (3, 1, "1-2", Some("R1"))]);
        tree(after.path(), &[(5, 1, "1-4.2", Some("L1")), (4, 0, "1-4.2", Some("L1")), (2, 0, "1-2", Some("R1"))]);
        let devices = found(before.path());
        for selector in ["serial:L1", "usb:1-1", "/dev/video0"] {
            let device = selector.parse::<Selector>().unwrap().find(&devices).unwrap();
            assert_eq!(device.path, Path::new("/dev/video0"), "{selector}");
            let identity = Identity::of(device, &devices);
            assert_eq!(identity.find(&found(after.path())).unwrap().path, Path::new("/dev/video4"), "{selector}");
        }
        let absent = "serial:X9".parse::<Selector>().unwrap().find(&devices).unwrap_err().to_string();
        assert!(absent.contains("serial number X9") && absent.contains("serial:R1, usb:1-2"), "{absent}");
    }

    #[test]
    fn cameras_with_one_serial_number_are_told_apart_by_their_ports() {
        let folder = tempfile::tempdir().unwrap();
        tree(folder.path(), &[(0, 0, "1-1", Some("SN0001")), (2, 0, "1-2", Some("SN0001")), (4, 0, "1-3", None)]);
        let devices = found(folder.path());
        let fault = Selector::Serial("SN0001".to_owned()).find(&devices).unwrap_err().to_string();
        assert!(fault.contains("1-1, 1-2") && fault.contains("usb:1-1"), "{fault}");
        for (port, path) in [("1-1", "/dev/video0"), ("1-2", "/dev/video2"), ("1-3", "/dev/video4")] {
            let identity = Identity::of(Selector::Port(port.to_owned()).find(&devices).unwrap(), &devices);
            assert_eq!(identity.find(&devices).unwrap().path, Path::new(path));
            assert_eq!(identity.selector(), format!("usb:{port}"));
            assert!(identity.find(&[]).unwrap_err().to_string().contains("found are none"));
        }
    }

    #[test]
    fn one_camera_is_not_both() {
        let folder = tempfile::tempdir().unwrap();
        tree(folder.path(), &[(0, 0, "1-1", Some("L1")), (2, 0, "1-2", Some("R1"))]);
        let devices = found(folder.path());
        let two = |left: &str, right: &str| two_cameras(Some(&left.parse().unwrap()), Some(&right.parse().unwrap()), &devices);
        for (left, right) in [("serial:L1", "usb:1-1"), ("/dev/video0", "serial:L1"), ("usb:1-1", "/dev/video0")] {
            let said = two(left, right).unwrap_err().to_string();
            assert!(said.starts_with(&format!("--left and --right are the same camera, `{left}` and `{right}`")), "{said}");
        }
        assert!(two("serial:absent", "serial:absent").is_err());
        two("serial:L1", "serial:R1").and_then(|()| two("serial:absent", "usb:1-1")).unwrap();
        two_cameras(None, Some(&Selector::Serial("L1".to_owned())), &devices).unwrap();
    }

    #[test]
    fn only_names_that_last_and_paths_choose_a_camera() {
        for text in ["0", "video0", "serial:", "usb:", "left"] {
            assert!(text.parse::<Selector>().is_err(), "{text}");
        }
    }
}
