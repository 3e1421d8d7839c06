//! `cameras.yaml`: two ROS `camera_info` blocks, the poses between them and the robot, and the quality of the calibration.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Matrix3x4, Rotation3, Translation3, UnitQuaternion, Vector3};
use serde::Deserialize;
use serde::de::IgnoredAny;

use super::{Cameras, Pinhole};
use crate::log::LARGEST_SIDE;
use crate::{Error, Result, files, yaml};

/// How good a calibration was. All members are optional: a file from elsewhere may not say.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(default)]
pub struct Quality {
    /// Reprojection RMS of the left camera alone [px].
    pub left_rms_px: Option<f64>,
    /// Reprojection RMS of the right camera alone [px].
    pub right_rms_px: Option<f64>,
    /// Reprojection RMS of both cameras with one pose per board [px].
    pub stereo_rms_px: Option<f64>,
    /// Standard deviations of `fx, fy, cx, cy` of the left camera [px].
    pub left_std: Option<[f64; 4]>,
    /// Standard deviations of `fx, fy, cx, cy` of the right camera [px].
    pub right_std: Option<[f64; 4]>,
    /// Standard deviation of the baseline [m].
    pub baseline_std_m: Option<f64>,
    /// Standard deviations of `base_from_left`'s rotation vector [rad].
    pub registration_rotation_std_rad: Option<[f64; 3]>,
    /// Standard deviations of `base_from_left`'s translation [m].
    pub registration_translation_std_m: Option<[f64; 3]>,
    /// Standard deviation of the latency [s].
    pub latency_std_s: Option<f64>,
    /// Standard deviation of the right images' latency beyond that of the left ones [s].
    pub right_minus_left_std_s: Option<f64>,
    /// Standard deviation of the disparity at the boards' mean distance, in the middle of the left image: what the whole calibration
    /// leaves unknown of the depth there [px].
    pub disparity_std_px: Option<f64>,
}

#[derive(Deserialize)]
struct CamerasFile {
    left: CameraInfo,
    right: CameraInfo,
    right_from_left: Pose,
    #[serde(default)]
    base_from_left: Option<Pose>,
    #[serde(default)]
    latency: f64,
    #[serde(default)]
    right_minus_left: f64,
    #[serde(default)]
    quality: Quality,
}

/// The keys of a file and of its quality, whatever they hold.
#[derive(Deserialize)]
struct Keys {
    #[serde(flatten)]
    all: BTreeMap<String, IgnoredAny>,
    #[serde(default)]
    quality: BTreeMap<String, IgnoredAny>,
}

/// Keys that may be left out.
const OPTIONAL: [&str; 4] = ["base_from_left", "latency", "right_minus_left", "quality"];
/// Letters in which a mistyped key differs at most.
const MISTYPED: usize = 2;

impl Keys {
    /// Refuses what may be a mistyped key: it would be as if that were left out. Others may be of some other program.
    fn check(&self) -> Result<(), String> {
        let of_quality = Quality::default();
        let numbers: Vec<&str> =
            of_quality.numbers().map(|(key, _)| key).into_iter().chain(of_quality.lists().map(|(key, _)| key)).collect();
        let mistyped = |keys: &BTreeMap<String, IgnoredAny>, known: &[&str]| {
            let mut unknown = keys.keys().filter(|key| !known.contains(&key.as_str()));
            let near =
                |key: &String| known.iter().find(|known| strsim::levenshtein(key, known) <= MISTYPED).map(|known| (*known).to_owned());
            unknown.find_map(|key| Some((key.clone(), near(key)?)))
        };
        match mistyped(&self.all, &OPTIONAL).or_else(|| mistyped(&self.quality, &numbers)) {
            Some((key, known)) => Err(format!("`{key}` is no key of this file; is it `{known}`?")),
            None => Ok(()),
        }
    }
}

#[derive(Deserialize)]
struct CameraInfo {
    image_width: u32,
    image_height: u32,
    camera_matrix: Array,
    distortion_model: String,
    distortion_coefficients: Array,
}

#[derive(Deserialize)]
struct Array {
    data: Vec<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Pose {
    rotation: Vec<f64>,
    translation: Vec<f64>,
}

impl Cameras {
    /// Reads `cameras.yaml`.
    ///
    /// # Errors
    /// If the file is missing, lacks a block, or has a mistyped key, a matrix of the wrong size or one that is no rotation,
    /// or a number that no cameras have.
    pub fn read(path: &Path) -> Result<Self> {
        Self::parse(path, &files::read_text(path)?)
    }

    /// Reads the text of a `cameras.yaml`, which came from `path`.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn parse(path: &Path, text: &str) -> Result<Self> {
        let file: CamerasFile = yaml::parse(path, text)?;
        let build = || -> Result<Self, String> {
            let cameras = Self {
                left: pinhole("left", &file.left)?,
                right: pinhole("right", &file.right)?,
                right_from_left: isometry("right_from_left", &file.right_from_left)?,
                base_from_left: file.base_from_left.as_ref().map(|p| isometry("base_from_left", p)).transpose()?,
                latency_s: file.latency,
                right_minus_left_s: file.right_minus_left,
                quality: file.quality,
            };
            for (key, seconds) in [("latency", file.latency), ("right_minus_left", file.right_minus_left)] {
                if seconds.is_nan() || seconds.abs() >= 5.0 {
                    return Err(format!("{key} is {seconds}, expected seconds. Is it in milliseconds?"));
                }
            }
            file.quality.check()?;
            let baseline = cameras.baseline_m();
            if !(1e-4..5.0).contains(&baseline) {
                return Err(format!("the baseline in right_from_left is {baseline}, expected 0.0001 to 5 m. Is it in millimetres?"));
            }
            Ok(cameras)
        };
        let checked = |cameras| yaml::parse::<Keys>(path, text).map_or(Ok(()), |keys| keys.check()).map(|()| cameras);
        build().and_then(checked).map_err(|message| Error::file(path, message))
    }

    /// Writes `cameras.yaml` in one step.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        files::write_atomic(path, self.to_yaml().as_bytes())
    }

    /// The file's text. Each camera's block alone, under its own name, is a ROS `camera_info` file: of one camera that is not
    /// rectified, with the length of the baseline in the right one's projection. `raven-calibrate cameras --export-ros` rectifies the pair.
    #[must_use]
    pub fn to_yaml(&self) -> String {
        let mut text =
            String::from("# Two ROS camera_info blocks; x_right = R x_left + t; x_frame0 = R x_left + t after registration. Metres.\n");
        let [left, right] = self.projections();
        text += &camera_info("left", &self.left, &left);
        text += &camera_info("right", &self.right, &right);
        text += &pose("right_from_left", &self.right_from_left);
        if let Some(base_from_left) = &self.base_from_left {
            text += &pose("base_from_left", base_from_left);
        }
        let _ = writeln!(text, "latency: {}", yaml::float(self.latency_s));
        if self.right_minus_left_s != 0.0 {
            let _ = writeln!(text, "right_minus_left: {}", yaml::float(self.right_minus_left_s));
        }
        text += &self.quality.to_yaml();
        text
    }
}

impl Quality {
    /// Keys and values of the single numbers.
    fn numbers(&self) -> [(&'static str, Option<f64>); 7] {
        [
            ("left_rms_px", self.left_rms_px),
            ("right_rms_px", self.right_rms_px),
            ("stereo_rms_px", self.stereo_rms_px),
            ("baseline_std_m", self.baseline_std_m),
            ("latency_std_s", self.latency_std_s),
            ("right_minus_left_std_s", self.right_minus_left_std_s),
            ("disparity_std_px", self.disparity_std_px),
        ]
    }

    /// Keys and values of the lists.
    fn lists(&self) -> [(&'static str, Option<&[f64]>); 4] {
        [
            ("left_std", self.left_std.as_ref().map(|std| std.as_slice())),
            ("right_std", self.right_std.as_ref().map(|std| std.as_slice())),
            ("registration_rotation_std_rad", self.registration_rotation_std_rad.as_ref().map(|std| std.as_slice())),
            ("registration_translation_std_m", self.registration_translation_std_m.as_ref().map(|std| std.as_slice())),
        ]
    }

    /// Refuses what is no deviation.
    fn check(&self) -> Result<(), String> {
        let single = self.numbers().into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?)));
        let listed = self.lists().into_iter().flat_map(|(key, values)| {
            let values = values.unwrap_or_default().iter().enumerate();
            values.map(move |(i, &value)| (format!("{key}[{i}]"), value))
        });
        match single.chain(listed).find(|(_, value)| !value.is_finite() || *value < 0.0) {
            Some((key, value)) => {
                Err(format!("quality.{key} is {value}, expected a finite number from 0 on; leave out what is not known."))
            }
            None => Ok(()),
        }
    }

    fn to_yaml(self) -> String {
        let mut lines = String::new();
        for (key, value) in self.numbers() {
            if let Some(value) = value {
                let _ = writeln!(lines, "  {key}: {}", yaml::float(value));
            }
        }
        for (key, values) in self.lists() {
            if let Some(values) = values {
                let _ = writeln!(lines, "  {key}: {}", yaml::list(values));
            }
        }
        if lines.is_empty() { lines } else { format!("quality:\n{lines}") }
    }
}

fn pinhole(name: &str, info: &CameraInfo) -> Result<Pinhole, String> {
    if info.distortion_model != Pinhole::DISTORTION_MODEL {
        return Err(format!("{name}.distortion_model is `{}`, expected `{}`.", info.distortion_model, Pinhole::DISTORTION_MODEL));
    }
    let &[fx, skew, cx, zero_1, fy, cy, zero_2, zero_3, one] = info.camera_matrix.data.as_slice() else {
        return Err(format!("{name}.camera_matrix.data has {} numbers, expected 9.", info.camera_matrix.data.len()));
    };
    if [skew, zero_1, zero_2, zero_3, one - 1.0].iter().any(|&v| v != 0.0) {
        return Err(format!("{name}.camera_matrix is not of the form [fx 0 cx; 0 fy cy; 0 0 1]."));
    }
    let mut distortion = [0.0; 5];
    let given = &info.distortion_coefficients.data;
    if given.len() != 4 && given.len() != 5 {
        return Err(format!("{name}.distortion_coefficients.data has {} numbers, expected k1 k2 p1 p2 [k3].", given.len()));
    }
    distortion[..given.len()].copy_from_slice(given);
    for (key, focal) in [("fx", fx), ("fy", fy)] {
        if !(focal > 1.0 && focal < 1e6) {
            return Err(format!("{name}.camera_matrix has {key} = {focal}, expected pixels."));
        }
    }
    if !distortion.iter().chain(&[cx, cy]).all(|v| v.is_finite()) {
        return Err(format!("{name} has a number that is not finite."));
    }
    for (key, pixels) in [("image_width", info.image_width), ("image_height", info.image_height)] {
        if !(1..=LARGEST_SIDE).contains(&pixels) {
            return Err(format!("{name}.{key} is {pixels}, expected 1 to {LARGEST_SIDE} pixels."));
        }
    }
    Ok(Pinhole { width: info.image_width, height: info.image_height, fx, fy, cx, cy, distortion })
}

fn isometry(name: &str, pose: &Pose) -> Result<Isometry3<f64>, String> {
    let (&[_, _, _, _, _, _, _, _, _], &[x, y, z]) = (pose.rotation.as_slice(), pose.translation.as_slice()) else {
        let (r, t) = (pose.rotation.len(), pose.translation.len());
        return Err(format!("{name} has {r} and {t} numbers, expected 9 in rotation and 3 in translation."));
    };
    let matrix = Matrix3::from_row_slice(&pose.rotation);
    let off = (matrix.transpose() * matrix - Matrix3::identity()).amax();
    if !(off < 1e-5 && matrix.determinant() > 0.0) {
        return Err(format!("{name}.rotation is no rotation: R'R differs from 1 by {off:.1e}, det R is {:.3}.", matrix.determinant()));
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&matrix));
    if ![x, y, z].iter().all(|v| v.is_finite()) {
        return Err(format!("{name}.translation has a number that is not finite."));
    }
    Ok(Isometry3::from_parts(Translation3::from(Vector3::new(x, y, z)), rotation))
}

fn camera_info(name: &str, camera: &Pinhole, projection: &Matrix3x4<f64>) -> String {
    let array = |rows: usize, cols: usize, data: &[f64]| format!("{{rows: {rows}, cols: {cols}, data: {}}}", yaml::list(data));
    format!(
        "{name}:\n  image_width: {}\n  image_height: {}\n  camera_name: {name}\n  camera_matrix: {}\n  distortion_model: {}\n  \
         distortion_coefficients: {}\n  rectification_matrix: {}\n  projection_matrix: {}\n",
        camera.width,
        camera.height,
        array(3, 3, camera.intrinsics().transpose().as_slice()),
        Pinhole::DISTORTION_MODEL,
        array(1, 5, &camera.distortion),
        array(3, 3, Matrix3::identity().as_slice()),
        array(3, 4, projection.transpose().as_slice()),
    )
}

fn pose(name: &str, pose: &Isometry3<f64>) -> String {
    let rotation = pose.rotation.to_rotation_matrix().into_inner().transpose();
    let translation = yaml::list(pose.translation.vector.as_slice());
    format!("{name}: {{rotation: {}, translation: {translation}}}\n", yaml::list(rotation.as_slice()))
}
