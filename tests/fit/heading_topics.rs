//! Topics that show the heading: which messages are read, how they are shown, and what is said of those that are none.

use serde_json::Value;
use stillpoint::simulate::Encoding;

use crate::common::Folder;
use crate::drives::{SCALE, Shown, drive};

fn folder(shown: Shown) -> Folder {
    let folder = Folder::new();
    folder.write("drive.mcap", &drive(shown));
    folder.write("odom.toml", b"[fit.heading]\ntopic = '/odom'\n");
    let antennas = "[fit.heading]\ntopic = '/relposned'\npath = 'relPosHeading'\nunit = '1e-5 deg'\nclockwise = true\n";
    folder.write("antennas.toml", antennas.as_bytes());
    folder
}

fn known(found: &Value) -> Vec<Value> {
    found["imus"][0]["gyroscope"]["combinations"].as_array().cloned().unwrap_or_default()
}

#[test]
fn headings_are_read_from_odometry_of_both_generations_of_ros_and_from_a_field() {
    for (shown, config) in [
        (Shown::Odometry(Encoding::Ros2), "odom.toml"),
        (Shown::Odometry(Encoding::Ros1), "odom.toml"),
        (Shown::Antennas, "antennas.toml"),
    ] {
        let folder = folder(shown);
        let run = folder.say(&format!("annotate drive.mcap --json -c {config}")).ok();
        assert!(!run.stderr.contains("fit.heading"), "{}", run.stderr);
        let [known] = known(&run.json()).try_into().unwrap();
        let (value, std) = (known["value"].as_f64().unwrap(), known["std"].as_f64().unwrap());
        assert!((value - SCALE).abs() < 3.0 * std && std < 0.004, "{shown:?}: {known}");
        let without = folder.say("annotate drive.mcap --json --force").ok().json();
        assert!(self::known(&without).is_empty(), "{without}");
    }
}

#[test]
fn a_topic_of_headings_is_shown_as_what_it_is_used_for() {
    let folder = folder(Shown::Odometry(Encoding::Ros2));
    let shown = folder.say("topics drive.mcap -c odom.toml").ok().stdout;
    assert!(shown.contains("heading, for turns about the vertical (pose.pose.orientation)"), "{shown}");
    let shown = folder.say("topics drive.mcap").ok().stdout;
    assert!(!shown.contains("heading"), "{shown}");
}

#[test]
fn a_topic_that_is_missing_or_shows_no_heading_is_said() {
    let folder = folder(Shown::Odometry(Encoding::Ros2));
    for (heading, words) in [
        ("topic='/odem'", "/odem: configured, but the recording has no such topic; did you mean /odom?"),
        ("topic='/imu/data_raw'", "the orientation in sensor_msgs/Imu is made from a gyroscope"),
        ("topic='/odom',path='pose.pose.position.q'", "has no field `pose.pose.position.q`"),
    ] {
        let set = format!("--set fit.heading={{{heading}}}");
        let run = folder.say(&format!("annotate drive.mcap --force --json {set}")).ok();
        assert!(run.stderr.contains(words), "{heading}: {}", run.stderr);
        assert!(known(&run.json()).is_empty());
        let shown = folder.say(&format!("topics drive.mcap {set}")).ok().stdout;
        assert!(shown.contains(words), "{heading}: {shown}");
    }
    folder.refuses("topics drive.mcap --set fit.heading={topic='/odom',std_deg=0}", 2, &["fit.heading.std_deg"]);
    folder.refuses("topics drive.mcap --set fit.heading={topic='/odom',unit='grad'}", 2, &["fit.heading", "grad"]);
    let antennas = self::folder(Shown::Antennas);
    let run = antennas.say("annotate drive.mcap --json --set fit.heading={topic='/relposned'}").ok();
    assert!(run.stderr.contains("which field is the heading? Set fit.heading.path"), "{}", run.stderr);
    let other_way = "annotate drive.mcap --force --json -c antennas.toml --set fit.heading.clockwise=false";
    let run = antennas.say(other_way).ok();
    assert!(run.stderr.contains("set fit.heading.clockwise = true"), "{}", run.stderr);
}
