//! Where an effect is looked for first: at some of its values where it is not smooth.

use std::cmp::Ordering;

use raven::effects::{Channel, Scale};

use crate::evidence::fit::Fitter;

impl Fitter<'_> {
    /// How many shapes an effect is looked for with.
    pub(crate) fn shapes_looked_at(&self, effect: usize) -> usize {
        let parameters = self.coordinates.sited[effect].effect.parameters;
        let mut starts = self.starts(effect, &self.nowhere());
        for start in &mut starts {
            start.iter_mut().zip(parameters).filter(|(_, parameter)| parameter.scale.is_size()).for_each(|(value, _)| *value = 0.0);
        }
        starts.sort_by(|a, b| a.partial_cmp(b).unwrap_or(Ordering::Equal));
        starts.dedup();
        starts.len()
    }

    /// Where to start looking for an effect: its numbers in units of their slabs.
    pub(crate) fn starts(&self, effect: usize, base: &[f64]) -> Vec<Vec<f64>> {
        let parameters = self.coordinates.sited[effect].effect.parameters;
        let alone = parameters.len() == 1;
        let shaped = parameters.iter().any(|p| !p.scale.is_size());
        let counted = parameters.iter().any(|p| matches!(p.scale, Scale::Whole { .. }));
        let sizes_vanish = parameters.iter().any(|p| matches!(p.scale, Scale::Offset(_) | Scale::Magnitude(_) | Scale::Part));
        // A limit has no slope where nothing reaches it, and far too much where everything does.
        let fine: Vec<f64> = (-10..=8).map(|k| 0.25 * f64::from(k)).collect();
        let happens = parameters.iter().any(|p| matches!(p.scale, Scale::Moment));
        let seen = if happens { self.rows.miscounts(self.coordinates.sited[effect].joint_measured()) } else { &[] };
        let moments: Vec<f64> = (0..10).map(|k| 0.05 + 0.1 * f64::from(k)).chain(seen.iter().copied()).collect();
        let is_cheap = self.coordinates.sited[effect].effect.channels == [Channel::Torque];
        let mut starts: Vec<Vec<f64>> = vec![Vec::new()];
        for (parameter, c) in parameters.iter().zip(self.coordinates.of(effect)) {
            let whole = parameter.scale.whole();
            let values: &[f64] = match parameter.scale {
                _ if self.coordinates.all[c].is_unknown() => &base[c..=c],
                // What may be a hundred times the nominal value has slopes that say nothing of it.
                Scale::Factor { size, .. } if size > 2.0 => &[base[c], -1.2, 0.8, 1.6, 2.4, 3.2],
                Scale::Factor { .. } => &[base[c], -1.2, 0.8, 1.6],
                // A whole number has no slope in any case, and what the size does is as it is for the other sign.
                Scale::Offset(_) if counted => &[0.5],
                // Beside a shape the size must not vanish, or the shape has no slope.
                Scale::Offset(_) if shaped => &[-0.5, 0.5],
                // Where the nominal model has borne it so far.
                Scale::Offset(_) => &base[c..=c],
                Scale::Part => &[0.5, 1.0],
                Scale::Magnitude(_) if shaped => &[0.05, 0.5, 1.5],
                Scale::Magnitude(_) => &[0.04, 0.15, 0.5, 1.5],
                Scale::Shape { .. } if alone && is_cheap => &fine,
                Scale::Shape { .. } if alone => &[-2.5, -1.5, -0.5, 0.5, 1.5],
                // A second shape is left to the fit.
                Scale::Shape { .. } if starts[0].iter().zip(parameters).any(|(_, p)| p.scale.is_shape()) => &[0.0],
                Scale::Shape { .. } => &[-1.0, 0.0, 1.0],
                // Where the size vanishes, nothing has been anywhere.
                Scale::State { .. } if !sizes_vanish => &[0.0],
                Scale::State { .. } => &[0.0, 1.0],
                Scale::Whole { .. } => &whole,
                Scale::Moment => &moments,
            };
            starts = starts.iter().flat_map(|start| values.iter().map(move |v| [start.as_slice(), &[*v]].concat())).collect();
        }
        starts
    }
}
