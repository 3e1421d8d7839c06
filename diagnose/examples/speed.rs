//! times
use raven::log::Recording;
use raven::robot::Robot;
use raven_diagnose::evidence::data::Data;
fn main() {
    let robot = Robot::read("/work/shared/robot/raven2-gold.yaml".as_ref()).unwrap();
    let cameras = raven::camera::Cameras::read("/work/shared/data/practice/cameras.yaml".as_ref()).unwrap();
    let rec = Recording::read(std::env::args().nth(1).unwrap().as_ref(), &(&robot).into()).unwrap();
    let data = [Data::new(&rec, Some(&cameras)).unwrap()];
    let t = std::time::Instant::now();
    let a = raven_diagnose::attribution::attribute(&robot, Some(&cameras), &data, || println!("step {:.1}", t.elapsed().as_secs_f64()))
        .unwrap();
    println!(
        "{:.1} {:?} {:?}",
        t.elapsed().as_secs_f64(),
        a.verdict,
        a.effects.iter().map(|e| (e.id, e.joint.clone(), e.probability)).collect::<Vec<_>>()
    );
}
