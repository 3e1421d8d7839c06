//! The marker's colour from a recording in which it rests, without a click.
//!
//! Colours are tried by sectors of hue all around the circle. A ball that both cameras see at one place, round and of the marker's radius at
//! its distance, is the marker; its pixels in all frames, against those around it, give the ranges.

use std::io::Write;
use std::path::Path;

use image::RgbImage;
use nalgebra::Vector2;
use raven::camera::Cameras;
use raven::cli::{self, Outcome};
use raven::stats::{quantiles, robust_std};
use raven::{Error, Result, files};
use rayon::prelude::*;
use serde::Serialize;

use crate::appearance::{Appearance, SHAFT_RADIUS_M};
use crate::colour::{MarkerColour, hsv, is_between};
use crate::look::Marker;
use crate::marker::Centre;
use crate::marker_position::{Gathered, Place, at_one_place, the_only};
use crate::{Colour, batches};

/// Width of a sector and from one to the next [deg]: every colour is well within one of them.
const SECTOR_DEG: f64 = 60.0;
const NEXT_DEG: usize = 20;
/// Pairs of frames that are looked at: a few seconds.
const PAIRS: usize = 60;
/// A place seen in a smaller part of the pairs is not at rest.
const LEAST_SHARE: f64 = 0.5;
/// Part of the radius whose pixels are all marker.
const INNER: f64 = 0.7;
/// The surroundings that count as background, in radii.
const AROUND: [f64; 2] = [1.6, 4.0];
/// Hues this many standard deviations from the middle are kept, and at least and at most so many degrees: light is never quite even.
const SIGMAS: f64 = 4.0;
const HALF_WIDTH_DEG: [f64; 2] = [15.0, 45.0];
/// Of the marker's pixels this part is more, and of the background's as large a part less, than the limits are set between.
const TAIL: f64 = 0.02;
/// Least saturation and value of any marker: below, hue is noise.
const LEAST_SATURATION: f64 = 0.2;
const LEAST_VALUE: f64 = 0.08;

/// A colour and what it rests on.
#[derive(Debug, Clone, Serialize)]
pub struct Learned {
    /// From and to on the circle [deg].
    pub hue_deg: [f64; 2],
    /// Least saturation, 0 to 1.
    pub min_saturation: f64,
    /// Least value, 0 to 1.
    pub min_value: f64,
    /// Where the marker is, before the left camera [m].
    pub marker_left_m: [f64; 3],
    /// Pairs of frames in which it was seen with this colour.
    pub pairs_seen: usize,
    /// Pairs of frames looked at.
    pub pairs: usize,
    /// Part of the surroundings, out to four radii, that has the colour as well.
    pub share_around: f64,
}

/// Runs `raven-track colour`.
///
/// # Errors
/// If nothing or more than one thing in view can be the marker.
pub fn run(args: &Colour, out: &mut dyn Write) -> Result<Outcome> {
    files::apart([&args.log, &args.cameras], &[("--json", args.json.as_deref())])?;
    let learned = learn(&args.log, &Cameras::read(&args.cameras)?, args.size.marker_radius_m)?;
    let Learned { hue_deg: hue_deg @ [from, to], min_saturation, min_value, marker_left_m: [x, y, z], pairs_seen, pairs, share_around } =
        &learned;
    let shown = |share: f64| (100.0 * share).round() / 100.0;
    let copied = Appearance {
        hue: *hue_deg,
        min_saturation: shown(*min_saturation),
        min_value: shown(*min_value),
        size: args.size,
        shaft_radius_m: SHAFT_RADIUS_M,
    };
    let text = format!(
        "colour              hue {from:.0} to {to:.0} deg, saturation at least {min_saturation:.2}, value at least {min_value:.2}\n\
         marker              ({:.1}, {:.1}, {:.1}) mm before the left camera, seen in {pairs_seen} of {pairs} pairs of frames\n\
         around it           {:.2} % of the pixels have this colour\n\
         track with          {}\n",
        1e3 * x,
        1e3 * y,
        1e3 * z,
        100.0 * share_around,
        copied.options()
    );
    cli::results(out, &text, args.json.as_deref(), &learned)?;
    Ok(Outcome::Done)
}

/// Learns the colour of a ball of a radius [m] that rests before the cameras.
///
/// # Errors
/// As [`run`], or if the log cannot be read.
pub fn learn(log: &Path, cameras: &Cameras, radius_m: f64) -> Result<Learned> {
    let marker = |colour| Marker { colour, radius_m, shaft_radius_m: 0.0, centre: Centre::Contour };
    let sector = |from: usize| MarkerColour { hue_deg: [from as f64, (from as f64 + SECTOR_DEG) % 360.0], ..MarkerColour::default() };
    let mut sectors: Vec<_> = (0..360).step_by(NEXT_DEG).map(|from| (marker(sector(from)), Gathered::default())).collect();
    // Each time that the pairs are looked at they are decoded again: all of them at once would take most of a gigabyte at 1920 x 1080.
    let pairs = batches::for_first_pairs(log, cameras, PAIRS, |[left, right]| {
        sectors.par_iter_mut().for_each(|(marker, gathered)| gathered.add(cameras, marker, [&left.image, &right.image]));
    })?;
    if pairs == 0 {
        return Err(Error::file(
            log,
            "no pair of frames of both cameras could be decoded; check the recording with `raven-capture check`.",
        ));
    }
    let often = |place: &Place| place.frames as f64 >= LEAST_SHARE * pairs as f64;
    let seen: Vec<Place> = sectors.iter().flat_map(|(_, gathered)| gathered.places()).filter(often).collect();
    let none_rests = || {
        format!(
            "no coloured ball of {:.1} mm radius rests in view of both cameras in half of {} pairs of frames. Check --marker-radius and the \
             cameras file, and that the marker is lit, in view and at rest.",
            1e3 * radius_m,
            pairs
        )
    };
    let place = the_only(log, &distinct(seen), none_rests)?;
    let Some((colour, share_around)) = colour_at(log, cameras, &place, radius_m)? else {
        return Err(Error::file(log, "the marker is too small in the images to tell its colour; move the cameras nearer."));
    };
    let mut gathered = Gathered::default();
    batches::for_first_pairs(log, cameras, PAIRS, |[left, right]| {
        gathered.add(cameras, &marker(colour), [&left.image, &right.image]);
    })?;
    let pairs_seen = gathered.places().first().map_or(0, |place| place.frames);
    // A ball that passes through a place has its colour there no longer.
    if (pairs_seen as f64) < LEAST_SHARE * pairs as f64 {
        return Err(Error::file(log, none_rests()));
    }
    Ok(Learned {
        hue_deg: colour.hue_deg,
        min_saturation: colour.min_saturation,
        min_value: colour.min_value,
        marker_left_m: place.point_left.into(),
        pairs_seen,
        pairs,
        share_around,
    })
}

/// The places that the sectors agree on, the most seen first.
fn distinct(mut seen: Vec<Place>) -> Vec<Place> {
    seen.sort_by_key(|place| std::cmp::Reverse(place.frames));
    let mut places: Vec<Place> = Vec::new();
    for place in seen {
        let near = |other: &Place| at_one_place(&other.point_left, &place.point_left);
        if !places.iter().any(near) {
            places.push(place);
        }
    }
    places
}

/// Hue [deg], saturation and value of a pixel.
type Hsv = [f64; 3];

/// The colour of a place, and the part of its surroundings that has it; `None` if the marker has no pixels there.
fn colour_at(log: &Path, cameras: &Cameras, place: &Place, radius_m: f64) -> Result<Option<(MarkerColour, f64)>> {
    let Some(centres) = cameras.project(&place.point_left) else { return Ok(None) };
    let right = (cameras.right_from_left * nalgebra::Point3::from(place.point_left)).z;
    let radii = [cameras.left.fx * radius_m / place.point_left.z, cameras.right.fx * radius_m / right];
    let (mut inner, mut around) = (Vec::new(), Vec::new());
    batches::for_first_pairs(log, cameras, PAIRS, |pair| {
        for ((frame, centre), radius_px) in pair.iter().zip(&centres).zip(radii) {
            inner.extend(ring(&frame.image, centre, [0.0, INNER * radius_px]));
            around.extend(ring(&frame.image, centre, AROUND.map(|radii| radii * radius_px)));
        }
    })?;
    let Some(colour) = ranges(&inner, &around) else { return Ok(None) };
    let has = |&&[hue, saturation, value]: &&Hsv| {
        is_between(hue, colour.hue_deg) && saturation >= colour.min_saturation && value >= colour.min_value
    };
    Ok(Some((colour, around.iter().filter(has).count() as f64 / around.len().max(1) as f64)))
}

/// Pixels between two distances from a centre [px].
fn ring<'i>(image: &'i RgbImage, centre: &Vector2<f64>, [from, to]: [f64; 2]) -> impl Iterator<Item = Hsv> + 'i {
    let centre = *centre;
    let range = |middle: f64, size: u32| ((middle - to).floor().max(0.0) as u32)..((middle + to).ceil().max(0.0) as u32 + 1).min(size);
    let columns = range(centre.x, image.width());
    range(centre.y, image.height()).flat_map(move |y| columns.clone().map(move |x| (x, y))).filter_map(move |(x, y)| {
        let distance = (Vector2::new(f64::from(x), f64::from(y)) - centre).norm();
        (from..=to).contains(&distance).then(|| {
            let [hue, saturation, value] = hsv(*image.get_pixel(x, y)).map(f64::from);
            [2.0 * hue, saturation / 255.0, value / 255.0]
        })
    })
}

/// Ranges that hold the marker's pixels and as few of those around it as that allows.
fn ranges(marker: &[Hsv], around: &[Hsv]) -> Option<MarkerColour> {
    let (sin, cos) = marker.iter().fold((0.0, 0.0), |(sin, cos), [hue, saturation, _]| {
        let angle = hue.to_radians();
        (sin + saturation * angle.sin(), cos + saturation * angle.cos())
    });
    let middle = f64::atan2(sin, cos).to_degrees();
    let off: Vec<f64> = marker.iter().map(|[hue, ..]| (hue - middle + 540.0).rem_euclid(360.0) - 180.0).collect();
    let half = (SIGMAS * robust_std(&off)?).clamp(HALF_WIDTH_DEG[0], HALF_WIDTH_DEG[1]);
    let hue_deg = [middle - half, middle + half].map(|hue| hue.round().rem_euclid(360.0));
    let alike: Vec<&Hsv> = around.iter().filter(|[hue, ..]| is_between(*hue, hue_deg)).collect();
    // Between what nearly all of the marker has and what hardly any background of its hue has, where there is room.
    let least = |of: usize, lowest: f64| -> Option<f64> {
        let [low] = quantiles(&marker.iter().map(|p| p[of]).collect::<Vec<f64>>(), [TAIL])?;
        let background = quantiles(&alike.iter().map(|p| p[of]).collect::<Vec<f64>>(), [1.0 - TAIL]).map_or(0.0, |[high]| high);
        let limit = if background < low { 0.5 * (background + low) } else { 0.8 * low };
        Some(limit.max(lowest).min(low.max(lowest)))
    };
    // Motion and shade darken a marker that a recording at rest shows in full light: half its value has to do.
    let [dark] = quantiles(&marker.iter().map(|p| p[2]).collect::<Vec<f64>>(), [TAIL])?;
    Some(MarkerColour { hue_deg, min_saturation: least(1, LEAST_SATURATION)?, min_value: (0.5 * dark).max(LEAST_VALUE) })
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn a_red_marker_before_skin_gets_a_range_over_zero_that_leaves_the_skin_out() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut pixels = |hue: [f64; 2], saturation: [f64; 2]| -> Vec<Hsv> {
            let mut between = |[from, to]: [f64; 2]| rng.random_range(from..to);
            (0..2000).map(|_| [between(hue).rem_euclid(360.0), between(saturation), between([0.5, 0.9])]).collect()
        };
        let (marker, skin) = (pixels([-8.0, 6.0], [0.75, 0.95]), pixels([5.0, 30.0], [0.2, 0.5]));
        let colour = ranges(&marker, &skin).unwrap();
        let [from, to] = colour.hue_deg;
        assert!(from > 330.0 && to < 30.0, "{from} {to}");
        assert!((0.5..0.75).contains(&colour.min_saturation), "{}", colour.min_saturation);
        assert!((0.2..0.3).contains(&colour.min_value), "{}", colour.min_value);
    }

    #[test]
    fn a_background_of_the_same_saturation_leaves_the_marker_in() {
        let marker = vec![[120.0, 0.6, 0.5]; 500];
        let colour = ranges(&marker, &vec![[120.0, 0.9, 0.5]; 500]).unwrap();
        assert!(colour.min_saturation < 0.6 && colour.hue_deg == [105.0, 135.0]);
        assert!(ranges(&[], &[]).is_none());
    }
}
