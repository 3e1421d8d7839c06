//! A virtual machine with Linux's own camera drivers, in which the real program records from cameras that fail on request.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;
use std::time::Instant;

use raven::log::{Damage, FrameData, FrameLosses, Side, Survey, frames};

pub use crate::lab::film::PICTURES;
use crate::lab::{aloud, example, film};

/// Programs without which there is no machine.
const NEEDED: [&str; 7] = ["qemu-system-x86_64", "apt-get", "dpkg-deb", "cpio", "modprobe", "ldd", "strip"];
/// After so long it is taken for hung [s].
const PATIENCE: &str = "240";

/// The machine has this machine's processors nearly to itself if others take less than this part of them.
const QUIET: f64 = 0.1;

/// A processor that is itself a program now and then loses a frame, and stamps some so late that they look like the one after. Whether a frame is
/// missing that no count shows is known from the pictures.
const HICCUPS: f64 = 0.02;
/// See [`HICCUPS`].
const LATE: f64 = 0.1;

/// What came out of the machine: the folder that it shared.
pub struct Machine {
    share: PathBuf,
    /// Whether nothing else kept the processors busy; the machine's cameras lose frames where something did.
    pub quiet: bool,
}

/// The machine after it has run, once for all tests; `None`, with a line that says why, where there can be none.
pub fn machine() -> Option<&'static Machine> {
    static MACHINE: OnceLock<Option<Machine>> = OnceLock::new();
    let start = || match run() {
        Ok(machine) => Some(machine),
        Err(why) => {
            aloud(&format!("SKIPPED: cameras in a virtual machine: {why}"));
            None
        }
    };
    MACHINE.get_or_init(start).as_ref()
}

/// Processor time, of everything and of this process's children (1/100 s).
struct Ticks {
    busy: u64,
    children: u64,
    processors: usize,
}

impl Ticks {
    fn now() -> Self {
        let (system, own) = ["/proc/stat", "/proc/self/stat"].map(|path| std::fs::read_to_string(path).unwrap()).into();
        let numbers = |line: &str| -> Vec<u64> { line.split_whitespace().map(|word| word.parse().unwrap_or(0)).collect() };
        let total = numbers(system.lines().next().unwrap());
        let own = numbers(own.rsplit_once(')').unwrap().1);
        // After the label: user, nice, system, idle, waiting, interrupts, soft interrupts, stolen. Of the process, fields 16 and 17.
        let busy = [1, 2, 3, 6, 7, 8].iter().map(|i| total[*i]).sum();
        let processors = system.lines().filter(|line| line.starts_with("cpu")).count() - 1;
        Self { busy, children: own[13] + own[14], processors }
    }

    /// Processors that something else kept busy, as a part of all, times the seconds that passed.
    fn others_since(&self, before: &Self) -> f64 {
        let others = (self.busy - before.busy).saturating_sub(self.children - before.children);
        others as f64 / 100.0 / self.processors as f64
    }
}

fn run() -> Result<Machine, String> {
    let missing = NEEDED
        .into_iter()
        .filter(|program| !Command::new("sh").args(["-c", &format!("command -v {program} >/dev/null")]).status().unwrap().success());
    let missing: Vec<&str> = missing.collect();
    if !cfg!(target_arch = "x86_64") || !missing.is_empty() {
        return Err(format!("needs an x86-64 Debian with {}", missing.join(", ")));
    }
    let (folder, here) = (Path::new(env!("CARGO_TARGET_TMPDIR")).join("vm"), Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/vm"));
    let program = PathBuf::from(env!("CARGO_BIN_EXE_raven-capture"));
    let examples: Vec<PathBuf> = ["virtual_webcam", "virtual_robot", "set_control"].into_iter().map(example).collect::<Result<_, _>>()?;
    let prepared = Command::new(here.join("prepare")).arg(&folder).arg(&program).args(&examples).output().unwrap();
    if !prepared.status.success() {
        return Err(format!("it cannot be made: {}", String::from_utf8_lossy(&prepared.stderr).trim()));
    }
    let share = folder.join("share");
    let _none_before = std::fs::remove_dir_all(&share);
    for (side, seed) in [(Side::Left, 1), (Side::Right, 2)] {
        std::fs::create_dir_all(share.join(side.name())).unwrap();
        for number in 0..PICTURES {
            std::fs::write(share.join(format!("{}/{number:03}.jpg", side.name())), film::picture(seed, number)).unwrap();
        }
    }
    std::fs::copy(here.join("run.sh"), share.join("run.sh")).unwrap();
    let files = format!("local,id=files,path={},security_model=none", share.display());
    let (before, started) = (Ticks::now(), Instant::now());
    let booted = Command::new("timeout")
        .args([
            "-k",
            "5",
            PATIENCE,
            "qemu-system-x86_64",
            "-machine",
            "pc",
            "-accel",
            "tcg,thread=multi",
            "-cpu",
            "max",
            "-smp",
            "2",
            "-m",
            "1024",
        ])
        .args(["-nodefaults", "-no-user-config", "-nographic", "-no-reboot", "-serial", "stdio", "-monitor", "none", "-net", "none"])
        .args(["-fsdev", &files, "-device", "virtio-9p-pci,fsdev=files,mount_tag=share"])
        .args(["-kernel", folder.join("vmlinuz").to_str().unwrap(), "-initrd", folder.join("initramfs.cpio").to_str().unwrap()])
        .args(["-append", "console=ttyS0 quiet panic=-1 rdinit=/init mitigations=off nokaslr"])
        .output()
        .unwrap();
    let others = Ticks::now().others_since(&before) / started.elapsed().as_secs_f64();
    if others > QUIET {
        aloud(&format!(
            "note: other programs took {:.0} % of the processors from the virtual machine; cameras may lose frames",
            100.0 * others
        ));
    }
    let machine = Machine { share, quiet: others <= QUIET };
    assert!(
        machine.share.join("run.status").exists(),
        "the machine did not come to its end:\n{}\n{}",
        machine.text("run.log"),
        String::from_utf8_lossy(&booted.stdout)
    );
    Ok(machine)
}

impl Machine {
    /// Whether nothing was damaged, cut off or repeated, and, where the machine had the processors to itself, no more than [`HICCUPS`] of the
    /// frames were missing and no more than [`LATE`] of them late.
    pub fn is_clean(&self, losses: &FrameLosses) -> bool {
        let part = |count: u64| count as f64 / losses.frames as f64;
        let whole = losses.total() == losses.missed + losses.skipped;
        whole && (!self.quiet || part(losses.missed) <= HICCUPS && part(losses.skipped) <= LATE)
    }

    /// Whether there are as many frames as there must be where the machine had the processors to itself.
    pub fn is_enough(&self, frames: u64, least: u64) -> bool {
        !self.quiet || frames >= least
    }

    /// Whether a rate is as it should be, within 2 %, as it must be where the machine had the processors to itself.
    pub fn is_rate(&self, rate_hz: f64, wanted_hz: f64) -> bool {
        !self.quiet || (rate_hz / wanted_hz - 1.0).abs() < 0.02
    }

    /// A file that the machine wrote, empty if it did not.
    pub fn text(&self, name: &str) -> String {
        std::fs::read_to_string(self.share.join(name)).unwrap_or_default()
    }

    /// The exit code of a recording, and its JSON.
    pub fn recording(&self, name: &str) -> (i32, serde_json::Value) {
        let (status, json) = (self.text(&format!("{name}.status")), self.text(&format!("{name}.json")));
        let status = status.trim().parse().unwrap_or_else(|_| panic!("{name} did not end: {}", self.text("run.log")));
        (status, serde_json::from_str(&json).unwrap_or_default())
    }

    /// What is in a recording; it must be whole.
    pub fn survey(&self, name: &str) -> Survey {
        let survey = self.survey_of(&format!("{name}.mcap"));
        assert_eq!(survey.damage, None);
        survey
    }

    /// What is in a recording that was killed, which may have been writing its last record.
    pub fn survey_killed(&self, name: &str) -> Survey {
        let survey = self.survey_of(&format!("{name}.mcap.active"));
        let broken_off = |damage: &Damage| damage.cut_off_at.is_some() && damage.bad_records == 0;
        assert!(survey.damage.as_ref().is_none_or(broken_off), "{:?}", survey.damage);
        survey
    }

    fn survey_of(&self, file: &str) -> Survey {
        Survey::of(&self.share.join(file)).unwrap_or_else(|e| panic!("{e} {}", self.text("run.log")))
    }

    /// The recording's file.
    pub fn file(&self, name: &str) -> PathBuf {
        self.share.join(format!("{name}.mcap"))
    }

    /// For each JPEG of a recording its sequence number and which of the webcam's pictures it is, byte for byte; `None` if it is none of them.
    pub fn pictures(&self, name: &str, side: Side) -> Vec<(u64, Option<usize>)> {
        let sent: Vec<Vec<u8>> =
            (0..PICTURES).map(|number| std::fs::read(self.share.join(format!("{}/{number:03}.jpg", side.name()))).unwrap()).collect();
        let frames = frames(&self.file(name)).unwrap().map(Result::unwrap).filter(|frame| frame.side == side);
        let number = |data: &FrameData| match data {
            FrameData::Jpeg(bytes) => sent.iter().position(|picture| picture == bytes),
            FrameData::Raw { .. } => None,
        };
        frames.map(|frame| (frame.sequence.unwrap_or(0), number(&frame.data))).collect()
    }
}
