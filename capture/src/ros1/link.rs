//! The connection to one publisher of one topic: a thread that keeps it up.

use std::io::{self, BufReader, Read, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use rustix::net::sockopt;

use super::call::call_ros;
use super::fault::ReadFault;
use super::tcpros::{Connection, MESSAGE_LIMIT, read_block};
use super::{Endpoint, Fault, Value};
use crate::clock::Arrival;

/// How often a waiting thread looks whether it should end.
const TICK: Duration = Duration::from_millis(100);
/// A publisher answers a header at once.
const HANDSHAKE_LIMIT: Duration = Duration::from_secs(3);
/// Pauses between attempts grow from the first to the last.
const PAUSES: [Duration; 2] = [Duration::from_millis(50), Duration::from_secs(1)];
/// A silent connection is probed after so long, and given up after three probes: a robot whose power was cut says no goodbye.
const PROBE: Duration = Duration::from_secs(3);

/// One message as it came.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Message {
    /// When its last byte was there.
    pub arrival: Arrival,
    /// Its number on this connection, from 0.
    pub sequence: u32,
    /// Its bytes.
    pub data: Vec<u8>,
}

/// Takes the messages of one connection.
pub type Receiver = Box<dyn FnMut(Message) + Send>;

/// Who gets the messages of a topic.
pub trait Listener: Send + Sync {
    /// A publisher has said what it sends; its messages go to what this returns.
    fn connected(&self, connection: Connection) -> Receiver;

    /// A publisher was not reached, or went away: `was_connected` says which.
    fn failed(&self, fault: &Fault, was_connected: bool);
}

/// What a link needs to know.
pub(super) struct Order {
    pub(super) topic: String,
    pub(super) caller_id: String,
    pub(super) publisher: Endpoint,
    pub(super) listener: Arc<dyn Listener>,
    /// The whole node ends.
    pub(super) stop: Arc<AtomicBool>,
}

/// A running link.
pub(super) struct Link {
    wanted: Arc<AtomicBool>,
    thread: JoinHandle<()>,
}

impl Link {
    pub(super) fn start(order: Order) -> io::Result<Self> {
        let wanted = Arc::new(AtomicBool::new(true));
        let keep = Arc::clone(&wanted);
        let thread = thread::Builder::new().name(order.topic.clone()).spawn(move || order.keep_up(&keep))?;
        Ok(Self { wanted, thread })
    }

    /// Whether the master still names this publisher. Without that the link reads what is under way, but does not connect again.
    pub(super) fn set_wanted(&self, wanted: bool) {
        self.wanted.store(wanted, Ordering::Relaxed);
    }

    pub(super) fn is_finished(&self) -> bool {
        self.thread.is_finished()
    }

    pub(super) fn join(self) {
        let _panicked = self.thread.join();
    }
}

impl Order {
    fn keep_up(&self, wanted: &AtomicBool) {
        let [first, last] = PAUSES;
        let mut pause = first;
        while wanted.load(Ordering::Relaxed) && !self.stopped() {
            let mut connected = None;
            let Err(fault) = self.receive(&mut connected);
            // Saying farewell to one that leaves on purpose would be noise.
            if self.stopped() || !wanted.load(Ordering::Relaxed) {
                return;
            }
            self.listener.failed(&fault, connected.is_some());
            // One that answers and then breaks off at once is no better than one that does not answer.
            if connected.is_some_and(|since: Instant| since.elapsed() > last) {
                pause = first;
            }
            self.sleep(pause);
            pause = (2 * pause).min(last);
        }
    }

    /// Asks for the connection and reads messages until it ends; `connected` becomes the moment since when it stood.
    fn receive(&self, connected: &mut Option<Instant>) -> Result<std::convert::Infallible, Fault> {
        let peer = format!("the publisher of {} at {}", self.topic, self.publisher);
        let offer = [Value::List(vec![Value::List(vec!["TCPROS".into()])])];
        let parameters = [[self.caller_id.as_str().into(), self.topic.as_str().into()].as_slice(), &offer].concat();
        let answer = call_ros(&peer, &self.publisher, "requestTopic", &parameters)?;
        let at = endpoint_of(&answer)
            .ok_or_else(|| ReadFault::Malformed("an answer to requestTopic that is not TCPROS, host and port".to_owned()).of(&peer))?;
        let lost = |source| Fault::Lost { peer: peer.clone(), source };
        let stream = at.connect(&peer)?;
        stream.set_read_timeout(Some(TICK)).and_then(|()| stream.set_write_timeout(Some(HANDSHAKE_LIMIT))).map_err(lost)?;
        keep_alive(&stream).map_err(|error| lost(error.into()))?;
        let mut stream = Interruptible { stream, stop: &self.stop, until: Some(Instant::now() + HANDSHAKE_LIMIT) };
        let connection = Connection::open(&mut stream, &self.caller_id, &self.topic).map_err(|fault| fault.of(&peer))?;
        *connected = Some(Instant::now());
        stream.until = None;
        let mut receiver = self.listener.connected(connection);
        let mut stream = BufReader::with_capacity(1 << 16, stream);
        let mut sequence = 0_u32;
        loop {
            if self.stopped() {
                return Err(lost(io::Error::other("the recording ends")));
            }
            let data = read_block(&mut stream, MESSAGE_LIMIT, "a message").map_err(|fault| fault.of(&peer))?;
            receiver(Message { arrival: Arrival::now(), sequence, data });
            sequence = sequence.wrapping_add(1);
        }
    }

    fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    fn sleep(&self, pause: Duration) {
        let until = Instant::now() + pause;
        while !self.stopped() && Instant::now() < until {
            thread::sleep(TICK.min(until.saturating_duration_since(Instant::now())));
        }
    }
}

/// Where `requestTopic` says to connect.
fn endpoint_of(answer: &Value) -> Option<Endpoint> {
    let Some([protocol, host, port]) = answer.list() else { return None };
    let port = u16::try_from(port.integer()?).ok().filter(|port| *port > 0)?;
    let host = host.text()?;
    // Some write a number of IPv6 as in an address.
    let host = host.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')).unwrap_or(host).to_owned();
    (protocol.text()? == "TCPROS").then_some(Endpoint { host, port })
}

fn keep_alive(stream: &TcpStream) -> rustix::io::Result<()> {
    sockopt::set_socket_keepalive(stream, true)?;
    sockopt::set_tcp_keepidle(stream, PROBE)?;
    sockopt::set_tcp_keepintvl(stream, PROBE)?;
    sockopt::set_tcp_keepcnt(stream, 3)
}

/// A stream with a short time-out, read until bytes come, the deadline passes, or the node ends.
struct Interruptible<'a> {
    stream: TcpStream,
    stop: &'a AtomicBool,
    until: Option<Instant>,
}

impl Read for Interruptible<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            match self.stream.read(buffer) {
                Err(error) if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut) => {
                    if self.stop.load(Ordering::Relaxed) {
                        return Err(io::Error::other("the recording ends"));
                    }
                    if self.until.is_some_and(|until| Instant::now() > until) {
                        return Err(io::ErrorKind::TimedOut.into());
                    }
                }
                result => return result,
            }
        }
    }
}

impl Write for Interruptible<'_> {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        self.stream.write(buffer)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.stream.flush()
    }
}
