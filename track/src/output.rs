//! The tracked log: what came from the robot byte for byte, the tip, and the files it was made with.

use std::collections::BTreeMap;
use std::path::Path;

use raven::Result;
use raven::camera::Cameras;
use raven::log::{CAMERAS_FILE, Item, LogWriter, ROBOT_FILE, Side, TipObservation, TipStatus, Walker, topics};

use crate::tracker::{Record, Sighting};

/// Name of the metadata record about the tips.
const TIP: &str = "tip";

/// What goes into a tracked log beside what the recording has.
#[derive(Debug, Clone, Copy)]
pub struct Contents<'a> {
    /// Tip observations in the order of time.
    pub tips: &'a [TipObservation],
    /// What was seen in the frames of each camera.
    pub records: &'a [Vec<Record>; 2],
    /// What is said about the tips beside each one's covariance.
    pub metadata: &'a BTreeMap<String, String>,
    /// Text of the robot file.
    pub robot: &'a str,
    /// Text of the cameras file.
    pub cameras_text: &'a str,
    /// What it says.
    pub cameras: &'a Cameras,
}

/// Writes `output` from `recording`: every topic but images and what tracking wrote earlier; metadata and attachments; the cameras,
/// tips and drawings.
///
/// # Errors
/// If the recording cannot be read or the disk is full; `output` is then left as it was.
pub fn write(recording: &Path, output: &Path, contents: Contents<'_>) -> Result<()> {
    let mut log = LogWriter::computed(output)?;
    if let Some(first) = contents.tips.first() {
        Side::BOTH.into_iter().try_for_each(|side| log.camera_info(side, first.stamp, contents.cameras))?;
    }
    let mut channels = std::collections::HashMap::new();
    let mut tips = contents.tips.iter().peekable();
    let mut walker = Walker::open(recording)?;
    walker.run(|item| {
        match item {
            Item::Channel(channel) if is_kept(&channel.topic) => {
                channels.insert(channel.id, log.copy_channel(channel)?);
            }
            Item::Message(message) => {
                while let Some(tip) = tips.next_if(|tip| tip.stamp <= message.log_time) {
                    log.tip(tip)?;
                }
                if let Some(&id) = channels.get(&message.channel.id) {
                    log.copy_message(id, &message)?;
                }
            }
            Item::Attachment(attachment) if ![ROBOT_FILE, CAMERAS_FILE].contains(&attachment.name.as_str()) => {
                log.copy_attachment(&attachment)?
            }
            Item::Metadata(name, pairs) if name != TIP => log.metadata(&name, &pairs)?,
            Item::Start { .. } | Item::Channel(_) | Item::Attachment(_) | Item::Metadata(..) => {}
        }
        Ok(())
    })?;
    walker.require_whole()?;
    for tip in tips {
        log.tip(tip)?;
    }
    draw(&mut log, contents.records)?;
    log.metadata(TIP, contents.metadata)?;
    log.made_with(contents.robot, Some(contents.cameras_text.as_bytes()))?;
    log.finish()
}

fn is_kept(topic: &str) -> bool {
    topics::camera_of(topic).is_none() && topic != topics::TIP && !made_of_cameras(topic)
}

/// Whether a topic follows from the cameras file and the images.
fn made_of_cameras(topic: &str) -> bool {
    Side::BOTH.into_iter().any(|side| [topics::camera_info(side), topics::annotations(side)].contains(&topic))
}

/// Circles around the marker, with the stamps of the images.
fn draw(log: &mut LogWriter, records: &[Vec<Record>; 2]) -> Result<()> {
    for (side, records) in Side::BOTH.into_iter().zip(records) {
        for record in records {
            let marker = match record.sighting {
                Sighting::Seen(c) => Some((c, TipStatus::Seen)),
                Sighting::Rejected(c) => Some((c, TipStatus::Jumped)),
                Sighting::Hidden => None,
            };
            let circle = marker.map(|(c, status)| (c.centre.into(), status, 2.0 * c.radius_px));
            log.annotations(side, record.stamp, circle, &[])?;
        }
    }
    Ok(())
}
