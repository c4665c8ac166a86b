//! Drives from rest to rest, with odometry or antennas beside the IMU.
#![allow(dead_code)]

use std::collections::BTreeMap;

use mcap::records::MessageHeader;
use mcap::{MessageStream, WriteOptions, Writer};
use stillpoint::simulate::{Encoding, Scenario, record};

/// True scale of the gyroscope about the vertical.
pub const SCALE: f64 = 1.012;

/// Headings of the rests, degrees, counterclockwise.
const HEADINGS: [f64; 11] = [0.0, 90.0, -20.0, 100.0, 220.0, 130.0, 10.0, -110.0, -10.0, 120.0, 20.0];
/// Duration of a rest and of the motion after it, s.
const REST: f64 = 3.0;
const MOTION: f64 = 2.5;

const ODOMETRY: &str = "std_msgs/Header header
string child_frame_id
geometry_msgs/PoseWithCovariance pose
===
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
===
MSG: geometry_msgs/PoseWithCovariance
geometry_msgs/Pose pose
===
MSG: geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/Quaternion orientation
===
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
===
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
";

/// What shows the heading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shown {
    /// `nav_msgs/Odometry` on `/odom`.
    Odometry(Encoding),
    /// JSON on `/relposned` with `relPosHeading` in 10⁻⁵ degrees, clockwise from north.
    Antennas,
}

/// A drive of an IMU that lies level, with headings that err by half a degree at the most.
pub fn drive(shown: Shown) -> Vec<u8> {
    let encoding = if let Shown::Odometry(encoding) = shown { encoding } else { Encoding::Ros2 };
    let mut text = format!(
        "[recording]\nseed = 4\nencoding = '{}'\n[accelerometer]\nrate_hz = 100\nnoise = 0.02\nbias = [0.1, -0.1, 0.2]\n\
         [gyroscope]\nrate_hz = 100\nnoise = 0.001\nbias = [0.01, -0.02, 0.005]\nsensitivity = [1.0, 1.0, {SCALE}]\n\
         [motion]\nduration_s = {MOTION}\nlift_m = 0.0\nwobble_deg = 1.0\nshake = 0.3\n",
        match encoding {
            Encoding::Ros2 => "ros2",
            Encoding::Ros1 => "ros1",
            Encoding::Protobuf => "protobuf",
            Encoding::Json => "json",
        }
    );
    for heading in HEADINGS {
        text += &format!("[[pose]]\nface = '+Z'\nheading_deg = {heading}\nrest_s = {REST}\n");
    }
    let mut bytes = Vec::new();
    record(&Scenario::parse(&text).unwrap(), &mut bytes).unwrap();
    beside(&bytes, shown)
}

/// The recording with a heading after every tenth message.
fn beside(bytes: &[u8], shown: Shown) -> Vec<u8> {
    let profile = if shown == Shown::Odometry(Encoding::Ros1) { "ros1" } else { "ros2" };
    let mut out = std::io::Cursor::new(Vec::new());
    let mut writer = Writer::with_options(&mut out, WriteOptions::new().profile(profile)).unwrap();
    let (name, language, text, wire, topic) = match shown {
        Shown::Odometry(Encoding::Ros1) => {
            let text = ODOMETRY.replace("builtin_interfaces/Time stamp", "uint32 seq\ntime stamp");
            ("nav_msgs/Odometry", "ros1msg", text.replace("===", &"=".repeat(80)), "ros1", "/odom")
        }
        Shown::Odometry(_) => {
            ("nav_msgs/msg/Odometry", "ros2msg", ODOMETRY.replace("===", &"=".repeat(80)), "cdr", "/odom")
        }
        Shown::Antennas => ("", "", String::new(), "json", "/relposned"),
    };
    let mut own = None;
    let start = MessageStream::new(bytes).unwrap().next().unwrap().unwrap().log_time;
    for (i, message) in MessageStream::new(bytes).unwrap().enumerate() {
        let message = message.unwrap();
        writer.write(&message).unwrap();
        if i % 10 != 5 {
            continue;
        }
        let channel_id = *own.get_or_insert_with(|| {
            let schema = match name {
                "" => 0,
                name => writer.add_schema(name, language, text.as_bytes()).unwrap(),
            };
            writer.add_channel(schema, topic, wire, &BTreeMap::new()).unwrap()
        });
        let log_time = message.log_time;
        let place = ((log_time - start) as f64 * 1e-9 / (REST + MOTION)).floor() as usize;
        // An error of half a degree and less at each rest.
        let off = [0.3, -0.4, 0.1, 0.5, -0.2, -0.5, 0.2][place % 7];
        let heading = HEADINGS[place.min(HEADINGS.len() - 1)] + off;
        let header = MessageHeader { channel_id, sequence: i as u32, log_time, publish_time: log_time };
        writer.write_to_known_channel(&header, &content(shown, log_time, heading)).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    out.into_inner()
}

/// A message with a heading in degrees, counterclockwise.
fn content(shown: Shown, time: u64, heading: f64) -> Vec<u8> {
    let (sec, nsec) = (time / 1_000_000_000, time % 1_000_000_000);
    let Shown::Odometry(encoding) = shown else {
        let north = ((90.0 - heading).rem_euclid(360.0) * 1e5).round();
        return format!(r#"{{"header":{{"stamp":{{"sec":{sec},"nsec":{nsec}}}}},"relPosHeading":{north}}}"#)
            .into_bytes();
    };
    let is_ros2 = encoding == Encoding::Ros2;
    let mut data = if is_ros2 { vec![0, 1, 0, 0] } else { vec![0; 4] };
    data.extend((sec as u32).to_le_bytes());
    data.extend((nsec as u32).to_le_bytes());
    // Two frames, "odom" and "base": the length counts the zero at its end in CDR alone.
    for frame in ["odom", "base"] {
        if is_ros2 {
            data.resize((data.len() - 4).next_multiple_of(4) + 4, 0);
        }
        data.extend((frame.len() as u32 + u32::from(is_ros2)).to_le_bytes());
        data.extend(frame.as_bytes());
        data.extend(is_ros2.then_some(0));
    }
    if is_ros2 {
        data.resize((data.len() - 4).next_multiple_of(8) + 4, 0);
    }
    let half = heading.to_radians() / 2.0;
    for number in [1.0, 2.0, 0.0, 0.0, 0.0, half.sin(), half.cos()] {
        data.extend(f64::to_le_bytes(number));
    }
    data
}
