use raven::log::Recording;
use raven::robot::Robot;
use raven_diagnose::evidence::{bench::Bench, coordinates::Coordinates, data::Data, fit::Fitter, rows::*};
fn main() {
    let mut args = std::env::args().skip(1);
    let mut robot = Robot::read(args.next().unwrap().as_ref()).unwrap();
    if std::env::var("ZERO").is_ok() {
        for j in &mut robot.joints { if let Some(m)=&mut j.motor { m.coulomb_friction=0.0 } if let Some(f)=&mut j.link_friction { f.coulomb=0.0 } }
    }
    let recs: Vec<_> = args.map(|p| Recording::read(p.as_ref(), &(&robot).into()).unwrap()).collect();
    let start = std::time::Instant::now();
    if robot.arm().is_err() {
        let b = Bench::new(&robot, &recs).unwrap();
        for r in b.remarks() { println!("{r}"); }
        show(&robot, &b, start);
    } else {
        let data: Vec<_> = recs.iter().map(|r| Data::new(r, None).unwrap()).collect();
        let rows = Rows::new(&robot, None, &data).unwrap();
        show(&robot, &rows, start);
    }
}
fn show(robot: &Robot, rows: &dyn Observed, start: std::time::Instant) {
    let coordinates = Coordinates::new(robot, rows);
    println!("rows {} {}", rows.tip_rows(), rows.torque_rows());
    for (e, why) in &coordinates.not_observable { println!("   not observable {}: {why}", e.id); }
    let fitter = Fitter { rows, coordinates: &coordinates };
    let t = std::time::Instant::now();
    fitter.exact(&fitter.nowhere()).unwrap();
    println!("exact {:.3} s", t.elapsed().as_secs_f64());
    let outcome = fitter.search(|| eprint!(" {:.1}", start.elapsed().as_secs_f64())).unwrap().unwrap();
    println!("{:.1} s none {:.1} fitted {}", start.elapsed().as_secs_f64(), outcome.none.evidence, outcome.fitted.len());
    println!("   {:?}", outcome.leftover);
    let n = rows.tip_rows();
    let chi = |r: &[f64]| (r.iter().map(|v| v * v).sum::<f64>() / r.iter().filter(|v| **v != 0.0).count().max(1) as f64).sqrt();
    println!("   nominal tip {:.3} torque {:.3}", chi(&fitter.exact(&fitter.nowhere()).unwrap()[..n]), chi(&fitter.exact(&fitter.nowhere()).unwrap()[n..]));
    println!("   tuned   tip {:.3} torque {:.3}", chi(&outcome.none.residuals[..n]), chi(&outcome.none.residuals[n..]));
    for (set, p) in outcome.probabilities().iter().take(8) {
        print!("   {p:.4}");
        let Some((h, z)) = outcome.fitted.get(set) else { println!(" screened {set:?}"); continue };
        print!(" {:+.1} ({:+.1} tempered)", h.evidence - outcome.none.evidence, z - outcome.fitted[&vec![]].1);
        for &e in &h.effects {
            let sited = coordinates.sited[e];
            print!("  {}:{}", sited.effect.id, sited.joint(robot).unwrap_or_default());
            for c in coordinates.of(e) {
                let p = &sited.effect.parameters[coordinates.all[c].parameter];
                print!(" {:.5}+-{:.5} {}", p.value(h.u[c], coordinates.kinds[e]), p.std(h.u[c], h.std(c), coordinates.kinds[e]), p.unit_at(coordinates.kinds[e]));
            }
        }
        println!("   tip {:.3} torque {:.3}", chi(&h.residuals[..n]), chi(&h.residuals[n..]));
    }
    let h = &outcome.best;
    for &c in &h.free {
        let e = coordinates.all[c].effect;
        let s = &coordinates.sited[e];
        let p = &s.effect.parameters[coordinates.all[c].parameter];
        let sp = coordinates.all[c].spike.unwrap_or(1.0);
        if (h.u[c] / sp).abs() > 1.0 { println!("    {}:{}.{} {:.5}+-{:.5} ({:.1} spikes)", s.effect.id, s.joint(robot).unwrap_or_default(), p.name, p.value(h.u[c], coordinates.kinds[e]), p.std(h.u[c], h.std(c), coordinates.kinds[e]), h.u[c] / sp); }
    }
}
