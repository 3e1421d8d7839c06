//! As much of HTTP/1.1 (RFC 9112) as remote calls between ROS 1 nodes need: one message, one answer, then the connection is closed.

use std::io::{self, BufRead, Read};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use super::fault::ReadFault;

/// No node sends a longer head.
const HEAD_LIMIT: u64 = 16 << 10;
/// No node sends a longer body: the longest lists the publishers of a topic.
const BODY_LIMIT: usize = 1 << 20;

/// A connection that ends at a deadline, however slowly bytes drip in.
pub(super) struct Timed {
    stream: TcpStream,
    until: Instant,
}

impl Timed {
    pub(super) fn new(stream: TcpStream, limit: Duration) -> io::Result<Self> {
        stream.set_write_timeout(Some(limit))?;
        Ok(Self { stream, until: Instant::now() + limit })
    }
}

impl Read for Timed {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let left = self.until.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(io::ErrorKind::TimedOut.into());
        }
        self.stream.set_read_timeout(Some(left))?;
        self.stream.read(buffer)
    }
}

impl io::Write for Timed {
    fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
        self.stream.write(buffer)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.stream.flush()
    }
}

/// A request or an answer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HttpMessage {
    /// `POST / HTTP/1.1` or `HTTP/1.1 200 OK`.
    pub start: String,
    /// Contents.
    pub body: String,
}

impl HttpMessage {
    /// Reads one message. Lengths are bounded, and nothing is allocated for bytes that have not come.
    ///
    /// # Errors
    /// If the connection ends, or what comes is no HTTP message with a length.
    pub fn read(source: &mut impl BufRead) -> Result<Self, ReadFault> {
        let mut lines = head(source)?.into_iter();
        let start = lines.next().unwrap_or_default();
        let mut length = None;
        for line in lines {
            let Some((name, value)) = line.split_once(':') else { return Err(malformed(format!("`{line}` as a line of an HTTP head"))) };
            if name.eq_ignore_ascii_case("content-length") {
                let value = value.trim();
                length = Some(value.parse::<usize>().map_err(|_| malformed(format!("Content-Length is `{value}`")))?);
            } else if name.eq_ignore_ascii_case("transfer-encoding") {
                return Err(malformed(format!("Transfer-Encoding is `{}`, which no ROS node uses", value.trim())));
            }
        }
        let length = length.ok_or_else(|| malformed("an HTTP message without Content-Length".to_owned()))?;
        let body = String::from_utf8(exactly(source, length, BODY_LIMIT, "an HTTP body")?);
        Ok(Self { start, body: body.map_err(|_| malformed("a body that is no UTF-8".to_owned()))? })
    }

    /// The bytes of a message with this first line and more lines of its head.
    #[must_use]
    pub fn bytes(start: &str, head: &str, body: &str) -> Vec<u8> {
        let length = body.len();
        format!("{start}\r\n{head}Content-Type: text/xml\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n{body}").into_bytes()
    }
}

/// Reads `length` bytes, if they are not more than `limit`; memory grows as they come.
pub(super) fn exactly(source: &mut impl Read, length: usize, limit: usize, what: &str) -> Result<Vec<u8>, ReadFault> {
    if length > limit {
        return Err(malformed(format!("{what} of {length} bytes; {limit} is the most that is taken")));
    }
    // One allocation for what is usual; a length that lies costs no more than this.
    let mut bytes = Vec::with_capacity(length.min(1 << 16));
    source.take(length as u64).read_to_end(&mut bytes)?;
    if bytes.len() < length {
        return Err(ReadFault::Io(io::ErrorKind::UnexpectedEof.into()));
    }
    Ok(bytes)
}

/// The lines up to the empty one.
fn head(source: &mut impl BufRead) -> Result<Vec<String>, ReadFault> {
    let (mut lines, mut source) = (Vec::new(), source.take(HEAD_LIMIT));
    loop {
        let mut line = Vec::new();
        source.read_until(b'\n', &mut line)?;
        if line.is_empty() && lines.is_empty() {
            return Err(ReadFault::Io(io::ErrorKind::UnexpectedEof.into()));
        }
        // The end of the limit or of the connection.
        if line.pop() != Some(b'\n') {
            return Err(malformed("an HTTP head that does not end".to_owned()));
        }
        let text = String::from_utf8_lossy(&line).trim_end().to_owned();
        if text.is_empty() {
            return Ok(lines);
        }
        lines.push(text);
    }
}

pub(super) fn malformed(what: String) -> ReadFault {
    ReadFault::Malformed(what)
}
