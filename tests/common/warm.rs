//! A session in which the sensor warms: six faces in the cold, one placement while it warms, six faces in the heat, and it
//! cools down again.

use stillpoint::simulate::{Encoding, Pose, Scenario, Temperature};

/// Scenario at this rate; `pace` is its duration over that of the full one, 27 minutes.
pub fn warming(encoding: Encoding, rate_hz: f64, pace: f64) -> Scenario {
    let mut scenario = Scenario::builtin("demo").unwrap();
    scenario.recording.encoding = encoding;
    scenario.tilt_scatter_deg = 0.5;
    let gyroscope = scenario.gyroscope.as_mut().unwrap();
    for triad in [&mut scenario.accelerometer, &mut *gyroscope] {
        triad.rate_hz = rate_hz;
    }
    scenario.accelerometer.bias_by_temperature = vec![[0.004, -0.003, 0.002]];
    scenario.accelerometer.placement_scatter = 0.002;
    gyroscope.bias_by_temperature = vec![[3e-5, -2e-5, 1e-5], [1.5e-6, 0.0, -1e-6]];
    gyroscope.placement_scatter = 5e-5;
    let course =
        [[0.0, 22.0], [100.0, 23.0], [400.0, 40.0], [800.0, 53.0], [1200.0, 58.0], [1300.0, 58.0], [1600.0, 48.0]];
    scenario.temperature = Some(Temperature {
        course: course.iter().map(|[time, celsius]| [pace * time, *celsius]).collect(),
        reference: 25.0,
        topic: matches!(encoding, Encoding::Ros1 | Encoding::Ros2).then(|| "/imu/temperature".to_owned()),
        rate_hz: 2.0,
        noise: 0.05,
        step: 0.0625,
    });
    let faces = ["+X", "-X", "+Y", "-Y", "-Z", "+Z"];
    let pose = |face: &&str, rest_s: f64| Pose { face: Some((*face).to_owned()), rest_s, ..Pose::default() };
    let cold = faces.iter().map(|face| pose(face, 12.0 * pace));
    let warming = [pose(&"+Z", 1200.0 * pace)];
    let hot = faces.iter().map(|face| pose(face, 12.0 * pace));
    let cooling = [pose(&"-X", 250.0 * pace)];
    scenario.pose = cold.chain(warming).chain(hot).chain(cooling).collect();
    scenario
}
