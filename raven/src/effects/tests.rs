use super::*;
use crate::robot::nominal;

#[test]
fn identifiers_are_unique_and_ties_are_known() {
    for effect in ALL {
        assert_eq!(Effect::named(effect.id).unwrap().id, effect.id);
        assert_eq!(ALL.iter().filter(|other| other.id == effect.id).count(), 1);
        for tie in effect.ties {
            assert!(Effect::named(tie.id).is_ok(), "{} is tied to {}", effect.id, tie.id);
        }
    }
    assert_eq!(ALL.len(), 34);
}

#[test]
fn values_and_their_units_of_a_slab_are_the_same_thing() {
    for sited in Sited::all(&nominal::gold()) {
        for parameter in sited.effect.parameters {
            for u in [0.3, 1.0] {
                let value = parameter.value(u, sited.measure);
                let again = parameter.value(parameter.u(value, sited.measure), sited.measure);
                approx::assert_relative_eq!(again, value, max_relative = 1e-12);
            }
        }
    }
}

#[test]
fn no_effect_is_no_change() {
    let robot = nominal::gold();
    for sited in Sited::all(&robot) {
        let neutral = sited.effect.parameters.iter().all(|p| matches!(p.scale, Scale::Offset(_) | Scale::Factor(_) | Scale::Magnitude(_)));
        if neutral {
            let u = vec![0.0; sited.effect.parameters.len()];
            let model = Model::new(&robot, None).unwrap().with(&sited, &u);
            assert_eq!(model.robot, Model::new(&robot, None).unwrap().robot, "{}", sited.effect.id);
        }
    }
}
