//! Messages with anything in their fields.

use proptest::collection::vec;
use proptest::option::of;
use proptest::prelude::*;
use prost_types::Timestamp;
use stillpoint::engine::Message;
use stillpoint::messages::{
    AllanSums, AxisNoise, Calibration, Combination, Coverage, Face, Header, Noise, Octaves, Segment, Stillness,
    TemperatureModel, Triad, TriadMean, Turn, Vector3, foxglove,
};

pub fn message() -> impl Strategy<Value = Message> {
    prop_oneof![
        stillness().prop_map(Message::Stillness),
        segment().prop_map(Message::Segment),
        turn().prop_map(Message::Turn),
        noise().prop_map(Message::Noise),
        coverage().prop_map(Message::Coverage),
        calibration().prop_map(|message| Message::Calibration(Box::new(message))),
        log().prop_map(Message::Log),
    ]
}

prop_compose! {
    fn stillness()(header in of(header()), state in 0..3, statistic: f64, enter: f64, leave: f64) -> Stillness {
        Stillness { header, state, statistic, enter, leave }
    }
}

prop_compose! {
    fn segment()(
        (header, start, end) in (of(header()), of(time()), of(time())),
        (accepted, reason, placement) in (any::<bool>(), 0..8, any::<u32>()),
        (face, explanation) in (text(), text()),
        (tilt_deg, temperature) in any::<(Option<f64>, Option<f64>)>(),
        means in vec(triad_mean(), 0..3),
    ) -> Segment {
        Segment { header, start, end, accepted, face, tilt_deg, reason, explanation, means, placement, temperature }
    }
}

prop_compose! {
    fn triad_mean()(
        (sensor, samples, effective_samples) in (text(), any::<u64>(), any::<f64>()),
        (mean, covariance, std) in (of(vector()), numbers(), of(vector())),
    ) -> TriadMean {
        TriadMean { sensor, samples, effective_samples, mean, covariance, std }
    }
}

prop_compose! {
    fn turn()(
        (header, start, end) in (of(header()), of(time()), of(time())),
        (angle, path, used, reason) in (any::<f64>(), any::<f64>(), any::<bool>(), 0..9),
        (explanation, axis) in (text(), of(vector())),
        (residual, vertical, declared, declared_residual) in any::<(Option<f64>, Option<f64>, Option<f64>, Option<f64>)>(),
        declared_std in any::<Option<f64>>(),
        (before, after, seconds, roughness) in any::<(u32, u32, f64, f64)>(),
        integrals in numbers(),
    ) -> Turn {
        Turn {
            header, start, end, angle, residual, used, reason, explanation, axis, path, vertical, declared,
            declared_residual, before, after, seconds, roughness, integrals,
            declared_std,
        }
    }
}

prop_compose! {
    fn noise()(header in of(header()), triads in vec(allan_sums(), 0..3)) -> Noise {
        Noise { header, triads }
    }
}

prop_compose! {
    fn allan_sums()(
        (sensor, period) in (text(), any::<f64>()), (all, lasting) in (of(octaves()), of(octaves())),
    ) -> AllanSums {
        AllanSums { sensor, period, all, lasting }
    }
}

prop_compose! {
    fn octaves()(
        (samples, rests, shortest) in any::<(u64, u32, f64)>(),
        (squares, counts) in (numbers(), vec(any::<u64>(), 0..4)),
        (white, wandering) in (numbers(), numbers()),
    ) -> Octaves {
        Octaves { samples, rests, shortest, squares, counts, white, wandering }
    }
}

prop_compose! {
    fn coverage()(
        header in of(header()), faces in vec(face(), 0..4), complete: bool, next_step in text(),
    ) -> Coverage {
        Coverage { header, faces, complete, next_step }
    }
}

prop_compose! {
    fn face()(name in text(), normal in of(vector()), placements: u32, seconds: f64) -> Face {
        Face { name, normal, placements, seconds }
    }
}

prop_compose! {
    fn calibration()(
        (header, begin, end) in (of(header()), of(time()), of(time())),
        (accelerometer, gyroscope, secondary) in (of(triad()), of(triad()), vec(triad(), 0..3)),
        (revision, segments, placements) in any::<(u32, u32, u32)>(),
        (gravity, gravity_source) in (any::<f64>(), text()),
        (temperature_min, temperature_max) in any::<(Option<f64>, Option<f64>)>(),
    ) -> Calibration {
        Calibration {
            header, revision, accelerometer, gyroscope, secondary, gravity, gravity_source, segments, placements, begin,
            end, temperature_min, temperature_max,
        }
    }
}

prop_compose! {
    fn triad()(
        (sensor, topic, notes) in (text(), text(), vec(text(), 0..3)),
        (model, status) in (0..7, 0..3),
        (bias, scale, bias_std, scale_std) in (of(vector()), of(vector()), of(vector()), of(vector())),
        (sensitivity, sensitivity_std, covariance, placement_std) in (numbers(), numbers(), numbers(), numbers()),
        (g_sensitivity, g2_sensitivity, rate_sensitivity) in (numbers(), numbers(), numbers()),
        (residual_rms, chi2_per_dof) in any::<(Option<f64>, Option<f64>)>(),
        (worst_case_error, condition) in any::<(Option<f64>, Option<f64>)>(),
        (row_norms, row_norms_std) in (of(vector()), of(vector())),
        (misalignment, misalignment_std, turns) in (numbers(), numbers(), any::<u32>()),
        (noise, temperature) in (vec(axis_noise(), 0..3), of(temperature_model())),
        combinations in vec(combination(), 0..3),
    ) -> Triad {
        Triad {
            sensor, topic, model, status, bias, scale, sensitivity, bias_std, scale_std, sensitivity_std, g_sensitivity,
            g2_sensitivity, rate_sensitivity, residual_rms, chi2_per_dof, worst_case_error, condition, covariance,
            placement_std, notes, row_norms, row_norms_std, misalignment, misalignment_std, turns, noise, temperature,
            combinations,
        }
    }
}

prop_compose! {
    fn combination()(
        (coefficients, value, std, explanation) in (numbers(), any::<f64>(), any::<f64>(), text()),
    ) -> Combination {
        Combination { coefficients, value, std, explanation }
    }
}

prop_compose! {
    fn axis_noise()(
        (density, density_low, density_high) in any::<(f64, f64, f64)>(),
        (random_walk, random_walk_low, random_walk_high) in any::<(Option<f64>, Option<f64>, Option<f64>)>(),
    ) -> AxisNoise {
        AxisNoise { density, density_low, density_high, random_walk, random_walk_low, random_walk_high }
    }
}

prop_compose! {
    fn temperature_model()(
        (order, reference, minimum, maximum) in any::<(u32, f64, f64, f64)>(),
        (coefficients, coefficients_std) in (numbers(), numbers()),
    ) -> TemperatureModel {
        TemperatureModel { order, reference, minimum, maximum, coefficients, coefficients_std }
    }
}

prop_compose! {
    fn log()(
        timestamp in of(time()), level in 0..6, message in text(), name in text(), file in text(), line: u32,
    ) -> foxglove::Log {
        foxglove::Log { timestamp, level, message, name, file, line }
    }
}

prop_compose! {
    fn header()(stamp in of(time()), frame_id in text()) -> Header {
        Header { stamp, frame_id }
    }
}

prop_compose! {
    fn time()(seconds: i32, nanos in 0..1_000_000_000) -> Timestamp {
        Timestamp { seconds: seconds.into(), nanos }
    }
}

prop_compose! {
    fn vector()(x: f64, y: f64, z: f64) -> Vector3 {
        Vector3 { x, y, z }
    }
}

fn numbers() -> impl Strategy<Value = Vec<f64>> {
    vec(any::<f64>(), 0..10)
}

fn text() -> impl Strategy<Value = String> {
    "[^\0]{0,12}"
}
