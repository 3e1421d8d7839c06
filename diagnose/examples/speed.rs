//! times
use raven::log::Recording;
use raven::robot::Robot;
use raven_diagnose::evidence::{coordinates::Coordinates, data::Data, fit::Fitter, rows::*};
fn main() {
    let robot = Robot::read("/work/shared/robot/raven2-gold.yaml".as_ref()).unwrap();
    let cameras = raven::camera::Cameras::read("/work/shared/data/practice/cameras.yaml".as_ref()).unwrap();
    let rec = Recording::read("/work/shared/data/practice/p06.mcap".as_ref(), &(&robot).into()).unwrap();
    let data = [Data::new(&rec, Some(&cameras)).unwrap()];
    let rows = Rows::new(&robot, Some(&cameras), &data).unwrap();
    let coordinates = Coordinates::new(&robot, &rows);
    let fitter = Fitter { rows: &rows, coordinates: &coordinates };
    let u = fitter.nowhere();
    println!("{} {} samples {} free {}", rows.tip_rows(), rows.torque_rows(), data[0].motors.time_s.len(), fitter.free(&[]).len());
    let s = coordinates.settings(&u);
    let time = |name: &str, f: &dyn Fn()| {
        let t = std::time::Instant::now();
        for _ in 0..5 {
            f();
        }
        println!("{name} {:.4} s", t.elapsed().as_secs_f64() / 5.0);
    };
    use raven::effects::Channel;
    time("exact", &|| {
        rows.residuals(&s, Links::RolledOut, &ALL).unwrap();
    });
    time("exact tip", &|| {
        rows.residuals(&s, Links::RolledOut, &[Channel::Tip]).unwrap();
    });
    time("settled", &|| {
        rows.residuals(&s, Links::Settled, &ALL).unwrap();
    });
    time("settled tip", &|| {
        rows.residuals(&s, Links::Settled, &[Channel::Tip]).unwrap();
    });
    time("settled torque", &|| {
        rows.residuals(&s, Links::Settled, &[Channel::Torque]).unwrap();
    });
    time("slopes", &|| {
        fitter.slopes(&u, &fitter.free(&[])).unwrap();
    });
    let columns = fitter.slopes(&u, &fitter.free(&[])).unwrap();
    let c: Vec<&[f64]> = columns.iter().map(|c| c.as_slice()).collect();
    time("gram", &|| {
        raven_diagnose::evidence::fit::gram(&c);
    });
}
