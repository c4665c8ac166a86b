//! The unit of a gyroscope that reads in deg/s, as people meet it: named by every command, also where every rest seems to turn.

use nalgebra::Vector3;
use stillpoint::imu::Sensor;

use crate::common::Folder;
use crate::hand::{Hand, Held};
use crate::real_recordings::{MAPPED, Measured, START, both, recording};

/// Rests with so many turns of 35° between them, read in deg/s with a bias, deg/s.
fn in_degrees(turns: usize, bias: f64) -> Folder {
    let mut hand =
        Hand::new(Held { gyro_bias: Vector3::new(1.0, -0.6, 0.4) * bias.to_radians(), ..Held::default() }, 7);
    hand = hand.rest(3.0);
    for turn in 0..turns {
        let up = hand.up();
        let across = up.cross(&Vector3::ith((up.iamin() + turn) % 3, 1.0));
        hand = hand.turn(across.normalize() * 0.61, 1.0).rest(3.0);
    }
    let messages = hand.samples.chunks_exact(2).map(|pair| {
        assert_eq!((pair[0].0, pair[1].0), (Sensor::Gyroscope, Sensor::Accelerometer));
        let at = pair[0].1.stamp.nanos();
        let read = Measured { at, accel: pair[1].1.value, gyro: pair[0].1.value.map(f64::to_degrees) };
        ("/imu", START + at, both(&read, START + at))
    });
    let folder = Folder::new();
    folder.write("a.mcap", &recording(messages));
    folder
}

#[test]
fn degrees_are_named_by_every_command_also_where_the_bias_passes_for_a_turn() {
    // Beyond the bounds of a bias, so that no rest is accepted, and within.
    for (turns, bias) in [(1, 1.2), (3, 1.2), (3, 0.1)] {
        let folder = in_degrees(turns, bias);
        let annotate = ["annotate", "a.mcap", "-o", "b.mcap", "--force", "--set", MAPPED];
        let run = folder.run(annotate).ok();
        let on_one_line = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
        let words =
            "gyroscope: between rests gravity turned as if the rates were in deg/s: set gyro = { unit = \"deg/s\" }";
        assert!(on_one_line(&run.stderr).contains(&format!("next {words}")), "{turns}, {bias}: {}", run.stderr);
        assert!(!run.stderr.contains("does it turn"), "{}", run.stderr);
        let report = folder.say("report b.mcap").ok().stdout;
        assert!(on_one_line(&report).contains(&format!("next {words}")), "{turns}, {bias}: {report}");
        let json = folder.run(annotate.iter().chain(&["--json"])).ok().json();
        let imu = &json["imus"][0];
        assert!(imu["coverage"]["next_step"].as_str().unwrap().starts_with(words), "{turns}, {bias}: {imu:#}");
        assert_ne!(imu["gyroscope"]["status"], "CONFIRMED");
        let topics = folder.run(["topics", "a.mcap", "--set", MAPPED]).ok().stdout;
        assert!(topics.contains("as if the rates were in deg/s"), "{topics}");
        // Once that is set, no rest seems to turn. (35° from a face they are tilted.)
        let set = r#"imu=[{topic="/imu", accel="a", gyro={path="g", unit="deg/s"}}]"#;
        let json = folder.run(["annotate", "a.mcap", "-o", "c.mcap", "--force", "--json", "--set", set]).ok().json();
        assert!(!json.to_string().contains("does it turn") && !json.to_string().contains("deg/s"), "{json:#}");
    }
}

#[test]
fn every_rest_that_seems_to_turn_for_its_unit_says_so() {
    let folder = in_degrees(3, 1.2);
    folder.run(["annotate", "a.mcap", "-o", "b.mcap", "--set", MAPPED]).ok();
    let bytes = folder.read("b.mcap");
    let mut last = std::collections::BTreeMap::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        if message.channel.topic == "/imu/stillpoint/segment" {
            let segment = <stillpoint::messages::Segment as prost::Message>::decode(&*message.data).unwrap();
            last.insert(segment.start.as_ref().unwrap().seconds, segment);
        }
    }
    assert_eq!(last.len(), 4);
    for segment in last.values() {
        assert_eq!(segment.reason().as_str_name(), "TURNING");
        assert!(segment.explanation.contains("as if the rates were in deg/s"), "{}", segment.explanation);
    }
}
