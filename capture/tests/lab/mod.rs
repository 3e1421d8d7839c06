//! A ROS 1 master and publishers for tests, and recordings made from them.

// Each test program uses its own part of this.
#![allow(dead_code)]

pub mod film;
pub mod readers;
pub mod ros;

use std::collections::BTreeMap;
use std::io::Write;
use std::net::{IpAddr, Ipv4Addr, Shutdown, SocketAddr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

use raven::log::{Item, Walker, ros1};
use raven_capture::ros1::{Endpoint, Server, Value, call_ros, encode_header, read_header};
pub use raven_tests::{aloud, python};

/// A message of 980 bytes, as the robot's is: a stamp, and a number by which the test knows it again.
pub const TYPE: &str = "test/Numbered";
pub const DEFINITION: &str = "Header header\nuint64 number\nuint8[956] rest\n\
    ================================================================================\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n";

/// The sum by which ROS knows that type.
pub fn md5sum() -> String {
    ros1::md5::md5sum(&ros1::Definition::parse(TYPE, DEFINITION).unwrap()).unwrap()
}

pub fn message(number: u64) -> Vec<u8> {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap();
    let mut data = Vec::with_capacity(980);
    data.extend((number as u32).to_le_bytes());
    data.extend((now.as_secs() as u32).to_le_bytes());
    data.extend(now.subsec_nanos().to_le_bytes());
    data.extend([0; 4]);
    data.extend(number.to_le_bytes());
    // Half of it does not compress, so that files grow.
    data.extend(
        (0..956_u64).map(|i| if i % 2 == 0 { (number.wrapping_mul(i + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40) as u8 } else { 0 }),
    );
    data
}

/// The definition of `sensor_msgs/JointState`, which CRTK's `measured_js` is.
pub const JOINT_STATE: &str = "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n\
    ================================================================================\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n";
pub const JOINTS: [&str; 3] = ["shoulder", "elbow", "insertion"];

/// Joint states number `i`, 1 ms apart; positions and efforts are known.
pub fn joint_state(i: u32) -> Vec<u8> {
    let text = |text: &str| [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat();
    let array = |numbers: [f64; 3]| [3_u32.to_le_bytes().to_vec(), numbers.map(f64::to_le_bytes).concat()].concat();
    let header = [i, 1_700_000_000, 1_000_000 * i].map(u32::to_le_bytes).concat();
    let names = [3_u32.to_le_bytes().to_vec(), JOINTS.iter().flat_map(|name| text(name)).collect()].concat();
    let at = f64::from(i);
    [header, text("arm"), names, array([at, -at, 1e-3 * at]), array([0.0; 3]), array([0.1 * at, 0.2, 0.3])].concat()
}

/// The numbers of a topic's messages in a recording, and whether the file is whole.
pub fn numbers(path: &Path, topic: &str) -> (Vec<u64>, bool) {
    let mut walker = Walker::open(path).unwrap();
    let mut numbers = Vec::new();
    walker
        .run(|item| {
            if let Item::Message(message) = item
                && message.channel.topic == topic
            {
                numbers.push(u64::from_le_bytes(message.data[16..24].try_into().unwrap()));
            }
            Ok(())
        })
        .unwrap();
    (numbers, walker.damage().is_none())
}

/// Sends a signal by its name, as in `-INT`.
pub fn signal(child: &Child, name: &str) {
    assert!(Command::new("kill").args([name, &child.id().to_string()]).status().unwrap().success());
}

/// An example of this package, which `cargo test` builds along.
pub fn example(name: &str) -> Result<PathBuf, String> {
    // Beside the folder of this test, as in target/release/deps/killed-0123456789abcdef.
    let folder = std::env::current_exe().unwrap().parent().unwrap().with_file_name("examples");
    let path = folder.join(name);
    if path.exists() {
        return Ok(path);
    }
    Err(format!("{} is not built; `cargo build --release -p raven-capture --examples` builds it", path.display()))
}

/// A folder for many files that need not outlive the machine: where it is in memory, a sync costs nothing.
pub fn in_memory() -> tempfile::TempDir {
    let memory = Path::new("/dev/shm");
    if memory.exists() { tempfile::tempdir_in(memory) } else { tempfile::tempdir() }.unwrap()
}

/// Waits until something holds; the test fails if it does not within half a minute, which a busy machine may need to start a program.
pub fn wait_for(what: &str, mut holds: impl FnMut() -> bool) {
    let until = Instant::now() + Duration::from_secs(30);
    while !holds() {
        assert!(Instant::now() < until, "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[derive(Default)]
struct Registered {
    /// Topic, caller and address.
    publishers: Vec<[String; 3]>,
    subscribers: Vec<[String; 3]>,
}

/// A master: it knows who publishes and tells who subscribes.
pub struct Master {
    host: IpAddr,
    server: Server,
}

impl Master {
    pub fn start(port: u16) -> Self {
        Self::on(Ipv4Addr::LOCALHOST.into(), port)
    }

    /// A master at this address, where its publishers are too.
    pub fn on(host: IpAddr, port: u16) -> Self {
        let registered = Mutex::new(Registered::default());
        let answer = move |method: &str, parameters: &[Value]| answer(&mut registered.lock().unwrap(), method, parameters);
        Self { host, server: Server::start(host, port, answer).unwrap() }
    }

    pub fn at(&self) -> Endpoint {
        Endpoint { host: self.host.to_string(), port: self.server.port() }
    }
}

fn answer(registered: &mut Registered, method: &str, parameters: &[Value]) -> Result<Value, String> {
    let texts: Vec<&str> = parameters.iter().filter_map(Value::text).collect();
    let Registered { publishers, subscribers } = registered;
    let addresses = |entries: &[[String; 3]], topic: &str| -> Value {
        Value::List(entries.iter().filter(|entry| entry[0] == topic).map(|entry| Value::from(entry[2].as_str())).collect())
    };
    match (method, texts.as_slice()) {
        ("registerPublisher", [caller, topic, _, at]) => {
            publishers.push([*topic, *caller, *at].map(str::to_owned));
            tell(subscribers, publishers, topic, &addresses);
            Ok(Value::success("", addresses(subscribers, topic)))
        }
        ("unregisterPublisher", [caller, topic, _]) => {
            publishers.retain(|entry| entry[0] != *topic || entry[1] != *caller);
            tell(subscribers, publishers, topic, &addresses);
            Ok(Value::success("", Value::Integer(1)))
        }
        ("registerSubscriber", [caller, topic, kind, at]) => {
            assert_eq!(*kind, "*");
            subscribers.push([*topic, *caller, *at].map(str::to_owned));
            Ok(Value::success("", addresses(publishers, topic)))
        }
        ("unregisterSubscriber", [caller, topic, _]) => {
            subscribers.retain(|entry| entry[0] != *topic || entry[1] != *caller);
            Ok(Value::success("", Value::Integer(1)))
        }
        ("lookupNode", [_, name]) => {
            let found = subscribers.iter().chain(publishers.iter()).find(|entry| entry[1] == *name);
            Ok(found.map_or_else(|| Value::failure("unknown node"), |entry| Value::success("", entry[2].as_str().into())))
        }
        _ => Err(format!("{method} is not part of the test's master")),
    }
}

/// Subscribers are told from another thread, as rosmaster does: they may be calling the master themselves.
fn tell(subscribers: &[[String; 3]], publishers: &[[String; 3]], topic: &str, addresses: &dyn Fn(&[[String; 3]], &str) -> Value) {
    let update = ["/master".into(), topic.into(), addresses(publishers, topic)];
    for subscriber in subscribers.iter().filter(|entry| entry[0] == topic) {
        let (at, update) = (Endpoint::from_str(&subscriber[2]).unwrap(), update.clone());
        std::thread::spawn(move || call_ros("the subscriber", &at, "publisherUpdate", &update));
    }
}

/// A publisher of numbered messages, registered with a master.
pub struct Publisher {
    name: String,
    topic: String,
    message_type: &'static str,
    master: Endpoint,
    at: Endpoint,
    _server: Server,
    listens_at: SocketAddr,
    streams: Arc<Mutex<Vec<TcpStream>>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Publisher {
    pub fn start(master: &Endpoint, topic: &str) -> Self {
        Self::of(master, topic, TYPE, DEFINITION)
    }

    /// A publisher of any type of message.
    pub fn of(master: &Endpoint, topic: &str, message_type: &'static str, definition: &'static str) -> Self {
        let host: IpAddr = master.host.parse().unwrap();
        let listener = TcpListener::bind((host, 0)).unwrap();
        let listens_at = listener.local_addr().unwrap();
        let port = listens_at.port();
        let server = Server::start(host, 0, move |method, _| match method {
            "requestTopic" => {
                let at = ["TCPROS".into(), Value::Text(host.to_string()), Value::Integer(i32::from(port))];
                Ok(Value::success("", Value::List(at.to_vec())))
            }
            _ => Ok(Value::success("", Value::Integer(0))),
        })
        .unwrap();
        let (streams, stop) = (Arc::new(Mutex::new(Vec::new())), Arc::new(AtomicBool::new(false)));
        let (accepted, stopped, wanted) = (Arc::clone(&streams), Arc::clone(&stop), topic.to_owned());
        let name = format!("/publisher_{port}");
        let caller = name.clone();
        let accept = move || {
            for stream in listener.incoming() {
                let mut stream: TcpStream = stream.unwrap();
                if stopped.load(Ordering::Relaxed) {
                    return;
                }
                let fields: BTreeMap<String, String> = read_header(&mut stream).unwrap();
                assert_eq!((fields["topic"].as_str(), fields["md5sum"].as_str()), (&*wanted, "*"));
                // Others may do without.
                assert!(!fields["callerid"].starts_with("/raven_capture") || fields["tcp_nodelay"] == "1");
                let sum = ros1::md5::md5sum(&ros1::Definition::parse(message_type, definition).unwrap()).unwrap();
                let header = encode_header(&[
                    ("callerid", &caller),
                    ("latching", "0"),
                    ("md5sum", &sum),
                    ("message_definition", definition),
                    ("topic", &wanted),
                    ("type", message_type),
                ]);
                stream.write_all(&header).unwrap();
                stream.set_nodelay(true).unwrap();
                accepted.lock().unwrap().push(stream);
            }
        };
        let thread = Some(std::thread::spawn(accept));
        let at = Endpoint { host: host.to_string(), port: server.port() };
        let publisher = Self {
            name,
            topic: topic.to_owned(),
            message_type,
            master: master.clone(),
            at,
            _server: server,
            listens_at,
            streams,
            stop,
            thread,
        };
        publisher.register();
        publisher
    }

    /// Tells the master, as a publisher does that starts.
    pub fn register(&self) {
        let parameters =
            [self.name.as_str().into(), self.topic.as_str().into(), self.message_type.into(), Value::Text(self.at.to_string())];
        call_ros("the master", &self.master, "registerPublisher", &parameters).unwrap();
    }

    /// Tells the master, as a publisher does that ends properly.
    pub fn unregister(&self) {
        let parameters = [self.name.as_str().into(), self.topic.as_str().into(), Value::Text(self.at.to_string())];
        call_ros("the master", &self.master, "unregisterPublisher", &parameters).unwrap();
    }

    pub fn subscribers(&self) -> usize {
        self.streams.lock().unwrap().len()
    }

    pub fn send(&self, bytes: &[u8]) {
        // One that went away is no concern of a publisher.
        self.streams.lock().unwrap().retain_mut(|stream| stream.write_all(bytes).is_ok());
    }

    pub fn publish(&self, number: u64) {
        self.publish_bytes(&message(number));
    }

    pub fn publish_bytes(&self, data: &[u8]) {
        self.send(&[&(data.len() as u32).to_le_bytes()[..], data].concat());
    }

    /// Publishes these numbers at a rate that does not drift; `more` is asked before each.
    pub fn stream(&self, numbers: std::ops::Range<u64>, rate_hz: f64, mut more: impl FnMut() -> bool) -> u64 {
        let start = Instant::now();
        for number in numbers.clone() {
            if !more() {
                return number;
            }
            self.publish(number);
            let due = start + Duration::from_secs_f64((number + 1 - numbers.start) as f64 / rate_hz);
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
        }
        numbers.end
    }
}

impl Drop for Publisher {
    /// As if killed: the master is not told.
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _woken = TcpStream::connect(self.listens_at);
        let _panicked = self.thread.take().unwrap().join();
        for stream in self.streams.lock().unwrap().drain(..) {
            let _gone = stream.shutdown(Shutdown::Both);
        }
    }
}
