//! A bag as a recording: every message byte for byte with its definition, on a topic of the same name.

use std::collections::{BTreeMap, BTreeSet, HashMap, hash_map};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use raven::log::ros1::{Definition, Extractor, HEADER_STAMPS, header_stamp};
use raven::log::{ChannelId, LogWriter, SchemaRef, Stamp, Times};
use raven::{Error, Result};

use super::bag::{BagFault, Entry, read_magic, read_record};
use super::{Imported, session};
use crate::record::summary::MISFITS;

/// What stops an import: the bag, which leaves what was read before, or the recording.
enum Stop {
    Bag(BagFault),
    Log(Error),
}

impl From<BagFault> for Stop {
    fn from(fault: BagFault) -> Self {
        Self::Bag(fault)
    }
}

impl From<Error> for Stop {
    fn from(error: Error) -> Self {
        Self::Log(error)
    }
}

/// Imports a bag under these other names of topics. What comes before damage is kept.
///
/// # Errors
/// If the file is no bag or holds no message that can be read or no topic that has another name, or the recording cannot be written.
pub fn import(path: &Path, rename: &[(String, String)], output: &Path) -> Result<Imported> {
    let file = File::open(path).map_err(|e| Error::io(path, "read", e))?;
    let mut input = BufReader::with_capacity(1 << 20, file);
    read_magic(&mut input).map_err(|fault| Error::file(path, format!("{fault}.")))?;
    let mut log = LogWriter::create(output)?;
    log.metadata("session", &session(path))?;

    let mut connections: HashMap<u32, Connection> = HashMap::new();
    let (mut imported, mut in_bag, mut topics) = (Imported::default(), BTreeSet::new(), BTreeSet::new());
    let (mut orphans, mut misfits, mut notices) = (0_u64, BTreeMap::<String, u64>::new(), BTreeSet::new());
    let mut take = |entry: Entry| -> Result<(), Stop> {
        match entry {
            Entry::Connection { id, topic, message_type, definition, metadata } => {
                if let hash_map::Entry::Vacant(place) = connections.entry(id) {
                    in_bag.insert(topic.clone());
                    let topic = rename.iter().find(|(from, _)| *from == topic).map_or(topic, |(_, to)| to.clone());
                    let schema =
                        SchemaRef { message_encoding: "ros1", name: &message_type, encoding: "ros1msg", data: definition.as_bytes() };
                    let channel = log.add_channel(&topic, schema, &metadata)?;
                    topics.insert(topic.clone());
                    let definition = Definition::parse(&message_type, &definition);
                    let stamps = definition.and_then(|definition| Extractor::new(&definition, &HEADER_STAMPS));
                    if let Err(what) = &stamps {
                        let publisher = metadata.get("callerid").map_or("its publisher", String::as_str);
                        notices.insert(format!(
                            "{topic}: the definition of {publisher} cannot be used: {what}; its messages are recorded as they came, with \
                             their arrival as the time of measurement."
                        ));
                    }
                    place.insert(Connection { channel, topic, stamps: stamps.ok() });
                }
            }
            Entry::Message { connection, time: [seconds, nanoseconds], data } => match connections.get(&connection) {
                Some(Connection { channel, topic, stamps }) => {
                    let arrived = Stamp::from_ros(seconds, nanoseconds);
                    let measured = match stamps.as_ref().map(|stamps| stamps.walk(&data)) {
                        Some(Ok(stamps)) => header_stamp(stamps),
                        Some(Err(_)) => {
                            *misfits.entry(topic.clone()).or_default() += 1;
                            None
                        }
                        None => None,
                    };
                    log.write(*channel, Times { measured: measured.unwrap_or(arrived), arrived }, 0, &data)?;
                    imported.messages += 1;
                }
                None => orphans += 1,
            },
        }
        Ok(())
    };
    let damage = loop {
        match read_record(&mut input, &mut take) {
            Ok(true) => {}
            Ok(false) => break None,
            Err(Stop::Bag(fault)) => break Some(fault),
            Err(Stop::Log(error)) => return Err(error),
        }
    };
    imported.topics = topics.into_iter().collect();
    imported.notices = notices.into_iter().collect();
    let name = path.display();
    imported.lost.extend(damage.map(|fault| format!("{name}: {fault}; what comes before is imported.")));
    imported.lost.extend((orphans > 0).then(|| format!("{name}: {orphans} messages belong to no topic of the bag, and are left out.")));
    imported.lost.extend(misfits.into_iter().map(|(topic, count)| format!("{topic}: {count} {MISFITS}.")));
    if imported.messages == 0 {
        return Err(Error::file(path, "it holds no message that can be read: there is nothing to import."));
    }
    if let Some((from, to)) = rename.iter().find(|(from, _)| !in_bag.contains(from)) {
        let (bag, topics) = (path.display(), Vec::from_iter(in_bag).join(", "));
        return Err(Error::Argument(format!("--rename {from}={to}: {bag} has no topic {from}, it has {topics}; name one of them.")));
    }
    log.finish()?;
    Ok(imported)
}

struct Connection {
    channel: ChannelId,
    /// Name in the recording.
    topic: String,
    /// Finds the header's stamp; `None` where the definition cannot be used.
    stamps: Option<Extractor>,
}
