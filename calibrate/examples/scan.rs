//! scratch
use raven_calibrate::*;
fn gray(f: &str) -> image::GrayImage {
    let img = image::open(f).unwrap();
    let rgb = img.to_rgb8();
    image::GrayImage::from_fn(rgb.width(), rgb.height(), |x, y| {
        let p = rgb.get_pixel(x, y).0;
        image::Luma([((299 * p[0] as u32 + 587 * p[1] as u32 + 114 * p[2] as u32 + 500) / 1000) as u8])
    })
}
fn main() {
    let mut it = std::env::args().skip(1);
    let size: board::BoardSize = it.next().unwrap().parse().unwrap();
    let square_m: f64 = it.next().unwrap().parse().unwrap();
    let files: Vec<String> = it.collect();
    let n = files.len() / 2;
    let mut wh = (0, 0);
    let shots: Vec<_> = (0..n)
        .map(|i| {
            let [a, b] = [&files[i], &files[i + n]].map(|f| {
                let g = gray(f);
                wh = g.dimensions();
                corners::find(&g, size)
            });
            calibration::Shot { name: files[i].clone(), sightings: [a, b] }
        })
        .collect();
    let t = std::time::Instant::now();
    let c = calibration::calibrate(&shots, [wh; 2], &board::Board { size, square_m }, false).unwrap();
    println!("{:.1} ms", t.elapsed().as_secs_f64() * 1e3);
    println!("mono {:?}\n{:?}", (c.mono[0].rms_px, c.mono[0].camera), (c.mono[1].rms_px, c.mono[1].camera));
    println!(
        "joint {} gradient {:e}\n{:?}\n{:?}\nT {:?} om {:?}",
        c.rms_px,
        c.gradient,
        c.rig.cameras[0],
        c.rig.cameras[1],
        c.rig.right_from_left.translation.vector * 1e3,
        c.rig.right_from_left.rotation.scaled_axis()
    );
    println!("sd {:?}", c.covariance.map(|c| c.diagonal().map(f64::sqrt)));
    println!("pairs {:?} unmatched {:?}", c.pairs, c.unmatched);
}
