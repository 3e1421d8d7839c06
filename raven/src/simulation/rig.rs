//! Two webcams on a stand before the robot: as they are believed to be, and as they are.
//!
//! The stand is built so that the left camera's axes are frame 0's in another order. Gold: `x0 = -y, y0 = z, z0 = -x`; green, the
//! mirror image: `x0 = -y, y0 = -z, z0 = x`.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rand::{Rng, RngExt};

use super::effect::{Effect, EffectKind};
use crate::camera::{Cameras, Pinhole, Quality};
use crate::observation::TipCorrection;
use crate::robot::ArmSide;

/// Where the stand puts the left camera, in frame 0 of the gold arm [m]: hard stop and working range are in both images.
const STAND_M: Vector3<f64> = Vector3::new(-0.062, -0.430, 0.024);
/// How far from there it really stands [m].
const STAND_SPREAD_M: f64 = 0.004;

/// The pair as a perfect calibration would describe it, and as it is once effects have bent it.
#[derive(Debug, Clone, PartialEq)]
pub struct Rig {
    /// What `cameras.yaml` would say.
    pub believed: Cameras,
    /// What makes the pixels.
    pub actual: Cameras,
}

impl Rig {
    /// Draws two cameras of one make on a stand, as they are believed to be.
    #[must_use]
    pub fn draw(arm: ArmSide, rng: &mut impl Rng) -> Cameras {
        let left = lens(-0.08, rng);
        let right = lens(-0.035, rng);
        let mut about = |size: f64| Vector3::from_fn(|_, _| rng.random_range(-size..size));
        let turn = UnitQuaternion::from_scaled_axis(about(0.005));
        let shift = Vector3::new(-0.048, 0.0, 0.0) + about(0.0004);
        let stand = STAND_M + about(STAND_SPREAD_M);
        let base_from_left = match arm {
            ArmSide::Gold => pose(Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, 1.0, -1.0, 0.0, 0.0), stand),
            ArmSide::Green => {
                let mirrored = Vector3::new(stand.x, -stand.y, GREEN_SIDE_M + stand.z - STAND_M.z);
                pose(Matrix3::new(0.0, -1.0, 0.0, 0.0, 0.0, -1.0, 1.0, 0.0, 0.0), mirrored)
            }
        };
        Cameras {
            left,
            right,
            right_from_left: Isometry3::from_parts(Translation3::from(shift), turn),
            base_from_left: Some(base_from_left),
            latency_s: 0.0,
            right_minus_left_s: 0.0,
            quality: Quality::default(),
        }
    }

    /// Lets effects loose on cameras that stand where a robot file corrects them to. `hard_stop_m` is the tip there, as believed.
    #[must_use]
    pub fn bent(believed: Cameras, hard_stop_m: &Vector3<f64>, correction: &TipCorrection, effects: &[Effect]) -> Self {
        let mut actual = believed.clone();
        for effect in effects {
            bend(&mut actual, effect, hard_stop_m);
        }
        if let (Some(before), Some(bent)) = (believed.base_from_left, actual.base_from_left.as_mut()) {
            *bent *= before.inverse() * correction.true_from_seen() * before;
        }
        Self { believed, actual }
    }
}

/// Sideways place of the green arm's stand [m].
const GREEN_SIDE_M: f64 = 0.008;

fn lens(k1: f64, rng: &mut impl Rng) -> Pinhole {
    let mut about = |middle: f64, spread: f64| rng.random_range(middle - spread..middle + spread);
    let fx = about(604.0, 8.0);
    Pinhole {
        width: 640,
        height: 480,
        fx,
        fy: fx * about(1.0, 0.002),
        cx: about(319.5, 8.0),
        cy: about(239.5, 8.0),
        distortion: [about(k1, 0.02), about(0.02, 0.01), about(0.0, 3e-4), about(0.0, 3e-4), 0.0],
    }
}

fn pose(rotation: Matrix3<f64>, translation: Vector3<f64>) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    Isometry3::from_parts(Translation3::from(translation), rotation)
}

fn bend(cameras: &mut Cameras, effect: &Effect, hard_stop_m: &Vector3<f64>) {
    let vector = || Vector3::from_iterator(effect.values.iter().copied().chain(std::iter::repeat(0.0)).take(3));
    let Some(registration) = cameras.base_from_left.as_mut() else { return };
    match effect.kind {
        EffectKind::CameraRotation => {
            // The registration saw the tip at the hard stop: that point keeps its place in the left camera.
            let seen = registration.inverse_transform_point(&Point3::from(*hard_stop_m));
            registration.rotation *= UnitQuaternion::from_scaled_axis(vector());
            registration.translation.vector = hard_stop_m - registration.rotation * seen.coords;
        }
        EffectKind::CameraTranslation => registration.translation.vector += registration.rotation * vector(),
        EffectKind::StereoScale => cameras.right_from_left.translation.vector *= 1.0 + effect.values[0],
        EffectKind::LensDistortion => {
            for camera in [&mut cameras.left, &mut cameras.right] {
                camera.distortion[0] += effect.values[0];
            }
        }
        _ => {}
    }
}
