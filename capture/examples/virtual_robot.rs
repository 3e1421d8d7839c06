//! A ROS 1 master at the usual port with one topic, `/numbers`: `virtual_robot RATE COUNT` publishes so many numbered messages at so many per
//! second, from the moment somebody subscribes, and says how many it was.

#[path = "../tests/lab/mod.rs"]
mod lab;

use std::time::Duration;

use lab::{Master, Publisher};
use raven_capture::ros1::MASTER_PORT;

fn main() {
    let mut arguments = std::env::args().skip(1).map(|word| word.parse::<u64>());
    let (Some(Ok(rate_hz)), Some(Ok(count))) = (arguments.next(), arguments.next()) else {
        eprintln!("expected RATE COUNT");
        return;
    };
    let master = Master::start(MASTER_PORT);
    let publisher = Publisher::start(&master.at(), "/numbers");
    while publisher.subscribers() == 0 {
        std::thread::sleep(Duration::from_millis(5));
    }
    println!("{}", publisher.stream(0..count, rate_hz as f64, || true));
}
