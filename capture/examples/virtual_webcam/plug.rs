//! The webcam at its hub: USB/IP over one end of a socket pair, whose other end the kernel's `vhci_hcd` has (Linux `usbip_protocol.rst`).

use std::collections::VecDeque;
use std::fs;
use std::io::{self, Read, Write};
use std::net::Shutdown;
use std::os::fd::AsRawFd;
use std::os::unix::net::UnixStream;
use std::path::PathBuf;
use std::sync::atomic::Ordering::SeqCst;
use std::sync::atomic::{AtomicBool, AtomicU32};
use std::sync::{Arc, Condvar, Mutex};
use std::thread;
use std::time::Duration;

use super::controls::Controls;
use super::descriptors::{self, INTERVALS, MJPG, YUYV, probe};
use super::{Args, film};

const ATTACH: &str = "/sys/devices/platform/vhci_hcd.0/attach";
const HIGH_SPEED: u32 = 3;
const SUBMIT: u32 = 1;
const UNLINK: u32 = 2;
const STALL: i32 = -32;
const CONNECTION_RESET: i32 = -104;

/// The webcam's state, seen from its threads.
pub struct Device {
    requests: Mutex<VecDeque<u32>>,
    arrived: Condvar,
    out: Mutex<UnixStream>,
    controls: Mutex<Controls>,
    interval: AtomicU32,
    /// How often frames were asked for anew.
    pub openings: AtomicU32,
    /// Whether frames are wanted.
    pub streaming: AtomicBool,
    /// Index of the format.
    pub format: AtomicU32,
    /// Whether it is unplugged.
    pub gone: AtomicBool,
}

/// Plugs the webcam in, and returns when it is unplugged.
pub fn plug(args: &Args) -> io::Result<()> {
    let (mut ours, kernels) = UnixStream::pair()?;
    let device_id = 0x1_0002 + args.port;
    fs::write(ATTACH, format!("{} {} {device_id} {HIGH_SPEED}", args.port, kernels.as_raw_fd()))?;
    drop(kernels);
    let mut paths: Vec<PathBuf> = fs::read_dir(&args.frames)?.map(|entry| entry.map(|entry| entry.path())).collect::<io::Result<_>>()?;
    paths.sort();
    let files: Vec<Vec<u8>> = paths.iter().map(fs::read).collect::<io::Result<_>>()?;
    let device = Arc::new(Device {
        requests: Mutex::default(),
        arrived: Condvar::new(),
        out: Mutex::new(ours.try_clone()?),
        controls: Mutex::new(Controls::new()),
        interval: INTERVALS[1].into(),
        openings: 0.into(),
        streaming: false.into(),
        format: u32::from(MJPG).into(),
        gone: false.into(),
    });
    let (camera, wanted) = (Arc::clone(&device), args.clone());
    thread::spawn(move || film::send(&camera, &wanted, &files));
    if let Some(seconds) = args.unplug_after {
        let cable = ours.try_clone()?;
        thread::spawn(move || {
            thread::sleep(Duration::from_secs_f64(seconds));
            eprintln!("unplugged");
            cable.shutdown(Shutdown::Both)
        });
    }
    let mut negotiated = probe(MJPG, INTERVALS[1]);
    // The socket ends when the kernel or the clock unplugs the webcam.
    while device.serve(args, &mut ours, &mut negotiated).is_ok() {}
    device.gone.store(true, SeqCst);
    Ok(())
}

fn word(header: &[u8], at: usize) -> u32 {
    header[at..at + 4].iter().fold(0, |word, byte| word << 8 | u32::from(*byte))
}

impl Device {
    /// Time between frames: what was negotiated, or the exposure where that is longer and may lower the rate.
    pub fn interval(&self) -> Duration {
        let negotiated = Duration::from_nanos(u64::from(self.interval.load(SeqCst)) * 100);
        let exposure = self.controls.lock().unwrap().lowers_rate().map(|units| Duration::from_micros(u64::from(units) * 100));
        exposure.map_or(negotiated, |exposure| negotiated.max(exposure))
    }

    /// Answers the next request for a payload with this one; `false` if no more are wanted. A request is answered before anybody can hear that it
    /// was withdrawn: the hub unplugs a webcam that answers afterwards.
    pub fn deliver(&self, payload: &[u8]) -> bool {
        let mut requests = self.requests.lock().unwrap();
        loop {
            if let Some(request) = requests.pop_front() {
                self.reply(request, 0, payload, payload.len() as u32);
                return true;
            }
            let (guard, waited) = self.arrived.wait_timeout(requests, Duration::from_millis(200)).unwrap();
            requests = guard;
            if waited.timed_out() && (self.gone.load(SeqCst) || !self.streaming.load(SeqCst)) {
                return false;
            }
        }
    }

    /// Answers a request with a status and bytes; `actual` is how many were transferred in either direction.
    fn reply(&self, sequence: u32, status: i32, data: &[u8], actual: u32) {
        self.send(3, sequence, status, actual, data);
    }

    fn send(&self, command: u32, sequence: u32, status: i32, actual: u32, data: &[u8]) {
        let mut packet = Vec::with_capacity(48 + data.len());
        packet.extend([command, sequence, 0, 0, 0, status as u32, actual, 0, 0, 0, 0, 0].into_iter().flat_map(u32::to_be_bytes));
        packet.extend(data);
        // An unplugged webcam has nobody to talk to.
        let _unplugged = self.out.lock().unwrap().write_all(&packet);
    }

    fn serve(&self, args: &Args, input: &mut UnixStream, negotiated: &mut Vec<u8>) -> io::Result<()> {
        let mut header = [0; 48];
        input.read_exact(&mut header)?;
        let (sequence, inwards, endpoint, bytes) = (word(&header, 4), word(&header, 12) == 1, word(&header, 16), word(&header, 24));
        match word(&header, 0) {
            SUBMIT => {
                let mut data = vec![0; if inwards { 0 } else { bytes as usize }];
                input.read_exact(&mut data)?;
                if endpoint != 0 {
                    self.requests.lock().unwrap().push_back(sequence);
                    self.arrived.notify_one();
                    return Ok(());
                }
                match self.control(args, &header[40..48], &data, negotiated) {
                    Some(answer) if inwards => self.reply(sequence, 0, &answer, answer.len() as u32),
                    Some(_) => self.reply(sequence, 0, &[], bytes),
                    None => self.reply(sequence, STALL, &[], 0),
                }
            }
            UNLINK => {
                let unlinked = word(&header, 20);
                let mut requests = self.requests.lock().unwrap();
                let before = requests.len();
                requests.retain(|request| *request != unlinked);
                let status = if requests.len() < before { CONNECTION_RESET } else { 0 };
                self.send(4, sequence, status, 0, &[]);
            }
            other => return Err(io::Error::other(format!("command {other} is not USB/IP"))),
        }
        Ok(())
    }

    /// Answers a request to endpoint 0; `None` refuses it.
    fn control(&self, args: &Args, setup: &[u8], data: &[u8], negotiated: &mut Vec<u8>) -> Option<Vec<u8>> {
        let [kind, request, low, high, interface, unit, ..] = *setup else { return None };
        let length = usize::from(u16::from_le_bytes([setup[6], setup[7]]));
        let streaming_interface = interface == 1;
        let answer = match (kind, request) {
            (0x80, 6) => match (high, low) {
                (1, _) => descriptors::device(),
                (2, _) => descriptors::configuration(),
                (3, 0) => vec![4, 3, 9, 4],
                (3, 1) => descriptors::string("virtual"),
                (3, 2) => descriptors::string(&args.name),
                (3, 3) => descriptors::string(&args.serial),
                _ => return None,
            },
            (0x80, 0) => vec![0, 0],
            (0x80, 8) => vec![1],
            (0x81, 10) => vec![0],
            // Addresses, configurations and interfaces are the hub's concern.
            (0x00, 3 | 5 | 9) | (0x01, 11) => Vec::new(),
            // How the driver stops a bulk stream.
            (0x02, 1) => {
                self.streaming.store(false, SeqCst);
                Vec::new()
            }
            (0xA1, _) if streaming_interface => match request {
                0x81 => negotiated.clone(),
                0x82 => probe(MJPG, INTERVALS[2]),
                0x83 => probe(YUYV, INTERVALS[0]),
                0x84 => vec![0; negotiated.len()],
                0x85 => vec![negotiated.len() as u8, 0],
                0x86 => vec![3],
                0x87 => probe(MJPG, INTERVALS[1]),
                _ => return None,
            },
            (0x21, 1) if streaming_interface => {
                let wanted = u32::from_le_bytes(data.get(4..8)?.try_into().ok()?);
                let interval = *INTERVALS.iter().min_by_key(|interval| interval.abs_diff(wanted))?;
                let format = (*data.get(2)?).clamp(MJPG, YUYV);
                *negotiated = probe(format, interval);
                if high == 2 {
                    self.format.store(format.into(), SeqCst);
                    self.interval.store(interval, SeqCst);
                    self.openings.fetch_add(1, SeqCst);
                    self.streaming.store(true, SeqCst);
                }
                Vec::new()
            }
            (0xA1 | 0x21, _) => self.controls.lock().unwrap().answer(request, unit, high, data)?,
            _ => return None,
        };
        Some(answer.into_iter().take(length).collect())
    }
}
