//! `raven-capture record`: topics of a robot in one file, each message as it came and when it came.

pub mod live;
pub mod pace;
mod recording;
pub mod source;
pub mod summary;
pub mod topic;
pub mod writer;

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::time::{Duration, Instant};

use raven::cli::{self, Outcome};
use raven::log::topics;
use raven::{Error, Result};

use self::live::Live;
use self::source::{Counters, Feed};
use self::summary::{Summary, TopicSummary};
use self::topic::{Shared, TopicSource};
use self::writer::{Plan, Writer};
use crate::clock::SessionClock;
use crate::ros1::{Endpoint, MASTER_PORT, Node, Subscription, TopicAddress, topic_name};

/// How often the command looks up from waiting.
const GLANCE: Duration = Duration::from_millis(100);

/// Arguments of `raven-capture record`.
#[derive(Debug, clap::Args)]
#[command(
    group = clap::ArgGroup::new("source").args(["robot", "joint_encoders", "topic"]).multiple(true).required(true),
    after_help = "Example:\n  raven-capture record --robot ros://robot:11311/ravenstate --duration 60 -o session.mcap\n  \
                  raven-capture record --ros-master http://robot:11311 --topic /ravenstate --topic /joint_states -o session.mcap\n\n\
                  Ctrl-C ends the recording and completes the file; a second one aborts. Until then it is called session.mcap.active, and\n\
                  `raven-capture check --recover` reads it if everything else fails.\n\n\
                  Exit codes: 0 recorded, 1 failed, 2 wrong arguments, 3 recorded, but data were lost."
)]
pub struct Args {
    /// The robot's own message, recorded as /ravenstate.
    #[arg(long, value_name = "ros://HOST:PORT/TOPIC")]
    pub robot: Option<TopicAddress>,
    /// Reference encoders at the joints, recorded as /joint_encoders.
    #[arg(long, value_name = "ros://HOST:PORT/TOPIC")]
    pub joint_encoders: Option<TopicAddress>,
    /// A topic recorded under its own name; may be repeated.
    #[arg(long, value_name = "TOPIC", value_parser = topic_name)]
    pub topic: Vec<String>,
    /// The ROS master of --topic; ROS_MASTER_URI or this machine if left off. ROS_IP or ROS_HOSTNAME say how the robot reaches this machine,
    /// if it is not by the address that the master sees.
    #[arg(long, value_name = "URI", requires = "topic")]
    pub ros_master: Option<Endpoint>,
    /// End after so long [s].
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    pub duration: Option<f64>,
    /// Begin another file after so much [MB]: NAME_000.mcap, NAME_001.mcap and so on.
    #[arg(long, value_name = "MB", value_parser = positive)]
    pub split_size: Option<f64>,
    /// Space that must stay free on the disk [MB]; below it the recording ends.
    #[arg(long, value_name = "MB", default_value_t = 1000)]
    pub min_space: u64,
    /// What to remember of the session, as in operator=Kim; may be repeated.
    #[arg(long, value_name = "KEY=VALUE", value_parser = pair)]
    pub session: Vec<(String, String)>,
    /// Write the result as JSON; `-` is standard output.
    #[arg(long, value_name = "FILE")]
    pub json: Option<PathBuf>,
    /// The recording; .mcap is added if it is left off.
    #[arg(short, long, value_name = "NAME")]
    pub output: PathBuf,
}

/// Records until it is told to end.
///
/// # Errors
/// If a master cannot be reached, or the recording exists or cannot be created. What goes wrong later ends in the outcome.
pub fn run(args: &Args, out: &mut dyn Write) -> Result<Outcome> {
    let wanted = wanted(args)?;
    let clock = SessionClock::start();
    let (feed, queue) = Feed::new();
    let (notices, notes) = mpsc::channel();
    let stop = stop_on_signals()?;

    let mut shown: Vec<(String, Arc<Counters>)> = Vec::new();
    let mut by_master: BTreeMap<Endpoint, Vec<Subscription>> = BTreeMap::new();
    for (recorded_as, address) in &wanted {
        let counters = Arc::new(Counters::default());
        shown.push((recorded_as.clone(), Arc::clone(&counters)));
        let (feed, notices) = (feed.clone(), notices.clone());
        let source = TopicSource { recorded_as: recorded_as.clone(), counters, feed, clock, notices, said: Default::default() };
        let listener = Arc::new(Shared(Arc::new(source)));
        by_master.entry(address.master.clone()).or_default().push(Subscription { topic: address.topic.clone(), listener });
    }
    // Masters first: without one there must be no file.
    let nodes: Vec<Node> = by_master
        .into_iter()
        .map(|(master, subscriptions)| Node::start(master, subscriptions, notices.clone()))
        .collect::<Result<_, _>>()?;
    let plan = Plan {
        path: with_extension(&args.output),
        split_bytes: args.split_size.map(|megabytes| (megabytes * 1e6) as u64),
        min_space_bytes: args.min_space.saturating_mul(1_000_000),
        session: session(args, &wanted, clock),
        clock,
    };
    let writer = Writer::start(plan, queue)?;

    let mut live = Live::start();
    // A duration beyond the end of time is one without an end.
    let until = args.duration.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok()).and_then(|d| Instant::now().checked_add(d));
    while !stop.load(Ordering::Relaxed) && !writer.progress().ended() && until.is_none_or(|until| Instant::now() < until) {
        live.show(&shown, writer.progress());
        let left = until.map_or(GLANCE, |until| until.saturating_duration_since(Instant::now()).min(GLANCE));
        if let Ok(sentence) = notes.recv_timeout(left) {
            live.say(&sentence);
        }
    }
    drop(nodes);
    let written = writer.finish()?;
    let seconds = live.end().as_secs_f64();

    let topics = shown.into_iter().map(|(topic, counters)| TopicSummary { topic, counts: counters.read() }).collect();
    let summary = Summary::new(written, seconds, topics);
    summary.lost.iter().for_each(|sentence| cli::warn(sentence));
    if args.json.as_deref() != Some(Path::new("-")) {
        out.write_all(summary.render().as_bytes()).map_err(|e| Error::io(Path::new("standard output"), "write", e))?;
    }
    if let Some(json) = &args.json {
        cli::write_json(json, &summary)?;
    }
    Ok(summary.outcome())
}

/// Every topic that was asked for, with its name in the recording.
fn wanted(args: &Args) -> Result<Vec<(String, TopicAddress)>> {
    let mut wanted: Vec<(String, TopicAddress)> = Vec::new();
    wanted.extend(args.robot.iter().map(|address| (topics::RAVEN_STATE.to_owned(), address.clone())));
    wanted.extend(args.joint_encoders.iter().map(|address| (topics::JOINT_ENCODERS.to_owned(), address.clone())));
    if !args.topic.is_empty() {
        let master = args.ros_master.clone().map_or_else(usual_master, Ok)?;
        wanted.extend(args.topic.iter().map(|topic| (topic.clone(), TopicAddress { master: master.clone(), topic: topic.clone() })));
    }
    let mut names: Vec<&str> = wanted.iter().map(|(name, _)| name.as_str()).chain([topics::CLOCK]).collect();
    names.sort_unstable();
    if let Some([twice, _]) = names.windows(2).find(|pair| pair[0] == pair[1]) {
        return Err(Error::Argument(format!(
            "`{twice}` would be in the recording twice; the recorder's own clocks are on `{}`.",
            topics::CLOCK
        )));
    }
    Ok(wanted)
}

/// The master that ROS's own programs would take.
fn usual_master() -> Result<Endpoint> {
    match std::env::var("ROS_MASTER_URI") {
        Ok(uri) if !uri.is_empty() => uri.parse().map_err(|what| Error::Argument(format!("ROS_MASTER_URI: {what}."))),
        _ => Ok(Endpoint { host: "localhost".to_owned(), port: MASTER_PORT }),
    }
}

/// Metadata record `session`.
fn session(args: &Args, wanted: &[(String, TopicAddress)], clock: SessionClock) -> BTreeMap<String, String> {
    let mut session: BTreeMap<String, String> = args.session.iter().cloned().collect();
    session.insert("tool".to_owned(), concat!("raven-capture ", env!("CARGO_PKG_VERSION")).to_owned());
    session.insert("epoch_ns".to_owned(), clock.epoch_ns().to_string());
    for (name, TopicAddress { master, topic }) in wanted {
        session.insert(format!("source {name}"), format!("ros://{}:{}{topic}", master.host, master.port));
    }
    session
}

/// A flag that Ctrl-C, a hang-up or a request to terminate raises; the second one ends the program at once.
fn stop_on_signals() -> Result<Arc<AtomicBool>> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::flag;
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        // In this order the first signal finds the flag down.
        flag::register_conditional_shutdown(signal, 130, Arc::clone(&stop))
            .and_then(|_| flag::register(signal, Arc::clone(&stop)))
            .map_err(|e| Error::Data(format!("Ctrl-C cannot be caught: {e}.")))?;
    }
    Ok(stop)
}

fn with_extension(output: &Path) -> PathBuf {
    if output.extension().is_some_and(|extension| extension == "mcap") {
        return output.to_owned();
    }
    let mut name = output.as_os_str().to_owned();
    name.push(".mcap");
    name.into()
}

fn positive(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number: &f64| number.is_finite() && *number > 0.0);
    number.ok_or_else(|| "expected a number above 0".to_owned())
}

fn pair(text: &str) -> Result<(String, String), String> {
    let (key, value) = text.split_once('=').filter(|(key, _)| !key.is_empty()).ok_or("expected KEY=VALUE")?;
    Ok((key.to_owned(), value.to_owned()))
}
