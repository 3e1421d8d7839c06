//! The commands: a calibration from files and from a log, and what they refuse.

use std::path::Path;

use clap::Parser;
use image::GrayImage;
use nalgebra::{Isometry3, Matrix3, UnitQuaternion, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use raven::Error;
use raven::camera::{Cameras, Pinhole};
use raven::log::{FrameData, LogWriter, Side, Stamp, frames};
use rayon::prelude::*;

use super::real::calibrate;
use super::scene::Scene;
use crate::board::{Board, BoardSize};
use crate::{Args, run};

const BOARD: Board = Board { size: BoardSize { columns: 7, rows: 5 }, square_m: 0.015 };

fn cameras() -> [Pinhole; 2] {
    let left = Pinhole { width: 320, height: 240, fx: 300.0, fy: 300.0, cx: 161.0, cy: 118.0, distortion: [-0.1, 0.02, 0.0, 0.0, 0.0] };
    [left, Pinhole { fx: 304.0, fy: 304.0, cx: 158.0, ..left }]
}

/// Left and right pictures of six boards.
fn pictures() -> Vec<[GrayImage; 2]> {
    let right_from_left = Isometry3::new(Vector3::new(-0.04, 0.0, 0.0), Vector3::new(0.0, -0.02, 0.005));
    let tilts = [(0.5, 0.0), (-0.5, 0.1), (0.0, 0.5), (0.1, -0.5), (0.4, 0.4), (-0.3, 0.5)];
    let one = |(index, (x, y)): (usize, (f64, f64))| {
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(x, y, 0.1 * index as f64));
        let centre = Vector3::new(0.01 * index as f64, 0.02 - 0.008 * index as f64, 0.24 + 0.01 * index as f64);
        let pose = Isometry3::from_parts((centre - rotation * BOARD.middle()).into(), rotation);
        let poses = [pose, right_from_left * pose];
        [0, 1].map(|c| {
            let scene = Scene { camera: cameras()[c], board: BOARD, camera_from_board: poses[c], blur_px: 0.6, noise: 2.0 };
            scene.render(&mut ChaCha8Rng::seed_from_u64(2 * index as u64 + c as u64))
        })
    };
    tilts.into_par_iter().enumerate().map(one).collect()
}

fn refused(args: &[&str]) -> Error {
    run(Args::try_parse_from(["raven-calibrate"].iter().chain(args)).unwrap(), &mut Vec::new()).unwrap_err()
}

fn save(folder: &Path, name: &str, image: &GrayImage) {
    image.save(folder.join(name)).unwrap();
}

#[test]
fn files_and_a_log_of_the_same_pictures_give_the_same_cameras() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let mut log = LogWriter::create(&folder.path().join("board.mcap")).unwrap();
    for (index, pair) in pictures().iter().enumerate() {
        for (side, image) in Side::BOTH.into_iter().zip(pair) {
            let name = format!("{}{index}.png", side.name());
            save(folder.path(), &name, image);
            let stamp = Stamp(1_700_000_000_000_000_000 + 1_000_000_000 * index as u64 + 2_000_000 * side as u64);
            log.compressed_image(side, stamp, 0, &std::fs::read(folder.path().join(&name)).unwrap()).unwrap();
        }
    }
    log.finish().unwrap();
    let board = ["--board", "7x5", "--square", "0.015"];
    let (left, right, output) = (at("left*.png"), at("right*.png"), at("cameras.yaml"));
    let (ros, kalibr, opencv, page) = (at("ros"), at("camchain.yaml"), at("opencv.yaml"), at("page.html"));
    let exports = ["--export-ros", &ros, "--export-kalibr", &kalibr, "--export-opencv", &opencv, "--html", &page];
    let (text, from_files) =
        calibrate(&[&["cameras", "--left", &left, "--right", &right, "-o", &output][..], &board, &exports].concat()).unwrap();
    for (option, name) in [("-o", "left.yaml"), ("--json", "right.yaml")] {
        let onto = Path::new(&ros).join(name).display().to_string();
        let both = refused(&[&["cameras", "--left", &left, "--right", &right, "--export-ros", &ros, option, &onto][..], &board].concat());
        assert!(
            matches!(&both, Error::Argument(s) if s.contains(&format!("{option} and --export-ros both name")) && s.contains(name)),
            "{both}"
        );
    }
    let nothing = at("nothing.yaml");
    let same = refused(&[&["cameras", "--left", &left, "--right", &left, "-o", &nothing][..], &board].concat());
    assert!(matches!(&same, Error::Data(s) if s.contains("stand at one place") && s.contains("the same?")), "{same}");
    assert!(!Path::new(&nothing).exists());
    let (_, from_log) = calibrate(&[&["cameras", &at("board.mcap")][..], &board].concat()).unwrap();
    for key in ["/left/fx", "/right/cy", "/stereo/baseline_m", "/stereo/rms_px", "/left/boards_seen"] {
        let [a, b] = [&from_files, &from_log].map(|json| json.pointer(key).and_then(serde_json::Value::as_f64).unwrap());
        assert!((a - b).abs() <= 1e-12 * a, "{key}: {a} {b}");
    }
    let mut twice = LogWriter::create(Path::new(&at("twice.mcap"))).unwrap();
    for frame in frames(Path::new(&at("board.mcap"))).unwrap().map(Result::unwrap) {
        let FrameData::Jpeg(file) = &frame.data else { panic!("{frame:?}") };
        (0..2).for_each(|_| twice.compressed_image(frame.side, frame.stamp, 0, file).unwrap());
    }
    twice.finish().unwrap();
    let (said, from_twice) = calibrate(&[&["cameras", &at("twice.mcap")][..], &board].concat()).unwrap();
    assert!(said.contains("6 of them by both at once."), "{said}");
    assert_eq!(from_twice["left"], from_log["left"]);
    assert!(text.contains("Boards used: 6 left, 6 right, 6 of them by both at once."), "{text}");
    assert!(!text.contains("swapped"), "{text}");
    let (swapped, _) = calibrate(&[&["cameras", "--left", &right, "--right", &left][..], &board].concat()).unwrap();
    assert!(swapped.contains("The right camera stands 40.0 mm to the left of the left one"), "{swapped}");
    let read = Cameras::read(Path::new(&output)).unwrap();
    assert!((read.left.fx - 300.0).abs() < 1.0 && (read.right.fx - 304.0).abs() < 1.0, "{} {}", read.left.fx, read.right.fx);
    assert!((read.baseline_m() - 0.04).abs() < 5e-5, "{}", read.baseline_m());
    assert!((read.quality.stereo_rms_px.unwrap() - from_files["stereo"]["rms_px"].as_f64().unwrap()).abs() < 1e-12);
    assert!(read.quality.left_std.is_some() && read.quality.baseline_std_m.is_some());
    for key in ["rms_px", "fx", "fy", "cx", "cy", "distortion", "std", "boards_used", "boards_seen"] {
        assert!(from_files["left"].get(key).is_some() && from_files["right"].get(key).is_some(), "{key}");
    }
    // ROS's block alone is what stands in the file of both cameras, but for the rectification.
    let text = std::fs::read_to_string(Path::new(&ros).join("right.yaml")).unwrap();
    let info: serde_json::Value = raven::yaml::parse(Path::new("right.yaml"), &text).unwrap();
    assert_eq!((&info["camera_name"], &info["distortion_model"]), (&"right".into(), &"plumb_bob".into()));
    assert_eq!(info["camera_matrix"]["data"][0].as_f64(), Some(read.right.fx));
    let (focal, shift) = (info["projection_matrix"]["data"][0].as_f64().unwrap(), info["projection_matrix"]["data"][3].as_f64().unwrap());
    assert!((shift / focal + read.baseline_m()).abs() < 1e-12, "{focal} {shift}");
    let text = std::fs::read_to_string(&kalibr).unwrap();
    let chain: serde_json::Value = raven::yaml::parse(Path::new(&kalibr), &text).unwrap();
    assert_eq!(chain["cam1"]["T_cn_cnm1"][0][3].as_f64(), Some(read.right_from_left.translation.x));
    assert_eq!(chain["cam0"]["intrinsics"][2].as_f64(), Some(read.left.cx));
    let text = std::fs::read_to_string(&opencv).unwrap();
    assert!(text.starts_with("%YAML:1.0\n---\n") && text.matches("!!opencv-matrix").count() == 11, "{text}");
    let page = std::fs::read_to_string(&page).unwrap();
    assert_eq!((page.matches("<svg").count(), page.matches("</svg>").count()), (6, 6));
    let elsewhere = page.replace("http://www.w3.org/2000/svg", "");
    assert!(!elsewhere.contains("http") && !page.contains("<script") && !page.contains("NaN"));
    assert!(page.contains("Cross-validation in 6 folds") && page.contains("fx [px]") && page.contains("left3.png"));
    assert!(from_files["stereo"]["rotation_deg"].is_number() && from_files["seconds"].is_number());
}

#[test]
fn wrong_pictures_end_in_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name).display().to_string();
    let flat = GrayImage::from_pixel(64, 48, image::Luma([90]));
    for name in ["l1.png", "l2.png", "r1.png", "r2.png"] {
        save(folder.path(), name, &flat);
    }
    save(folder.path(), "big.png", &GrayImage::new(80, 60));
    save(folder.path(), "whole.jpg", &GrayImage::from_fn(64, 48, |x, y| image::Luma([(7 * x * y % 251) as u8])));
    std::fs::write(folder.path().join("text.jpg"), "no picture").unwrap();
    let cameras = |left: &[&str], right: &[&str]| {
        let (left, right): (Vec<String>, Vec<String>) = (left.iter().map(|n| at(n)).collect(), right.iter().map(|n| at(n)).collect());
        let mut args = vec!["cameras", "--board", "9x6", "--square", "0.012", "--left"];
        args.extend(left.iter().map(String::as_str));
        args.push("--right");
        args.extend(right.iter().map(String::as_str));
        refused(&args)
    };
    let none = cameras(&["l*.png"], &["r*.png"]);
    assert!(
        matches!(&none, Error::Data(s) if s.contains("9 x 6 inner corners") && s.contains("2 left and 2 right") && s.contains("nothing that looks like")),
        "{none}"
    );
    let one = cameras(&["l1.png"], &["r*.png"]);
    assert!(matches!(&one, Error::Argument(s) if s.contains("1 left and 2 right")), "{one}");
    save(folder.path(), "r3.png", &flat);
    let shifted = cameras(&["l1.png", "l2.png"], &["r2.png", "r3.png"]).to_string();
    std::fs::remove_file(folder.path().join("r3.png")).unwrap();
    assert!(shifted.contains("l2.png: ") && shifted.contains("r3.png, but by its number ") && shifted.contains("no partner"), "{shifted}");
    let sizes = cameras(&["l1.png", "big.png"], &["r*.png"]).to_string();
    assert!(sizes.contains("80 x 60") && sizes.contains("64 x 48"), "{sizes}");
    let text = cameras(&["text.jpg", "l1.png"], &["r*.png"]).to_string();
    assert!(text.contains("text.jpg") && text.contains("no picture"), "{text}");
    let whole = std::fs::read(folder.path().join("whole.jpg")).unwrap();
    std::fs::write(folder.path().join("cut.jpg"), &whole[..2 * whole.len() / 3]).unwrap();
    let cut = cameras(&["cut.jpg", "l1.png"], &["r*.png"]).to_string();
    assert!(cut.contains("cut.jpg") && cut.contains("cut off"), "{cut}");
    assert!(matches!(cameras(&["x*.png"], &["r*.png"]), Error::Argument(_)));
    assert!(matches!(cameras(&["l3.png", "l1.png"], &["r*.png"]), Error::Io { .. }));
}

#[test]
fn wrong_arguments_are_refused_by_name() {
    let parse = |args: &[&str]| Args::try_parse_from(["raven-calibrate"].iter().chain(args)).unwrap_err().to_string();
    let millimetres = parse(&["cameras", "board.mcap", "--board", "9x6", "--square", "12"]);
    assert!(millimetres.contains("millimetres"), "{millimetres}");
    let negative = parse(&["cameras", "board.mcap", "--board", "9x6", "--square", "-0.012"]);
    assert!(negative.contains("-0.012 is not between"), "{negative}");
    assert!(parse(&["cameras", "board.mcap", "--board", "9", "--square", "0.012"]).contains("9x6"));
    assert!(parse(&["cameras", "--board", "9x6", "--square", "0.012"]).contains("required"));
    let board = ["cameras", "board.mcap", "--board", "9x6", "--square", "0.012"];
    let kalibr = parse(&[&board[..], &["--k3", "--export-kalibr", "camchain.yaml"]].concat());
    assert!(kalibr.contains("cannot be used with") && kalibr.contains("--k3") && kalibr.contains("--export-kalibr"), "{kalibr}");
    let register = ["register", "no.mcap", "--robot", "no.yaml", "--cameras", "no.yaml", "--rotation"];
    let mirror = refused(&[&register[..], &["x0=y y0=z z0=-x"]].concat());
    assert!(matches!(&mirror, Error::Argument(s) if s.contains("mirror")), "{mirror}");
    assert!(matches!(refused(&[&register[..], &["guess"]].concat()), Error::Argument(s) if s.contains("estimate")));
    assert!(matches!(refused(&[&register[..], &["estimate"]].concat()), Error::Io { .. }));
    assert!(matches!(refused(&[&register[..], &["x0=-y y0=z z0=-x"]].concat()), Error::Io { .. }));
}

#[test]
fn every_help_shows_an_example_that_is_understood() {
    for command in ["cameras", "register"] {
        let help = Args::try_parse_from(["raven-calibrate", command, "--help"]).unwrap_err().to_string();
        let examples = &help[help.find("Examples:").unwrap()..];
        let words: Vec<&str> = examples.split_whitespace().skip(1).collect();
        let starts: Vec<usize> = (0..words.len()).filter(|&k| words[k] == "raven-calibrate").chain([words.len()]).collect();
        assert_eq!(starts.len(), 3, "{examples}");
        starts.windows(2).for_each(|example| drop(Args::try_parse_from(&words[example[0]..example[1]]).unwrap()));
    }
}

#[test]
fn the_default_mount_is_the_one_in_the_help() {
    let Args { command: crate::Command::Register(args) } =
        Args::try_parse_from(["raven-calibrate", "register", "a.mcap", "--robot", "r.yaml", "--cameras", "c.yaml"]).unwrap()
    else {
        panic!("register")
    };
    let mount: crate::mount::Mount = args.rotation.parse().unwrap();
    assert_eq!(*mount.base_from_left.matrix(), Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, 1.0, -1.0, 0.0, 0.0));
}
