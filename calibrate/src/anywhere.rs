//! Cameras of which nobody knows where they are: the marker is looked for anywhere in both images while the robot moves.
//!
//! 1. Balls of the marker's colour and size that both cameras see at one place, in a few hundred pairs of frames, and the pose that agrees
//!    with the motors ([`crate::align`]).
//! 2. With that pose the marker is followed through all frames as in tracking, which leaves out what is not the marker and brings both
//!    cameras to one time.
//! 3. The pose from these sightings, which are ten times as exact.
//!
//! Kinematics of the robot file that are off turn this pose by degrees. It is where [`crate::from_motion`] begins, with nothing known of
//! the rotation.

use raven::camera::Cameras;
use raven::log::{Recording, Side};
use raven::robot::Robot;
use raven::{Error, Result, cli};
use raven_track::batches;
use raven_track::look::Marker;
use raven_track::marker_position::candidates;
use raven_track::predict::Predictor;

use crate::align::{Aligned, Glimpse, Unaligned, align};
use crate::from_motion;
use crate::moving::Moving;

/// Standard deviation of a rotation [rad] and of a place [m] of which nothing is known but what the motion itself says: the alignment is
/// good to a tenth of it.
pub const ROTATION_STD_RAD: f64 = 0.5;
/// See [`ROTATION_STD_RAD`].
pub const TRANSLATION_STD_M: f64 = 0.1;
/// Pairs of frames of one recording in which the whole images are searched.
const PAIRS: usize = 500;
/// How fast the marker moves in an image at most [px/s]: 0.1 m/s at 0.3 m. Rays of frames that are not taken at one time miss each other by
/// as much.
const SPEED_PX_S: f64 = 200.0;

/// Recordings with the marker followed, by cameras whose pose was found from them.
pub struct Found {
    /// The recordings.
    pub moving: Vec<Moving>,
    /// `x_0 = R x_left + t`, as well as the robot file's kinematics allow.
    pub aligned: Aligned,
}

/// Finds the pose of the left camera from moving recordings.
///
/// # Errors
/// If a recording lacks motors or a camera, or the motion does not tell the pose: why, and what to do.
pub fn find(recordings: Vec<Recording>, robot: &Robot, cameras: &Cameras, marker: Marker) -> Result<Found> {
    let mut glimpses = Vec::new();
    for recording in &recordings {
        glimpses.extend(look(recording, robot, cameras, &marker)?);
    }
    let rough = align(&glimpses).map_err(|why| sentence(recordings.iter(), &why, glimpses.len()))?;
    let mut cameras = Cameras { latency_s: rough.latency_s, right_minus_left_s: 0.0, ..cameras.clone() };
    cameras.base_from_left = Some(rough.base_from_left);
    let follow = |recording| Moving::follow(recording, robot, &cameras, marker);
    let moving: Vec<Moving> = recordings.into_iter().map(follow).collect::<Result<_>>()?;
    let aligned = realign(robot, &cameras, &moving)?;
    Ok(Found { moving, aligned })
}

/// The pose from recordings in which the marker was followed.
///
/// # Errors
/// As [`find`].
pub fn realign(robot: &Robot, cameras: &Cameras, moving: &[Moving]) -> Result<Aligned> {
    let right_minus_left_s = from_motion::offset(cameras, moving).right_minus_left_s;
    let mut glimpses = Vec::new();
    for one in moving {
        glimpses.extend(one.glimpses(robot, cameras, right_minus_left_s)?);
    }
    align(&glimpses).map_err(|why| sentence(moving.iter().map(|one| &one.recording), &why, glimpses.len()))
}

/// What both cameras saw of the marker's colour and size in pairs of frames all over a recording.
fn look(recording: &Recording, robot: &Robot, cameras: &Cameras, marker: &Marker) -> Result<Vec<Glimpse>> {
    let predictor = Predictor::new(recording, robot, 0.0)?;
    let frames = recording.require_images(Side::Left)?.1.max(recording.require_images(Side::Right)?.1) as usize;
    let pair_within_s = batches::pair_within_s(recording);
    let stride = frames.div_ceil(PAIRS);
    let bar = cli::progress(frames as u64, "looking for the marker");
    let (mut glimpses, mut pairs) = (Vec::new(), 0);
    batches::for_each(&recording.path, cameras, pair_within_s, |frames| {
        let [Some(left), Some(right)] = frames else { return };
        bar.inc(1);
        pairs += 1;
        if (pairs - 1) % stride != 0 {
            return;
        }
        let slack_px = SPEED_PX_S * right.stamp.seconds_since(left.stamp).abs();
        let seen = candidates(cameras, marker, [&left.image, &right.image], slack_px).into_iter().map(|(_, point)| point).collect();
        glimpses.extend(Glimpse::new(seen, |latency_s| predictor.tip(left.stamp.plus_seconds(-latency_s))));
    })?;
    bar.finish_and_clear();
    Ok(glimpses)
}

fn sentence<'r>(mut recordings: impl Iterator<Item = &'r Recording>, why: &Unaligned, all: usize) -> Error {
    let text = match why {
        Unaligned::Few(count) => format!(
            "both cameras saw a ball of the marker's colour and size in {count} pairs of frames while the motors were recorded, too few to tell \
             where the cameras are. Check --hue, --min-saturation, --min-value and --marker-radius, and that the marker is in both images."
        ),
        Unaligned::Line(extents) => {
            let [a, b, c] = extents.map(|extent| 1e3 * extent);
            format!(
                "the motion hardly leaves a line, about which it does not tell how the cameras are turned: the tip moves by {a:.1}, {b:.1} and \
                 {c:.1} mm (root mean square) along three axes at right angles. Move all three joints, or give the mount's rotation with \
                 --rotation."
            )
        }
        Unaligned::NoPose(count) => format!(
            "of {all} times at which both cameras saw a ball of the marker's colour and size, no pose of the cameras puts more than {count} where \
             the motors have the tip. Check that the marker is what was seen, the cameras file, and the robot file."
        ),
    };
    match (recordings.next(), recordings.next()) {
        (Some(only), None) => Error::file(&only.path, text),
        _ => Error::Data(text),
    }
}
