//! The engine alone: IMU samples (six channels) a second, and one refit of 64 rests with a secondary.
#![allow(missing_docs, clippy::unwrap_used)]

#[path = "../common/session.rs"]
mod session;

use criterion::{BatchSize, Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::Vector3;
use stillpoint::engine::{Config, Engine, Secondary};
use stillpoint::fit::Calibration;

use session::Session;

fn cube() -> [Vector3<f64>; 6] {
    [Vector3::x(), -Vector3::x(), Vector3::y(), -Vector3::y(), Vector3::z(), -Vector3::z()]
}

/// A session as the thesis proposes it: each face for a minute, with motion between them, and a refit at the end of each.
fn samples(criterion: &mut Criterion) {
    let session = Session::new().rests(&cube(), 60.0);
    let imu_samples = session.samples.len() as u64 / 2;
    let mut group = criterion.benchmark_group("engine");
    group.throughput(Throughput::Elements(imu_samples));
    group.bench_function("imu samples", |bencher| {
        bencher.iter_batched(
            || (Engine::new(Config::default()), Vec::with_capacity(4096)),
            |(mut engine, mut events)| {
                for (sensor, sample) in &session.samples {
                    engine.push(*sensor, sample, &mut events);
                }
                (engine, events)
            },
            BatchSize::LargeInput,
        );
    });
}

/// What a rest costs once 64 are remembered: judged, fitted, and put into messages, secondary included.
fn refit(criterion: &mut Criterion) {
    let session = (0..11).fold(Session::new().secondary(Calibration::default()), |s, _| s.rests(&cube(), 2.0));
    let config =
        Config { secondary: vec![Secondary { name: "highg".to_owned(), ..Secondary::default() }], ..Config::default() };
    let mut engine = Engine::new(config);
    let mut events = Vec::new();
    for (sensor, sample) in &session.samples {
        engine.push(*sensor, sample, &mut events);
    }
    // The recording ends in an open rest: finishing it is one refit.
    criterion.bench_function("refit of 64 rests", |bencher| {
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

criterion_group!(benches, samples, refit);
criterion_main!(benches);
