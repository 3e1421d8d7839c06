//! The effects, one file each.

mod backlash;
mod cable_coupling;
mod cable_damping;
mod cable_slip;
mod cable_stiffening;
mod cable_stretch;
mod camera_rotation;
mod camera_translation;
mod clock_drift;
mod creep;
mod hysteresis;
mod joint_offset;
mod lens_distortion;
mod link_angle;
mod link_coulomb_friction;
mod link_inertia;
mod link_viscous_friction;
mod load_dependent_friction;
mod missed_counts;
mod motor_coulomb_friction;
mod motor_inertia;
mod motor_viscous_friction;
mod payload;
mod pulley_eccentricity;
mod pulley_radius;
mod rolling_shutter;
mod stereo_desync;
mod stereo_scale;
mod stribeck_friction;
mod time_offset;
mod tool_length;
mod torque_constant;
mod torque_ripple;
mod torque_saturation;

use super::{Amount, Effect};

/// The registry.
pub const ALL: &[&Effect] = &[
    &pulley_radius::EFFECT,
    &joint_offset::EFFECT,
    &cable_coupling::EFFECT,
    &cable_stretch::EFFECT,
    &cable_stiffening::EFFECT,
    &cable_damping::EFFECT,
    &backlash::EFFECT,
    &hysteresis::EFFECT,
    &creep::EFFECT,
    &cable_slip::EFFECT,
    &pulley_eccentricity::EFFECT,
    &link_coulomb_friction::EFFECT,
    &link_viscous_friction::EFFECT,
    &load_dependent_friction::EFFECT,
    &payload::EFFECT,
    &link_inertia::EFFECT,
    &motor_coulomb_friction::EFFECT,
    &motor_viscous_friction::EFFECT,
    &motor_inertia::EFFECT,
    &stribeck_friction::EFFECT,
    &torque_constant::EFFECT,
    &torque_saturation::EFFECT,
    &torque_ripple::EFFECT,
    &tool_length::EFFECT,
    &link_angle::EFFECT,
    &camera_rotation::EFFECT,
    &camera_translation::EFFECT,
    &stereo_scale::EFFECT,
    &lens_distortion::EFFECT,
    &time_offset::EFFECT,
    &clock_drift::EFFECT,
    &stereo_desync::EFFECT,
    &rolling_shutter::EFFECT,
    &missed_counts::EFFECT,
];

/// Effects on numbers that a nominal model may lack or have as zero.
pub const AMOUNTS: &[&Amount] = &[
    &cable_stretch::AMOUNT,
    &link_coulomb_friction::AMOUNT,
    &link_viscous_friction::AMOUNT,
    &motor_coulomb_friction::AMOUNT,
    &motor_viscous_friction::AMOUNT,
    &motor_inertia::AMOUNT,
];
