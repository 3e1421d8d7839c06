//! What can go wrong with another program on the network, in words.

use std::io;

/// A remote program could not be reached or did not answer as it must.
#[derive(Debug, thiserror::Error)]
pub enum Fault {
    /// Nobody answers at the address.
    #[error("cannot reach {peer}: {source}")]
    Unreachable {
        /// Who, with the address.
        peer: String,
        /// What the operating system says.
        source: io::Error,
    },
    /// The connection ended or timed out.
    #[error("lost {peer}: {source}")]
    Lost {
        /// Who, with the address.
        peer: String,
        /// What the operating system says.
        source: io::Error,
    },
    /// What came is not what the protocol says.
    #[error("{peer} sent what is not in its protocol: {what}")]
    Malformed {
        /// Who, with the address.
        peer: String,
        /// Half a sentence with the field and the value.
        what: String,
    },
    /// The other side understood and said no.
    #[error("{peer} refuses {request}: {reason}")]
    Refused {
        /// Who, with the address.
        peer: String,
        /// What it was asked for.
        request: String,
        /// Its own words.
        reason: String,
    },
}

impl From<Fault> for raven::Error {
    fn from(fault: Fault) -> Self {
        Self::Network(format!("{fault}."))
    }
}

/// Why a message could not be read: the connection, or what came over it.
#[derive(Debug)]
pub enum ReadFault {
    /// The connection ended or timed out.
    Io(io::Error),
    /// Half a sentence with the field and the value.
    Malformed(String),
}

impl ReadFault {
    /// The fault of a named peer.
    #[must_use]
    pub fn of(self, peer: &str) -> Fault {
        let peer = peer.to_owned();
        match self {
            Self::Io(source) if source.kind() == io::ErrorKind::UnexpectedEof => {
                Fault::Lost { peer, source: io::Error::new(source.kind(), "it closed the connection") }
            }
            Self::Io(source) => Fault::Lost { peer, source },
            Self::Malformed(what) => Fault::Malformed { peer, what },
        }
    }
}

impl From<io::Error> for ReadFault {
    fn from(error: io::Error) -> Self {
        Self::Io(error)
    }
}
