//! Calls to masters and nodes.

use std::io::{BufReader, Write};
use std::time::Duration;

use super::fault::ReadFault;
use super::http::{HttpMessage, Timed};
use super::value::{Value, read_answer, write_call};
use super::{Endpoint, Fault};

/// A master answers within milliseconds.
const CALL_LIMIT: Duration = Duration::from_secs(3);

/// Calls a method and returns what it answers; `peer` names the other side in errors, as in `the master at http://robot:11311/`.
///
/// # Errors
/// If nobody answers in time, the answer is malformed, or the method fails.
pub fn call(peer: &str, at: &Endpoint, method: &str, parameters: &[Value]) -> Result<Value, Fault> {
    let lost = |source| Fault::Lost { peer: peer.to_owned(), source };
    let mut stream = Timed::new(at.connect(peer)?, CALL_LIMIT).map_err(lost)?;
    let head = format!("Host: {}\r\nUser-Agent: raven-capture\r\n", at.authority());
    stream.write_all(&HttpMessage::bytes("POST / HTTP/1.1", &head, &write_call(method, parameters))).map_err(lost)?;
    let answer = HttpMessage::read(&mut BufReader::new(stream)).map_err(|fault| fault.of(peer))?;
    let malformed = |what| ReadFault::Malformed(what).of(peer);
    if answer.start.split_ascii_whitespace().nth(1) != Some("200") {
        return Err(malformed(format!("`{}` in answer to {method}", answer.start)));
    }
    let refused = |reason| Fault::Refused { peer: peer.to_owned(), request: method.to_owned(), reason };
    read_answer(&answer.body).map_err(malformed)?.map_err(refused)
}

/// Calls a method of ROS, whose answer is a triple of code, words and value, and returns the value.
///
/// # Errors
/// Those of [`call`], and if the code is not 1, for success.
pub fn call_ros(peer: &str, at: &Endpoint, method: &str, parameters: &[Value]) -> Result<Value, Fault> {
    let answer = call(peer, at, method, parameters)?;
    let Some([code, words, value]) = answer.list() else {
        return Err(ReadFault::Malformed(format!("an answer to {method} that is not code, words and value")).of(peer));
    };
    if code.integer() == Some(1) {
        return Ok(value.clone());
    }
    let reason = words.text().unwrap_or("without words").trim_end_matches('.').to_owned();
    Err(Fault::Refused { peer: peer.to_owned(), request: method.to_owned(), reason })
}
