//! Addresses of ROS 1: `http://HOST:PORT/` of a master or node, and `ros://HOST:PORT/TOPIC` of a topic.

use std::fmt;
use std::io;
use std::net::{TcpStream, ToSocketAddrs};
use std::str::FromStr;
use std::time::Duration;

use super::Fault;

/// Where a master listens if nothing is said.
pub const MASTER_PORT: u16 = 11311;
/// A robot is in the same building: who has not answered by then is not there.
const CONNECT_WAIT: Duration = Duration::from_secs(3);

/// Host and port of a master, a node or a connection.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Endpoint {
    /// Name or number of the host; IPv6 without brackets.
    pub host: String,
    /// Port.
    pub port: u16,
}

impl Endpoint {
    /// Host and port as they stand in addresses.
    #[must_use]
    pub fn authority(&self) -> String {
        let Self { host, port } = self;
        if host.contains(':') { format!("[{host}]:{port}") } else { format!("{host}:{port}") }
    }

    /// Connects, without Nagle's delay.
    ///
    /// # Errors
    /// If the name is unknown or nobody answers within three seconds.
    pub fn connect(&self, peer: &str) -> Result<TcpStream, Fault> {
        let unreachable = |source| Fault::Unreachable { peer: peer.to_owned(), source };
        let unknown = |_| {
            let host = &self.host;
            unreachable(io::Error::other(format!("`{host}` has no address here; name it in /etc/hosts, or set ROS_IP on that machine")))
        };
        let addresses = (self.host.as_str(), self.port).to_socket_addrs().map_err(unknown)?;
        let mut last = io::Error::new(io::ErrorKind::NotFound, "the name has no address");
        for address in addresses {
            match TcpStream::connect_timeout(&address, CONNECT_WAIT) {
                Ok(stream) => {
                    stream.set_nodelay(true).map_err(unreachable)?;
                    return Ok(stream);
                }
                Err(error) => last = error,
            }
        }
        Err(unreachable(last))
    }
}

impl fmt::Display for Endpoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "http://{}/", self.authority())
    }
}

impl FromStr for Endpoint {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let address = text.strip_prefix("http://").ok_or_else(|| format!("`{text}` is no address as in http://localhost:{MASTER_PORT}"))?;
        let (host, port) = host_and_port(address.split('/').next().unwrap_or_default())?;
        Ok(Self { host, port: port.ok_or_else(|| format!("`{text}` has no port, as in http://localhost:{MASTER_PORT}"))? })
    }
}

/// A topic at a master.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TopicAddress {
    /// The master.
    pub master: Endpoint,
    /// Full name of the topic, as in `/ravenstate`.
    pub topic: String,
}

impl FromStr for TopicAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("`{text}` is no topic's address as in ros://localhost:{MASTER_PORT}/ravenstate");
        let (address, topic) = text.strip_prefix("ros://").and_then(|rest| rest.split_once('/')).ok_or_else(wrong)?;
        let (host, port) = host_and_port(address)?;
        let topic = topic_name(&format!("/{topic}"))?;
        Ok(Self { master: Endpoint { host, port: port.unwrap_or(MASTER_PORT) }, topic })
    }
}

/// A topic's full name, the leading `/` added where it is left off.
///
/// # Errors
/// Half a sentence, if ROS does not allow the name.
pub fn topic_name(text: &str) -> Result<String, String> {
    let name = text.strip_prefix('/').unwrap_or(text);
    let word =
        |word: &str| word.starts_with(|c: char| c.is_ascii_alphabetic()) && word.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    if name.split('/').all(word) { Ok(format!("/{name}")) } else { Err(format!("`{text}` is no topic as in /ravenstate")) }
}

fn host_and_port(text: &str) -> Result<(String, Option<u16>), String> {
    let parse = |port: &str| port.parse::<u16>().ok().filter(|port| *port > 0).ok_or_else(|| format!("`{port}` in `{text}` is no port"));
    let (host, port) = match text.strip_prefix('[').and_then(|rest| rest.split_once(']')) {
        Some((host, rest)) => (host, rest.strip_prefix(':')),
        None => text.rsplit_once(':').map_or((text, None), |(host, port)| (host, Some(port))),
    };
    if host.is_empty() || host.contains(char::is_whitespace) {
        return Err(format!("`{text}` has no host"));
    }
    Ok((host.to_owned(), port.map(parse).transpose()?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn addresses_as_people_and_masters_write_them() {
        let endpoint = |text: &str| text.parse::<Endpoint>().map(|e| (e.host, e.port));
        assert_eq!(endpoint("http://robot:11311"), Ok(("robot".to_owned(), 11311)));
        assert_eq!(endpoint("http://[fe80::1]:40123/"), Ok(("fe80::1".to_owned(), 40123)));
        assert_eq!("http://[::1]:7/".parse::<Endpoint>().unwrap().to_string(), "http://[::1]:7/");
        for wrong in ["robot:11311", "http://robot", "http://:1", "http://robot:0", "http://robot:99999", "http://a b:1", ""] {
            assert!(endpoint(wrong).is_err(), "{wrong}");
        }
        let topic = "ros://[fd00::2]:11311/ravenstate".parse::<TopicAddress>().unwrap();
        assert_eq!((topic.master.host.as_str(), topic.master.authority().as_str()), ("fd00::2", "[fd00::2]:11311"));
        assert_eq!("ros://[fe80::1%eth0]/ravenstate".parse::<TopicAddress>().unwrap().master.port, 11311);
        let topic = "ros://robot/arm/measured_js".parse::<TopicAddress>().unwrap();
        assert_eq!((topic.master.port, topic.topic.as_str()), (11311, "/arm/measured_js"));
        for wrong in ["ros://robot:11311", "ros://robot:11311/", "ros://robot/a//b", "/ravenstate", "ros://robot/a b"] {
            assert!(wrong.parse::<TopicAddress>().is_err(), "{wrong}");
        }
        assert_eq!(topic_name("ravenstate").unwrap(), "/ravenstate");
    }

    proptest! {
        #[test]
        fn any_text_is_an_address_or_a_sentence(text in "(http://|ros://)?\\PC{0,40}") {
            if let Ok(endpoint) = text.parse::<Endpoint>() {
                prop_assert_eq!(endpoint.to_string().parse::<Endpoint>(), Ok(endpoint));
            }
            let _sentence = text.parse::<TopicAddress>();
        }
    }
}
