//! An effect that was diagnosed, put into the robot file: the model with it and the model of the new file are the same.

use super::{Home, Model, Sited};
use crate::camera::Cameras;
use crate::robot::Robot;
use crate::{Error, Result};

impl Sited {
    /// The robot file with this effect in it, with values in the units of its parameters: in the file's numbers where those can say it,
    /// in its list of effects otherwise. The encoders stay set as the old file set them. `cameras` say how the rig stands, where the
    /// effect is in their frame.
    ///
    /// # Errors
    /// If the robot is no arm, a value is beyond its range, the effect belongs to the camera file, or is in the list already.
    pub fn added_to(&self, robot: &Robot, cameras: Option<&Cameras>, values: &[f64]) -> Result<Robot> {
        let id = self.effect.id;
        if values.len() != self.effect.parameters.len() {
            let names: Vec<&str> = self.effect.parameters.iter().map(|parameter| parameter.name).collect();
            return Err(Error::Argument(format!("{id} takes {}; {} values are given.", names.join(", "), values.len())));
        }
        self.check_values(values)?;
        match self.effect.home() {
            Home::Numbers => self.in_numbers_of(robot, cameras, values),
            Home::List => {
                if self.is_listed(robot) {
                    let message =
                        format!("{id} is in the robot file's list of effects already; change its values there, or take it out first.");
                    return Err(Error::Argument(message));
                }
                robot.arm()?;
                let mut new = robot.clone();
                new.effects.push(self.listed(robot, values));
                Ok(new)
            }
            Home::Cameras => Err(Error::Argument(format!(
                "{id} belongs to the cameras and not to the robot: calibrate them anew with raven-calibrate cameras; nothing is written."
            ))),
        }
    }

    /// The robot as a recording begins whose motion before left of this effect, which the file has, those of `values` that are
    /// [`Scale::State`](super::Scale::State). The others have to be those of no effect.
    ///
    /// # Errors
    /// If the robot is no arm, or the effect belongs to the camera file.
    pub fn begun(&self, robot: &Robot, values: &[f64]) -> Result<Robot> {
        if !self.is_listed(robot) {
            return self.added_to(robot, None, values);
        }
        let mut begun = robot.clone();
        self.begin_listed(&mut begun, values);
        Ok(begun)
    }

    fn in_numbers_of(&self, robot: &Robot, cameras: Option<&Cameras>, values: &[f64]) -> Result<Robot> {
        let model = Model::new(robot, cameras)?.with_values(self, values);
        let mut new = model.robot;
        for (joint, before) in new.joints.iter_mut().zip(&robot.joints) {
            joint.motor_at_hard_stop = before.motor_at_hard_stop;
        }
        new.effects.clone_from(&robot.effects);
        new.keep_encoders_of(robot)?;

        let view = &model.view;
        let rig_moved = view.rotation.norm() > 0.0 || view.translation_m.norm() > 0.0;
        if rig_moved && !view.has_cameras() {
            return Err(Error::Argument(format!(
                "{} is in the left camera's frame, and where that stands is not known; give --cameras with the registered camera file.",
                self.effect.id
            )));
        }
        // The correction turns about the tip at the hard stop, which a new hard stop, tool or link angle moves.
        let arm = new.arm()?;
        if rig_moved || robot.observation.corrects_registration() {
            new.observation = view.observation(&arm.kinematics.forward(&arm.hard_stop));
        }
        new.observation.latency = view.latency_s;
        Ok(new)
    }
}
