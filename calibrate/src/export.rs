//! The calibration for other programs: ROS `camera_info`, a Kalibr camera chain, OpenCV's stereo parameters.
//!
//! Rectification turns both cameras so that their x axes lie along the baseline and their rows match: `R1`, `R2`; both get one focal length
//! `f` and one principal point, the one that centres the images on average (OpenCV's zero disparity):
//!
//! ```text
//! P1 = [f 0 cx 0; 0 f cy 0; 0 0 1 0],   P2 = P1 with P2[0][3] = f t_x [px m], negative with the right camera on the right
//! ```

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Matrix3x4, Matrix4, Rotation3, Vector2, Vector3};
use raven::camera::{Cameras, Pinhole};
use raven::files::write_atomic;
use raven::{Error, Result, yaml};

/// Both cameras turned and scaled so that one row of pixels shows the same in both.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rectification {
    /// Rectified frame from each camera's frame.
    pub rotations: [Matrix3<f64>; 2],
    /// Pixels from the left rectified frame [px, px m].
    pub projections: [Matrix3x4<f64>; 2],
}

impl Rectification {
    /// Of a pair side by side; `None` where the distortion of an image's corner cannot be undone.
    #[must_use]
    pub fn of(cameras: &Cameras) -> Option<Self> {
        let right_from_left = cameras.right_from_left.rotation.to_rotation_matrix();
        // From the left camera's centre to the right one's, in the left frame; x points to the right in either order of the cameras.
        let baseline = -(right_from_left.inverse() * cameras.right_from_left.translation.vector);
        let x = baseline.normalize() * if baseline.x < 0.0 { -1.0 } else { 1.0 };
        let ahead = Vector3::z() + right_from_left.inverse() * Vector3::z();
        let z = (ahead - x * x.dot(&ahead)).normalize();
        let left = Matrix3::from_rows(&[x.transpose(), z.cross(&x).transpose(), z.transpose()]);
        let rotations = [left, left * right_from_left.inverse().matrix()];
        let pinholes = [&cameras.left, &cameras.right];
        let focal = pinholes.iter().map(|c| 0.25 * (c.fx + c.fy)).sum::<f64>();
        let middles = [middle(pinholes[0], &rotations[0])?, middle(pinholes[1], &rotations[1])?];
        let half = pinholes.map(|c| Vector2::new(f64::from(c.width) - 1.0, f64::from(c.height) - 1.0) * 0.5);
        let centre = (half[0] - middles[0] * focal + half[1] - middles[1] * focal) * 0.5;
        let shift = focal * (rotations[1] * cameras.right_from_left.translation.vector).x;
        let projection = |shift: f64| Matrix3x4::new(focal, 0.0, centre.x, shift, 0.0, focal, centre.y, 0.0, 0.0, 0.0, 1.0, 0.0);
        Some(Self { rotations, projections: [projection(0.0), projection(shift)] })
    }

    /// `(X Y Z W)' = Q (u v disparity 1)'`.
    fn disparity_to_point(&self) -> Matrix4<f64> {
        let [left, right] = &self.projections;
        let (focal, tx) = (left[(0, 0)], right[(0, 3)] / right[(0, 0)]);
        let column = Vector3::new(-left[(0, 2)], -left[(1, 2)], focal);
        let mut q = Matrix4::identity();
        q.fixed_view_mut::<3, 1>(0, 3).copy_from(&column);
        (q[(2, 2)], q[(3, 2)], q[(3, 3)]) = (0.0, -1.0 / tx, 0.0);
        q
    }
}

/// Mean of where an image's four corners come to lie, in rectified normalised coordinates.
fn middle(camera: &Pinhole, rotation: &Matrix3<f64>) -> Option<Vector2<f64>> {
    let (right, bottom) = (f64::from(camera.width) - 1.0, f64::from(camera.height) - 1.0);
    let mut sum = Vector2::zeros();
    for pixel in [(0.0, 0.0), (right, 0.0), (0.0, bottom), (right, bottom)] {
        let ray = rotation * camera.undistort(&Vector2::new(pixel.0, pixel.1))?.push(1.0);
        sum += ray.xy() / ray.z;
    }
    Some(sum * 0.25)
}

fn rectified(cameras: &Cameras) -> Result<Rectification> {
    let message = "the cameras cannot be rectified: their distortion turns over within the image; calibrate with boards near its edges.";
    Rectification::of(cameras).ok_or_else(|| Error::Data(message.to_owned()))
}

/// The files that [`ros`] writes into a folder, left and right.
#[must_use]
pub fn ros_files(folder: &Path) -> [PathBuf; 2] {
    ["left.yaml", "right.yaml"].map(|name| folder.join(name))
}

/// Writes `left.yaml` and `right.yaml` as ROS's `camera_info_manager` loads them; the folder is made where it is missing.
///
/// # Errors
/// If the cameras cannot be rectified, or the files cannot be written.
pub fn ros(cameras: &Cameras, folder: &Path) -> Result<()> {
    let rectification = rectified(cameras)?;
    std::fs::create_dir_all(folder).map_err(|e| Error::io(folder, "create", e))?;
    let files = ros_files(folder);
    for (i, (name, camera)) in [("left", &cameras.left), ("right", &cameras.right)].into_iter().enumerate() {
        let text = camera_info(name, camera, &rectification.rotations[i], &rectification.projections[i]);
        write_atomic(&files[i], text.as_bytes())?;
    }
    Ok(())
}

fn camera_info(name: &str, camera: &Pinhole, rotation: &Matrix3<f64>, projection: &Matrix3x4<f64>) -> String {
    let matrix = |key: &str, (rows, columns): (usize, usize), data: &[f64]| {
        format!("{key}:\n  rows: {rows}\n  cols: {columns}\n  data: {}\n", yaml::list(data))
    };
    [
        format!("image_width: {}\nimage_height: {}\ncamera_name: {name}\n", camera.width, camera.height),
        matrix("camera_matrix", (3, 3), by_rows(&camera.intrinsics()).as_slice()),
        format!("distortion_model: {}\n", Pinhole::DISTORTION_MODEL),
        matrix("distortion_coefficients", (1, 5), &camera.distortion),
        matrix("rectification_matrix", (3, 3), by_rows(rotation).as_slice()),
        matrix("projection_matrix", (3, 4), projection.transpose().as_slice()),
    ]
    .concat()
}

/// Writes a Kalibr camera chain, `camchain.yaml`.
///
/// # Errors
/// If a camera has a sixth-order distortion, which Kalibr's `radtan` has no place for, or the file cannot be written.
pub fn kalibr(cameras: &Cameras, path: &Path) -> Result<()> {
    let mut text = String::new();
    for (i, camera) in [&cameras.left, &cameras.right].into_iter().enumerate() {
        let [k1, k2, p1, p2, k3] = camera.distortion;
        if k3 != 0.0 {
            return Err(Error::Argument(format!("Kalibr's radtan model has no k3, and camera {i} has k3 = {k3}; calibrate without --k3.")));
        }
        let _ = write!(
            text,
            "cam{i}:\n  cam_overlaps: [{}]\n  camera_model: pinhole\n  distortion_coeffs: {}\n  distortion_model: radtan\n  intrinsics: {}\n  \
             resolution: [{}, {}]\n  rostopic: /stereo/{}/image_raw\n",
            1 - i,
            yaml::list(&[k1, k2, p1, p2]),
            yaml::list(&[camera.fx, camera.fy, camera.cx, camera.cy]),
            camera.width,
            camera.height,
            ["left", "right"][i],
        );
        if i == 1 {
            text += "  T_cn_cnm1:\n";
            for row in cameras.right_from_left.to_homogeneous().row_iter() {
                let _ = writeln!(text, "  - {}", yaml::list(&row.iter().copied().collect::<Vec<_>>()));
            }
        }
    }
    write_atomic(path, text.as_bytes())
}

/// Writes OpenCV's stereo parameters, as its stereo sample names them, for `cv::FileStorage`.
///
/// # Errors
/// If the cameras cannot be rectified, or the file cannot be written.
pub fn opencv(cameras: &Cameras, path: &Path) -> Result<()> {
    let rectification = rectified(cameras)?;
    let mut text = String::from("%YAML:1.0\n---\n");
    let _ = write!(text, "image_width: {}\nimage_height: {}\n", cameras.left.width, cameras.left.height);
    let mut matrix = |name: &str, (rows, columns): (usize, usize), data: &[f64]| {
        let numbers: Vec<String> = data.iter().map(|&v| yaml::float(v)).collect();
        let list = numbers.join(", ");
        let _ = write!(text, "{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: [ {list} ]\n");
    };
    for (i, camera) in [&cameras.left, &cameras.right].into_iter().enumerate() {
        matrix(["M1", "M2"][i], (3, 3), by_rows(&camera.intrinsics()).as_slice());
        matrix(["D1", "D2"][i], (1, 5), &camera.distortion);
    }
    let rotation: Rotation3<f64> = cameras.right_from_left.rotation.to_rotation_matrix();
    matrix("R", (3, 3), by_rows(rotation.matrix()).as_slice());
    matrix("T", (3, 1), cameras.right_from_left.translation.vector.as_slice());
    for i in 0..2 {
        matrix(["R1", "R2"][i], (3, 3), by_rows(&rectification.rotations[i]).as_slice());
        matrix(["P1", "P2"][i], (3, 4), rectification.projections[i].transpose().as_slice());
    }
    matrix("Q", (4, 4), rectification.disparity_to_point().transpose().as_slice());
    write_atomic(path, text.as_bytes())
}

/// The numbers of a matrix row by row; its memory holds them column by column.
fn by_rows(matrix: &Matrix3<f64>) -> Matrix3<f64> {
    matrix.transpose()
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Point3};
    use raven::camera::Quality;

    use super::*;

    fn pair() -> Cameras {
        let left =
            Pinhole { width: 640, height: 480, fx: 533.0, fy: 534.0, cx: 342.0, cy: 235.0, distortion: [-0.28, 0.1, 1e-3, 2e-4, 0.0] };
        let right = Pinhole { fx: 537.0, fy: 536.0, cx: 327.0, cy: 250.0, ..left };
        let right_from_left = Isometry3::new(Vector3::new(-0.0998, 0.0011, -0.0002), Vector3::new(0.0065, 0.0045, -0.0035));
        Cameras { left, right, right_from_left, base_from_left: None, latency_s: 0.0, right_minus_left_s: 0.0, quality: Quality::default() }
    }

    fn swapped(cameras: &Cameras) -> Cameras {
        Cameras { left: cameras.right, right: cameras.left, right_from_left: cameras.right_from_left.inverse(), ..cameras.clone() }
    }

    #[test]
    fn a_point_is_on_one_row_of_both_rectified_images_and_its_disparity_tells_its_depth() {
        for cameras in [pair(), swapped(&pair())] {
            let rectification = Rectification::of(&cameras).unwrap();
            for rotation in &rectification.rotations {
                assert!((rotation * rotation.transpose() - Matrix3::identity()).amax() < 1e-12 && rotation.determinant() > 0.0);
                assert!(rotation.trace() > 2.9, "{rotation}");
            }
            let point = Vector3::new(0.03, -0.05, 0.4);
            let left = rectification.rotations[0] * point;
            let right = rectification.rotations[1] * (cameras.right_from_left * Point3::from(point)).coords;
            let pixel = |projection: &Matrix3x4<f64>, p: &Vector3<f64>| {
                let image = projection.fixed_view::<3, 3>(0, 0) * p;
                image.xy() / image.z
            };
            let seen = [pixel(&rectification.projections[0], &left), pixel(&rectification.projections[1], &right)];
            assert!((seen[0].y - seen[1].y).abs() < 1e-9, "{seen:?}");
            // The projection of the right camera, applied to the left rectified frame, sees the same.
            let same = rectification.projections[1] * left.push(1.0);
            assert!((same.xy() / same.z - seen[1]).norm() < 1e-9, "{same}");
            let found = rectification.disparity_to_point() * nalgebra::Vector4::new(seen[0].x, seen[0].y, seen[0].x - seen[1].x, 1.0);
            assert!((found.xyz() / found.w - left).norm() < 1e-12, "{found}");
        }
    }

    #[test]
    fn kalibr_has_no_k3() {
        let folder = tempfile::tempdir().unwrap();
        let mut cameras = pair();
        cameras.left.distortion[4] = 0.1;
        let error = kalibr(&cameras, &folder.path().join("camchain.yaml")).unwrap_err();
        assert!(matches!(&error, Error::Argument(s) if s.contains("--k3")), "{error}");
    }
}
