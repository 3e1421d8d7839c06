//! The search on recordings made of nothing but what is tested.

use raven::Result;
use raven::effects::{Channel, Sited};
use raven::robot::{Robot, nominal};

use super::coordinates::Coordinates;
use super::fit::Fitter;
use super::rows::{Links, Observed, Setting};

/// Tips that see one coupling, and nothing else that could be off. Rolled-out links stick elsewhere where the coupling is below `sticks_below`,
/// in units of its slab; settled ones know nothing of it.
struct Coupled {
    robot: Robot,
    coupling: f64,
    sticks_below: f64,
}

const ROWS: usize = 300;
/// Rows that stick otherwise, and by how many deviations.
const STUCK: usize = 8;
const STICKS: f64 = 2.0;
/// Deviations by which a coupling of one slab moves tips, in the mean.
const SEEN: f64 = 3.0;

impl Coupled {
    fn is_seen(sited: &Sited) -> bool {
        sited.effect.id == "cable-coupling" && (sited.place.first, sited.place.second) == (0, 1)
    }
}

impl Observed for Coupled {
    fn robot(&self) -> &Robot {
        &self.robot
    }

    fn tip_rows(&self) -> usize {
        ROWS
    }

    fn torque_rows(&self) -> usize {
        0
    }

    fn has_cameras(&self) -> bool {
        true
    }

    fn cannot_show(&self, sited: &Sited) -> Option<&'static str> {
        (!Self::is_seen(sited)).then_some("it is not there")
    }

    fn residuals(&self, settings: &[Setting], links: Links, _: &[Channel]) -> Result<Vec<f64>> {
        let coupling = settings.iter().find(|(sited, _)| Self::is_seen(sited)).map_or(0.0, |(_, u)| u[0]);
        let sticks = links == Links::RolledOut && coupling < self.sticks_below;
        let row = |k: usize| {
            let moved = SEEN * (k as f64).sin() * std::f64::consts::SQRT_2 * (self.coupling - coupling);
            moved + if sticks && k < STUCK { STICKS } else { 0.0 }
        };
        Ok((0..ROWS).map(row).collect())
    }
}

#[test]
fn where_joints_happen_to_stick_is_no_evidence_for_an_effect() {
    // The tolerance pulls the nominal model a little further back than an effect, and there the elbow sticks.
    let rows = Coupled { robot: nominal::gold(), coupling: 1.2, sticks_below: 1.198 };
    let coordinates = Coordinates::new(&rows.robot, &rows);
    assert_eq!(coordinates.sited.len(), 1);
    let fitter = Fitter { rows: &rows, coordinates: &coordinates };
    let outcome = fitter.search(|| {}).unwrap().unwrap();
    let (coupled, _) = &outcome.fitted[&vec![0]];
    let strain = 0.5 * (coupled.u[0] / coordinates.all[0].spike.unwrap()).powi(2);
    let gained = coupled.evidence - outcome.none.evidence;
    assert!(coupled.u[0] > rows.sticks_below, "{:?}", coupled.u);
    assert!(gained < strain, "{gained} nats for a strain of {strain}");
}
