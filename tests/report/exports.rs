//! Calibrations in the formats of other programs: what those programs would compute from the file is what we would.

use crate::common::Folder;
use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;
use serde_json::Value;
use stillpoint::messages::triad::{Model, Status};
use stillpoint::messages::{self, TemperatureModel, Triad};
use stillpoint::report::{self, Axes, Findings, Format, Options, Parameters, Readings};

/// A calibration of any kind that is one.
#[derive(Clone, Debug)]
struct Truth {
    accel: (Vector3<f64>, Matrix3<f64>),
    gyro: (Vector3<f64>, Matrix3<f64>),
    g: Matrix3<f64>,
}

impl Truth {
    fn accel(&self, measured: &Vector3<f64>) -> Vector3<f64> {
        self.accel.1.try_inverse().unwrap() * (measured - self.accel.0)
    }

    fn gyro(&self, measured: &Vector3<f64>, acceleration: &Vector3<f64>) -> Vector3<f64> {
        self.gyro.1.try_inverse().unwrap() * (measured - self.gyro.0 - self.g * acceleration)
    }

    fn findings(&self) -> Vec<Findings> {
        let rows = |m: &Matrix3<f64>| m.transpose().as_slice().to_vec();
        let xyz = |v: &Vector3<f64>| Some(messages::Vector3 { x: v.x, y: v.y, z: v.z });
        let triad = |sensor: &str, (bias, s): &(Vector3<f64>, Matrix3<f64>)| Triad {
            sensor: sensor.into(),
            topic: "/imu".into(),
            model: Model::CrossAxis.into(),
            status: Status::Confirmed.into(),
            bias: xyz(bias),
            scale: xyz(&s.diagonal()),
            sensitivity: rows(s),
            ..Triad::default()
        };
        let mut gyro = triad("gyroscope", &self.gyro);
        if self.g != Matrix3::zeros() {
            gyro.g_sensitivity = rows(&self.g);
        }
        let calibration = messages::Calibration {
            accelerometer: Some(triad("accelerometer", &self.accel)),
            gyroscope: Some(gyro),
            gravity: 9.80665,
            ..Default::default()
        };
        vec![Findings { calibration: Some(calibration), ..Findings::new("/imu", "/imu") }]
    }
}

fn vector(size: f64) -> impl Strategy<Value = Vector3<f64>> {
    prop::array::uniform3(-size..size).prop_map(Vector3::from)
}

fn diagonal() -> impl Strategy<Value = Matrix3<f64>> {
    vector(0.2).prop_map(|d| Matrix3::from_diagonal(&d.add_scalar(1.0)))
}

/// What autopilots can hold.
fn scales() -> impl Strategy<Value = Truth> {
    (vector(8.0), diagonal(), vector(0.3)).prop_map(|(bias, scale, rate)| Truth {
        accel: (bias, scale),
        gyro: (rate, Matrix3::identity()),
        g: Matrix3::zeros(),
    })
}

/// Calibrations, and how far an autopilot's correction may be from ours for each m/s² and rad/s: its parameters have 32
/// bits, and what these hold exactly must agree to 1e-9.
fn in_32_bits() -> impl Strategy<Value = (Truth, f64)> {
    let exact = scales().prop_map(|truth| {
        let short = |value: f64| f64::from(value as f32);
        // The scale of an autopilot is the inverse of ours.
        let scale = truth.accel.1.diagonal().map(|scale| 1.0 / short(1.0 / scale));
        let accel = (truth.accel.0.map(short), Matrix3::from_diagonal(&scale));
        Truth { accel, gyro: (truth.gyro.0.map(short), truth.gyro.1), g: truth.g }
    });
    prop_oneof![scales().prop_map(|truth| (truth, 1e-6)), exact.prop_map(|truth| (truth, 1e-9 / 60.0))]
}

/// What Kalibr's layout can hold.
fn full() -> impl Strategy<Value = Truth> {
    let matrix = |size: f64| prop::array::uniform9(-size..size).prop_map(|m| Matrix3::from_row_slice(&m));
    (vector(8.0), matrix(0.1), vector(0.3), matrix(0.1), matrix(0.001)).prop_map(|(b, s, w, t, g)| Truth {
        accel: (b, Matrix3::identity() + s),
        gyro: (w, Matrix3::identity() + t),
        g,
    })
}

fn export(truth: &Truth, format: &str, options: &Options) -> String {
    report::export(&truth.findings(), Format::named(format).unwrap(), options).unwrap().text
}

fn raw(axes: Axes) -> Options {
    Options { readings: Readings::Raw, axes: Some(axes), ..Options::default() }
}

fn yaml(text: &str) -> Value {
    serde_saphyr::from_str(text).unwrap()
}

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(numbers).collect(),
        value => vec![value.as_f64().unwrap()],
    }
}

fn matrix(value: &Value) -> Matrix3<f64> {
    Matrix3::from_row_slice(&numbers(value))
}

fn xyz(value: &Value) -> Vector3<f64> {
    Vector3::from_column_slice(&numbers(value))
}

/// A parameter as an autopilot keeps it: the text of a file has no more digits than tell its 32 bits from others.
fn kept(file: &Parameters, name: &str) -> f64 {
    f64::from(file.get(name).unwrap() as f32)
}

/// What PX4 makes of a raw reading: `Accelerometer.hpp` and `Gyroscope.hpp`, `Correct`, in 64 bits.
struct Px4(Parameters);

impl Px4 {
    fn vector(&self, name: &str, suffix: &str) -> Vector3<f64> {
        Vector3::from_iterator(["X", "Y", "Z"].map(|axis| kept(&self.0, &format!("{name}_{axis}{suffix}"))))
    }

    fn accel(&self, data: &Vector3<f64>) -> Vector3<f64> {
        (data - self.vector("CAL_ACC0", "OFF")).component_mul(&self.vector("CAL_ACC0", "SCALE"))
    }

    fn gyro(&self, data: &Vector3<f64>) -> Vector3<f64> {
        data - self.vector("CAL_GYRO0", "OFF")
    }
}

fn turned(v: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(v.x, -v.y, -v.z)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn imu_calib_would_correct_as_we_do(truth in full(), reading in vector(30.0)) {
        // accel_calib.cpp, applyCalib.
        let file = yaml(&export(&truth, "imu-calib", &Options::default()));
        let corrected = matrix(&file["SM"]) * reading - xyz(&file["bias"]);
        prop_assert!((corrected - truth.accel(&reading)).norm() < 1e-9);
    }

    #[test]
    fn kalibr_would_predict_what_we_correct(truth in full(), a in vector(30.0), w in vector(5.0)) {
        // IccSensors.py, IccScaledMisalignedImu: predictions of true values.
        let file = yaml(&export(&truth, "kalibr", &Options::default()));
        let (accel, gyro) = (&file["imu0"]["accelerometers"], &file["imu0"]["gyroscopes"]);
        let (m, c) = (matrix(&gyro["M"]), matrix(&gyro["C_gyro_i"]));
        prop_assert!((c * c.transpose() - Matrix3::identity()).norm() < 1e-12 && c.determinant() > 0.0);
        prop_assert!(m[(0, 1)] == 0.0 && m[(0, 2)] == 0.0 && m[(1, 2)] == 0.0 && m.diagonal().min() > 0.0);
        let alpha = matrix(&accel["M"]) * a + xyz(&accel["b"]);
        let omega = matrix(&gyro["M"]) * (c * w) + matrix(&gyro["A"]) * (c * a) + xyz(&gyro["b"]);
        let corrected = truth.accel(&alpha);
        prop_assert!((corrected - a).norm() < 1e-9);
        prop_assert!((truth.gyro(&omega, &corrected) - w).norm() < 1e-9);
    }

    #[test]
    fn px4_would_correct_as_we_do((truth, within) in in_32_bits(), a in vector(30.0), w in vector(5.0)) {
        let px4 = |axes| Px4(Parameters::parse(&export(&truth, "px4", &raw(axes))).unwrap());
        let same = px4(Axes::Frd);
        prop_assert!((same.accel(&a) - truth.accel(&a)).norm() < within * 60.0);
        prop_assert!((same.gyro(&w) - truth.gyro(&w, &a)).norm() < within);
        // A recording along forward, left, up: the autopilot sees the same motion with y and z turned.
        let other = px4(Axes::Flu);
        prop_assert!((other.accel(&turned(&a)) - turned(&truth.accel(&a))).norm() < within * 60.0);
        prop_assert!((other.gyro(&turned(&w)) - turned(&truth.gyro(&w, &a))).norm() < within);
    }

    #[test]
    fn ardupilot_would_correct_as_we_do((truth, within) in in_32_bits(), a in vector(30.0), w in vector(5.0), slot in 0_u8..4) {
        let options = Options { slot, ..raw(Axes::Frd) };
        let file = Parameters::parse(&export(&truth, "ardupilot", &options)).unwrap();
        let get = |name: &str| {
            let name = match slot {
                0 => format!("INS_{name}"),
                3 => format!("INS4_{name}"),
                n => format!("INS_{}{}{}", &name[..3], n + 1, &name[3..]),
            };
            Vector3::from_iterator(["X", "Y", "Z"].map(|axis| kept(&file, &format!("{name}_{axis}"))))
        };
        // AP_InertialSensor_Backend.cpp, _rotate_and_correct_accel and _rotate_and_correct_gyro.
        let accel = (a - get("ACCOFFS")).component_mul(&get("ACCSCAL"));
        prop_assert!((accel - truth.accel(&a)).norm() < within * 60.0);
        prop_assert!((w - get("GYROFFS") - truth.gyro(&w, &a)).norm() < within);
    }

    #[test]
    fn parameters_in_force_are_composed(before in scales(), after in scales(), a in vector(30.0), w in vector(5.0)) {
        let in_force = Parameters::parse(&export(&before, "px4", &raw(Axes::Frd))).unwrap();
        let then = Px4(in_force.clone());
        let options = Options { readings: Readings::Corrected(in_force), ..raw(Axes::Flu) };
        let now = Px4(Parameters::parse(&export(&after, "px4", &options)).unwrap());
        // `after` was learned from what PX4 had corrected, in the axes of ROS.
        let expected = turned(&after.accel(&turned(&then.accel(&a))));
        prop_assert!((now.accel(&a) - expected).norm() < 1e-6 * 100.0);
        let expected = turned(&after.gyro(&turned(&then.gyro(&w)), &a));
        prop_assert!((now.gyro(&w) - expected).norm() < 1e-6);
    }

    #[test]
    fn an_import_takes_back_what_an_export_wrote(truth in full(), simple in scales()) {
        let read = |truth: &Truth, format: &str, options: &Options| {
            let imus = report::import(&export(truth, format, options), Some(Axes::Flu)).unwrap();
            let calibration = imus[0].calibration.clone().unwrap();
            let known = |triad: Option<Triad>| report::calibration(&triad.unwrap()).unwrap();
            (known(calibration.accelerometer), calibration.gyroscope.map(|gyro| (known(Some(gyro.clone())), gyro)))
        };
        for format in ["json", "yaml", "kalibr", "imu-calib"] {
            let (accel, gyro) = read(&truth, format, &Options::default());
            let exact = if format == "imu-calib" { 1e-9 } else { 0.0 };
            prop_assert!((accel.bias - truth.accel.0).norm() <= exact && (accel.sensitivity - truth.accel.1).norm() <= exact);
            if let Some((gyro, triad)) = gyro {
                // Kalibr's file holds its sensitivity as a product.
                let exact = if format == "kalibr" { 1e-14 } else { 0.0 };
                prop_assert_eq!(gyro.bias, truth.gyro.0);
                prop_assert!((gyro.sensitivity - truth.gyro.1).norm() <= exact);
                prop_assert!((Matrix3::from_row_slice(&triad.g_sensitivity) - truth.g).norm() <= exact);
            }
        }
        for format in ["px4", "ardupilot"] {
            let (accel, gyro) = read(&simple, format, &raw(Axes::Flu));
            prop_assert!((accel.bias - simple.accel.0).norm() < 1e-6 && (accel.sensitivity - simple.accel.1).norm() < 1e-6);
            prop_assert!((gyro.unwrap().0.bias - simple.gyro.0).norm() < 1e-7);
        }
    }
}

#[test]
fn what_a_format_cannot_hold_is_refused() {
    let diagonal = Truth {
        accel: (Vector3::new(0.1, 0.2, 0.3), Matrix3::from_diagonal(&Vector3::new(1.01, 0.99, 1.0))),
        gyro: (Vector3::new(0.01, 0.0, 0.0), Matrix3::identity()),
        g: Matrix3::zeros(),
    };
    let refused = |truth: &Truth, format: &str, options: &Options| {
        report::export(&truth.findings(), Format::named(format).unwrap(), options).unwrap_err().to_string()
    };
    for format in ["px4", "ardupilot"] {
        let mut crossed = diagonal.clone();
        crossed.accel.1[(1, 0)] = 0.001;
        assert!(refused(&crossed, format, &raw(Axes::Frd)).contains("cannot hold cross-axis sensitivity"));
        let mut scaled = diagonal.clone();
        scaled.gyro.1[(2, 2)] = 1.01;
        assert!(refused(&scaled, format, &raw(Axes::Frd)).contains("cannot hold the scale of a gyroscope"));
        let mut sensitive = diagonal.clone();
        sensitive.g[(0, 0)] = 1e-5;
        assert!(refused(&sensitive, format, &raw(Axes::Frd)).contains("cannot hold g-sensitivity"));
        assert!(
            refused(&diagonal, format, &Options { axes: Some(Axes::Frd), ..Options::default() }).contains("--in-force")
        );
        let unsaid = Options { readings: Readings::Raw, ..Options::default() };
        assert!(refused(&diagonal, format, &unsaid).contains("--axes"));
        assert!(refused(&diagonal, format, &Options { slot: 9, ..raw(Axes::Frd) }).contains("has no sensor 9"));
        assert!(refused(&diagonal, format, &Options { imu: Some("/no".into()), ..raw(Axes::Frd) }).contains("/imu"));
    }
    for format in ["kalibr", "imu-calib"] {
        let mut findings = diagonal.findings();
        let accelerometer =
            findings[0].calibration.as_mut().and_then(|calibration| calibration.accelerometer.as_mut()).unwrap();
        let coefficients = vec![0.01, 0.0, -0.002];
        accelerometer.temperature = Some(TemperatureModel { order: 1, coefficients, ..TemperatureModel::default() });
        let error = report::export(&findings, Format::named(format).unwrap(), &raw(Axes::Frd)).unwrap_err().to_string();
        assert!(error.contains("cannot hold change of bias with temperature"), "{error}");
    }
    for format in ["px4", "ardupilot"] {
        // What the turns show is lost, and said to be; the bias is worth having without it.
        let mut turned = diagonal.clone();
        turned.gyro.1[(0, 1)] = 0.01;
        let mut findings = turned.findings();
        let gyroscope =
            findings[0].calibration.as_mut().and_then(|calibration| calibration.gyroscope.as_mut()).unwrap();
        gyroscope.model = Model::Turns.into();
        let written = report::export(&findings, Format::named(format).unwrap(), &raw(Axes::Frd)).unwrap();
        assert!(written.warnings.iter().any(|said| said.contains("cannot hold the sensitivity of a gyroscope")));
        assert!(written.text.contains("0.01"), "{}", written.text);
    }
    let twice = [diagonal.findings(), diagonal.findings()].concat();
    let error =
        report::export(&twice, Format::named("imu-calib").unwrap(), &Options::default()).unwrap_err().to_string();
    assert!(error.contains("--imu"), "{error}");
    assert!(refused(&diagonal, "kalibr-input", &Options::default()).contains("--random-walk"));
    let mut corrected = diagonal.findings();
    corrected[0].source_type = "px4_msgs/msg/SensorCombined".into();
    let error = report::export(&corrected, Format::named("px4").unwrap(), &raw(Axes::Frd)).unwrap_err().to_string();
    assert!(error.contains("after its own calibration"), "{error}");
    let turned = Parameters::parse("SENS_BOARD_ROT,8\nCAL_ACC0_XOFF,0\n").unwrap();
    let turned = Options { readings: Readings::Corrected(turned), ..raw(Axes::Frd) };
    assert!(refused(&diagonal, "px4", &turned).contains("SENS_BOARD_ROT"));
    // Those of the sensors themselves, of the slot that is written.
    for (slot, name) in [(0, "CAL_GYRO0_ROT"), (0, "CAL_ACC0_ROT"), (1, "CAL_ACC1_ROT"), (1, "CAL_GYRO1_ROT")] {
        let in_force = |rotation: i32| {
            let none = ["ACC0", "ACC1", "GYRO0", "GYRO1"].into_iter().flat_map(|sensor| {
                let axis = |axis| format!("CAL_{sensor}_{axis}OFF,0\nCAL_{sensor}_{axis}SCALE,1\n");
                ["X", "Y", "Z"].map(axis)
            });
            let none: String = none.collect();
            let parameters = Parameters::parse(&format!("{none}{name},{rotation}\n")).unwrap();
            Options { slot, readings: Readings::Corrected(parameters), ..raw(Axes::Frd) }
        };
        assert!(refused(&diagonal, "px4", &in_force(6)).contains(name), "{name}");
        for harmless in [in_force(0), in_force(-1), Options { slot: 1 - slot, ..in_force(6) }] {
            let written = report::export(&diagonal.findings(), Format::named("px4").unwrap(), &harmless);
            assert!(written.is_ok(), "{name}: {:?}", written.err().map(|error| error.to_string()));
        }
    }
}

#[test]
fn every_format_is_written_of_a_recording_and_read_back_as_what_annotate_said() {
    let folder = Folder::with_demo();
    folder.say("annotate demo.mcap -o a.mcap").ok();
    let own = folder.say("export a.mcap --format json").ok().json();
    folder.write("own.json", own.to_string().as_bytes());
    let read = folder.say("import own.json").ok().json();
    for triad in ["accelerometer", "gyroscope"] {
        assert_eq!(read["imus"][0][triad], own["imus"][0][triad], "its notes and statistics, too");
    }
    let accel = &own["imus"][0]["accelerometer"];
    for (format, options) in [
        ("yaml", ""),
        ("kalibr", ""),
        ("imu-calib", ""),
        ("px4", "--raw --axes flu"),
        ("ardupilot", "--raw --axes flu --slot 1"),
    ] {
        folder.say(&format!("export a.mcap --format {format} {options} -o file.{format}")).ok();
        let text = String::from_utf8(folder.read(&format!("file.{format}"))).unwrap();
        let header: String = text.lines().take_while(|line| line.starts_with('#')).collect();
        assert!(
            header.contains("axes as in the recording; convention: ") || header.contains("# convention: "),
            "{text}"
        );
        let run = folder.say(&format!("import file.{format} --axes flu --topic /imu")).ok();
        let read = &run.json()["imus"][0];
        assert_eq!(read["topic"], "/imu", "{format}");
        for key in ["bias", "sensitivity"] {
            let pairs = numbers(&read["accelerometer"][key]).into_iter().zip(numbers(&accel[key]));
            pairs.for_each(|(read, said)| assert!((read - said).abs() < 1e-6, "{format} {key}: {read} is not {said}"));
        }
        folder.write("other", b"precious");
        folder.refuses(&format!("export a.mcap --format {format} {options} -o other"), 1, &["other: exists"]);
    }
    // What the command line lacks is its fault.
    folder.refuses("export a.mcap --format px4 --axes flu", 2, &["a.mcap", "--raw", "--in-force"]);
    folder.refuses("export a.mcap --format ardupilot --raw", 2, &["a.mcap", "--axes frd or flu"]);
    folder.refuses("export a.mcap --format px4 --raw --axes flu --slot 9", 2, &["PX4 has no sensor 9"]);
    folder.refuses("merge a.mcap --format px4 --axes flu", 2, &["the merged calibration: ", "--raw"]);
    folder.say("export a.mcap --format px4 --raw --axes flu -o axes.params").ok();
    folder.refuses("import axes.params", 2, &["axes.params: PX4 counts along forward", "--axes frd or flu"]);
    folder.refuses("annotate demo.mcap -o c.mcap --against axes.params", 2, &["axes.params: ", "--axes"]);
    folder.refuses("import demo.mcap", 1, &["demo.mcap"]);
    folder.refuses("export a.mcap --format kalibr --random-walk 1,1", 2, &["--random-walk", "kalibr-input"]);
    // Rests of three seconds show no random walk, but bound one.
    for format in ["kalibr", "kalibr-input"] {
        let text = folder.say(&format!("export a.mcap --format {format} --random-walk bound")).ok().stdout;
        let file = yaml(&text);
        let imu = if format == "kalibr" { &file["imu0"] } else { &file };
        for (sensor, noise) in [("accelerometer", 0.02), ("gyroscope", 0.002)] {
            let density = imu[format!("{sensor}_noise_density")].as_f64().unwrap();
            assert!((density / (noise / 10.0) - 1.0).abs() < 0.2, "{format} {sensor}: {density}");
            assert!(imu[format!("{sensor}_random_walk")].as_f64().unwrap() > 0.0);
        }
        assert!(text.contains("gyroscope_random_walk is an upper bound (95 %), not an estimate"), "{text}");
    }
    let unasked = folder.say("export a.mcap --format kalibr").ok().stdout;
    assert!(unasked.contains("# gyroscope_random_walk: no more than "), "{unasked}");
    assert_eq!(yaml(&unasked)["imu0"].get("gyroscope_random_walk"), None);
    folder.refuses("export a.mcap --format kalibr-input", 1, &["--random-walk bound"]);
    folder.refuses("export a.mcap --format px4 --random-walk bound --raw --axes flu", 2, &["kalibr"]);
    folder.refuses("export a.mcap --format kalibr --random-walk least", 2, &["the word bound"]);
    folder.refuses("export a.mcap --format json --imu /nope", 1, &["no IMU /nope; there are: "]);
    let input = folder.say("export a.mcap --format kalibr-input --random-walk 2e-4,4e-6").ok().stdout;
    let input = yaml(&input);
    let truth = folder.say("simulate demo -o again.mcap --json").ok().json();
    let rate = input["update_rate"].as_f64().unwrap();
    assert!((rate - 100.0).abs() < 0.5, "{rate}: {truth}");
    assert_eq!(input["accelerometer_random_walk"].as_f64(), Some(2e-4));
}

#[test]
fn an_earlier_calibration_shows_the_drift_since() {
    let folder = Folder::with_demo();
    folder.say("export demo.mcap --format json -o before.json").ok();
    let same = folder.say("annotate demo.mcap -o a.mcap --against before.json --json").ok();
    assert!(same.stderr.contains("within the uncertainty"), "{}", same.stderr);
    assert_eq!(same.json()["drift"][0]["triads"][0]["worst"].as_f64().map(|worst| worst < 1e-9), Some(true));

    let mut moved = folder.say("export demo.mcap --format json").ok().json();
    let bias = &mut moved["imus"][0]["accelerometer"]["bias"];
    bias[1] = (bias[1].as_f64().unwrap() - 0.5).into();
    folder.write("moved.json", moved.to_string().as_bytes());
    let run = folder.say("annotate demo.mcap -o b.mcap --against moved.json --json").ok();
    assert!(run.stderr.contains("accelerometer  has moved"), "{}", run.stderr);
    let accel = &run.json()["drift"][0]["triads"][0];
    assert!((accel["bias"]["by"][1].as_f64().unwrap() - 0.5).abs() < 1e-9, "{accel}");
    let worst = accel["worst"].as_f64().unwrap();
    assert!((0.45..0.55).contains(&worst), "{worst}");
    assert_eq!(folder.read("a.mcap"), folder.read("b.mcap"), "comparing changes nothing that is written");
    folder.refuses("annotate demo.mcap -o c.mcap --against nothing.json", 1, &["nothing.json"]);
}
