//! Mappings that `topics` offers for what phones and browsers record: both triads, gravity included, or the reason why none.

use serde_json::{Value, json};

use crate::common::Folder;
use crate::real_recordings::{MAPPED, Measured, START, is_true, recording, six_faces, vector};
use crate::session::GYRO_BIAS;

const G: f64 = 9.80665;

/// A message of each topic for every sample.
fn told<const N: usize>(topics: impl Fn(&Measured) -> [(&'static str, Value); N]) -> Folder {
    let samples = six_faces();
    let messages =
        samples.iter().flat_map(|m| topics(m).into_iter().map(move |(topic, value)| (topic, START + m.at, value)));
    let folder = Folder::new();
    folder.write("a.mcap", &recording(messages));
    folder
}

/// What `topics` says.
fn topics(folder: &Folder) -> Vec<Value> {
    folder.say("topics a.mcap --json").ok().json()["topics"].as_array().unwrap().clone()
}

/// The lines that are offered calibrate both triads when they are pasted.
fn works(folder: &Folder, of: &str) -> String {
    let said = topics(folder);
    let offered: Vec<_> = said.iter().filter_map(|topic| topic["configuration"].as_str()).collect();
    assert_eq!(offered.len(), 1, "{of}: {said:#?}");
    folder.write("c.toml", offered[0].as_bytes());
    is_true(&folder.say("annotate a.mcap -o b.mcap -c c.toml --json").ok().json(), GYRO_BIAS);
    offered[0].to_owned()
}

#[test]
fn the_rates_of_a_browser_are_offered_in_degrees() {
    let named = |m: &Measured, names: [&str; 3]| {
        Value::from_iter(names.into_iter().zip(&m.gyro).map(|(name, rate)| (name.to_owned(), json!(rate.to_degrees()))))
    };
    let browser = ["alpha", "beta", "gamma"];
    let one = told(|m| {
        let rates = named(m, browser);
        [("/dm", json!({"accelerationIncludingGravity": vector(m.accel), "rotationRate": rates}))]
    });
    assert!(works(&one, "one topic").contains("unit = \"deg/s\""));
    let two = told(|m| [("/dm/acceleration", vector(m.accel)), ("/dm/rotationRate", named(m, browser))]);
    assert!(works(&two, "two topics").contains("unit = \"deg/s\""));
    let aircraft = told(|m| {
        let rates = named(&Measured { gyro: m.gyro.map(f64::to_radians), ..*m }, ["roll", "pitch", "yaw"]);
        [("/dm", json!({"acceleration": vector(m.accel), "body_rates": rates}))]
    });
    assert!(!works(&aircraft, "an aircraft's names").contains("deg/s"));
}

#[test]
fn where_gravity_stands_beside_an_acceleration_without_it_their_sum_is_offered() {
    let android = told(|m| {
        let gravity = m.accel.normalize() * G;
        let (linear, rates) = (vector(m.accel - gravity), vector(m.gyro));
        [("/ph", json!({"linear_acceleration": linear, "gravity": vector(gravity), "angular_velocity": rates}))]
    });
    assert!(works(&android, "Android").contains("plus = \"gravity\""));
    let apple = told(|m| {
        let gravity = m.accel.normalize();
        let user = m.accel / G - gravity;
        let attitude = json!({"roll": 0.1, "pitch": 0.2, "yaw": 0.3});
        let (rates, gravity, user) = (vector(m.gyro), vector(gravity), vector(user));
        let motion = json!({"rotationRate": rates, "gravity": gravity, "userAcceleration": user, "attitude": attitude});
        [("/m", json!({"motion": motion}))]
    });
    assert!(works(&apple, "Apple, nested").contains("plus = \"motion.gravity\""));
    // Readings as they are, by the same name, with no gravity beside them; and with it, where both are recorded.
    let ros = told(|m| [("/i", json!({"linear_acceleration": vector(m.accel), "angular_velocity": vector(m.gyro)}))]);
    assert!(!works(&ros, "ROS").contains("plus"));
    let all = told(|m| {
        let gravity = m.accel.normalize() * G;
        let (whole, linear, rates) = (vector(m.accel), vector(m.accel - gravity), vector(m.gyro));
        [(
            "/i",
            json!({"linear_acceleration": linear, "gravity": vector(gravity), "accelerometer": whole, "gyro": rates}),
        )]
    });
    assert!(works(&all, "all").contains("accel = \"accelerometer\""));
}

#[test]
fn two_topics_called_as_ros_calls_their_vectors_are_offered_together() {
    for [accel, gyro] in [
        ["/imu/linear_acceleration", "/imu/angular_velocity"],
        ["/phone/linearAcceleration", "/phone/angularVelocity"],
        ["/phone/accel", "/phone/angular_rate"],
    ] {
        let folder = told(|m| [(gyro, vector(m.gyro)), (accel, vector(m.accel))]);
        assert!(works(&folder, accel).contains(gyro));
    }
}

#[test]
fn an_accelerometer_without_gravity_is_not_offered_and_the_reason_is_said() {
    let folder = told(|m| {
        let gravity = m.accel.normalize() * G;
        [("Accelerometer", vector(m.accel - gravity)), ("Gravity", vector(gravity)), ("Gyroscope", vector(m.gyro))]
    });
    let said = topics(&folder);
    assert!(said.iter().all(|topic| topic["configuration"].is_null()), "{said:#?}");
    let remarks = said.iter().find(|topic| topic["topic"] == "Accelerometer").unwrap()["remarks"].to_string();
    assert!(remarks.contains("gravity was removed before it was recorded"), "{remarks}");
    let run = folder.say("annotate a.mcap");
    assert!(run.code == 1 && !run.stderr.contains("topic = \"Accelerometer\""), "{}", run.stderr);
}

#[test]
fn numbers_with_unusual_names_are_listed_and_can_be_mapped() {
    let folder = told(|m| {
        let (a, g) = (m.accel, m.gyro);
        let stamp = json!({"sec": 1, "nanosec": m.at});
        [("/strap", json!({"n": stamp, "p": g.x, "q": g.y, "r": g.z, "fx": a.x, "fy": a.y, "fz": a.z, "name": "left"}))]
    });
    let said = topics(&folder);
    let verdict = said[0]["verdict"].as_str().unwrap();
    assert!(verdict.contains("the numbers `fx`, `fy`, `fz`, `p`, `q`, `r`, of which three make a vector"), "{verdict}");
    let set = r#"imu=[{topic="/strap", accel=["fx","fy","fz"], gyro=["p","q","r"]}]"#;
    is_true(&folder.run(["annotate", "a.mcap", "-o", "b.mcap", "--json", "--set", set]).ok().json(), GYRO_BIAS);
    // Where there are many, the first; where there are few, none.
    let many = told(|m| {
        [
            ("/many", Value::from_iter((10..40).map(|i| (format!("c{i}"), json!(m.accel.x))))),
            ("/few", json!({"volts": 24.1, "amperes": 0.5})),
            ("/times", json!({"sec": 1.5, "nsec": 2.0, "timestamp": 3.0, "t": 4.0, "x1": 1.0})),
        ]
    });
    let said = topics(&many);
    let verdict = |name: &str| said.iter().find(|topic| topic["topic"] == name).unwrap()["verdict"].as_str().unwrap();
    assert!(verdict("/many").contains("`c21`") && !verdict("/many").contains("`c22`"), "{}", verdict("/many"));
    assert_eq!((verdict("/few"), verdict("/times")), ("not an IMU", "not an IMU"));
}

#[test]
fn readings_that_are_refused_are_said_to_be_so_by_topics() {
    let marked = told(|m| {
        let mark = json!([-1.0, 0, 0, 0, 0, 0, 0, 0, 0]);
        // A number in the first message, and none later.
        let y = if m.at == 0 { json!(m.accel.y) } else { json!("NaN") };
        let holes = json!({"a": {"x": m.accel.x, "y": y, "z": m.accel.z}, "g": vector(m.gyro)});
        let message = json!({"a": vector(m.accel), "g": vector(m.gyro), "g_covariance": mark});
        [("/imu", message), ("/holes", holes)]
    });
    let set = r#"imu=[{topic="/imu", accel="a", gyro="g"},{topic="/holes", accel="a", gyro="g"}]"#;
    let json = marked.run(["topics", "a.mcap", "--json", "--set", set]).ok().json();
    let remarks = |name: &str| {
        let all = json["topics"].as_array().unwrap();
        all.iter().find(|topic| topic["topic"] == name).unwrap()["remarks"].to_string()
    };
    let said = remarks("/imu");
    assert!(said.contains("gyroscope: ") && said.contains("readings are refused: marked as not measured"), "{said}");
    assert!(said.contains("covariance = \\\"ignore\\\"") && !said.contains("accelerometer: 2"), "{said}");
    let said = remarks("/holes");
    assert!(said.contains("accelerometer: ") && said.contains("readings are refused: NaN, infinity"), "{said}");
    assert!(marked.run(["topics", "a.mcap", "--set", set]).ok().stdout.contains("readings are refused"));
    // Of readings that are used nothing is said.
    let good = told(|m| [("/imu", json!({"a": vector(m.accel), "g": vector(m.gyro)}))]);
    let said = good.run(["topics", "a.mcap", "--json", "--set", MAPPED]).ok().stdout;
    assert!(!said.contains("refused"), "{said}");
}

#[test]
fn a_gyroscope_alone_is_called_so_whatever_its_type() {
    let alone = "/rig/gyro is a gyroscope alone; an IMU needs an accelerometer";
    let folder = told(|m| [("/rig/gyro", vector(m.gyro))]);
    folder.refuses("annotate a.mcap", 1, &[alone]);
    // A report of a copy that was annotated all the same says so, too.
    folder.say("annotate a.mcap -o b.mcap --allow-no-imu").ok();
    folder.refuses("report b.mcap", 1, &["was annotated, but no IMU was found in it", alone]);
    // Beside an IMU that may be mapped, that is offered as well.
    let folder =
        told(|m| [("/rig/gyro", vector(m.gyro)), ("/body", json!({"accel": vector(m.accel), "gyro": vector(m.gyro)}))]);
    let run = folder.say("annotate a.mcap");
    assert!(run.stderr.contains("topic = \"/body\""), "{}", run.stderr);
}

#[test]
fn a_report_of_an_annotated_recording_says_which_readings_were_refused() {
    let folder = told(|m| {
        let mark = json!([-1.0, 0, 0, 0, 0, 0, 0, 0, 0]);
        [("/imu", json!({"a": vector(m.accel), "g": vector(m.gyro), "g_covariance": mark}))]
    });
    folder.run(["annotate", "a.mcap", "-o", "b.mcap", "--set", MAPPED]).ok();
    let said = folder.say("report b.mcap").ok().stdout;
    assert!(said.contains("/imu, gyroscope: 3000 readings refused: marked as not measured"), "{said}");
}
