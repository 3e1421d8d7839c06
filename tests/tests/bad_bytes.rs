//! Logs cut off at any length and logs with any byte changed: every program ends, with a result or a sentence, and takes no memory to speak of.

use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use raven::log::{Item, LogWriter, RawMessage, Survey, Walker};
use raven::robot::nominal;
use raven_tests::typed;

/// Cuts, changed bytes of the file, and changed bytes of messages and their definitions in a file that is otherwise whole.
const EACH: usize = 200;
const SEED: u64 = 2;
/// No program takes longer on so short a log.
const LONGEST: Duration = Duration::from_secs(20);
/// Memory that all of them may have taken at most [MB].
const MEMORY_MB: f64 = 1000.0;

/// A program on the log of that name in a folder.
type Ends = fn(&Path, &str) -> Result<(), String>;

/// Every program that reads logs, and whether it reads images.
const PROGRAMS: [(&str, bool, Ends); 11] = [
    ("check of images", true, |at, log| typed(at, raven_capture::run, &["check", log, "--json", "{out}"]).map(drop)),
    ("check", false, |at, log| typed(at, raven_capture::run, &["check", log, "--json", "{out}"]).map(drop)),
    ("recover", true, |at, log| {
        typed(at, raven_capture::run, &["check", log, "--recover", "-o", "{out}"])?;
        assert_eq!(Survey::of(&at.join("out")).unwrap().damage, None, "what was recovered is damaged");
        Ok(())
    }),
    ("cut", false, |at, log| typed(at, raven_capture::run, &["cut", log, "--from", "0.3", "-o", "{out}"]).map(drop)),
    ("import", false, |at, log| typed(at, raven_capture::run, &["import", log, "-o", "{out}"]).map(drop)),
    ("cameras", true, |at, log| {
        typed(at, raven_calibrate::run, &["cameras", log, "--board", "9x6", "--square", "0.012", "-o", "{out}"]).map(drop)
    }),
    ("register", true, |at, log| {
        typed(at, raven_calibrate::run, &["register", log, "--robot", "{robot.yaml}", "--cameras", "{cameras.yaml}", "-o", "{out}"])
            .map(drop)
    }),
    ("track", true, |at, log| {
        typed(at, raven_track::run, &[log, "--robot", "{robot.yaml}", "--cameras", "{cameras.yaml}", "-o", "{out}"]).map(drop)
    }),
    ("identify", false, |at, log| {
        typed(at, raven_identify::run, &[log, "--robot", "{robot.yaml}", "--cameras", "{cameras.yaml}", "-o", "{out}"]).map(drop)
    }),
    ("replay", false, |at, log| {
        typed(at, raven_replay::run, &[log, "--robot", "{robot.yaml}", "--cameras", "{cameras.yaml}", "-o", "{out}"]).map(drop)
    }),
    ("diagnose", false, |at, log| {
        typed(at, raven_diagnose::run, &[log, "--robot", "{robot.yaml}", "--gap-only", "--json", "{out}"]).map(drop)
    }),
];

/// Numbers from 0 up to a limit, always the same ones (splitmix64).
struct Lot(u64);

impl Lot {
    fn below(&mut self, limit: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((mixed ^ (mixed >> 31)) % limit as u64) as usize
    }
}

/// What came of all runs.
#[derive(Default)]
struct Tally {
    broken: Vec<String>,
    runs: usize,
    refused: usize,
    longest: (Duration, String),
}

impl Tally {
    fn run(&mut self, at: &Path, (program, _, ends): (&str, bool, Ends), what: &str) {
        let started = Instant::now();
        let ended = catch_unwind(AssertUnwindSafe(|| ends(at, "{bad.mcap}")));
        let took = started.elapsed();
        self.runs += 1;
        match ended {
            Ok(Ok(())) => {}
            Ok(Err(sentence)) if !sentence.trim().is_empty() => self.refused += 1,
            _ => self.broken.push(format!("{program}: {what}")),
        }
        if took > self.longest.0 {
            self.longest = (took, format!("{program}: {what}"));
        }
        let _none = std::fs::remove_file(at.join("out"));
    }
}

/// Two short recordings of a virtual lab: the tip's position, and images.
fn session(at: &Path) -> [Vec<u8>; 2] {
    std::fs::write(at.join("robot.yaml"), nominal::GOLD_YAML).unwrap();
    let simulated = |name: &str, more: &[&str]| {
        let words = ["simulate", "--robot", "{robot.yaml}", "--cameras-out", "{cameras.yaml}", "-o", name];
        typed(at, raven_capture::run, &[&words, more].concat()).unwrap();
        std::fs::read(at.join(name.trim_matches(['{', '}']))).unwrap()
    };
    [
        simulated("{tip.mcap}", &["--motion", "sinusoid", "--duration", "1", "--rate", "60"]),
        simulated("{images.mcap}", &["--motion", "hardstop", "--duration", "0.3", "--rate", "10", "--images"]),
    ]
}

/// Copies a log with one byte changed: of the definition of its `place`-th channel, or of a message.
fn changed(from: &Path, to: &Path, lot: &mut Lot) {
    let (messages, in_definition) = (Survey::of(from).unwrap().messages as usize, lot.below(4) == 0);
    // There are few channels: most lots change the definition of one of the first.
    let place = lot.below(if in_definition { 3 } else { messages });
    let (mut channels, mut seen) = (HashMap::new(), 0);
    let mut log = LogWriter::computed(to).unwrap();
    let mut flip = |bytes: &mut [u8]| {
        if !bytes.is_empty() {
            let at = lot.below(bytes.len());
            bytes[at] ^= 1 << lot.below(8);
        }
    };
    let copied = Walker::open(from).unwrap().run(|item| {
        match item {
            Item::Channel(channel) => {
                let mut copy = raven::log::Channel::clone(channel);
                if let Some(schema) = copy.schema.as_mut().filter(|_| in_definition && channels.len() == place) {
                    flip(Arc::make_mut(schema).data.to_mut());
                }
                channels.insert(channel.id, log.copy_channel(&copy)?);
            }
            Item::Message(message) => {
                let mut data = message.data.to_vec();
                if !in_definition && seen == place {
                    flip(&mut data);
                }
                seen += 1;
                log.copy_message(channels[&message.channel.id], &RawMessage { data: &data, ..message })?;
            }
            Item::Attachment(attachment) => log.copy_attachment(&attachment)?,
            Item::Metadata(name, pairs) => log.metadata(&name, &pairs)?,
            Item::Start { .. } => {}
        }
        Ok(())
    });
    copied.and_then(|()| log.finish()).unwrap();
}

/// The most memory that this program ever had [MB].
fn memory_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let kilobytes = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?.split_whitespace().next()?.parse::<f64>().ok()?;
    Some(kilobytes * 1024e-6)
}

#[test]
fn no_cut_and_no_changed_byte_breaks_a_program() {
    // Nothing here has to outlive the machine: in memory a sync costs nothing.
    let memory = Path::new("/dev/shm");
    let folder = if memory.exists() { tempfile::tempdir_in(memory) } else { tempfile::tempdir() }.unwrap();
    let at = folder.path();
    let logs = session(at);
    let bad = at.join("bad.mcap");
    // Whatever refuses the good logs would refuse the bad ones for another reason.
    for (program, images, ends) in PROGRAMS.iter().filter(|(program, ..)| !["import", "cameras"].contains(program)) {
        std::fs::write(&bad, &logs[usize::from(*images)]).unwrap();
        assert_eq!(ends(at, "{bad.mcap}"), Ok(()), "{program}");
        std::fs::remove_file(at.join("out")).unwrap();
    }
    let (mut lot, mut tally) = (Lot(SEED), Tally::default());
    let log_of = |images: bool| &logs[usize::from(images)];
    // A program that refuses a log does so at once; one that does not takes its time, so that such a log is for one program alone.
    for number in 0..EACH {
        for images in [false, true] {
            let log = log_of(images);
            let length = lot.below(log.len());
            let mut flipped = log.clone();
            let (byte, bit) = (lot.below(log.len()), lot.below(8));
            flipped[byte] ^= 1 << bit;
            for (bytes, what) in [(&log[..length], format!("cut at {length}")), (&flipped, format!("bit {bit} of byte {byte}"))] {
                std::fs::write(&bad, bytes).unwrap();
                let refused = Survey::of(&bad).map_or(true, |survey| survey.damage.is_some());
                let of_these: Vec<_> = PROGRAMS.into_iter().filter(|(_, of_images, _)| *of_images == images).collect();
                let alone = number % of_these.len();
                for (i, program) in of_these.into_iter().enumerate() {
                    if refused || i == alone {
                        tally.run(at, program, &what);
                    }
                }
            }
        }
    }
    for number in 0..EACH {
        let program = PROGRAMS[number % PROGRAMS.len()];
        changed(&at.join(if program.1 { "images.mcap" } else { "tip.mcap" }), &bad, &mut lot);
        tally.run(at, program, &format!("changed message {number}"));
    }
    let Tally { broken, runs, refused, longest } = tally;
    eprintln!(
        "{runs} runs, {refused} of them refused; the longest took {:.2} s ({}); {:?} MB",
        longest.0.as_secs_f64(),
        longest.1,
        memory_mb()
    );
    assert!(broken.is_empty(), "{} of {runs} runs broke: {broken:#?}", broken.len());
    assert!(longest.0 < LONGEST, "{} took {:?}", longest.1, longest.0);
    assert!(memory_mb().is_none_or(|most| most < MEMORY_MB), "{:?} MB", memory_mb());
}
