//! From a temperature in the recording to what autopilots, reports and other readers make of it.

use nalgebra::Vector3;
use serde_json::Value;
use stillpoint::report::Parameters;
use stillpoint::simulate::{Encoding, Scenario};

use crate::common::Folder;
use crate::common::page::check;
use crate::warm::warming;

/// The session as annotated with these settings, and the JSON of its calibration.
fn annotated(scenario: &Scenario, settings: &str) -> (Folder, Value) {
    let folder = Folder::with_scenario("warm.mcap", scenario);
    folder.say(&format!("annotate warm.mcap -o annotated.mcap {settings}")).ok();
    let json = folder.say("export annotated.mcap --format json").ok().json();
    (folder, json["imus"][0].clone())
}

fn mapped() -> &'static str {
    "--set imu=[{topic='/imu/data_raw',temperature={topic='/imu/temperature'}}]"
}

fn xyz(value: &Value) -> Vector3<f64> {
    Vector3::from_fn(|axis, _| value[axis].as_f64().unwrap())
}

/// Published bias at a temperature, and how far it may be off: four standard deviations.
fn published(triad: &Value, celsius: f64) -> (Vector3<f64>, Vector3<f64>) {
    let model = &triad["temperature"];
    let number = |name: &str| model[name].as_f64().unwrap();
    let d = celsius.clamp(number("minimum"), number("maximum")) - number("reference");
    let (mut value, mut off) = (xyz(&triad["bias"]), xyz(&triad["bias_std"]).map(|std| 4.0 * std));
    for degree in 0..model["order"].as_u64().unwrap() as usize {
        value += xyz(&model["coefficients"][degree]) * d.powi(degree as i32 + 1);
        off += xyz(&model["coefficients_std"][degree]).map(|std| 4.0 * std) * d.abs().powi(degree as i32 + 1);
    }
    (value, off)
}

/// True bias at a temperature, °C.
fn bias(at_reference: [f64; 3], change: &[[f64; 3]], celsius: f64) -> Vector3<f64> {
    let terms = (1..).zip(change).map(|(degree, change)| Vector3::from(*change) * (celsius - 25.0).powi(degree));
    Vector3::from(at_reference) + terms.sum::<Vector3<f64>>()
}

const SEEN: [f64; 4] = [23.0, 35.0, 46.0, 57.5];

#[test]
fn a_sensor_that_warms_has_its_biases_over_the_temperature() {
    for encoding in [Encoding::Ros2, Encoding::Protobuf] {
        let scenario = warming(encoding, 50.0, 1.0);
        let settings = match encoding {
            Encoding::Ros2 => mapped(),
            _ => "--set imu=[{topic='/imu/data_raw',accel='accel',gyro='gyro',temperature='temperature'}]",
        };
        // Autopilots hold no cross-axis sensitivity, which turns would show.
        let (folder, imu) = annotated(&scenario, &format!("{settings} --set fit.model=bias-scale"));
        let truths = [("accelerometer", &scenario.accelerometer), ("gyroscope", scenario.gyroscope.as_ref().unwrap())];
        for (name, truth) in truths {
            let triad = &imu[name];
            assert!(triad["temperature"].is_object(), "{name}: {}", triad["notes"]);
            for celsius in SEEN {
                let (found, off) = published(triad, celsius);
                let error = found - bias(truth.bias, &truth.bias_by_temperature, celsius);
                assert!((0..3).all(|axis| error[axis].abs() <= off[axis]), "{name} at {celsius}: {error} of {off}");
            }
        }
        assert_eq!(imu["gyroscope"]["temperature"]["order"], 2);
        assert_eq!(imu["accelerometer"]["temperature"]["order"], 1);
        let range: Vec<_> = imu["temperature_range"].as_array().unwrap().iter().map(|t| t.as_f64().unwrap()).collect();
        assert!((21.0..23.5).contains(&range[0]) && (57.0..58.5).contains(&range[1]), "{range:?}");
        // The bias is that at the end.
        let reference = imu["gyroscope"]["temperature"]["reference"].as_f64().unwrap();
        assert!((47.0..54.0).contains(&reference), "{reference}");

        autopilots(&folder, &imu);
        folder.say("report annotated.mcap -o report.html").ok();
        let html = String::from_utf8(folder.read("report.html")).unwrap();
        check(&html);
        assert!(html.contains("Bias over temperature") && html.contains("Gyroscope bias y, rad/s, over °C"));
        folder.refuses(
            "export annotated.mcap --format kalibr",
            1,
            &["change of bias with temperature", "--set fit.temperature=off"],
        );
    }
}

/// What PX4 and ArduPilot take off a reading is the published bias, at any temperature; and it is read back.
fn autopilots(folder: &Folder, imu: &Value) {
    let px4 = folder.say("export annotated.mcap --format px4 --raw --axes frd").ok().stdout;
    let file = Parameters::parse(&px4).unwrap();
    let get = |name: &str| file.get(name).unwrap_or_else(|| panic!("{name} in {px4}"));
    for (sensor, prefix, own) in [("accelerometer", "TC_A0", "CAL_ACC0"), ("gyroscope", "TC_G0", "CAL_GYRO0")] {
        assert_eq!(get(&format!("{}_ENABLE", &prefix[..4])), 1.0);
        for celsius in [-20.0_f64, 23.0, 35.0, 57.0, 90.0] {
            // temperature_compensation.cpp, calc_thermal_offsets_3D.
            let clipped = celsius.clamp(get(&format!("{prefix}_TMIN")), get(&format!("{prefix}_TMAX")));
            let d = clipped - get(&format!("{prefix}_TREF"));
            let offset = Vector3::from_fn(|axis, _| {
                let x = |degree: usize| get(&format!("{prefix}_X{degree}_{axis}"));
                let own = get(&format!("{own}_{}OFF", ["X", "Y", "Z"][axis]));
                own + x(0) + x(1) * d + x(2) * d * d + x(3) * d * d * d
            });
            let (expected, _) = published(&imu[sensor], celsius);
            assert!((offset - expected).amax() < 1e-6, "PX4 {sensor} at {celsius}: {offset} {expected}");
        }
    }
    let ardupilot = folder.say("export annotated.mcap --format ardupilot --raw --axes frd").ok().stdout;
    let file = Parameters::parse(&ardupilot).unwrap();
    let get = |name: &str| file.get(name).unwrap_or_else(|| panic!("{name} in {ardupilot}"));
    assert_eq!(get("INS_TCAL1_ENABLE"), 1.0);
    for (sensor, kind, own) in [("accelerometer", "ACC", "INS_ACCOFFS"), ("gyroscope", "GYR", "INS_GYROFFS")] {
        let p = |axis: usize, u: f64| {
            let c = |degree: usize| get(&format!("INS_TCAL1_{kind}{degree}_{}", ["X", "Y", "Z"][axis]));
            (c(1) + (c(2) + c(3) * u) * u) * u * 1e-6
        };
        let clip = |celsius: f64| celsius.clamp(get("INS_TCAL1_TMIN"), get("INS_TCAL1_TMAX"));
        let at = get(&format!("INS_{kind}1_CALTEMP"));
        for celsius in [24.0_f64, 35.0, 57.0] {
            // AP_InertialSensor_tempcal.cpp, correct_sensor.
            let offset = Vector3::from_fn(|axis, _| {
                let own = get(&format!("{own}_{}", ["X", "Y", "Z"][axis]));
                own + p(axis, clip(celsius) - 35.0) - p(axis, clip(at) - 35.0)
            });
            let (expected, _) = published(&imu[sensor], celsius);
            assert!((offset - expected).amax() < 2e-6, "ArduPilot {sensor} at {celsius}: {offset} {expected}");
        }
    }
    for (name, text) in [("px4.params", px4), ("ardupilot.param", ardupilot)] {
        folder.write(name, text.as_bytes());
        let back = folder.say(&format!("import {name} --axes frd")).ok().json();
        let back = &back["imus"][0];
        for sensor in ["accelerometer", "gyroscope"] {
            let model = &imu[sensor]["temperature"];
            assert!((xyz(&back[sensor]["bias"]) - xyz(&imu[sensor]["bias"])).amax() < 1e-6, "{name} {sensor}");
            let difference = xyz(&back[sensor]["temperature"]["coefficients"][0]) - xyz(&model["coefficients"][0]);
            assert!(difference.amax() < 1e-7, "{name} {sensor}: {difference}");
        }
        folder.refuses(
            &format!("export annotated.mcap --format px4 --axes frd --in-force {name}"),
            1,
            &["correct for the temperature"],
        );
    }
}

#[test]
fn too_little_of_a_range_is_said_and_off_says_nothing() {
    let mut scenario = warming(Encoding::Ros2, 50.0, 0.25);
    let temperature = scenario.temperature.as_mut().unwrap();
    temperature.course.iter_mut().for_each(|[_, celsius]| *celsius = 22.0 + 0.2 * (*celsius - 22.0));
    let (folder, imu) = annotated(&scenario, mapped());
    for sensor in ["accelerometer", "gyroscope"] {
        assert!(imu[sensor]["temperature"].is_null());
        let notes = imu[sensor]["notes"].to_string();
        assert!(notes.contains("too little of a range"), "{notes}");
    }
    assert!(imu["temperature_range"][0].as_f64().unwrap() > 20.0);
    folder.say(&format!("annotate warm.mcap -o off.mcap --set fit.temperature=off {}", mapped())).ok();
    let off = folder.say("export off.mcap --format json").ok().json();
    assert!(!off.to_string().contains("too little of a range"));
    // Without a temperature nothing is said of it at all.
    folder.say("annotate warm.mcap -o without.mcap").ok();
    let without = folder.say("export without.mcap --format json").ok().json();
    assert!(without["imus"][0]["temperature_range"].is_null());
    assert!(!without.to_string().contains("°C"), "{without}");
}

#[test]
fn topics_says_what_the_temperature_of_an_imu_is() {
    let folder = Folder::with_scenario("warm.mcap", &warming(Encoding::Ros2, 50.0, 0.05));
    let said = folder.say(&format!("topics warm.mcap {}", mapped())).ok().stdout;
    assert!(said.contains("temperature of /imu/data_raw (temperature)"), "{said}");
    let wrong =
        "topics warm.mcap --set imu=[{topic='/imu/data_raw',temperature={topic='/imu/temperature',path='temprature'}}]";
    let said = folder.say(wrong).ok().stdout;
    assert!(said.contains("no field `temprature`; the nearest is `temperature`"), "{said}");
}
