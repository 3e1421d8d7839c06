//! What the motion before each recording left of effects that the robot file has: creep that has not settled, slip, where in its loop a cable is. It is no
//! gap of the file.

use nalgebra::DVector;
use raven::Result;

use super::fit::Fitter;
use super::fit::linear::Quadratic;
use super::numbers::coordinates::Coordinates;
use super::recorded::rows::{ALL, Links, Observed};
use super::recorded::settings::Setting;

/// Step of the difference quotient by what was left, of its deviation.
const LEFT_STEP: f64 = 0.1;

/// What the motion before the recordings left of effects that the file has, where effects are `added` with these settings and the file's numbers
/// are as it has them: the model goes nearly straight by it.
///
/// # Errors
/// If the robot does not fit the recordings.
pub(crate) fn left(rows: &dyn Observed, coordinates: &Coordinates, added: &[usize], settings: &[Setting]) -> Result<Vec<Setting>> {
    let left: Vec<usize> = coordinates.left().filter(|&c| !added.contains(&coordinates.all[c].effect)).collect();
    if left.is_empty() {
        return Ok(Vec::new());
    }
    let fitter = Fitter::new(rows, coordinates);
    let begun = |of_left: &[f64]| {
        let mut u = fitter.nowhere();
        left.iter().zip(of_left).for_each(|(&c, value)| u[c] = *value);
        coordinates.settings(&u)
    };
    let residuals = |begun: Vec<Setting>| rows.residuals(&[settings, &begun].concat(), Links::Settled, &ALL);
    let slope = |k: usize| -> Result<Vec<f64>> {
        let [behind, ahead] = [-LEFT_STEP, LEFT_STEP].map(|step| {
            let mut of_left = vec![0.0; left.len()];
            of_left[k] = step;
            residuals(begun(&of_left))
        });
        // As of a search: what is left less what a step takes of it.
        Ok(behind?.iter().zip(&ahead?).map(|(behind, ahead)| (behind - ahead) / (2.0 * LEFT_STEP)).collect())
    };
    let slopes = (0..left.len()).map(slope).collect::<Result<Vec<_>>>()?;
    let slopes: Vec<&[f64]> = slopes.iter().map(Vec::as_slice).collect();
    let quadratic = Quadratic::new(&slopes, &residuals(Vec::new())?);
    let most_probable = quadratic.minimum(&DVector::zeros(left.len()), &fitter.precision(&left, added));
    Ok(most_probable.map(|(step, _)| begun(step.as_slice())).unwrap_or_default())
}
