//! Robots with cables that remember, each recording of which begins where the motion before left them.

use nalgebra::DVector;
use rand_distr::{Distribution, StandardNormal};
use raven::effects::Sited;
use raven_identify::problem::Problem;
use raven_identify::session::Session;

use super::virtual_robot::{self, Case, MIDDLE, WIDE, motion, session};

const RECORDINGS: usize = 2;

/// A robot file that has an effect at the elbow, of its typical size.
fn remembering(id: &str) -> (Case, Sited) {
    let mut case = Case::new(&["r_l2", "offset_2", "latency"]);
    let sited = Sited::at(&case.robot, id, Some("elbow")).unwrap();
    let sizes = sited.effect.parameters.iter().map(|parameter| if parameter.scale.is_size() { 1.0 } else { 0.0 });
    let values = sited.values(&sizes.collect::<Vec<f64>>());
    case.robot = sited.added_to(&case.robot, None, &values).unwrap();
    (case, sited)
}

/// What `u` is of what the motion before left, nothing else of the effect being changed.
fn left(sited: &Sited, u: f64) -> Vec<f64> {
    let of_parameter = sited.effect.parameters.iter().map(|parameter| if parameter.scale.is_state() { u } else { 0.0 });
    sited.values(&of_parameter.collect::<Vec<f64>>())
}

#[test]
fn claims_hold_whatever_the_motion_before_left() {
    for id in ["creep", "cable-slip"] {
        let (case, sited) = remembering(id);
        virtual_robot::assert_covered(&case, &["r_l2", "offset_2"], 24, |truth, random| {
            let sessions: Vec<Session> = (0..RECORDINGS)
                .map(|_| {
                    let begun = sited.begun(truth, &left(&sited, StandardNormal.sample(random))).unwrap();
                    session(&begun, &motion(12.0, MIDDLE, WIDE), random, 0.0)
                })
                .collect();
            case.estimate(&sessions)
        });
    }
}

/// Of each recording for itself.
#[test]
fn what_the_motion_before_left_is_told() {
    let (case, sited) = remembering("creep");
    let truth = case.truth(&DVector::zeros(case.unknowns.len()));
    let mut random = rand::SeedableRng::seed_from_u64(3);
    let sessions = [1.5, -1.0].map(|u| {
        let begun = sited.begun(&truth, &left(&sited, u)).unwrap();
        session(&begun, &motion(40.0, MIDDLE, WIDE), &mut random, 0.0)
    });
    let mut problem = Problem::new(&case.robot, &case.unknowns, &sessions).unwrap();
    let estimate = problem.estimate().unwrap();
    let found = problem.left_found(&estimate);
    assert_eq!(found.len(), RECORDINGS);
    for (s, (found, u)) in found.iter().zip([1.5, -1.0]).enumerate() {
        assert_eq!((found.effect.as_str(), found.parameter, found.recording), ("creep:elbow", "fresh_part", Some(s)));
        let off = (found.tolerances_off - u) / found.std;
        assert!(off.abs() < 3.5 && found.std < 0.5, "{u} came out as {} +- {}", found.tolerances_off, found.std);
    }
}
