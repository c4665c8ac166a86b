//! The events of a short session with everything in it: absent and present fields, several IMUs, text beyond ASCII.

use prost_types::Timestamp;
use stillpoint::Stamp;
use stillpoint::engine::{Event, Message};
use stillpoint::messages::{
    AllanSums, AxisNoise, Calibration, Combination, Coverage, Face, Header, Noise, Octaves, Segment, Stillness,
    TemperatureModel, Triad, TriadMean, Turn, Vector3, foxglove, segment, stillness, triad, turn,
};

const START: i64 = 1_700_000_000_000_000_000;

pub fn events() -> Vec<(&'static str, Event)> {
    let messages = [
        ("/imu/data", Message::Log(log(0, foxglove::log::Level::Info))),
        ("/imu/data", Message::Stillness(stillness(0))),
        ("/imu/data", Message::Segment(rejected(1))),
        ("/imu/data", Message::Coverage(Coverage { header: header(1), ..Coverage::default() })),
        ("front", Message::Stillness(Stillness { header: header(2), ..Stillness::default() })),
        ("/imu/data", Message::Segment(accepted(3))),
        ("/imu/data", Message::Coverage(coverage(3))),
        ("/imu/data", Message::Calibration(Box::new(gyroscope_alone(3)))),
        ("/imu/data", Message::Turn(turn(8))),
        ("/imu/data", Message::Calibration(Box::new(everything(9)))),
        ("/imu/data", Message::Noise(noise(9))),
        ("/imu/data", Message::Log(log(9, foxglove::log::Level::Warning))),
    ];
    let second = |index: usize| START as u64 + index as u64 * 1_000_000_000;
    messages
        .into_iter()
        .enumerate()
        .map(|(index, (imu, message))| (imu, Event { log_time: second(index), message }))
        .collect()
}

fn stamp(second: i64) -> Option<Timestamp> {
    Some(Stamp::from_nanos(START + second * 1_000_000_000 + 123_456_789).into())
}

fn header(second: i64) -> Option<Header> {
    Some(Header { stamp: stamp(second), frame_id: "imu_link".to_owned() })
}

fn vector(x: f64, y: f64, z: f64) -> Option<Vector3> {
    Some(Vector3 { x, y, z })
}

fn log(second: i64, level: foxglove::log::Level) -> foxglove::Log {
    foxglove::Log {
        timestamp: stamp(second),
        level: level.into(),
        message: "never seen still: 0.4 m/s² — is it bolted to a motor?".to_owned(),
        name: "stillpoint".to_owned(),
        ..foxglove::Log::default()
    }
}

fn stillness(second: i64) -> Stillness {
    let state = stillness::State::Still.into();
    Stillness { header: header(second), state, statistic: 1.25, enter: 3.0, leave: 5.0 }
}

fn rejected(second: i64) -> Segment {
    let reason = segment::Reason::TooShort.into();
    Segment { header: header(second), start: stamp(0), end: stamp(1), reason, ..Segment::default() }
}

fn accepted(second: i64) -> Segment {
    let covariance = (0..9).map(|entry| f64::from(entry) * 1e-4).collect();
    let mean = TriadMean {
        sensor: "accelerometer".to_owned(),
        samples: u64::MAX,
        effective_samples: 151.5,
        mean: vector(9.8, -0.1, f64::MIN_POSITIVE),
        covariance,
        std: vector(0.03, 0.03, 0.04),
    };
    let absent = TriadMean { sensor: "gyroscope".to_owned(), ..TriadMean::default() };
    Segment {
        header: header(second),
        start: stamp(2),
        end: stamp(3),
        accepted: true,
        face: "+X".to_owned(),
        tilt_deg: Some(1.5),
        reason: segment::Reason::Accepted.into(),
        explanation: "0.7° from +X".to_owned(),
        means: vec![mean, absent],
        placement: 4,
        temperature: None,
    }
}

fn turn(second: i64) -> Turn {
    Turn {
        header: header(second),
        start: stamp(3),
        end: stamp(second),
        angle: 1.5,
        residual: Some(0.002),
        reason: turn::Reason::Clipped.into(),
        explanation: "read 250 °/s at the end of its range".to_owned(),
        axis: vector(0.6, 0.8, 0.0),
        path: 1.75,
        declared: None,
        before: 4,
        after: 5,
        seconds: 1.5,
        integrals: vec![0.5; 10],
        ..Turn::default()
    }
}

fn noise(second: i64) -> Noise {
    let all = Octaves {
        samples: 1000,
        rests: 3,
        shortest: 2.5,
        squares: vec![1e-4, 2e-4, 3e-4, 1e-5, 2e-5, 3e-5],
        counts: vec![900, 400],
        white: vec![80.5, 40.25],
        wandering: vec![70.0, 30.0],
    };
    let accelerometer = AllanSums { sensor: "accelerometer".to_owned(), period: 0.01, all: Some(all), lasting: None };
    Noise { header: header(second), triads: vec![accelerometer, AllanSums::default()] }
}

fn coverage(second: i64) -> Coverage {
    let up = Face { name: "+X".to_owned(), normal: vector(1.0, 0.0, 0.0), placements: 1, seconds: 1.5 };
    let faces = vec![up, Face { name: "-X".to_owned(), ..Face::default() }];
    Coverage { header: header(second), faces, complete: false, next_step: "place it with -X up".to_owned() }
}

fn gyroscope_alone(second: i64) -> Calibration {
    let gyroscope = Triad {
        sensor: "gyroscope".to_owned(),
        topic: "/imu/data".to_owned(),
        model: triad::Model::Bias.into(),
        status: triad::Status::Provisional.into(),
        bias: vector(-0.01, 0.0, 0.002),
        bias_std: vector(1e-4, 1e-4, 1e-4),
        ..Triad::default()
    };
    Calibration { header: header(second), gyroscope: Some(gyroscope), ..Calibration::default() }
}

fn everything(second: i64) -> Calibration {
    let accelerometer = Triad {
        sensor: "accelerometer".to_owned(),
        topic: "/imu/data".to_owned(),
        model: triad::Model::Full.into(),
        status: triad::Status::Confirmed.into(),
        bias: vector(0.5, -0.6, 0.4),
        scale: vector(0.997, 1.002, 1.023),
        sensitivity: vec![0.997, 0.0, 0.0, 0.0, 1.002, 0.0, 0.0, 0.0, 1.023],
        bias_std: vector(0.005, 0.005, 0.005),
        scale_std: vector(5e-4, 5e-4, 5e-4),
        sensitivity_std: vec![5e-4; 9],
        g_sensitivity: vec![1e-6; 9],
        g2_sensitivity: vec![1e-8; 3],
        rate_sensitivity: vec![1e-3; 9],
        residual_rms: Some(0.0026),
        chi2_per_dof: Some(1.1),
        worst_case_error: Some(0.012),
        condition: Some(1.55),
        covariance: vec![2.5e-5; 36],
        placement_std: vec![0.01],
        notes: vec!["bias.x rests on its bound".to_owned(), String::new()],
        row_norms: vector(0.997, 1.002, 1.023),
        row_norms_std: vector(5e-4, 5e-4, 5e-4),
        misalignment: vec![0.01; 6],
        misalignment_std: vec![1e-3; 6],
        turns: 12,
        noise: vec![
            AxisNoise { density: 1e-3, density_low: 9e-4, density_high: 1.1e-3, ..AxisNoise::default() },
            AxisNoise { random_walk: Some(1e-5), random_walk_low: Some(5e-6), ..AxisNoise::default() },
        ],
        temperature: Some(TemperatureModel {
            order: 1,
            reference: 25.0,
            minimum: 15.0,
            maximum: 40.0,
            coefficients: vec![1e-3, -1e-3, 0.0],
            coefficients_std: vec![1e-5; 3],
        }),
        combinations: vec![Combination {
            coefficients: vec![1.0, 0.0, 0.0, 9.80665, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            value: 9.873,
            std: 0.01,
            explanation: "bias x + 9.80665 · scale x = 9.873 ± 0.020 m/s²".to_owned(),
        }],
    };
    let secondary = vec![Triad { sensor: "highg".to_owned(), ..accelerometer.clone() }, Triad::default()];
    Calibration {
        header: header(second),
        revision: 7,
        accelerometer: Some(accelerometer),
        gyroscope: None,
        secondary,
        gravity: 9.80665,
        gravity_source: "standard".to_owned(),
        segments: 13,
        placements: 9,
        begin: stamp(0),
        end: stamp(second),
        temperature_min: Some(21.5),
        temperature_max: None,
    }
}
