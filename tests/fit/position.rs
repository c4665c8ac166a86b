//! Where a recording says that it was made sets the length of gravity, unless the configuration knows better.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;

use crate::common::Folder;
use mcap::records::MessageHeader;
use mcap::{Channel, MessageStream, Schema, Writer};
use serde_json::Value;
use stillpoint::simulate::{Encoding, Scenario, record};

const NAV_SAT_FIX: &str = "std_msgs/Header header
sensor_msgs/NavSatStatus status
float64 latitude
float64 longitude
float64 altitude
float64[9] position_covariance
uint8 position_covariance_type
===
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
===
MSG: sensor_msgs/NavSatStatus
int8 STATUS_NO_FIX=-1
int8 status
uint16 service
";

/// The demo with positions on `/fix`: two that are none, one in the Alps, one elsewhere.
fn folder(encoding: Encoding) -> Folder {
    let mut scenario = Scenario::builtin("demo").unwrap();
    scenario.recording.encoding = encoding;
    let mut bytes = Vec::new();
    record(&scenario, &mut bytes).unwrap();
    let (schema_encoding, message_encoding, seq): (_, _, &[u8]) = match encoding {
        Encoding::Ros1 => ("ros1msg", "ros1", &[0; 4]),
        _ => ("ros2msg", "cdr", &[]),
    };
    let text = match encoding {
        Encoding::Ros1 => NAV_SAT_FIX
            .replace("builtin_interfaces/Time stamp", "uint32 seq\ntime stamp")
            .replace("===\n", "================================================================================\n"),
        _ => NAV_SAT_FIX.to_owned(),
    };
    let name = if encoding == Encoding::Ros1 { "sensor_msgs/NavSatFix" } else { "sensor_msgs/msg/NavSatFix" };
    let schema =
        Schema { id: 900, name: name.into(), encoding: schema_encoding.into(), data: Cow::Owned(text.into_bytes()) };
    let fix = Arc::new(Channel {
        id: 900,
        topic: "/fix".into(),
        schema: Some(Arc::new(schema)),
        message_encoding: message_encoding.into(),
        metadata: BTreeMap::new(),
    });
    let mut out = std::io::Cursor::new(Vec::new());
    let mut writer = Writer::new(&mut out).unwrap();
    let fixes = [(-1, 10.0, 20.0, 0.0), (0, 0.0, 0.0, 0.0), (0, 46.5, 8.0, 1500.0), (0, -80.0, 8.0, 0.0)];
    let mut fixes = fixes.into_iter();
    for (i, message) in MessageStream::new(&bytes).unwrap().enumerate() {
        let message = message.unwrap();
        writer.write(&message).unwrap();
        if i % 200 == 100
            && let Some((status, latitude, longitude, altitude)) = fixes.next()
        {
            let mut data = Vec::new();
            if encoding != Encoding::Ros1 {
                data.extend([0, 1, 0, 0]);
            }
            data.extend(seq);
            // Stamp, then the frame "g": its length counts the zero at its end in CDR alone.
            data.extend([0; 8]);
            match encoding {
                Encoding::Ros1 => data.extend([1, 0, 0, 0, b'g']),
                _ => data.extend([2, 0, 0, 0, b'g', 0]),
            }
            data.push(i8::to_le_bytes(status)[0]);
            if encoding != Encoding::Ros1 {
                data.resize((data.len() - 4).next_multiple_of(2) + 4, 0);
            }
            data.extend([1, 0]);
            if encoding != Encoding::Ros1 {
                data.resize((data.len() - 4).next_multiple_of(8) + 4, 0);
            }
            for number in [latitude, longitude, altitude].into_iter().chain([0.0; 9]) {
                data.extend(f64::to_le_bytes(number));
            }
            data.push(0);
            let (log_time, publish_time) = (message.log_time, message.log_time);
            let id = writer.add_schema(name, schema_encoding, &fix.schema.as_ref().unwrap().data).unwrap();
            let channel_id = writer.add_channel(id, "/fix", message_encoding, &fix.metadata).unwrap();
            let header = MessageHeader { channel_id, sequence: i as u32, log_time, publish_time };
            writer.write_to_known_channel(&header, &data).unwrap();
        }
    }
    writer.finish().unwrap();
    drop(writer);
    let folder = Folder::new();
    folder.write("demo.mcap", &out.into_inner());
    folder
}

fn imu(folder: &Folder, settings: &str) -> Value {
    folder.say(&format!("annotate demo.mcap --force --json -q {settings}")).ok().json()["imus"][0].clone()
}

#[test]
fn the_first_valid_position_sets_the_length_of_gravity_in_both_generations_of_ros() {
    for encoding in [Encoding::Ros2, Encoding::Ros1] {
        let imu = imu(&folder(encoding), "");
        assert_eq!(imu["gravity_source"], "fix topic");
        // 46.5° north, 1500 m up: 9.8076 on the ellipsoid, less 3.086e-6 a metre.
        let gravity = imu["gravity"].as_f64().unwrap();
        assert!((gravity - (9.80755 - 1500.0 * 3.086e-6)).abs() < 2e-4, "{gravity}");
        let notes = imu["accelerometer"]["notes"].to_string();
        assert!(notes.contains("of the recorded position"), "{notes}");
    }
}

#[test]
fn what_the_configuration_says_of_gravity_counts_more() {
    let folder = folder(Encoding::Ros2);
    let standard = imu(&folder, "--set fit.fix_topic=/elsewhere");
    assert_eq!((standard["gravity_source"].as_str(), standard["gravity"].as_f64()), (Some("standard"), Some(9.80665)));
    let configured = imu(&folder, "--set fit.gravity=9.81 --set fit.latitude_deg=10");
    assert_eq!(
        (configured["gravity_source"].as_str(), configured["gravity"].as_f64()),
        (Some("configured"), Some(9.81))
    );
    let latitude = imu(&folder, "--set fit.latitude_deg=0");
    assert_eq!(latitude["gravity_source"], "latitude");
    assert!((latitude["gravity"].as_f64().unwrap() - 9.780_325).abs() < 1e-5);
    let std = |imu: &Value| imu["accelerometer"]["sensitivity_std"][0][0].as_f64().unwrap();
    assert!(std(&configured) < std(&latitude) && std(&latitude) < std(&standard), "less is known, the bars are wider");
}

#[test]
fn a_topic_of_positions_is_shown_as_what_it_is_used_for() {
    let folder = folder(Encoding::Ros2);
    let topics = folder.say("topics demo.mcap").ok().stdout;
    assert!(topics.contains("position, for the length of gravity"), "{topics}");
    let missing = folder.say("topics demo.mcap --set fit.fix_topic=/fux").ok().stdout;
    assert!(missing.contains("/fux") && missing.contains("did you mean /fix?"), "{missing}");
    folder.refuses("topics demo.mcap --set fit.height_m=3", 2, &["fit.height_m", "fit.latitude_deg"]);
}

#[test]
fn where_the_latitude_is_known_the_earth_s_rotation_is_no_bias() {
    let text = "[recording]\nencoding='ros2'\n[accelerometer]\nrate_hz=100\nnoise=0.02\n[gyroscope]\nrate_hz=100\nnoise=1e-4\n";
    let faces = ["+X", "-X", "+Y", "-Y", "+Z", "-Z", "+Z", "+Z", "+Z", "+Z"];
    let poses: String = faces.iter().map(|face| format!("[[pose]]\nface='{face}'\nrest_s=3.0\n")).collect();
    let scenario = Scenario::parse(&format!("latitude_deg = 80.0\n{text}{poses}")).unwrap();
    let folder = Folder::with_scenario("demo.mcap", &scenario);
    let (unaware, aware) = (imu(&folder, ""), imu(&folder, "--set fit.latitude_deg=80"));
    let z = |imu: &Value, key: &str| imu["gyroscope"][key][2].as_f64().unwrap();
    // The true bias is zero; five rests on +Z and one on -Z see 4/10 of 7.2e-5 rad/s.
    assert!(z(&unaware, "bias") > 2e-5, "{}", z(&unaware, "bias"));
    assert!(z(&aware, "bias").abs() < 1e-5, "{}", z(&aware, "bias"));
    assert!(z(&aware, "bias_std") < z(&unaware, "bias_std"));
}
