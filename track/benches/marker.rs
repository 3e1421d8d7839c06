//! Times of the paper's pipeline and of the fits, on the frames of a file, one thread: called by `benches/marker_opencv.py`.
//!
//! Arguments: a file of RGB frames one after the other, their width and height, and for each the middle of a region of 100 x 100 pixels. Prints
//! least milliseconds as JSON, and writes the cleaned masks of the whole frames, a byte a pixel, beside the frames.

use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use image::RgbImage;
use nalgebra::Vector2;
use raven_track::colour::MarkerColour;
use raven_track::marker::{Blobs, Centre, Region};

const ROUNDS: usize = 40;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let [path, width, height, middles @ ..] = arguments.as_slice() else {
        eprintln!("called by benches/marker_opencv.py: FRAMES WIDTH HEIGHT U V U V ...");
        return;
    };
    let number = |text: &String| text.parse::<f64>().expect("a number");
    let (width, height) = (number(width) as u32, number(height) as u32);
    let bytes = std::fs::read(path).expect("frames");
    let size = (3 * width * height) as usize;
    let images: Vec<RgbImage> =
        bytes.chunks_exact(size).map(|frame| RgbImage::from_raw(width, height, frame.to_vec()).expect("a frame")).collect();
    let regions: Vec<Region> = middles.chunks_exact(2).map(|m| Region::around(&Vector2::new(number(&m[0]), number(&m[1])), 100)).collect();
    let colour = MarkerColour::default();

    let mut masks = Vec::new();
    for image in &images {
        let mask = colour.mask(image, Region::whole(image)).clean();
        let all = (0..height as i32).flat_map(|y| (0..width as i32).map(move |x| (x, y)));
        masks.extend(all.map(|(x, y)| 255 * u8::from(mask.get(x, y))));
    }
    std::fs::write(Path::new(path).with_extension("masks"), masks).expect("room for the masks");

    let pairs = || images.iter().zip(&regions);
    let full = least_ms(|| pairs().for_each(|(image, _)| drop(black_box(Blobs::find(image, None, &colour)))), images.len());
    let region = least_ms(|| pairs().for_each(|(image, r)| drop(black_box(Blobs::find(image, Some(*r), &colour)))), images.len());
    let found: Vec<Blobs<'_>> = pairs().map(|(image, r)| Blobs::find(image, Some(*r), &colour)).collect();
    let fit = |kind: Centre| {
        let all = || found.iter().filter_map(|blobs| Some(black_box(blobs.centre(blobs.found.first()?, kind)))).count();
        least_ms(
            || {
                black_box(all());
            },
            images.len(),
        )
    };
    let (ball, refined) = (fit(Centre::Ball), fit(Centre::Refined));
    println!("{{\"full_ms\": {full}, \"region_ms\": {region}, \"ball_ms\": {ball}, \"refined_ms\": {refined}}}");
}

/// Least time of a run over its number of frames [ms]: what else runs on the machine only adds.
fn least_ms(mut run: impl FnMut(), frames: usize) -> f64 {
    let times: Vec<f64> = (0..ROUNDS)
        .map(|_| {
            let start = Instant::now();
            run();
            1e3 * start.elapsed().as_secs_f64() / frames as f64
        })
        .collect();
    times.into_iter().fold(f64::MAX, f64::min)
}
