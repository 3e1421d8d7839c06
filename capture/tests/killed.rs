//! `kill -9` at any moment while webcams and a robot are recorded: what was received up to a second before is in a file that every reader opens.

mod lab;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Instant, SystemTime};

use lab::film::{PICTURES, RATE_HZ, pictures};
use lab::readers::counts_by_pypi;
use lab::{Master, Publisher, aloud, example, numbers, wait_for};
use raven::log::{FrameData, Side, Stamp, Survey, active_name, frames, topics};

const TOPIC: &str = "/numbers";
const MESSAGES_HZ: f64 = 250.0;
/// Kills, so many recordings at once so many times.
const WAVES: usize = 4;
const AT_ONCE: usize = 5;
/// Of the moments, which are up to so long after the first message [s].
const SEED: u64 = 6;
const LATEST_S: f64 = 3.4;
/// What a kill may cost [s].
const LOSS_S: f64 = 1.0;

/// A recording that was killed.
struct Killed {
    file: PathBuf,
    moment_s: f64,
    /// When each message was published, when the recording had its file, and when it was killed.
    sent: Vec<Stamp>,
    begun: Stamp,
    end: Stamp,
    /// The longest that this machine kept the test itself from publishing on time [s]: as late the recorder may have been.
    late_s: f64,
}

fn now() -> Stamp {
    Stamp(SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap().as_nanos() as u64)
}

fn killed(program: &Path, folder: &Path, moment_s: f64) -> Killed {
    let master = Master::start(0);
    let publisher = Publisher::start(&master.at(), TOPIC);
    let file = folder.join("session.mcap");
    let mut recorder = Command::new(program)
        .args(["record", "--left", "serial:L1", "--right", "serial:R1", "--ros-master", &master.at().to_string()])
        .args(["--topic", TOPIC, "--min-space", "1", "-o", file.to_str().unwrap()])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let file = active_name(&file);
    wait_for("the subscriber", || publisher.subscribers() == 1);
    wait_for("the file", || file.exists());
    let (begun, start, mut sent, mut late_s) = (now(), Instant::now(), Vec::new(), 0.0_f64);
    publisher.stream(0..100_000, MESSAGES_HZ, || {
        late_s = late_s.max(start.elapsed().as_secs_f64() - sent.len() as f64 / MESSAGES_HZ);
        sent.push(now());
        start.elapsed().as_secs_f64() < moment_s
    });
    // The last moment is that of a message which was not sent any more.
    sent.pop();
    recorder.kill().unwrap();
    let end = now();
    recorder.wait().unwrap();
    Killed { file, moment_s, sent, begun, end, late_s }
}

impl Killed {
    /// What our reader finds: messages by topic, whether the file is whole, and how much is lost [s].
    fn read(&self, shown: &BTreeMap<Side, Vec<Vec<u8>>>) -> (BTreeMap<String, usize>, bool, f64) {
        let survey = Survey::of(&self.file).unwrap();
        let counts = survey.topics.iter().map(|topic| (topic.topic.clone(), topic.quality.messages)).collect();
        let (read, whole) = numbers(&self.file, TOPIC);
        assert_eq!(read, (0..read.len() as u64).collect::<Vec<_>>(), "killed after {} s", self.moment_s);
        assert_eq!(whole, survey.damage.is_none());
        let mut lost_s = self.sent.get(read.len()).map_or(0.0, |first| self.end.seconds_since(*first));
        for (side, pictures) in shown {
            let (mut next, mut last) = (None, self.begun);
            // Up to the cut, where there is one; a recording that was killed at once has no frames.
            for frame in frames(&self.file).into_iter().flatten().map_while(Result::ok).filter(|frame| frame.side == *side) {
                let number = frame.sequence.unwrap_or(0);
                assert_eq!(number, next.unwrap_or(number), "killed after {} s", self.moment_s);
                assert!(frame.data == FrameData::Jpeg(pictures[number as usize % PICTURES].clone()), "the picture is another one");
                (next, last) = (Some(number + 1), frame.stamp.plus_seconds(1.0 / f64::from(RATE_HZ)));
            }
            lost_s = lost_s.max(self.end.seconds_since(last));
        }
        (counts, whole, lost_s)
    }
}

#[test]
fn a_kill_costs_a_second_at_most_and_leaves_a_file_that_every_reader_opens() {
    let program = match example("replayed_lab") {
        Ok(program) => program,
        Err(why) => return aloud(&format!("SKIPPED: recordings that are killed: {why}")),
    };
    let shown: BTreeMap<Side, Vec<Vec<u8>>> = Side::BOTH.map(|side| (side, pictures(side))).into();
    let folder = tempfile::tempdir().unwrap();
    let mut state = SEED;
    let mut recordings = Vec::new();
    for wave in 0..WAVES {
        let one = |number: usize| {
            // splitmix64
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mixed = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            let own = folder.path().join(format!("{wave}-{number}"));
            std::fs::create_dir(&own).unwrap();
            (own, LATEST_S * ((mixed ^ (mixed >> 31)) >> 11) as f64 / (1_u64 << 53) as f64)
        };
        let chosen: Vec<(PathBuf, f64)> = (0..AT_ONCE).map(one).collect();
        recordings.extend(thread::scope(|scope| {
            let running: Vec<_> = chosen.iter().map(|(folder, moment_s)| scope.spawn(|| killed(&program, folder, *moment_s))).collect();
            running.into_iter().map(|thread| thread.join().unwrap()).collect::<Vec<_>>()
        }));
    }
    let (mut ours, mut words, mut losses) = (Vec::new(), Vec::new(), Vec::new());
    for recording in &recordings {
        let (counts, whole, lost_s) = recording.read(&shown);
        let (moment_s, late_s) = (recording.moment_s, recording.late_s);
        assert!(lost_s < LOSS_S + late_s, "killed after {moment_s} s: the last {lost_s} s are lost; the machine was late by {late_s} s");
        words.push(format!("{}{}", if whole { "" } else { "torn:" }, recording.file.display()));
        ours.push(counts);
        losses.push(lost_s);
    }
    losses.sort_unstable_by(f64::total_cmp);
    let torn = words.iter().filter(|word| word.starts_with("torn:")).count();
    eprintln!(
        "lost in the median {:.2} s, at most {:.2} s; {torn} files end in a part of a chunk",
        losses[losses.len() / 2],
        losses[losses.len() - 1]
    );
    // A chunk of 900 kB is written in less than a hundredth of the time that it is filled in.
    assert!(torn <= 2, "{torn} files are not whole");
    assert!(ours.iter().any(|counts| counts.get(topics::LEFT_COMPRESSED).is_some_and(|count| *count > 30)));

    ours.iter_mut().for_each(|counts| counts.retain(|_, count| *count > 0));
    if let Some(theirs) = counts_by_pypi(&words) {
        assert_eq!(ours, theirs);
    }
}
