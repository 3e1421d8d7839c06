//! What stands out, in words: "68 % of the elbow's excess error sits within 150 ms of reversals, which are 9 % of the time (p < 0.001)."

use super::bins::label;
use super::{Channel, Kind, LEVEL, Place};
use crate::phase::REVERSAL_S;

/// Sentences about one channel, at most.
const PER_CHANNEL: usize = 2;
/// Sentences altogether, at most.
const ALL: usize = 8;
/// What holds less of the excess than this is not worth a sentence.
const SHARE_MIN: f64 = 0.1;
/// A second sentence about a channel has to say at least this share of what the first says.
const WORTH: f64 = 0.5;

/// The most telling parts that stand out; neighbours of one kind are taken together. One sentence says so if there is none; without
/// channels there is nothing to say.
pub(super) fn sentences(channels: &[Channel], places: &[Place]) -> Vec<String> {
    let mut told: Vec<(f64, String)> = Vec::new();
    let mut of_tip: Vec<Place> = Vec::new();
    for channel in channels {
        let mut merged = merged(channel, places);
        // A band of frequencies says least about a cause: it is named where nothing else is.
        if merged.iter().any(|place| place.kind != Kind::Frequency) {
            merged.retain(|place| place.kind != Kind::Frequency);
        }
        merged.sort_by(|a, b| telling(b).total_cmp(&telling(a)));
        merged.retain(|place| place.share_of_excess >= SHARE_MIN);
        let enough = merged.first().map_or(0.0, |best| WORTH * telling(best));
        let mut kinds = Vec::new();
        for place in merged.iter().filter(|place| telling(place) >= enough) {
            // What one image shows the other shows too.
            let repeated = of_tip.iter().any(|p| p.kind == place.kind && p.label == place.label && p.horizon_s == place.horizon_s);
            if kinds.len() < PER_CHANNEL && !kinds.contains(&place.kind) && !repeated {
                kinds.push(place.kind);
                of_tip.extend(place.joint.is_none().then(|| place.clone()));
                told.push((telling(place), sentence(place)));
            }
        }
    }
    if channels.is_empty() {
        return Vec::new();
    }
    if told.is_empty() {
        return vec![format!("No part of the motion stands out (family-wise level {LEVEL}).")];
    }
    told.sort_by(|a, b| b.0.total_cmp(&a.0));
    told.into_iter().take(ALL).map(|(_, sentence)| sentence).collect()
}

/// How far the shares of error and time are apart: what the part adds to the information between them [nat].
pub(super) fn telling(place: &Place) -> f64 {
    place.share_of_excess * (place.share_of_excess / place.share_of_time.max(f64::MIN_POSITIVE)).ln()
}

fn merged(channel: &Channel, places: &[Place]) -> Vec<Place> {
    let mut merged: Vec<Place> = Vec::new();
    for place in places.iter().filter(|p| {
        let own = channel.horizon_s.is_none() || p.horizon_s == channel.horizon_s;
        own && p.channel == channel.name && p.joint == channel.joint && p.stands_out()
    }) {
        let neighbour = merged.last_mut().filter(|last| {
            let touching = last.range.zip(place.range).is_some_and(|(a, b)| a[1] == b[0]);
            last.kind == place.kind && last.horizon_s == place.horizon_s && touching
        });
        match neighbour.and_then(|last| Some((last.range?[0], place.range?[1], last))) {
            Some((from, to, last)) => {
                let time = last.share_of_time + place.share_of_time;
                last.rms = ((last.rms.powi(2) * last.share_of_time + place.rms.powi(2) * place.share_of_time) / time).sqrt();
                last.share_of_time = time;
                last.share_of_excess += place.share_of_excess;
                last.p = last.p.max(place.p);
                last.range = Some([from, to]);
                last.label = label(channel, place.kind, [from, to]);
            }
            None => merged.push(place.clone()),
        }
    }
    merged
}

fn sentence(place: &Place) -> String {
    let what = match &place.joint {
        Some(joint) if place.channel == *joint => format!("the {joint}'s excess error"),
        Some(joint) => {
            let what = place.channel.strip_prefix(joint.as_str()).unwrap_or(&place.channel).trim();
            format!("the {joint}'s excess {what} error")
        }
        None => format!("the excess error of {}", place.channel),
    };
    let over =
        place.horizon_s.map_or_else(String::new, |h| if h < 1.0 { format!(" over {:.0} ms", h * 1e3) } else { format!(" over {h} s") });
    let p = if place.p < 1e-3 { "p < 0.001".to_owned() } else { format!("p = {:.3}", place.p) };
    let (excess, time) = (percent(place.share_of_excess), percent(place.share_of_time));
    let of = if place.kind == Kind::Frequency { "bandwidth" } else { "time" };
    format!("{excess} of {what}{over} sits {}, which {} {time} of the {of} ({p}).", part(place), verb(place))
}

fn verb(place: &Place) -> &'static str {
    match place.kind {
        Kind::Speed | Kind::Position => "are",
        Kind::Phase if ["reversal", "hold"].contains(&place.label.as_str()) => "are",
        _ => "is",
    }
}

fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}

fn part(place: &Place) -> String {
    let label = &place.label;
    match place.kind {
        Kind::Phase => match label.as_str() {
            "reversal" => format!("within {:.0} ms of reversals", REVERSAL_S * 1e3),
            "hold" => "in holds".to_owned(),
            "acceleration" => "where the speed changes".to_owned(),
            _ => "at cruise".to_owned(),
        },
        Kind::Speed => format!("at speeds of {label}"),
        Kind::Load => format!("where gravity pulls with {label}"),
        Kind::Position => format!("at positions of {label}"),
        Kind::Capstan => format!("with the capstan at {label} of its turn"),
        Kind::Time => format!("in {label} of the recording"),
        Kind::Image => format!("in the {label} of the left image"),
        Kind::Frequency => format!("at {label}"),
    }
}
