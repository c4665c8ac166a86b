//! Samples in, calibration out, without any file: what a driver or a node would do with its own readings.
//!
//! `cargo run --example calibrate`
#![allow(clippy::print_stdout)]

use std::error::Error;

use stillpoint::engine::{Config, Engine, Message};
use stillpoint::imu::Sample;
use stillpoint::report;
use stillpoint::simulate::{Scenario, samples};

fn main() -> Result<(), Box<dyn Error>> {
    // Readings in m/s² and rad/s, each with its stamp; here of a simulated session through six faces.
    let scenario = Scenario::builtin("demo")?;
    let mut engine = Engine::new(Config::default());
    let mut events = Vec::new();
    for reading in samples(&scenario)? {
        let log_time = reading.stamp.nanos() as u64;
        let sample = Sample { stamp: reading.stamp, log_time, value: reading.measured };
        engine.push(reading.sensor, &sample, &mut events);
    }
    engine.finish(&mut events);

    for event in &events {
        match &event.message {
            Message::Segment(segment) if segment.accepted => println!("rest on face {}", segment.face),
            Message::Segment(segment) => println!("rest rejected: {:?}", segment.reason()),
            _ => {}
        }
    }
    let last = events.iter().rev().find_map(|event| match &event.message {
        Message::Calibration(calibration) => calibration.accelerometer.as_ref(),
        _ => None,
    });
    // None where the data determine nothing: then coverage says what is missing.
    let triad = last.ok_or("nothing was published")?;
    let calibration = report::calibration(triad).ok_or("the accelerometer is not determined")?;
    println!("{}: true = S⁻¹ (measured − b)", triad.status().as_str_name());
    println!("b = {:.4?} m/s²", calibration.bias.as_slice());
    println!("S = {:.5}", calibration.sensitivity);
    let reading = scenario.accelerometer.bias.into();
    println!("a reading of {reading:.3?} is a specific force of {:.3?}", calibration.correct(&reading).as_slice());
    Ok(())
}
