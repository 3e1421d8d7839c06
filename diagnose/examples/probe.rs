use raven::log::Recording;
use raven::robot::Robot;
use raven_diagnose::evidence::{coordinates::Coordinates, data::Data, rows::Rows, search::Search};
fn main() {
    let mut robot = Robot::read("/work/shared/robot/raven2-gold.yaml".as_ref()).unwrap();
    if std::env::var("HOLDS").is_ok() {
        robot.joints.iter_mut().filter_map(|j| j.link_friction.as_mut()).for_each(|f| f.holds = true);
    }
    let mut args = std::env::args().skip(1);
    let cameras = raven::camera::Cameras::read(args.next().unwrap().as_ref()).unwrap();
    for path in args {
        let start = std::time::Instant::now();
        let rec = Recording::read(path.as_ref(), &(&robot).into()).unwrap();
        let data = [Data::new(&rec, Some(&cameras)).unwrap()];
        let rows = Rows::new(&robot, Some(&cameras), &data).unwrap();
        let coordinates = Coordinates::new(&robot, &rows);
        let outcome = Search::new(&rows, &coordinates).run(3.0 + 4.6).unwrap().unwrap();
        println!("{} {:.1} s none {:.1}", path.rsplit('/').next().unwrap(), start.elapsed().as_secs_f64(), outcome.none.evidence);
        let mut before = outcome.none.evidence;
        for round in &outcome.rounds {
            for h in round.iter().take(3) {
                print!("   {:+.1} ", h.evidence - before);
                for &e in &h.effects {
                    let sited = coordinates.sited[e];
                    print!(" {}:{}", sited.effect.id, sited.joint(&robot).unwrap_or_default());
                    for c in coordinates.of(e) {
                        let p = &sited.effect.parameters[coordinates.all[c].parameter];
                        print!(" {:.5}+-{:.5}", p.value(h.u[c], coordinates.kinds[e]), p.std(h.u[c], h.std[c], coordinates.kinds[e]));
                    }
                }
                let n = rows.tip_rows();
                let chi = |r: &[f64]| r.iter().map(|v| v * v).sum::<f64>() / r.iter().filter(|v| **v != 0.0).count() as f64;
                println!("   tip {:.3} torque {:.3}", chi(&h.residuals[..n]), chi(&h.residuals[n..]));
            }
            before = round[0].evidence;
            println!("   --");
        }
    }
}
