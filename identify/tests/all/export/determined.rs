//! Which numbers an export lets through, and what it says of them.

use raven::camera::Quality;
use raven::robot::{Robot, nominal};
use raven_identify::identified::{Finding, identified as with_findings};
use raven_identify::parameters::{ALL, Selection};
use raven_identify::priors;

use super::{Folder, change, identified, provenance};

#[test]
fn what_the_hardware_cannot_be_is_refused() {
    let refused = |parameter: &str, key: &str, value: f64| {
        let mut robot = nominal::gold();
        change(&mut robot, parameter, key, value);
        let folder = Folder::new(&robot);
        ["r2params", "defines", "rosparam"].map(|format| {
            let base = (format == "r2params").then_some("r2params.yaml");
            folder.export(format, base, "new").expect_err(&format!("{key} = {value} was exported as {format}"))
        })
    };
    for message in refused("r_l1", "joints.shoulder.link_pulley_radius", 0.063095 * 1.16) {
        assert!(message.contains("+16.0 %") && message.contains("shoulder"), "{message}");
    }
    assert!(refused("r_l1", "joints.shoulder.link_pulley_radius", -0.063)[0].contains("link_pulley_radius is -0.063"));
    assert!(refused("k_e2", "joints.elbow.cable.stiffness", -88_000.0)[1].contains("stiffness is -88000"));
    assert!(refused("offset_3", "joints.insertion.hard_stop", 0.62)[2].contains("hard_stop is 0.62"));
    assert!(refused("coupling_12", "cable_coupling.shoulder.elbow", 0.5)[0].contains("cable_coupling from shoulder to elbow is 0.5"));
}

#[test]
fn what_the_data_did_not_identify_is_refused() {
    let refused = |edit: &dyn Fn(&mut Robot)| {
        let mut robot = identified("gold");
        edit(&mut robot);
        Folder::new(&robot).export("rosparam", None, "new.yaml").unwrap_err()
    };
    let flag = refused(&|robot| robot.calibration[0].identified = false);
    assert!(flag.contains("r_l1") && flag.contains("not identified"), "{flag}");
    let wide = refused(&|robot| robot.calibration[0].std = 0.6 * robot.calibration[0].prior_std);
    assert!(wide.contains("r_l1") && wide.contains("not identified"), "{wide}");
    for wrong in [f64::NAN, -1.0, f64::INFINITY] {
        let std = refused(&|robot| robot.calibration[0].std = wrong);
        assert!(std.contains("calibration has std: ") && std.contains("r_l1") && std.contains("no standard deviation"), "{std}");
        assert!(refused(&|robot| robot.calibration[0].prior_std = wrong).contains("calibration has prior_std: "));
    }
    let typed = refused(&|robot| (robot.calibration[0].identified, robot.calibration[0].std) = (false, 0.0));
    assert!(typed.contains("r_l1") && typed.contains("it was typed by hand and not identified, yet it is 0.059"), "{typed}");
    assert!(refused(&|robot| robot.joints[0].link_pulley_radius = 0.06).contains("its calibration found 0.059"));
    assert!(refused(&|robot| robot.calibration.clear()).contains("it has no calibration"));
    let nothing = refused(&|robot| {
        *robot = nominal::gold();
        let mut entry = provenance("r_l1", "joints.shoulder.link_pulley_radius", 0.063095, 0.063095);
        (entry.identified, entry.std) = (false, entry.prior_std);
        robot.calibration.push(entry);
    });
    assert!(nothing.contains("nothing to export") && nothing.contains("100 %"), "{nothing}");
    // Of no deviation nothing can be left.
    for std in [0.0, 1e-3] {
        let fixed = refused(&|robot| {
            *robot = nominal::gold();
            let mut entry = provenance("r_l1", "joints.shoulder.link_pulley_radius", 0.063095, 0.063095);
            (entry.std, entry.prior_std) = (std, 0.0);
            robot.calibration.push(entry);
        });
        assert!(fixed.contains("nothing to export: r_l1 was not identified (it has no deviation from before)"), "{fixed}");
    }
}

#[test]
fn how_straight_a_loop_turns_holds_back_no_other_number() {
    let mut robot = identified("gold");
    robot.joints[2].hysteresis.half_loop = 1e-6;
    change(&mut robot, "straight_part_3", "joints.insertion.hysteresis.straight_part", -0.0106);
    robot.calibration.last_mut().unwrap().identified = false;
    Folder::new(&robot).export("rosparam", None, "new.yaml").unwrap();
}

#[test]
fn what_the_controller_does_not_have_holds_back_no_other_number_and_is_no_calibration_alone() {
    let mut robot = identified("gold");
    change(&mut robot, "k_e3", "joints.insertion.cable.stiffness", 1700.0);
    robot.calibration.last_mut().unwrap().identified = false;
    let folder = Folder::new(&robot);
    assert!(!folder.export("rosparam", None, "new.yaml").unwrap().contains("k_e3: ["));
    folder.export("defines", None, "new.h").unwrap();
    let mut cable = nominal::gold();
    change(&mut cable, "k_e2", "joints.elbow.cable.stiffness", 20_000.0);
    let folder = Folder::new(&cable);
    let refused = folder.export("defines", None, "new.h").unwrap_err();
    assert!(refused.contains("there is nothing to export: the controller has no constant for k_e2."), "{refused}");
    assert!(folder.export("rosparam", None, "new.yaml").unwrap().contains("k_e2: ["));
}

/// A factor is known to a part of itself: of one that went up, more is left in SI units than half of what there was before.
#[test]
fn what_an_identification_determined_is_exported_whichever_way_it_went() {
    let robot = nominal::gold();
    let selection = Selection { quantities: ALL.into_iter().filter(|q| q.is_positive()).collect(), named: true };
    let unknowns = priors::unknowns(&robot, &selection, &Quality::default()).unwrap();
    let unknowns: Vec<_> = unknowns.into_iter().filter(|unknown| unknown.named).collect();
    let export = |z: f64, std_z: f64, is_identified: bool| {
        let finding = |unknown: &priors::Unknown| {
            let value = if is_identified { unknown.value(z) } else { unknown.prior };
            Finding { value, std: unknown.std(value, std_z), identified: is_identified, unknown: unknown.clone() }
        };
        let findings: Vec<Finding> = unknowns.iter().map(finding).collect();
        Folder::new(&with_findings(&robot, &findings, &[], "batch", &[]).unwrap()).export("rosparam", None, "new.yaml")
    };
    for z in [0.8, 0.3, -0.8] {
        let text = export(z, 0.49, true).unwrap();
        assert!(unknowns.iter().all(|unknown| text.contains(&format!("      {}: [", unknown.quantity.name()))), "{text}");
        // What a hand says of it does not count.
        let error = export(z, 0.51, true).unwrap_err();
        assert!(error.contains("r_l1 (joints.shoulder.link_pulley_radius) was not identified ("), "{error}");
    }
    assert!(export(0.0, 0.9, false).unwrap_err().contains("r_l1 was not identified (the log left 90 % of its deviation)"));
}

/// A log that says nothing of a number leaves what a log before it found.
#[test]
fn what_a_log_before_determined_is_exported() {
    let mut robot = identified("gold");
    let mut again = provenance("r_l1", "joints.shoulder.link_pulley_radius", 0.059, 0.059);
    (again.identified, again.std) = (false, again.prior_std);
    robot.calibration.insert(0, again);
    let folder = Folder::new(&robot);
    let header = folder.export("defines", None, "new.h").unwrap();
    assert!(header.contains("/* r_l1: 0.059 +- "), "{header}");
    folder.export("r2params", Some("r2params.yaml"), "new.yaml").unwrap();
}

/// What a model cannot explain is said wherever its numbers go.
#[test]
fn exports_say_how_badly_the_model_explained_the_log() {
    let mut robot = identified("gold");
    for entry in &mut robot.calibration[..2] {
        entry.method = "batch; the residuals are 18.9 times what */ says.".to_owned();
    }
    let folder = Folder::new(&robot);
    let said = "r_l1, r_l2: the residuals are 18.9 times what";
    let header = folder.export("defines", None, "new.h").unwrap();
    assert!(header.contains(&format!("\n * {said} * / says.\n")), "{header}");
    let neutral = folder.export("rosparam", None, "new.yaml").unwrap();
    assert!(neutral.contains(&format!("\n# {said} */ says.\n")), "{neutral}");
    let own = folder.export("r2params", Some("r2params.yaml"), "own.yaml").unwrap();
    let line = own.lines().find(|line| line.starts_with("tr_gold: ")).unwrap();
    assert!(line.ends_with(&format!("# r_l1, r_l2, r_l3 by raven-identify from sinusoid.mcap; {said} */ says.")), "{line}");
}
