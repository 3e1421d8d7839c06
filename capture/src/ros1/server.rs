//! A server of remote calls: what masters and nodes call a node by.

use std::io::{self, BufReader, Write};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use super::http::{HttpMessage, Timed};
use super::value::{Value, read_call, write_answer};

/// Calls are taken one after the other, so one that stalls must not keep the others waiting for long.
const REQUEST_LIMIT: Duration = Duration::from_secs(2);

/// A running server; it ends when dropped.
#[derive(Debug)]
pub struct Server {
    at: SocketAddr,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Server {
    /// Starts a server on a port of these interfaces, 0 for any that is free. `answer` gets method and parameters of each call; what it returns in
    /// words becomes a fault of XML-RPC.
    ///
    /// # Errors
    /// If the port is not free.
    pub fn start(
        interfaces: IpAddr,
        port: u16,
        answer: impl Fn(&str, &[Value]) -> Result<Value, String> + Send + 'static,
    ) -> io::Result<Self> {
        let listener = TcpListener::bind((interfaces, port))?;
        let at = listener.local_addr()?;
        let stop = Arc::new(AtomicBool::new(false));
        let stopped = Arc::clone(&stop);
        let serve = move || {
            for stream in listener.incoming() {
                if stopped.load(Ordering::Relaxed) {
                    return;
                }
                // Who calls wrongly or hangs up has nobody to complain to.
                let _gone = stream.and_then(|stream| take(stream, &answer));
            }
        };
        let thread = thread::Builder::new().name("remote calls".to_owned()).spawn(serve)?;
        Ok(Self { at, stop, thread: Some(thread) })
    }

    /// The port it listens on.
    #[must_use]
    pub const fn port(&self) -> u16 {
        self.at.port()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        // A connection wakes the thread; without one it would wait for the next call.
        let here: IpAddr = if self.at.is_ipv6() { Ipv6Addr::LOCALHOST.into() } else { Ipv4Addr::LOCALHOST.into() };
        let woken = TcpStream::connect_timeout(&(here, self.at.port()).into(), REQUEST_LIMIT);
        if let (Ok(_), Some(thread)) = (woken, self.thread.take()) {
            let _panicked = thread.join();
        }
    }
}

fn take(stream: TcpStream, answer: &impl Fn(&str, &[Value]) -> Result<Value, String>) -> io::Result<()> {
    let mut stream = BufReader::new(Timed::new(stream, REQUEST_LIMIT)?);
    let request = match HttpMessage::read(&mut stream) {
        Ok(request) if request.start.starts_with("POST ") => request,
        _ => return stream.get_mut().write_all(&HttpMessage::bytes("HTTP/1.1 400 Bad Request", "", "")),
    };
    let body = write_answer(read_call(&request.body).and_then(|(method, parameters)| answer(&method, &parameters)));
    stream.get_mut().write_all(&HttpMessage::bytes("HTTP/1.1 200 OK", "", &body))
}
