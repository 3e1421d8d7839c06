//! `raven_2/raven_state`, the robot's own message: written in the layout of the public controller, read in any.
//!
//! All angles in it are in degrees, and the insertion is treated as if it were one: 0.40 m reads 22.918. Forks of the controller have other
//! fields, so reading goes by name in the definition stored in the file. MD5 of the layout written here:
//! `ce9e7f4969049d8bb365de3c98461a01`.

use super::header::ros1_extractor;
use super::ros1::{Extractor, HEADER_STAMPS, header_stamp};
use super::{Channel, Stamp};
use crate::robot::ArmSide;

/// Name of the message type.
pub const RAVEN_STATE_TYPE: &str = "raven_2/raven_state";

/// Definition of the message as it goes into logs.
pub const RAVEN_STATE_DEFINITION: &str = "\
Header      hdr
int32       runlevel
int32       sublevel
int32       last_seq
int32[2]    type
int32[6]    pos
float32[18] ori
float32[18] ori_d
int32[6]    pos_d
duration    dt
int32[16]   encVals
int32[16]   dac_val
float32[16] tau
float32[16] mpos
float32[16] jpos
float32[16] mvel
float32[16] jvel
float32[16] mpos_d
float32[16] jpos_d
float32[2]  grasp_d
float32[16] encoffsets
float32[12] jac_vel
float32[12] jac_f
================================================================================
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
";

/// Names of the first three joints of an arm.
pub const ARM_JOINTS: [&str; 3] = ["shoulder", "elbow", "insertion"];

/// Index of an arm's shoulder in the 16-long arrays of the message.
#[must_use]
pub const fn arm_offset(arm: ArmSide) -> usize {
    match arm {
        ArmSide::Gold => 0,
        ArmSide::Green => 8,
    }
}

/// One message, field by field in the message's own units; arrays of 16 are gold 0-7, green 8-15.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RavenState {
    /// Counter; the robot itself leaves it at 0.
    pub seq: u32,
    /// 0 emergency stop, 1 initialising, 2 pedal up, 3 pedal down.
    pub runlevel: i32,
    /// State within the run level.
    pub sublevel: i32,
    /// Counter of the last packet from the console.
    pub last_seq: i32,
    /// Kind of each arm.
    pub mechanism_type: [i32; 2],
    /// Tip in frame 0, gold then green (um).
    pub pos_um: [i32; 6],
    /// Orientation of the tip, two row-major matrices.
    pub ori: [f32; 18],
    /// Desired orientation.
    pub ori_d: [f32; 18],
    /// Desired tip (um).
    pub pos_d_um: [i32; 6],
    /// Seconds and nanoseconds since the last message.
    pub dt: [i32; 2],
    /// Raw encoder counts, without the arm's sign.
    pub encoder_counts: [i32; 16],
    /// Commands to the amplifiers (counts).
    pub dac: [i32; 16],
    /// Commanded torque after the gear box, at the capstan (N m).
    pub tau: [f32; 16],
    /// Motor shaft angles (deg).
    pub mpos_deg: [f32; 16],
    /// The controller's joint angles (deg), insertion (m x 180/pi).
    pub jpos_deg: [f32; 16],
    /// Motor speeds (deg/s).
    pub mvel_deg_s: [f32; 16],
    /// The controller's joint speeds (deg/s).
    pub jvel_deg_s: [f32; 16],
    /// Desired motor angles (deg).
    pub mpos_d_deg: [f32; 16],
    /// Desired joint angles (deg).
    pub jpos_d_deg: [f32; 16],
    /// Desired grasp (rad).
    pub grasp_d: [f32; 2],
    /// Encoder counts at zero of the motor angle.
    pub encoder_offsets: [f32; 16],
    /// Tip speeds.
    pub jac_vel: [f32; 12],
    /// Tip forces; the controller repeats `jac_vel` here.
    pub jac_f: [f32; 12],
}

impl RavenState {
    /// The message on the wire: 980 bytes, with an empty frame name as the robot sends it.
    #[must_use]
    pub fn encode(&self, stamp: Stamp) -> Vec<u8> {
        let (seconds, nanoseconds) = stamp.to_ros();
        let mut wire = Vec::with_capacity(980);
        for number in [self.seq, seconds, nanoseconds, 0] {
            wire.extend_from_slice(&number.to_le_bytes());
        }
        put_integers(&mut wire, &[self.runlevel, self.sublevel, self.last_seq]);
        put_integers(&mut wire, &self.mechanism_type);
        put_integers(&mut wire, &self.pos_um);
        put_floats(&mut wire, &self.ori);
        put_floats(&mut wire, &self.ori_d);
        put_integers(&mut wire, &self.pos_d_um);
        put_integers(&mut wire, &self.dt);
        put_integers(&mut wire, &self.encoder_counts);
        put_integers(&mut wire, &self.dac);
        put_floats(&mut wire, &self.tau);
        for angles in [&self.mpos_deg, &self.jpos_deg, &self.mvel_deg_s, &self.jvel_deg_s, &self.mpos_d_deg, &self.jpos_d_deg] {
            put_floats(&mut wire, angles);
        }
        put_floats(&mut wire, &self.grasp_d);
        put_floats(&mut wire, &self.encoder_offsets);
        put_floats(&mut wire, &self.jac_vel);
        put_floats(&mut wire, &self.jac_f);
        wire
    }
}

fn put_integers(wire: &mut Vec<u8>, values: &[i32]) {
    wire.extend(values.iter().flat_map(|value| value.to_le_bytes()));
}

fn put_floats(wire: &mut Vec<u8>, values: &[f32]) {
    wire.extend(values.iter().flat_map(|value| value.to_le_bytes()));
}

/// The first three joints of one arm in one message.
pub(super) struct MotorSample {
    pub(super) stamp: Option<Stamp>,
    /// Motor shaft angles (rad).
    pub(super) motor: [f64; 3],
    /// Torque after the gear box, before clipping (N m).
    pub(super) torque: Option<[f64; 3]>,
    /// The controller's joint angles (rad, rad, m).
    pub(super) controller: Option<[f64; 3]>,
    /// What the converters were given.
    pub(super) steps: Option<[i32; 3]>,
}

/// Reads one arm out of the robot's messages.
pub(super) struct StateDecoder {
    extractor: Extractor,
    offset: usize,
}

impl StateDecoder {
    /// # Errors
    /// Half a sentence about the channel.
    pub(super) fn new(channel: &Channel, arm: ArmSide) -> Result<Self, String> {
        if channel.message_encoding != "ros1" {
            return Err(format!("its messages are encoded as `{}`; the robot's own message is read in `ros1`", channel.message_encoding));
        }
        let [header, hdr] = HEADER_STAMPS;
        let extractor = ros1_extractor(channel, &[header, hdr, "mpos", "tau", "jpos", "dac_val"])?;
        if !extractor.has(2) {
            return Err("its messages have no field `mpos`; `source.format` in the robot file may be wrong".to_owned());
        }
        Ok(Self { extractor, offset: arm_offset(arm) })
    }

    /// `None` if the message does not fit its definition or has too few joints.
    pub(super) fn decode(&self, message: &[u8]) -> Option<MotorSample> {
        let [header, hdr, mpos, tau, jpos, steps] = self.extractor.walk(message).ok()?;
        let three = |value: super::ros1::Value<'_>| -> Option<[f64; 3]> {
            Some([value.number(self.offset)?, value.number(self.offset + 1)?, value.number(self.offset + 2)?])
        };
        let integer = |value: super::ros1::Value<'_>, joint| i32::try_from(value.integer(self.offset + joint)?).ok();
        Some(MotorSample {
            stamp: header_stamp([header, hdr]),
            motor: three(mpos?)?.map(f64::to_radians),
            torque: tau.and_then(three),
            controller: jpos.and_then(three).map(|angles| angles.map(f64::to_radians)),
            steps: steps.and_then(|value| Some([integer(value, 0)?, integer(value, 1)?, integer(value, 2)?])),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::ros1::{Definition, md5::md5sum};

    #[test]
    fn the_definition_is_the_public_controllers() {
        let definition = Definition::parse(RAVEN_STATE_TYPE, RAVEN_STATE_DEFINITION).unwrap();
        assert_eq!(md5sum(&definition).unwrap(), "ce9e7f4969049d8bb365de3c98461a01");
    }

    /// Every field comes back under its name, so the order written is the order defined.
    #[test]
    fn the_layout_written_is_the_layout_defined() {
        let mut last = 0;
        let mut next = || {
            last += 1;
            last
        };
        macro_rules! count_through {
            ($($field:ident),*) => { RavenState { $($field: std::array::from_fn(|_| next() as _),)* ..RavenState::default() } };
        }
        let mut state = count_through!(
            mechanism_type,
            pos_um,
            ori,
            ori_d,
            pos_d_um,
            encoder_counts,
            dac,
            tau,
            mpos_deg,
            jpos_deg,
            mvel_deg_s,
            jvel_deg_s,
            mpos_d_deg,
            jpos_d_deg,
            grasp_d,
            encoder_offsets,
            jac_vel,
            jac_f
        );
        (state.runlevel, state.sublevel, state.last_seq) = (-2, -1, 0);
        let wire = state.encode(Stamp::from_ros(5, 6));
        assert_eq!(wire.len(), 980);
        let definition = Definition::parse(RAVEN_STATE_TYPE, RAVEN_STATE_DEFINITION).unwrap();
        let mut expected = -3.0;
        for field in definition.fields(RAVEN_STATE_TYPE).iter().filter(|field| field.name != "hdr" && field.name != "dt") {
            let [value] = Extractor::new(&definition, &[&field.name]).unwrap().walk(&wire).unwrap();
            let value = value.unwrap();
            for i in 0..value.len() {
                expected += 1.0;
                assert_eq!(value.number(i), Some(expected), "{}[{i}]", field.name);
            }
        }
        assert_eq!(expected, f64::from(last));
    }
}
