//! One frame's region of interest as a picture, with what was found in it drawn over.

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder, RgbImage, imageops};
use raven::log::{CameraFrame, Part};
use raven::plot::page::png_uri;
use raven::plot::svg::{frame, line, rectangle};

use crate::colour::MarkerColour;
use crate::look::BALL_REGION_PX;
use crate::marker::Region;
use crate::outline::outlines;
use crate::tracker::{Looked, Sighting};

/// Most pixels of a tile either way: larger regions, as after a long time without sight, are shown smaller.
const SIDE: u32 = 200;
/// Outlines drawn, and pixels of all of them: speckle of the marker's colour has no end.
const OUTLINES: usize = 60;
const PIXELS: usize = 4000;
/// Half the length of a cross [px of a tile as wide as the least region in which balls are searched].
const CROSS: f64 = 4.0;

/// A region of a frame, kept to be shown.
#[derive(Debug, Clone)]
pub struct Tile {
    /// Since the first frame of the recording [s].
    pub time_s: f64,
    /// What became of the frame.
    pub looked: Looked,
    picture: RgbImage,
    /// What the picture shows, in pixels of the frame.
    region: Region,
    /// `(u, v)` of the outlines of all that has the marker's colour [px].
    outlines: Vec<Vec<[f64; 2]>>,
    expected_px: [f64; 2],
}

impl Tile {
    /// The region of a frame that was searched; `None` if it lies outside the image or the frame was not searched.
    #[must_use]
    pub fn cut(frame: &CameraFrame, time_s: f64, looked: &Looked, colour: &MarkerColour) -> Option<Self> {
        let (expected, region) = looked.searched?;
        let Part { image, corner } = frame.decode_rgb_part(region.columns(), region.rows()).ok()?;
        let in_part = region.from(corner).clipped(&image)?;
        let region = Region { x: region.x, y: region.y, ..in_part };
        let part = imageops::crop_imm(&image, in_part.x, in_part.y, region.width, region.height);
        let smaller = region.width.max(region.height).div_ceil(SIDE);
        let picture = match smaller {
            0 | 1 => part.to_image(),
            by => imageops::thumbnail(&*part, (region.width / by).max(1), (region.height / by).max(1)),
        };
        let mut left = PIXELS;
        let mut all = outlines(&colour.mask(&image, in_part).clean());
        all.sort_by_key(|outline| std::cmp::Reverse(outline.len()));
        let shown = all.into_iter().take(OUTLINES).take_while(|outline| {
            let fits = outline.len() <= left;
            left -= if fits { outline.len() } else { 0 };
            fits
        });
        let in_frame = |p: crate::outline::Pixel| [f64::from(p.x) + f64::from(region.x), f64::from(p.y) + f64::from(region.y)];
        let outlines = shown.map(|outline| outline.into_iter().map(in_frame).collect()).collect();
        Some(Self { time_s, looked: *looked, picture, region, outlines, expected_px: expected.into() })
    }

    /// How far the marker was from where it was expected [px]; `None` where nothing was found.
    #[must_use]
    pub fn miss_px(looked: &Looked) -> Option<f64> {
        let (Sighting::Seen(found) | Sighting::Rejected(found)) = looked.sighting else { return None };
        Some((found.centre - looked.searched?.0).norm())
    }

    /// As SVG, one unit a pixel of the frame.
    #[must_use]
    pub fn svg(&self, id: &str) -> String {
        let size = [f64::from(self.region.width), f64::from(self.region.height)];
        // Whole numbers are the middles of pixels.
        let [left, top] = [f64::from(self.region.x) - 0.5, f64::from(self.region.y) - 0.5];
        let at = |[u, v]: [f64; 2]| [u - left, v - top];
        let arm = CROSS * size[0].max(size[1]) / BALL_REGION_PX;
        let mut inside = format!(
            "<image width=\"{}\" height=\"{}\" preserveAspectRatio=\"none\" href=\"{}\"/>",
            size[0],
            size[1],
            png_uri(&png(&self.picture))
        );
        for outline in &self.outlines {
            let points: Vec<String> = outline.iter().map(|&p| at(p)).map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
            inside += &format!("<polygon points=\"{}\" class=\"outline\"/>", points.join(" "));
        }
        let [x, y] = at(self.expected_px);
        inside += &(line([x - arm, y - arm, x + arm, y + arm], "expected") + &line([x - arm, y + arm, x + arm, y - arm], "expected"));
        inside += &rectangle([0.0, 0.0, size[0], size[1]], "region");
        let found = match self.looked.sighting {
            Sighting::Seen(found) => Some((found, "seen")),
            Sighting::Rejected(found) => Some((found, "rejected")),
            Sighting::Hidden => None,
        };
        if let Some((found, class)) = found {
            let [x, y] = at(found.centre.into());
            inside += &format!("<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{:.2}\" class=\"{class}\"/>", found.radius_px);
            inside += &(line([x - arm, y, x + arm, y], class) + &line([x, y - arm, x, y + arm], class));
        }
        frame(id, size, &self.caption(), &self.description(), &inside)
    }

    /// Time and what became of the frame.
    #[must_use]
    pub fn caption(&self) -> String {
        let word = match self.looked.sighting {
            Sighting::Seen(_) => "seen",
            Sighting::Rejected(_) => "rejected",
            Sighting::Hidden => "hidden",
        };
        Self::miss_px(&self.looked)
            .map_or_else(|| format!("{:.2} s, {word}", self.time_s), |miss| format!("{:.2} s, {word}, {miss:.1} px off", self.time_s))
    }

    fn description(&self) -> String {
        let Region { x, y, width, height } = self.region;
        format!("Pixels {x} to {} across and {y} to {} down: {}.", x + width - 1, y + height - 1, self.looked.reason.words())
    }
}

fn png(image: &RgbImage) -> Vec<u8> {
    let mut bytes = Vec::new();
    // Writing to memory fails for no image that fits into it.
    let written = PngEncoder::new(&mut bytes).write_image(image.as_raw(), image.width(), image.height(), ExtendedColorType::Rgb8);
    if written.is_ok() { bytes } else { Vec::new() }
}

#[cfg(test)]
mod tests {
    use image::Rgb;
    use nalgebra::{Matrix2, Vector2};

    use super::*;
    use crate::html::as_frame;
    use crate::look::Candidate;
    use crate::reason::Reason;
    use crate::response::Response;

    fn disc(width: u32, height: u32, centre: Vector2<f64>) -> CameraFrame {
        let inside = |x: u32, y: u32| (Vector2::new(f64::from(x), f64::from(y)) - centre).norm() < 8.0;
        let image = RgbImage::from_fn(width, height, |x, y| if inside(x, y) { Rgb([30, 180, 40]) } else { Rgb([120; 3]) });
        as_frame(image)
    }

    fn looked(centre: Vector2<f64>, side_px: u32) -> Looked {
        let candidate =
            Candidate { centre, noise_px2: Matrix2::identity() * 0.01, response: Response::untold(0.07), radius_px: 8.0, share: 1.0 };
        let expected = centre + Vector2::new(3.0, 4.0);
        let searched = Some((expected, Region::around(&expected, side_px)));
        Looked { sighting: Sighting::Seen(candidate), reason: Reason::Seen, searched }
    }

    #[test]
    fn a_tile_shows_the_region_with_what_was_found_at_its_place() {
        let centre = Vector2::new(200.25, 100.5);
        let tile = Tile::cut(&disc(320, 240, centre), 1.5, &looked(centre, 100), &MarkerColour::default()).unwrap();
        assert_eq!((tile.picture.dimensions(), tile.outlines.len()), ((100, 100), 1));
        assert_eq!(tile.caption(), "1.50 s, seen, 5.0 px off");
        // The outline runs around the disc.
        let radii: Vec<f64> = tile.outlines[0].iter().map(|&p| (Vector2::from(p) - centre).norm()).collect();
        assert!(radii.iter().all(|r| (6.0..9.0).contains(r)), "{radii:?}");
        // The region starts at column 153 and row 54 or 55; a pixel's middle is half a unit in.
        let svg = tile.svg("t");
        let [x, y] = [200.25 - f64::from(tile.region.x) + 0.5, 100.5 - f64::from(tile.region.y) + 0.5];
        assert!(svg.contains(&format!("<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"8.00\" class=\"seen\"/>")), "{x} {y} {svg}");
        let png = tile.picture.get_pixel((x - 0.5) as u32, (y - 0.5) as u32);
        assert_eq!(*png, Rgb([30, 180, 40]));
    }

    #[test]
    fn a_cross_is_as_large_on_the_page_whatever_was_searched() {
        let centre = Vector2::new(200.25, 100.5);
        for (side_px, arm) in [(48, 4.0), (96, 8.0)] {
            let svg = Tile::cut(&disc(320, 240, centre), 0.0, &looked(centre, side_px), &MarkerColour::default()).unwrap().svg("t");
            let seen = svg.split("<line ").find(|line| line.contains("class=\"seen\"")).unwrap();
            let at = |name: &str| seen.split(&format!("{name}=\"")).nth(1).unwrap().split('"').next().unwrap().parse::<f64>().unwrap();
            assert!((at("x2") - at("x1") - 2.0 * arm).abs() < 0.4, "{seen}");
        }
    }

    #[test]
    fn a_region_larger_than_the_image_is_shown_smaller_and_one_outside_not_at_all() {
        let centre = Vector2::new(300.0, 200.0);
        let tile = Tile::cut(&disc(640, 480, centre), 0.0, &looked(centre, 1280), &MarkerColour::default()).unwrap();
        assert_eq!((tile.picture.dimensions(), tile.region.width, tile.region.height), ((160, 120), 640, 480));
        let outside = looked(Vector2::new(5000.0, 100.0), 100);
        assert!(Tile::cut(&disc(64, 48, centre), 0.0, &outside, &MarkerColour::default()).is_none());
    }
}
