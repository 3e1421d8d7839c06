//! A ROS 1 topic as a source: its bytes as they came, its definition as the publisher sent it, and the stamp out of its header.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, PoisonError, mpsc};

use raven::Result;
use raven::log::ros1::{Definition, Extractor, HEADER_STAMPS, header_stamp};
use raven::log::{LogWriter, SchemaRef, Times};

use super::source::{Counters, Feed, Sample};
use crate::clock::SessionClock;
use crate::ros1::{Connection, Fault, Listener, Message, Receiver};

/// A publisher that always finds something new to complain of is not listened to for ever.
const SENTENCES: usize = 50;

/// A topic that is recorded.
pub struct TopicSource {
    /// Name in the recording.
    pub recorded_as: String,
    /// What it has done so far.
    pub counters: Arc<Counters>,
    /// Where its messages go.
    pub feed: Feed,
    /// The clock of its arrivals.
    pub clock: SessionClock,
    /// Where sentences for the user go.
    pub notices: mpsc::Sender<String>,
    /// What has been said already; trouble that goes on is said once.
    pub said: Mutex<BTreeSet<String>>,
}

impl TopicSource {
    fn notice(&self, sentence: String) {
        let mut said = self.said.lock().unwrap_or_else(PoisonError::into_inner);
        if said.len() < SENTENCES && said.insert(sentence.clone()) {
            // Nobody listens any more when everything ends.
            let _ended = self.notices.send(sentence);
        }
    }

    /// What finds the stamp in messages of this connection; `None` if there is none to find.
    fn extractor(&self, connection: &Connection) -> Option<Extractor> {
        let definition = Definition::parse(&connection.message_type, &connection.definition)
            .and_then(|definition| Extractor::new(&definition, &HEADER_STAMPS).map(|extractor| (definition, extractor)));
        match definition {
            Ok((definition, extractor)) => {
                let sum = raven::log::ros1::md5::md5sum(&definition).unwrap_or_default();
                if sum != connection.md5sum {
                    let (topic, publisher) = (&self.recorded_as, &connection.caller_id);
                    self.notice(format!(
                        "{topic}: {publisher} says that its definition has the sum {}, but it has {sum}; its messages may not be readable.",
                        connection.md5sum
                    ));
                }
                Some(extractor)
            }
            Err(what) => {
                let (topic, publisher) = (&self.recorded_as, &connection.caller_id);
                self.notice(format!(
                    "{topic}: the definition that {publisher} sent cannot be used: {what}; the bytes are recorded all the same."
                ));
                None
            }
        }
    }
}

/// The listener is shared with the node's threads.
pub struct Shared(pub Arc<TopicSource>);

impl Listener for Shared {
    fn connected(&self, connection: Connection) -> Receiver {
        let source = Arc::clone(&self.0);
        // What goes wrong from here on is news again.
        let failed_before = !std::mem::take(&mut *source.said.lock().unwrap_or_else(PoisonError::into_inner)).is_empty();
        if failed_before {
            source.notice(format!("{}: connected to {}.", source.recorded_as, connection.caller_id));
        }
        let extractor = source.extractor(&connection);
        let channel = Arc::new(RosChannel::new(source.recorded_as.clone(), connection));
        Box::new(move |message: Message| {
            let arrived = source.clock.stamp(message.arrival.monotonic_ns);
            let measured = match extractor.as_ref().map(|extractor| extractor.walk(&message.data)) {
                Some(Ok(stamps)) => header_stamp(stamps),
                Some(Err(_)) => {
                    source.counters.misfit();
                    None
                }
                None => None,
            };
            let measured = measured.unwrap_or(arrived);
            let Message { arrival, sequence, data } = message;
            let sample = RosSample { channel: Arc::clone(&channel), times: Times { measured, arrived }, sequence, data };
            source.feed.send(&source.counters, arrival, measured, Box::new(sample));
        })
    }

    fn failed(&self, fault: &Fault, was_connected: bool) {
        if was_connected {
            self.0.counters.interrupted();
        }
        self.0.notice(format!("{}: {fault}; trying again.", self.0.recorded_as));
    }
}

/// A connection as a channel of a log.
struct RosChannel {
    topic: String,
    message_type: String,
    definition: String,
    metadata: BTreeMap<String, String>,
}

impl RosChannel {
    fn new(recorded_as: String, connection: Connection) -> Self {
        let mut metadata = BTreeMap::from([
            ("md5sum".to_owned(), connection.md5sum),
            ("callerid".to_owned(), connection.caller_id),
            ("latching".to_owned(), u8::from(connection.latching).to_string()),
        ]);
        if connection.topic != recorded_as {
            metadata.insert("topic".to_owned(), connection.topic);
        }
        Self { topic: recorded_as, message_type: connection.message_type, definition: connection.definition, metadata }
    }
}

struct RosSample {
    channel: Arc<RosChannel>,
    times: Times,
    sequence: u32,
    data: Vec<u8>,
}

impl Sample for RosSample {
    fn bytes(&self) -> usize {
        self.data.len()
    }

    fn write(&self, log: &mut LogWriter) -> Result<()> {
        let channel = &*self.channel;
        let schema =
            SchemaRef { message_encoding: "ros1", name: &channel.message_type, encoding: "ros1msg", data: channel.definition.as_bytes() };
        let id = log.add_channel(&channel.topic, schema, &channel.metadata)?;
        log.write(id, self.times, self.sequence, &self.data)
    }
}
