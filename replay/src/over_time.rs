//! Figures of a log over time: where the joints were by each estimate, and how far off it was.

use raven::filter::FilterRun;
use raven::log::JointSeries;
use raven::plot::{Mark, Panel, Series};
use raven::robot::Joint;

use crate::errors::{Estimate, Estimates, JointErrors};

/// One joint of a log, in its display unit.
#[derive(Debug, Clone, Copy)]
pub struct OverTime<'a> {
    /// The joint.
    pub joint: &'a Joint,
    /// Its place in the arm.
    pub j: usize,
    /// Its estimates.
    pub estimates: &'a Estimates,
    /// What is shown ends there [s].
    pub until_s: f64,
}

impl OverTime<'_> {
    /// Positions by each estimate, and by the reference encoder if there is one.
    #[must_use]
    pub fn positions(&self, reference: Option<&JointSeries>) -> Panel {
        let j = self.j;
        let of = |e: &Estimate| e.time_s.iter().zip(&e.joints).map(|(&t, q)| (t, q[j])).collect::<Vec<_>>();
        let mut curves = vec![
            self.series("camera", &of(&self.estimates.camera), Mark::Points),
            self.series("as recorded", &of(&self.estimates.believed), Mark::Line),
            self.series("filter", &of(&self.estimates.filter), Mark::Line),
        ];
        if let Some(reference) = reference {
            let truth: Vec<_> = reference.time_s.iter().copied().zip(reference.position[j].iter().copied()).collect();
            curves.push(self.series("joint encoder", &truth, Mark::Line));
        }
        self.panel(self.joint.name.clone(), "position", curves)
    }

    /// Errors against the reference encoder; if the filter's `run` is given, with its own band of two sigma in place of what was recorded.
    #[must_use]
    pub fn errors(&self, reference: &JointSeries, run: Option<&FilterRun>) -> Panel {
        let errors = JointErrors::new(self.estimates, reference, self.j);
        let beside = run.map_or_else(|| self.series("as recorded", &errors.believed, Mark::Line), |run| self.band(run));
        let curves = vec![self.series("camera", &errors.camera, Mark::Points), beside, self.series("filter", &errors.filter, Mark::Line)];
        self.panel(format!("{}: error", self.joint.name), "error", curves)
    }

    fn band(&self, run: &FilterRun) -> Series {
        let scale = self.joint.display_unit().1;
        let shown = run.filtered.time_s.iter().zip(run.filtered.std()).filter(|(t, _)| **t <= self.until_s);
        let edges: Vec<_> = shown.map(|(t, std)| (*t, -2.0 * std[self.j] * scale, 2.0 * std[self.j] * scale)).collect();
        Series::band("filter's two sigma", &edges)
    }

    fn series(&self, label: &str, samples: &[(f64, f64)], mark: Mark) -> Series {
        let scale = self.joint.display_unit().1;
        let shown = samples.iter().filter(|(t, _)| *t <= self.until_s);
        Series { label: label.to_owned(), samples: shown.map(|(t, value)| (*t, value * scale)).collect(), mark }
    }

    fn panel(&self, title: String, quantity: &str, series: Vec<Series>) -> Panel {
        let y_label = format!("{quantity} [{}]", self.joint.display_unit().0);
        Panel { title, x_label: "time [s]".to_owned(), y_label, series }
    }
}
