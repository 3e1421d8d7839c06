//! The node: known to the master for as long as it runs, with one link per publisher of each topic.

use std::collections::BTreeMap;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, ToSocketAddrs};
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use super::call::call_ros;
use super::link::{Link, Listener, Order};
use super::{Endpoint, Fault, Server, Value};

/// How often the node asks whether the master still knows it: a master that came back does not.
const WATCH: Duration = Duration::from_secs(1);
/// No robot has more publishers of a topic; a list without end must not start threads without end.
const MAX_PUBLISHERS: usize = 16;

/// A topic that is wanted, and who gets its messages.
pub struct Subscription {
    /// Full name.
    pub topic: String,
    /// Who gets its messages.
    pub listener: Arc<dyn Listener>,
}

/// A running node; it ends, and tells the master so, when dropped.
pub struct Node {
    shared: Arc<Shared>,
    watcher: Option<(mpsc::Sender<()>, JoinHandle<()>)>,
    server: Option<Server>,
    /// The address that the master knows.
    own: String,
}

/// What the threads of a node share.
struct Shared {
    master: Endpoint,
    caller_id: String,
    topics: Vec<Topic>,
    stop: Arc<AtomicBool>,
    notices: mpsc::Sender<String>,
}

struct Topic {
    wanted: Subscription,
    publishers: Mutex<Publishers>,
}

/// Who publishes a topic, as the master says, and the links to them.
#[derive(Default)]
struct Publishers {
    listed: Vec<Endpoint>,
    links: BTreeMap<Endpoint, Link>,
    /// How often the master has said so without being asked.
    updates: u64,
}

impl Node {
    /// Registers with a master. What goes wrong later, and right again, comes as sentences over `notices`.
    ///
    /// # Errors
    /// If the master cannot be reached or refuses.
    pub fn start(master: Endpoint, subscriptions: Vec<Subscription>, notices: mpsc::Sender<String>) -> Result<Self, Fault> {
        static NODES: AtomicU32 = AtomicU32::new(0);
        let unreachable = |source| Fault::Unreachable { peer: master_at(&master), source };
        let host = own_host(&master)?;
        let caller_id = format!("/raven_capture_{}_{}", std::process::id(), NODES.fetch_add(1, Ordering::Relaxed));
        let topics = subscriptions.into_iter().map(|wanted| Topic { wanted, publishers: Mutex::default() }).collect();
        let stop = Arc::new(AtomicBool::new(false));
        let shared = Arc::new(Shared { master: master.clone(), caller_id, topics, stop, notices });
        let answering = Arc::clone(&shared);
        let server = Server::start(interfaces_of(&host), 0, move |method, parameters| answering.answer(method, parameters));
        let server = server.map_err(unreachable)?;
        let own = Endpoint { host, port: server.port() }.to_string();
        let mut node = Self { shared, watcher: None, server: Some(server), own: own.clone() };
        node.shared.register(&own)?;
        let (end, ended) = mpsc::channel();
        let shared = Arc::clone(&node.shared);
        let watch = move || shared.watch(&own, &ended);
        let thread = thread::Builder::new().name("master".to_owned()).spawn(watch).map_err(unreachable)?;
        node.watcher = Some((end, thread));
        Ok(node)
    }
}

impl Drop for Node {
    fn drop(&mut self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        // After this nothing starts links any more.
        if let Some((end, thread)) = self.watcher.take() {
            drop(end);
            let _panicked = thread.join();
        }
        drop(self.server.take());
        self.shared.unregister(&self.own);
        for topic in &self.shared.topics {
            let publishers = std::mem::take(&mut *topic.publishers.lock().unwrap_or_else(PoisonError::into_inner));
            publishers.links.into_values().for_each(Link::join);
        }
    }
}

impl Shared {
    /// What others may call this node for (ROS/Slave_API).
    fn answer(&self, method: &str, parameters: &[Value]) -> Result<Value, String> {
        match (method, parameters) {
            ("publisherUpdate", [_, topic, publishers]) => {
                let (Some(topic), Some(publishers)) = (topic.text(), publishers.texts()) else {
                    return Ok(Value::failure("publisherUpdate takes a name, a topic and a list of addresses"));
                };
                self.update(topic, &publishers, None);
                Ok(Value::success("", Value::Integer(0)))
            }
            ("getPid", _) => Ok(Value::success("", Value::Integer(i32::try_from(std::process::id()).unwrap_or_default()))),
            ("getMasterUri", _) => Ok(Value::success("", Value::Text(self.master.to_string()))),
            ("getPublications", _) => Ok(Value::success("", Value::List(Vec::new()))),
            ("getSubscriptions", _) => {
                let topic = |topic: &Topic| Value::List(vec![topic.wanted.topic.as_str().into(), "*".into()]);
                Ok(Value::success("", Value::List(self.topics.iter().map(topic).collect())))
            }
            _ => Err(format!("{method}: this node only subscribes")),
        }
    }

    fn register(&self, own: &str) -> Result<(), Fault> {
        for topic in &self.topics {
            let name = topic.wanted.topic.as_str();
            let parameters = [self.caller_id.as_str().into(), name.into(), "*".into(), own.into()];
            let before = topic.publishers.lock().unwrap_or_else(PoisonError::into_inner).updates;
            let answer = call_ros(&master_at(&self.master), &self.master, "registerSubscriber", &parameters)?;
            self.update(name, &answer.texts().unwrap_or_default(), Some(before));
        }
        Ok(())
    }

    fn unregister(&self, own: &str) {
        for topic in &self.topics {
            let parameters = [self.caller_id.as_str().into(), topic.wanted.topic.as_str().into(), own.into()];
            // A master that is gone has forgotten this node anyway; waiting for it once is enough.
            if let Err(Fault::Unreachable { .. }) = call_ros(&master_at(&self.master), &self.master, "unregisterSubscriber", &parameters) {
                return;
            }
        }
    }

    /// Asks the master once in a while who this node is, and registers again when it does not know.
    fn watch(&self, own: &str, ended: &mpsc::Receiver<()>) {
        let mut missing = false;
        while let Err(mpsc::RecvTimeoutError::Timeout) = ended.recv_timeout(WATCH) {
            let name = Value::Text(self.caller_id.clone());
            let known = match call_ros(&master_at(&self.master), &self.master, "lookupNode", &[name.clone(), name]) {
                Err(Fault::Refused { .. }) => self.register(own),
                other => other.map(|_| ()),
            };
            match known {
                Err(ref fault) if !missing => self.notice(format!("{fault}; topics that are connected go on.")),
                Ok(()) if missing => self.notice(format!("{} is back.", master_at(&self.master))),
                _ => {}
            }
            missing = known.is_err();
            for topic in &self.topics {
                self.start_missing(topic, &mut topic.publishers.lock().unwrap_or_else(PoisonError::into_inner));
            }
        }
    }

    /// Brings the links of a topic to a list of publishers. A list that the master was asked for, `before` so many of its own accord, is older than
    /// one that came meanwhile.
    fn update(&self, name: &str, publishers: &[String], before: Option<u64>) {
        let Some(topic) = self.topics.iter().find(|topic| topic.wanted.topic == name) else { return };
        let mut wanted: Vec<Endpoint> = Vec::new();
        for publisher in publishers {
            match Endpoint::from_str(publisher) {
                Ok(endpoint) => wanted.push(endpoint),
                Err(what) => self.notice(format!("{name}: {what}; this publisher is left out.")),
            }
        }
        if wanted.len() > MAX_PUBLISHERS {
            self.notice(format!("{name}: of {} publishers, only {MAX_PUBLISHERS} are recorded.", wanted.len()));
            wanted.truncate(MAX_PUBLISHERS);
        }
        let mut publishers = topic.publishers.lock().unwrap_or_else(PoisonError::into_inner);
        match before {
            None => publishers.updates += 1,
            Some(before) if before < publishers.updates => return,
            Some(_) => {}
        }
        publishers.links.iter().for_each(|(publisher, link)| link.set_wanted(wanted.contains(publisher)));
        publishers.listed = wanted;
        self.start_missing(topic, &mut publishers);
    }

    /// Starts the links that a topic lacks; one that ended just before its publisher was listed again would stay away for good.
    fn start_missing(&self, topic: &Topic, publishers: &mut Publishers) {
        let Publishers { listed, links, .. } = publishers;
        links.retain(|_, link| !link.is_finished());
        for publisher in listed.iter() {
            if links.contains_key(publisher) || self.stop.load(Ordering::Relaxed) {
                continue;
            }
            let name = &topic.wanted.topic;
            let order = Order {
                topic: name.clone(),
                caller_id: self.caller_id.clone(),
                publisher: publisher.clone(),
                listener: Arc::clone(&topic.wanted.listener),
                stop: Arc::clone(&self.stop),
            };
            match Link::start(order) {
                Ok(link) => drop(links.insert(publisher.clone(), link)),
                Err(error) => self.notice(format!("{name}: no thread for {publisher}: {error}.")),
            }
        }
    }

    fn notice(&self, sentence: String) {
        // Nobody listens any more when everything ends.
        let _ended = self.notices.send(sentence);
    }
}

fn master_at(master: &Endpoint) -> String {
    format!("the ROS master at {master}")
}

/// By which name others reach this machine: `ROS_HOSTNAME`, `ROS_IP`, or the address under which the master sees it.
fn own_host(master: &Endpoint) -> Result<String, Fault> {
    let given = ["ROS_HOSTNAME", "ROS_IP"].into_iter().filter_map(|name| std::env::var(name).ok()).find(|host| !host.is_empty());
    if let Some(host) = given {
        return Ok(host);
    }
    let peer = master_at(master);
    let seen = master.connect(&peer)?.local_addr();
    seen.map(|address| address.ip().to_string()).map_err(|source| Fault::Unreachable { peer, source })
}

/// All interfaces by which others can reach this machine under that name: those of IPv6 too if it has no address of IPv4.
fn interfaces_of(host: &str) -> IpAddr {
    let only_new = (host, 0).to_socket_addrs().is_ok_and(|mut addresses| addresses.all(|address| address.is_ipv6()));
    if only_new { Ipv6Addr::UNSPECIFIED.into() } else { Ipv4Addr::UNSPECIFIED.into() }
}

#[cfg(test)]
mod tests {
    use std::net::{Ipv4Addr, TcpListener};
    use std::time::{Duration, Instant};

    use super::super::{Connection, Receiver};
    use super::*;

    struct Nobody;

    impl Listener for Nobody {
        fn connected(&self, _: Connection) -> Receiver {
            Box::new(|_| {})
        }

        fn failed(&self, _: &Fault, _: bool) {}
    }

    /// A master that tells of a publisher before its answer, that there was none, is read.
    #[test]
    fn an_answer_that_is_older_than_an_update_changes_nothing() {
        let publisher = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).unwrap();
        publisher.set_nonblocking(true).unwrap();
        let at = format!("http://{}/", publisher.local_addr().unwrap());
        let answer = move |method: &str, parameters: &[Value]| {
            if let ("registerSubscriber", [_, topic, _, node]) = (method, parameters) {
                let node = Endpoint::from_str(node.text().unwrap()).unwrap();
                let update = ["/master".into(), topic.clone(), Value::List(vec![at.as_str().into()])];
                call_ros("the node", &node, "publisherUpdate", &update).unwrap();
            }
            Ok(Value::success("", Value::List(Vec::new())))
        };
        let master = Server::start(Ipv4Addr::LOCALHOST.into(), 0, answer).unwrap();
        let master_at = Endpoint { host: Ipv4Addr::LOCALHOST.to_string(), port: master.port() };
        let numbers = Subscription { topic: "/numbers".to_owned(), listener: Arc::new(Nobody) };
        let _node = Node::start(master_at, vec![numbers], mpsc::channel().0).unwrap();
        // A link that is still wanted tries again each time that the publisher hangs up.
        let (mut calls, until) = (0, Instant::now() + Duration::from_secs(10));
        while calls < 3 && Instant::now() < until {
            calls += usize::from(publisher.accept().is_ok());
            thread::sleep(Duration::from_millis(5));
        }
        assert_eq!(calls, 3);
    }
}
