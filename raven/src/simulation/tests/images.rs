//! Sessions with images: what the decoded frames show, and when.

use std::path::Path;

use nalgebra::{Isometry3, Vector2};

use super::*;
use crate::camera::Cameras;
use crate::log::{CameraFrame, MotorSource, Recording, Side, frames};

fn filmed(options: Options, motion: Motion, duration_s: f64) -> (Session, Vec<CameraFrame>, Recording) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("images.mcap");
    let session = Session::new(&nominal::gold(), Options { images: true, ..options }).unwrap();
    session.record(motion, duration_s, &path, |done| assert!((0.0..=1.001).contains(&done))).unwrap();
    let images = frames(&path).unwrap().collect::<crate::Result<Vec<_>>>().unwrap();
    (session, images, Recording::read(&path, &MotorSource::default()).unwrap())
}

/// Centroid of the pixels that are green, about a pixel, and how many there are.
fn green_near(frame: &CameraFrame, about: &Vector2<f64>) -> (Vector2<f64>, f64) {
    let image = frame.decode_rgb().unwrap();
    let (mut sum, mut weight) = (Vector2::zeros(), 0.0);
    for v in about.y as u32 - 16..about.y as u32 + 16 {
        for u in about.x as u32 - 16..about.x as u32 + 16 {
            let [red, green, blue] = image.get_pixel(u, v).0.map(f64::from);
            let greener = f64::from(u8::from(green - red.max(blue) > 35.0));
            sum += Vector2::new(f64::from(u), f64::from(v)) * greener;
            weight += greener;
        }
    }
    (sum / weight, weight)
}

fn projected(cameras: &Cameras, side: Side, tip: &Vector3<f64>) -> Vector2<f64> {
    cameras.project_base(tip).unwrap()[usize::from(side == Side::Right)]
}

#[test]
fn the_marker_is_where_the_tip_was_before_the_stamp() {
    let hidden = effects(&["time-offset=0.04", "stereo-desync=0.02"]);
    let quiet = Options { effects: hidden, hidden_part: 0.0, ..Options::default() };
    let (session, images, log) = filmed(quiet, Motion::Sinusoid, 8.0);
    let (_, trace) = session.run(Motion::Sinusoid, 8.0, || {}).unwrap();
    let kinematics = nominal::gold().arm().unwrap().kinematics;
    let cameras = &session.truth().rig.as_ref().unwrap().actual;
    assert!(log.tip.is_empty() && !log.attachments.contains_key("cameras.yaml"));
    let (mut late, mut naive) = (0.0, 0.0);
    for frame in images.iter().filter(|f| f.stamp.seconds_since(log.start) > 3.0) {
        let stamp_s = frame.stamp.seconds_since(log.start);
        let delay_s = session.truth().delays.of_image(frame.side, stamp_s);
        let place = |time_s: f64| projected(cameras, frame.side, &kinematics.forward(&trace.joint_at(time_s)));
        let (seen, _) = green_near(frame, &place(stamp_s - delay_s));
        let count = images.len() as f64;
        late += (seen - place(stamp_s - delay_s)).norm_squared() / count;
        naive += (seen - place(stamp_s)).norm_squared() / count;
    }
    // Noise of the sensor, the JPEG, the shade's side of the ball, and a millisecond of jitter.
    assert!(late.sqrt() < 0.7, "{}", late.sqrt());
    assert!(naive > 4.0 * late, "{naive} {}", late);
}

#[test]
fn fingers_hide_the_marker_when_they_should() {
    let half = Options { hidden_part: 0.5, ..Options::default() };
    let (session, images, _) = filmed(half, Motion::Hardstop, 6.0);
    let robot = nominal::gold().arm().unwrap();
    let cameras = &session.truth().rig.as_ref().unwrap().actual;
    let tip = robot.kinematics.forward(&robot.hard_stop);
    let seen = images.iter().filter(|f| green_near(f, &projected(cameras, f.side, &tip)).1 > 60.0).count();
    let share = seen as f64 / images.len() as f64;
    assert!((0.3..0.95).contains(&share), "{share}");
}

#[test]
fn the_board_is_shown_all_over_and_is_known_by_its_metadata() {
    let (_, images, log) = filmed(Options::default(), Motion::Board, 5.0);
    assert_eq!(images.len(), 50);
    assert_eq!(log.session["board_inner_corners"], "9x6");
    assert_eq!(log.session["board_square_m"], "0.012");
    assert!(log.motor.is_none());
}

#[test]
fn board_poses_fill_both_images_and_lean_every_way() {
    for seed in 0..5 {
        let session = Session::new(&nominal::gold(), Options { seed, ..Options::default() }).unwrap();
        let cameras = &session.truth().rig.as_ref().unwrap().actual;
        let poses = film::board_poses(&BOARD, cameras, 32, &mut rng(seed)).unwrap();
        let (mut low, mut high) = (Vector2::repeat(1e9), Vector2::repeat(-1e9));
        let mut leans = [0; 4];
        for pose in &poses {
            for corner in BOARD.plate() {
                let [left, right] = cameras.project(&(pose * corner).coords).unwrap();
                assert!(cameras.left.contains(&left, 0.0) && cameras.right.contains(&right, 0.0));
                (low, high) = (low.inf(&left), high.sup(&left));
            }
            let normal = pose.rotation * Vector3::z();
            leans[usize::from(normal.x > 0.0) + 2 * usize::from(normal.y > 0.0)] += 1;
        }
        assert!(low.x < 100.0 && low.y < 30.0 && high.x > 590.0 && high.y > 450.0, "{low} {high}");
        assert!(leans.iter().all(|n| *n >= 3), "{leans:?}");
        let depths: Vec<f64> = poses.iter().map(|p: &Isometry3<f64>| p.translation.z).collect();
        let range = depths.iter().fold([1e9_f64, 0.0_f64], |[a, b], d| [a.min(*d), b.max(*d)]);
        assert!(range[1] > 1.3 * range[0]);
    }
}

#[test]
fn the_same_seed_gives_the_same_images() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str| {
        let path = folder.path().join(name);
        let session = Session::new(&nominal::gold(), Options { images: true, ..Options::default() }).unwrap();
        session.record(Motion::Hardstop, 1.0, Path::new(&path), |_| {}).unwrap();
        std::fs::read(&path).unwrap()
    };
    assert!(write("a.mcap") == write("b.mcap"));
}
