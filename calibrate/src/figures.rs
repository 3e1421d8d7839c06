//! The drawings of the calibration's page: where corners were and how far each was missed, bars per board, maps over the image.

use std::fmt::Write as _;

use nalgebra::Vector2;
use raven::camera::Pinhole;
use raven::plot::svg::{figure, frame, line, rectangle, text};

use crate::map::Map;

/// Width of a drawing of an image [px of the page].
const WIDTH: f64 = 440.0;
/// Room above a drawing, and for the legend below it.
const HEAD: f64 = 4.0;
const FOOT: f64 = 26.0;

/// Where the corners were, and how far each was missed, drawn larger by a round factor.
#[must_use]
pub fn residuals(id: &str, camera: &Pinhole, corners: &[(Vector2<f64>, Vector2<f64>)]) -> String {
    let scale = WIDTH / f64::from(camera.width);
    let height = scale * f64::from(camera.height);
    let rms = (corners.iter().map(|(_, r)| r.norm_squared()).sum::<f64>() / corners.len().max(1) as f64).sqrt();
    let larger = magnification(rms);
    let mut inside = rectangle([0.0, HEAD, WIDTH, height], "image");
    for (pixel, residual) in corners {
        let at = (pixel.add_scalar(0.5)) * scale;
        // A wild corner's arrow stays in the drawing.
        let tip = at + (residual * larger * scale).cap_magnitude(0.15 * WIDTH);
        inside += &line([at.x, at.y + HEAD, tip.x, tip.y + HEAD], "arrow");
        let _ = write!(inside, "<circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"1.1\" class=\"dot\"/>", at.x, at.y + HEAD);
    }
    inside +=
        &text(0.0, height + HEAD + 18.0, "s", &format!("{} corners, RMS {rms:.3} px, misses {larger:.0} times as long", corners.len()));
    let description = format!("Each of {} corners with a line to where the cameras say it is, {larger:.0} times as long.", corners.len());
    frame(id, [WIDTH, HEAD + height + FOOT], "Residuals", &description, &inside)
}

/// A factor of 1, 2 or 5 times a power of ten that makes a residual of this size about a fiftieth of an image.
fn magnification(rms_px: f64) -> f64 {
    let wanted = (12.0 / rms_px.max(1e-6)).clamp(1.0, 1e6);
    let power = 10_f64.powf(wanted.log10().floor());
    [5.0, 2.0, 1.0].into_iter().map(|m| m * power).find(|f| *f <= wanted).unwrap_or(power)
}

/// A map over an image: the darker, the larger; a cross where nothing is known.
#[must_use]
pub fn map(id: &str, camera: &Pinhole, map: &Map, title: &str, unit: &str, scale_to_unit: f64) -> String {
    let height = WIDTH * f64::from(camera.height) / f64::from(camera.width);
    let (across, down) = map.cells;
    let (low, high) = map.range().unwrap_or((0.0, 0.0));
    let (width, tall) = (WIDTH / across as f64, height / down as f64);
    let mut inside = rectangle([0.0, HEAD, WIDTH, height], "image");
    for (k, value) in map.values.iter().enumerate() {
        let (x, y) = ((k % across) as f64 * width, HEAD + (k / across) as f64 * tall);
        match value {
            // From the smallest to the largest in equal ratios: edges are often ten times worse than the middle.
            Some(value) => {
                let part = if high > low { (value / low).ln() / (high / low).ln() } else { 0.0 };
                let _ = write!(
                    inside,
                    "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.2}\" height=\"{tall:.2}\" class=\"heat\" fill-opacity=\"{:.2}\"/>",
                    0.08 + 0.92 * part
                );
            }
            None => inside += &line([x, y, x + width, y + tall], "axis"),
        }
    }
    let [low, high, middle] = [low, high, map.median().unwrap_or(f64::NAN)].map(|v| figure(v * scale_to_unit));
    let legend = format!("{low} {unit} (pale) to {high} {unit} (dark), half of the map below {middle} {unit}");
    inside += &text(0.0, height + HEAD + 18.0, "s", &legend);
    frame(id, [WIDTH, HEAD + height + FOOT], title, &legend, &inside)
}

/// Bars of the RMS of each board: left alone, right alone, both together.
#[must_use]
pub fn boards(id: &str, rows: &[(String, [Option<f64>; 3])]) -> String {
    const ROW: f64 = 30.0;
    const LABEL: f64 = 170.0;
    const FULL: f64 = 640.0;
    let most = rows.iter().flat_map(|(_, v)| v.iter().flatten().copied()).fold(1e-12, f64::max);
    let mut inside = String::new();
    for (i, (name, values)) in rows.iter().enumerate() {
        let y = i as f64 * ROW;
        inside += &text(LABEL - 8.0, y + 18.0, "e", name);
        for (k, value) in values.iter().enumerate() {
            let Some(value) = value else { continue };
            inside += &rectangle([LABEL, y + 3.0 + 8.0 * k as f64, FULL * value / most, 7.0], ["left", "right", "both"][k]);
        }
        let last = values[2].or(values[0]).or(values[1]);
        let longest = values.iter().flatten().copied().fold(0.0, f64::max);
        inside += &text(LABEL + FULL * longest / most + 6.0, y + 18.0, "s", &last.map_or_else(String::new, |v| format!("{v:.3} px")));
    }
    let size = [LABEL + FULL + 90.0, ROW * rows.len() as f64 + 4.0];
    frame(id, size, "RMS of each board", "Reprojection RMS per board: left alone, right alone, both together.", &inside)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrows_are_magnified_by_round_numbers() {
        assert_eq!([0.2, 0.07, 3.0, 100.0].map(magnification), [50.0, 100.0, 2.0, 1.0]);
        assert!(magnification(0.0).is_finite());
    }

    #[test]
    fn a_map_shows_what_is_known() {
        let camera = Pinhole { width: 64, height: 48, fx: 60.0, fy: 60.0, cx: 32.0, cy: 24.0, distortion: [0.0; 5] };
        let values = vec![Some(0.001), Some(0.002), None, Some(0.004)];
        let svg = map("m", &camera, &Map { cells: (2, 2), values }, "depth", "mm", 1e3);
        assert_eq!(svg.matches("class=\"heat\"").count(), 3);
        assert!(svg.contains("1.00 mm (pale) to 4.00 mm (dark), half of the map below 2.00 mm"), "{svg}");
        let unknown = map("m", &camera, &Map { cells: (1, 1), values: vec![None] }, "depth", "mm", 1e3);
        assert!(!unknown.contains("NaN"), "{unknown}");
    }
}
