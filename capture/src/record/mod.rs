//! `raven-capture record`: cameras and topics of a robot in one file, each frame and message as it came and when it came.

pub mod args;
mod disk;
pub mod live;
pub mod pace;
mod recording;
pub mod source;
pub(crate) mod stop;
pub mod summary;
pub mod topic;
pub mod writer;

use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::time::{Duration, Instant};

use raven::cli::{self, Outcome};
use raven::log::{Side, topics};
use raven::{Error, Result, files};

pub use self::args::Args;
use self::args::{cameras, wanted, with_extension};
use self::live::{Live, Shown};
use self::source::{Counters, Feed};
use self::stop::Stop;
use self::summary::{Summary, TopicSummary};
use self::topic::{Shared, TopicSource};
use self::writer::{Plan, Writer};
use crate::camera::source::{CameraSource, Ready, Sink};
use crate::camera::{Driver, Encoding};
use crate::clock::SessionClock;
use crate::robot_trial::disagreement;
use crate::ros1::{Endpoint, Node, Subscription, TopicAddress};

/// How often the command looks up from waiting.
const GLANCE: Duration = Duration::from_millis(100);

/// Records until it is told to end.
///
/// # Errors
/// If a camera cannot be opened or a master reached, or the recording exists or cannot be created, or it is stopped before that. What goes wrong
/// later ends in the outcome.
pub fn run(args: &Args, out: &mut dyn Write) -> Result<Outcome> {
    record(args, cameras(args)?, out)
}

/// Records from these cameras, whatever they are, and the topics that were asked for.
///
/// # Errors
/// Those of [`run`].
pub fn record(args: &Args, cameras: Vec<(Side, Box<dyn Driver>)>, out: &mut dyn Write) -> Result<Outcome> {
    let (wanted, path) = (wanted(args)?, with_extension(&args.output));
    files::no_stream(&path)?;
    files::apart(None::<&Path>, &[("-o", Some(path.as_path())), ("--json", args.json.as_deref())])?;
    let clock = SessionClock::start();
    let (feed, queue) = Feed::new();
    let (notices, notes) = mpsc::channel();
    let (stop, rolling) = (Stop::on_signals()?, Arc::new(AtomicBool::new(false)));

    // Cameras first, all at once: they take seconds to settle. Without one of them, or without a master, there must be no file.
    let sink = |side| {
        let (feed, notices, rolling) = (feed.clone(), notices.clone(), Arc::clone(&rolling));
        Sink { side, counters: Arc::default(), feed, clock, notices, rolling }
    };
    let mut sources = Vec::new();
    for (side, driver) in cameras {
        let sink = sink(side);
        sources.push((side, Arc::clone(&sink.counters), CameraSource::start(driver, sink)?));
    }
    let (mut shown, mut records) = (Vec::new(), vec![("session".to_owned(), session(args, &wanted, clock))]);
    for (side, counters, source) in &sources {
        let Ready { mode, record } = source.ready()?;
        let topic = if mode.encoding == Encoding::Mjpg { topics::compressed(*side) } else { topics::raw(*side) };
        shown.push(Shown { topic: topic.to_owned(), camera: Some(*side), counters: Arc::clone(counters) });
        records.push((format!("camera.{}", side.name()), record));
    }

    let mut by_master: BTreeMap<Endpoint, Vec<Subscription>> = BTreeMap::new();
    for (recorded_as, address) in &wanted {
        let counters = Arc::new(Counters::default());
        shown.push(Shown { topic: recorded_as.clone(), camera: None, counters: Arc::clone(&counters) });
        let (feed, notices) = (feed.clone(), notices.clone());
        let source = TopicSource { recorded_as: recorded_as.clone(), counters, feed, clock, notices, said: Default::default() };
        let listener = Arc::new(Shared(Arc::new(source)));
        by_master.entry(address.master.clone()).or_default().push(Subscription { topic: address.topic.clone(), listener });
    }
    let nodes: Vec<Node> = by_master
        .into_iter()
        .map(|(master, subscriptions)| Node::start(master, subscriptions, notices.clone()))
        .collect::<Result<_, _>>()?;
    let plan = Plan {
        path,
        split_bytes: args.split_size.map(|megabytes| (megabytes * 1e6) as u64),
        min_space_bytes: args.min_space.saturating_mul(1_000_000),
        records,
        clock,
    };
    // Cameras and masters take their time, in which the user may think better of it.
    if stop.asked() {
        return Err(Error::Data("stopped before the recording began: there is no file.".to_owned()));
    }
    let writer = Writer::start(plan, queue)?;
    rolling.store(true, Ordering::Relaxed);

    let mut live = Live::start();
    // A duration beyond the end of time is one without an end.
    let until = args.duration.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok()).and_then(|d| Instant::now().checked_add(d));
    while !stop.asked() && !writer.progress().ended() && until.is_none_or(|until| Instant::now() < until) {
        live.show(&shown, writer.progress());
        let left = until.map_or(GLANCE, |until| until.saturating_duration_since(Instant::now()).min(GLANCE));
        if let Ok(sentence) = notes.recv_timeout(left) {
            live.say(&sentence);
        }
    }
    drop((nodes, sources));
    notes.try_iter().for_each(|sentence| live.say(&sentence));
    let written = writer.finish()?;
    let seconds = live.end().as_secs_f64();

    let skew = live::skew(&shown);
    let topics =
        shown.into_iter().map(|Shown { topic, camera, counters }| TopicSummary { topic, camera, counts: counters.read() }).collect();
    let summary = Summary::new(written, seconds, topics, skew);
    summary.lost.iter().for_each(|sentence| cli::warn(sentence));
    // A camera's stamps are of this machine's own clock.
    let of_robots = summary.topics.iter().filter(|topic| topic.camera.is_none());
    of_robots.filter_map(|topic| disagreement(&topic.topic, topic.counts.least_lag_s)).for_each(|sentence| cli::warn(&sentence));
    cli::results(out, &summary.render(), args.json.as_deref(), &summary)?;
    Ok(summary.outcome())
}

/// Metadata record `session`.
fn session(args: &Args, wanted: &[(String, TopicAddress)], clock: SessionClock) -> BTreeMap<String, String> {
    let mut session: BTreeMap<String, String> = args.session.iter().cloned().collect();
    session.insert("tool".to_owned(), concat!("raven-capture ", env!("CARGO_PKG_VERSION")).to_owned());
    session.insert("epoch_ns".to_owned(), clock.epoch_ns().to_string());
    for (name, TopicAddress { master, topic }) in wanted {
        session.insert(format!("source {name}"), format!("ros://{}{topic}", master.authority()));
    }
    session
}
