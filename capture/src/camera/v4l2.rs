//! A camera by V4L2, with the `v4l` crate.
//!
//! What the crate leaves to its caller: a slice is the whole buffer, of which the driver used a part; a `next` that timed out has given a
//! buffer away that it did not own, so the next one fails (we wait by ourselves and call `next` only when a frame is there); after any error the
//! stream has to be made anew; and what a driver says beyond the crate's tables makes it panic ([`super::source`] catches that).

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, ErrorKind};
use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use v4l::buffer::{Metadata, Type};
use v4l::capability::Flags;
use v4l::control::{Control, Value};
use v4l::io::traits::CaptureStream;
use v4l::prelude::{Device, MmapStream};
use v4l::video::Capture;
use v4l::video::capture::Parameters;
use v4l::{Format, FourCC};

use super::controls::{Controls, Held, Panel, exposure};
use super::find::{Identity, SYSFS, Selector, devices};
use super::mode::describe;
use super::note::Note;
use super::{CameraFault, Driver, Encoding, Frame, Mode, Opened, Request, Stream};
use crate::clock::Arrival;

/// Buffers of the driver: 0.1 s at 60 frames per second.
const BUFFERS: u32 = 6;
/// How long a camera may take to its first frame.
const FIRST_FRAME: Duration = Duration::from_secs(5);
/// How long exposure and white balance are given to settle on the scene before they are locked.
const SETTLE: Duration = Duration::from_millis(1500);
/// How long the system may take to set up a camera's file.
const SETTING_UP: Duration = Duration::from_secs(1);
/// `POLLIN` of `poll.h`.
const POLLIN: i16 = 1;

/// A camera that is opened by V4L2.
pub struct V4l2 {
    selector: Selector,
    request: Request,
    identity: Option<Identity>,
    /// The controls as they were first found, and what they are held at.
    controls: Option<(Controls, Held)>,
}

impl V4l2 {
    /// A camera of which this is asked.
    #[must_use]
    pub const fn new(selector: Selector, request: Request) -> Self {
        Self { selector, request, identity: None, controls: None }
    }

    /// Locks the controls, at what they were locked at before if it is not the first time.
    fn lock(&mut self, stream: &mut Running, found: Controls) -> Result<Vec<String>, CameraFault> {
        let held = match &self.controls {
            Some((_, held)) => held.clone(),
            None => self.request.exposure_ms.map(exposure).unwrap_or_default(),
        };
        if self.controls.is_none() && found.adjusts_itself() {
            stream.discard(SETTLE)?;
        }
        let (held, notices) = found.lock(&stream.device, &held);
        // Another plugging has put the camera's own values back; what it goes back to is what was found first.
        let before = self.controls.take().map_or(found, |(before, _)| before);
        self.controls = Some((before, held));
        Ok(notices)
    }
}

impl Driver for V4l2 {
    fn open(&mut self) -> Result<Opened, CameraFault> {
        let present = devices(Path::new(SYSFS));
        let found = match &self.identity {
            Some(identity) => identity.find(&present)?,
            None => self.selector.find(&present)?,
        };
        let device = open_device(&found.path).map_err(|e| CameraFault::system("open it", e))?;
        let capabilities = device.query_caps().map_err(|e| CameraFault::system("ask what it is", e))?;
        if !capabilities.capabilities.contains(Flags::VIDEO_CAPTURE) {
            return Err(CameraFault::NoImages { path: found.path.clone(), card: capabilities.card });
        }
        let mode = negotiate(&device, &self.request)?;
        let stream = MmapStream::with_buffers(&device, Type::VideoCapture, BUFFERS).map_err(|e| CameraFault::system("get buffers", e))?;
        // Whoever has buffers has the camera: only now may its controls be touched.
        let identity = Identity::of(found, &present);
        let note = Note::of(&identity.selector());
        let mut notices = Vec::new();
        if self.controls.is_none() && note.as_ref().is_some_and(|note| note.put_back(&device)) {
            notices.push(
                "a recording that was killed had left its exposure, focus or white balance locked; they are as before that".to_owned(),
            );
        }
        let controls = Controls::read(&device);
        let mut stream = Running { stream, device, started: false, restore: None };
        if self.request.lock {
            let before = self.controls.as_ref().map_or(&controls, |(before, _)| before);
            note.iter().for_each(|note| note.write(before));
            stream.restore = Some((before.clone(), note));
            controls.keep_rate(&stream.device);
        }
        let first = stream.next(FIRST_FRAME)?.ok_or(CameraFault::Silent { seconds: FIRST_FRAME.as_secs_f64() })?;
        if self.request.lock {
            notices.extend(self.lock(&mut stream, controls)?);
        }

        let controls = self.controls.as_ref().map_or_else(Controls::default, |(before, _)| before.clone());
        let mut record = controls.record(&stream.device);
        let words = [
            ("card", capabilities.card),
            ("driver", capabilities.driver),
            ("bus", capabilities.bus),
            ("port", found.port.clone()),
            ("serial", found.serial.clone().unwrap_or_default()),
            ("mode", mode.to_string()),
            ("stamps", first.stamp_kind().to_owned()),
            ("locked", self.request.lock.to_string()),
        ];
        record.extend(words.into_iter().filter(|(_, value)| !value.is_empty()).map(|(key, value)| (key.to_owned(), value)));
        record.extend(host());
        self.identity = Some(identity);
        Ok(Opened { stream: Box::new(stream), mode, record, notices })
    }
}

/// Opens a device. One that was just plugged in has no file for a moment, or not yet its permissions; one that another program uses can be opened.
fn open_device(path: &Path) -> io::Result<Device> {
    let until = Instant::now() + SETTING_UP;
    loop {
        match Device::with_path(path) {
            Err(e) if [ErrorKind::NotFound, ErrorKind::PermissionDenied].contains(&e.kind()) && Instant::now() < until => {
                thread::sleep(SETTING_UP / 20);
            }
            opened => return opened,
        }
    }
}

/// Asks for a mode and reads back what the camera made of it: a driver changes what it cannot do without a word.
fn negotiate(device: &Device, request: &Request) -> Result<Mode, CameraFault> {
    let [width, height] = request.size_px;
    let fourcc = request.encoding.fourcc();
    let set = device.set_format(&Format::new(width, height, FourCC::new(&fourcc))).map_err(|e| CameraFault::system("set the format", e))?;
    device.set_params(&Parameters::with_fps(request.rate_hz)).map_err(|e| CameraFault::system("set the frame rate", e))?;
    let (given, interval) = (device.format(), device.params());
    let given = given.map_err(|e| CameraFault::system("read the format back", e))?;
    let interval = interval.map_err(|e| CameraFault::system("read the frame rate back", e))?.interval;
    let mode = Mode {
        encoding: request.encoding,
        size_px: [given.width, given.height],
        interval_s: [interval.numerator, interval.denominator],
        stride_bytes: if request.encoding == Encoding::Yuyv { given.stride } else { 0 },
    };
    // Some cameras mean 29.97 where they say 30.
    let same_rate = (mode.rate_hz() / f64::from(request.rate_hz) - 1.0).abs() < 0.01;
    if given.fourcc.repr == fourcc && set.fourcc.repr == fourcc && mode.size_px == request.size_px && same_rate {
        return Ok(mode);
    }
    let (mut asked, mut got) = (String::new(), String::new());
    // Writing to a string cannot fail.
    let _ = describe(&mut asked, fourcc, request.size_px, request.rate_hz.into());
    let _ = describe(&mut got, given.fourcc.repr, mode.size_px, mode.rate_hz());
    Err(CameraFault::OtherMode { asked, given: got })
}

/// What the log should know of the machine: the kernel, and how its webcam driver is set.
fn host() -> BTreeMap<String, String> {
    let text = |path: &Path| fs::read_to_string(path).ok().map(|text| text.trim().to_owned());
    let mut host: BTreeMap<String, String> =
        text(Path::new("/proc/sys/kernel/osrelease")).map(|release| ("kernel".to_owned(), release)).into_iter().collect();
    for parameter in ["clock", "hwtimestamps", "nodrop", "quirks", "timeout"] {
        let value = text(&Path::new("/sys/module/uvcvideo/parameters").join(parameter));
        host.extend(value.map(|value| (format!("uvcvideo {parameter}"), value)));
    }
    host
}

impl Panel for Device {
    fn get(&self, id: u32) -> Option<i64> {
        match self.control(id).ok()?.value {
            Value::Integer(value) => Some(value),
            Value::Boolean(value) => Some(value.into()),
            _ => None,
        }
    }

    fn set(&self, id: u32, value: i64) -> io::Result<()> {
        self.set_control(Control { id, value: Value::Integer(value) })
    }
}

/// A camera that delivers.
struct Running {
    stream: MmapStream<'static>,
    device: Device,
    started: bool,
    /// The controls as they are put back, and the note of that.
    restore: Option<(Controls, Option<Note>)>,
}

impl Running {
    /// Takes frames for so long and throws them away.
    fn discard(&mut self, time: Duration) -> Result<(), CameraFault> {
        let until = Instant::now() + time;
        while Instant::now() < until {
            self.next(until.saturating_duration_since(Instant::now()))?;
        }
        Ok(())
    }

    /// Waits until there is a frame or an error to be had.
    fn wait(&self, within: Duration) -> io::Result<bool> {
        let until = Instant::now() + within;
        loop {
            let left_ms = until.saturating_duration_since(Instant::now()).as_millis();
            match self.device.handle().poll(POLLIN, i32::try_from(left_ms).unwrap_or(i32::MAX)) {
                Ok(ready) => return Ok(ready > 0),
                Err(e) if e.kind() == ErrorKind::Interrupted => {}
                Err(e) => return Err(e),
            }
        }
    }
}

impl Stream for Running {
    fn next(&mut self, within: Duration) -> Result<Option<Frame>, CameraFault> {
        if self.started {
            if !self.wait(within).map_err(|e| CameraFault::system("wait for a frame", e))? {
                return Ok(None);
            }
        } else {
            // The first call starts the camera and waits by itself.
            self.stream.set_timeout(within);
        }
        match self.stream.next() {
            Ok((buffer, metadata)) => {
                self.started = true;
                Ok(Some(frame(buffer, metadata)))
            }
            Err(e) if e.kind() == ErrorKind::TimedOut => Err(CameraFault::Silent { seconds: within.as_secs_f64() }),
            Err(e) => Err(CameraFault::system(if self.started { "get a frame" } else { "start it" }, e)),
        }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if let Some((controls, note)) = &self.restore {
            controls.restore(&self.device);
            note.iter().for_each(Note::remove);
        }
    }
}

fn frame(buffer: &[u8], metadata: &Metadata) -> Frame {
    let dequeued = Arrival::now();
    let used = usize::try_from(metadata.bytesused).unwrap_or(usize::MAX).min(buffer.len());
    let [seconds, microseconds] = [metadata.timestamp.sec, metadata.timestamp.usec].map(|part| u64::try_from(part).unwrap_or_default());
    Frame {
        bytes: buffer.get(..used).unwrap_or_default().to_vec(),
        sequence: metadata.sequence,
        flags: metadata.flags.into(),
        kernel_ns: seconds.saturating_mul(1_000_000_000).saturating_add(microseconds.saturating_mul(1000)),
        dequeued,
    }
}
