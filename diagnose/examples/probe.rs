//! Prints hypotheses.
use raven::log::Recording;
use raven::robot::Robot;
use raven_diagnose::evidence::{
    coordinates::Coordinates,
    data::Data,
    fit::Fitter,
    rows::{Observed, Rows},
};
fn main() {
    let robot = Robot::read(std::env::var("ROBOT").unwrap_or("/work/shared/robot/raven2-gold.yaml".into()).as_ref()).unwrap();
    let mut args = std::env::args().skip(1);
    let cameras = raven::camera::Cameras::read(args.next().unwrap().as_ref()).unwrap();
    for path in args {
        let start = std::time::Instant::now();
        let rec = Recording::read(path.as_ref(), &(&robot).into()).unwrap();
        let data = [Data::new(&rec, Some(&cameras)).unwrap()];
        let rows = Rows::new(&robot, Some(&cameras), &data).unwrap();
        let coordinates = Coordinates::new(&robot, &rows);
        if let Ok(only) = std::env::var("ONLY") {
            // ONLY=id:joint=u,u
            let fitter = Fitter { rows: &rows, coordinates: &coordinates };
            let mut u = fitter.nowhere();
            let mut effects = vec![];
            for each in only.split(';').filter(|s| !s.is_empty()) {
                let (name, values) = each.split_once('=').unwrap();
                let e = coordinates
                    .sited
                    .iter()
                    .position(|s| format!("{}:{}", s.effect.id, s.joint(&robot).unwrap_or_default()) == name)
                    .unwrap();
                for (c, v) in coordinates.of(e).zip(values.split(',')) {
                    u[c] = v.parse().unwrap();
                }
                effects.push(e);
            }
            if let Ok(dump) = std::env::var("RAW") {
                use std::io::Write;
                let model = rows.model(&coordinates.settings(&u)).unwrap();
                let tip = raven::effects::TipModel::new(&model, &data[0].motors).unwrap();
                let torque = raven::effects::TorqueModel::new(&model).unwrap();
                let times: Vec<f64> = data[0].shafts.iter().map(|s| s.time_s).collect();
                let (_, moving) = tip.rolled_out(&[], &times, 0.06);
                let mut f = std::fs::File::create(dump).unwrap();
                for (s, m) in data[0].shafts.iter().zip(moving) {
                    let Some(m) = m else { continue };
                    let rigid = torque.rigid(s);
                    let (a, b) = (torque.needed(s, &m), torque.needed(s, &rigid));
                    writeln!(
                        f,
                        "{} {} {} {} {} {} {} {} {} {} {} {} {}",
                        s.time_s,
                        s.rate[0],
                        s.rate[1],
                        s.rate[2],
                        s.acceleration[0],
                        s.acceleration[1],
                        s.acceleration[2],
                        s.commanded[0],
                        s.commanded[1],
                        s.commanded[2],
                        a[0],
                        b[0],
                        m.rate[0]
                    )
                    .unwrap();
                }
            }
            let mut h = fitter.fit(&effects, &u, None).unwrap().unwrap();
            if std::env::var("NOFIT").is_ok() {
                h.residuals = fitter.exact(&fitter.nowhere()).unwrap();
            }
            let n = rows.tip_rows();
            let chi = |r: &[f64]| r.iter().map(|v| v * v).sum::<f64>() / r.iter().filter(|v| **v != 0.0).count() as f64;
            println!(
                "{only} {:.1} s evidence {:.1} tip {:.3} torque {:.3}",
                start.elapsed().as_secs_f64(),
                h.evidence,
                chi(&h.residuals[..n]),
                chi(&h.residuals[n..])
            );
            for &c in &h.free {
                let e = coordinates.all[c].effect;
                let s = &coordinates.sited[e];
                let p = &s.effect.parameters[coordinates.all[c].parameter];
                let sp = coordinates.all[c].spike.unwrap_or(1.0);
                if effects.contains(&e) || (h.u[c] / sp).abs() > 1.5 {
                    println!(
                        "    {}:{}.{} {:.5}+-{:.5} ({:.1} spikes)",
                        s.effect.id,
                        s.joint(&robot).unwrap_or_default(),
                        p.name,
                        p.value(h.u[c], coordinates.kinds[e]),
                        p.std(h.u[c], h.std(c), coordinates.kinds[e]),
                        h.u[c] / sp
                    );
                }
            }
            if let Ok(dump) = std::env::var("DUMP") {
                use std::io::Write;
                let model = rows.model(&coordinates.settings(&h.u)).unwrap();
                let arm = model.robot.arm().unwrap();
                let mut f = std::fs::File::create(dump).unwrap();
                for (k, s) in data[0].sights.iter().enumerate() {
                    let Some((m, rate)) = data[0].motors.at(s.stamp_s) else { continue };
                    let q = arm.transmission.joint_from_motor(&m);
                    let load = arm.transmission.tension_n(&arm.dynamics.bias(&q, &nalgebra::Vector3::zeros()));
                    let qd = arm.transmission.joint_rate_from_motor(&rate);
                    let l = s.covariance_m2.cholesky().unwrap().l();
                    let r = l * nalgebra::Vector3::new(h.residuals[3 * k], h.residuals[3 * k + 1], h.residuals[3 * k + 2]);
                    let j = arm.kinematics.jacobian(&q).try_inverse().unwrap() * r;
                    writeln!(
                        f,
                        "{} {} {} {} {} {} {} {} {} {} {} {} {}",
                        s.stamp_s, q[0], q[1], q[2], qd[0], qd[1], qd[2], load[0], load[1], load[2], j[0], j[1], j[2]
                    )
                    .unwrap();
                }
            }
            continue;
        }
        let outcome =
            Fitter { rows: &rows, coordinates: &coordinates }.search(|| eprint!(" {:.1}", start.elapsed().as_secs_f64())).unwrap().unwrap();
        println!(
            "{} {:.1} s none {:.1} fitted {}",
            path.rsplit('/').next().unwrap(),
            start.elapsed().as_secs_f64(),
            outcome.none.evidence,
            outcome.fitted.len()
        );
        if let Ok(dump) = std::env::var("DUMP") {
            use std::io::Write;
            let mut f = std::fs::File::create(dump).unwrap();
            let h = &outcome.none;
            let n = rows.tip_rows();
            for (k, s) in data[0].shafts.iter().enumerate() {
                let r = &h.residuals[n + 3 * k..n + 3 * k + 3];
                writeln!(
                    f,
                    "{} {} {} {} {} {} {} {} {} {} {} {} {}",
                    s.time_s,
                    s.rate[0],
                    s.rate[1],
                    s.rate[2],
                    s.acceleration[0],
                    s.acceleration[1],
                    s.acceleration[2],
                    s.commanded[0],
                    s.commanded[1],
                    s.commanded[2],
                    r[0],
                    r[1],
                    r[2]
                )
                .unwrap();
            }
        }
        println!("   {:?}", outcome.leftover);
        for (set, p) in outcome.probabilities().iter().take(6) {
            print!("   {p:.4}");
            let Some((h, _)) = outcome.fitted.get(set) else {
                println!(" screened {set:?}");
                continue;
            };
            print!(" {:+.1}", h.evidence - outcome.none.evidence);
            for &e in &h.effects {
                let sited = coordinates.sited[e];
                print!("  {}:{}", sited.effect.id, sited.joint(&robot).unwrap_or_default());
                for c in coordinates.of(e) {
                    let p = &sited.effect.parameters[coordinates.all[c].parameter];
                    print!(" {:.5}+-{:.5}", p.value(h.u[c], coordinates.kinds[e]), p.std(h.u[c], h.std(c), coordinates.kinds[e]));
                }
            }
            let n = rows.tip_rows();
            let chi = |r: &[f64]| r.iter().map(|v| v * v).sum::<f64>() / r.iter().filter(|v| **v != 0.0).count() as f64;
            println!("   tip {:.3} torque {:.3}", chi(&h.residuals[..n]), chi(&h.residuals[n..]));
        }
    }
}
