//! The engine alone: IMU samples (six channels) a second, and one refit of 64 rests with a secondary: of a sensor that a
//! hand turns from face to face, and of one whose gyroscope says nothing of how gravity turned.
#![allow(missing_docs, clippy::unwrap_used)]

#[path = "../common/hand.rs"]
mod hand;
#[path = "../common/session.rs"]
mod session;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::Vector3;
use stillpoint::engine::{Config, Engine, Secondary};
use stillpoint::imu::{Sample, Sensor};

use hand::{Hand, Held};
use session::Session;

fn cube() -> [Vector3<f64>; 6] {
    [Vector3::x(), -Vector3::x(), Vector3::y(), -Vector3::y(), Vector3::z(), -Vector3::z()]
}

/// Readings, in order.
type Samples = Vec<(Sensor, Sample)>;

/// A session as the thesis proposes it: each face for a minute, turned over in between.
fn by_hand() -> Samples {
    cube().iter().fold(Hand::new(Held::default(), 11), |hand, up| hand.turn_up(*up, 1.5).rest(60.0)).samples
}

/// The same with motion in between that has nothing to do with how gravity turned.
fn unexplained() -> Samples {
    Session::new().rests(&cube(), 60.0).samples
}

/// Each with a refit at the end of each rest.
fn samples(criterion: &mut Criterion) {
    for (name, samples) in [("imu samples", by_hand()), ("imu samples, turns unexplained", unexplained())] {
        let mut group = criterion.benchmark_group("engine");
        group.throughput(Throughput::Elements(samples.len() as u64 / 2));
        group.bench_function(name, |bencher| {
            bencher.iter_batched(
                || (Engine::new(Config::default()), Vec::with_capacity(4096)),
                |(mut engine, mut events)| {
                    for (sensor, sample) in &samples {
                        engine.push(*sensor, sample, &mut events);
                    }
                    (engine, events)
                },
                BatchSize::LargeInput,
            );
        });
    }
}

/// What a rest costs once 64 are remembered: judged, fitted, and put into messages, secondary included.
fn refit(criterion: &mut Criterion) {
    let by_hand = || Hand::new(Held::default(), 11).rest(3.0).through_faces(65).samples;
    let unexplained = || (0..11).fold(Session::new(), |session, _| session.rests(&cube(), 2.0)).samples;
    let kinds: [(&str, &dyn Fn() -> Samples); 2] =
        [("refit of 64 rests", &by_hand), ("refit of 64 rests, turns unexplained", &unexplained)];
    for (name, samples) in kinds {
        // The recording ends in an open rest: finishing it is one refit.
        criterion.bench_function(name, |bencher| {
            let engine = before_the_end(&samples());
            bencher.iter_batched(
                || (engine.clone(), Vec::with_capacity(64)),
                |(mut engine, mut events)| {
                    engine.finish(&mut events);
                    (engine, events)
                },
                BatchSize::LargeInput,
            );
        });
    }
}

/// Engine that has taken these readings, also as those of a secondary accelerometer.
fn before_the_end(samples: &Samples) -> Engine {
    let secondary = vec![Secondary { name: "highg".to_owned(), ..Secondary::default() }];
    let mut engine = Engine::new(Config { secondary, ..Config::default() });
    let mut events = Vec::new();
    for (sensor, sample) in samples {
        engine.push(*sensor, sample, &mut events);
        if *sensor == Sensor::Accelerometer {
            engine.push(Sensor::Secondary(0), sample, &mut events);
        }
    }
    engine
}

criterion_group!(benches, samples, refit);
criterion_main!(benches);
