//! Damping and stiffness of the elbow from a rich motion: claimed deviations against sampled ones, on robots that are what the model says.

use nalgebra::{Matrix3, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use raven::camera::Quality;
use raven::robot::{Robot, nominal};
use raven_identify::excite::candidates::Candidate;
use raven_identify::excite::motion::{motors, speed_max};
use raven_identify::identifiability::Identifiability;
use raven_identify::identified::Finding;
use raven_identify::motion::Motion;
use raven_identify::parameters::Selection;
use raven_identify::prediction::Predictor;
use raven_identify::priors;
use raven_identify::problem::Problem;
use raven_identify::session::{Session, Sighting};

const DURATION_S: f64 = 16.0;
const CAMERA_HZ: f64 = 15.0;
const SAMPLES: u64 = 10;

/// A multisine as seen by nominal cameras.
fn session(truth: &Robot, random: &mut ChaCha8Rng) -> Session {
    let arm = nominal::gold().arm().unwrap();
    let segment = Candidate::Multisine([0.5; 3]).segment(DURATION_S, &arm.limits, &speed_max(&nominal::gold()));
    let motion = Motion::new(motors(&arm.transmission, DURATION_S, |t| segment.at(t)), 0.02).unwrap();
    let predictor = Predictor::new(truth).unwrap();
    let driving = predictor.driving(&motion);
    let times: Vec<f64> = (0..((DURATION_S - 0.4) * CAMERA_HZ) as usize).map(|i| 0.2 + i as f64 / CAMERA_HZ).collect();
    let std_m = Vector3::new(1e-4, 1.5e-3, 1e-4);
    let covariance = Matrix3::from_diagonal(&std_m.component_mul(&std_m));
    let mut see = |(&t, lag): (&f64, &Vector3<f64>)| {
        let noise = Vector3::from_fn(|j, _| std_m[j] * Distribution::<f64>::sample(&StandardNormal, random));
        Sighting::new(t, predictor.seen_lagging_m(&driving, t, lag) + noise, &covariance).unwrap()
    };
    let sightings = times.iter().zip(&predictor.lag(&motion, &times)).map(&mut see).collect();
    Session { name: "simulated.mcap".to_owned(), sha256: "00".to_owned(), motion, sightings }
}

#[test]
fn damping_and_stiffness_are_known_as_well_as_claimed() {
    let robot = nominal::gold();
    let names = ["k_e2", "b_e2", "latency"].map(str::to_owned);
    let unknowns = priors::unknowns(&robot, &Selection::named(&names).unwrap(), &Quality::default()).unwrap();
    let truths = [("k_e2", "joints.elbow.cable.stiffness", 1.1), ("b_e2", "joints.elbow.cable.damping", 0.8)];
    let mut truth = robot.clone();
    for (_, key, factor) in truths {
        *truth.value_mut(key).unwrap() *= factor;
    }
    let mut squares = [0.0; 2];
    for seed in 0..SAMPLES {
        let sessions = [session(&truth, &mut ChaCha8Rng::seed_from_u64(seed))];
        let mut problem = Problem::new(&robot, &unknowns, &sessions).unwrap();
        let estimate = problem.estimate().unwrap();
        let findings = Finding::all(&unknowns, &estimate);
        for ((name, key, _), square) in truths.iter().zip(&mut squares) {
            let found = findings.iter().find(|f| f.unknown.quantity.name() == *name).unwrap();
            assert!(found.identified, "{name} with seed {seed}: {found:?}");
            *square += ((found.value - *truth.value_mut(key).unwrap()) / found.std).powi(2) / SAMPLES as f64;
        }
        if seed == 0 {
            // No unbiased estimator can do better than the bound; a posterior that claims to has too much confidence.
            let bounds = Identifiability::of(&robot, &problem, &unknowns, &estimate).unwrap();
            for (line, finding) in
                bounds.parameters.iter().zip(&findings).filter(|(line, _)| ["k_e2", "b_e2"].contains(&line.name.as_str()))
            {
                let part = finding.std / line.cramer_rao_with_all.unwrap();
                assert!((0.8..1.7).contains(&part), "{}: {part} of the bound", line.name);
            }
        }
    }
    // Mean of ten squared normals: 99 % lie between 0.22 and 2.52.
    for ((name, ..), square) in truths.iter().zip(squares) {
        assert!((0.22..2.52).contains(&square), "{name}: squared errors are {square:.2} of the claimed variance");
    }
}
