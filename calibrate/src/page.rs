//! The calibration on one page: HTML without scripts or anything from elsewhere.

use nalgebra::Vector2;
use raven::plot::page::{document, grid, section, sentences as list};
use raven::plot::svg::escape;

use crate::board::Board;
use crate::calibration::{Calibration, Shot, residuals};
use crate::figures;
use crate::map::{depth_m, projection_px};
use crate::verdict::{Sentence, mean_distance_m};

const STYLE: &str = include_str!("page.css");

/// The page. `table` is the result in text.
#[must_use]
pub fn html(calibration: &Calibration, shots: &[Shot], board: &Board, table: &str, sentences: &[Sentence]) -> String {
    let distance_m = mean_distance_m(&calibration.rig, board);
    let warnings = sentences.iter().filter(|s| s.warning).count();
    let heading = match warnings {
        0 => "A calibration without warnings".to_owned(),
        1 => "A calibration with one warning".to_owned(),
        count => format!("A calibration with {count} warnings"),
    };
    let body = [
        format!("<header>\n<h1>{heading}</h1>\n</header>\n"),
        section("What it is worth", "", &list(sentences.iter().map(|s| (s.text.as_str(), s.warning)))),
        section("The numbers", "", &format!("<pre>{}</pre>", escape(table))),
        section(
            "Where the corners were, and how they were missed",
            "A pattern in the lines is something that the model lacks: a bowed board, a higher distortion, a moving board.",
            &misses(calibration),
        ),
        section(
            "How well it is known what is where",
            &format!(
                "Standard deviations from the calibration alone, of points {distance_m:.3} m away: where a camera sees a point that stands still \
                 among the boards, and how far away a point is that both cameras see. Without corners there is little to rely on."
            ),
            &maps(calibration, distance_m),
        ),
        section(
            "Boards",
            "Reprojection RMS of each: left alone (blue), right alone (orange), and together with one pose for both (grey, printed).",
            &format!("<figure>{}</figure>", figures::boards("boards", &bars(calibration, shots))),
        ),
    ]
    .concat();
    document("Calibration of two cameras", STYLE, &body)
}

fn misses(calibration: &Calibration) -> String {
    let all = residuals(&calibration.rig, &calibration.views);
    let of = |camera: usize| {
        let pixels = calibration.views.iter().flat_map(|view| view[camera].iter().map(|c| c.pixel));
        let corners: Vec<(Vector2<f64>, Vector2<f64>)> = pixels.zip(all.iter().flat_map(|both| both[camera].iter().copied())).collect();
        let name = ["left", "right"][camera];
        (format!("{name} camera"), figures::residuals(&format!("misses-{name}"), &calibration.rig.cameras[camera], &corners))
    };
    grid([of(0), of(1)])
}

fn maps(calibration: &Calibration, distance_m: f64) -> String {
    let seen = |camera: usize| {
        let name = ["left", "right"][camera];
        let (map, pinhole) = (projection_px(calibration, camera, distance_m), &calibration.rig.cameras[camera]);
        let title = format!("{name} camera, where it sees a point");
        let svg = figures::map(&format!("projection-{name}"), pinhole, &map, &title, "px", 1.0);
        (title, svg)
    };
    let title = "both cameras, depth of a point".to_owned();
    let depth = figures::map("depth", &calibration.rig.cameras[0], &depth_m(calibration, distance_m), &title, "mm", 1e3);
    grid([seen(0), seen(1), (title, depth)])
}

fn bars(calibration: &Calibration, shots: &[Shot]) -> Vec<(String, [Option<f64>; 3])> {
    let row = |(i, shot): (usize, &Shot)| {
        let together = calibration.pairs.iter().find(|(index, _)| *index == i).map(|pair| pair.1);
        let alone = |camera: usize| calibration.mono[camera].board_rms_px.get(i).copied().flatten();
        (shot.name.clone(), [alone(0), alone(1), together])
    };
    shots.iter().enumerate().map(row).filter(|(_, values)| values.iter().any(Option::is_some)).collect()
}
