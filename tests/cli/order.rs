//! Readings that do not stand in a recording in the order of their times: late ones, and sensors one behind the other.

use serde_json::Value;

use crate::common::Folder;
use crate::real_recordings::{MAPPED, START, both, is_true, learns_the_truth, recording, six_faces};
use crate::session::GYRO_BIAS;

const PAIR: &str = r#"imu=[{topic="/a", accel="a", gyro={topic="/g", path="g"}}]"#;

/// Two topics, one wholly behind the other, at these log times by the number of the message and its true time.
fn one_behind_the_other(
    topics: [&'static str; 2],
    log: impl Fn(i64, i64) -> i64,
    stamp: impl Fn(i64) -> i64,
) -> Vec<u8> {
    let samples = six_faces();
    let all = topics.into_iter().flat_map(|topic| samples.iter().map(move |m| (topic, m)));
    recording(all.enumerate().map(|(i, (topic, m))| (topic, log(i as i64, START + m.at), both(m, stamp(START + m.at)))))
}

#[test]
fn readings_repeated_under_a_coarse_clock_count_once() {
    for (times, step) in [(3, 100_000_000), (6, 100_000_000), (3, 1_000_000_000), (4, 30_000_000)] {
        let samples = six_faces();
        let polled = samples.iter().flat_map(|m| {
            let stamp = START + m.at - m.at % step;
            (0..times).map(move |k| ("/imu", START + m.at + k * 1_500_000, both(m, stamp)))
        });
        let said = learns_the_truth(&recording(polled), MAPPED, GYRO_BIAS);
        let line = said.lines().find(|line| line.contains("repeat a reading under its stamp, and count once"));
        let line = line.unwrap_or_else(|| panic!("{times}, {step}: {said}"));
        let count = line.split(" of ").next().unwrap().rsplit(' ').next().unwrap();
        assert_eq!(count.parse(), Ok(samples.len() * (times as usize - 1)), "{times}, {step}: {said}");
    }
}

#[test]
fn sensors_that_were_logged_as_they_were_written_are_read_in_the_order_of_their_stamps() {
    for topics in [["/a", "/g"], ["/g", "/a"]] {
        // At once, and at some pace of the converter.
        for pace in [20_000, 900_000] {
            let bytes = one_behind_the_other(topics, |i, _| START + 10_i64.pow(15) + pace * i, |t| t);
            let said = learns_the_truth(&bytes, PAIR, GYRO_BIAS);
            assert!(said.contains("read in the order of their stamps"), "{topics:?}: {said}");
        }
    }
}

/// Longer than what is held in memory: the rest waits on disk.
#[test]
fn sensors_further_apart_than_memory_holds_are_read_in_time_order_all_the_same() {
    const MEMORY: usize = 48 << 20;
    for logged_when_written in [false, true] {
        let samples = six_faces();
        let padding = "x".repeat(MEMORY / samples.len() * 3 / 2);
        let all = ["/a", "/g"].into_iter().flat_map(|topic| samples.iter().map(move |m| (topic, m)));
        let bytes = recording(all.enumerate().map(|(i, (topic, m))| {
            let mut message = both(m, START + m.at);
            if topic == "/a" {
                message["padding"] = Value::String(padding.clone());
            }
            let written = START + 10_i64.pow(15) + 20_000 * i as i64;
            (topic, if logged_when_written { written } else { START + m.at }, message)
        }));
        let said = learns_the_truth(&bytes, PAIR, GYRO_BIAS);
        assert!(said.contains("read in the order of their"), "{said}");
    }
}

#[test]
fn pauses_are_believed_where_the_log_times_are_those_of_writing() {
    // Six pauses of a second, and one of twenty.
    let pauses =
        |at: i64| at + at / 4_000_000_000 * 1_000_000_000 + if at > 20_000_000_000 { 20_000_000_000 } else { 0 };
    for pace in [0, 20_000] {
        let samples = six_faces();
        let messages = samples
            .iter()
            .enumerate()
            .map(|(i, m)| ("/imu", START + 10_i64.pow(15) + pace * i as i64, both(m, START + pauses(m.at))));
        let said = learns_the_truth(&recording(messages), MAPPED, GYRO_BIAS);
        assert!(!said.contains("make no sense") && !said.contains("warning"), "{pace}: {said}");
    }
}

#[test]
fn a_clock_that_is_set_back_before_the_end_is_not_told_as_readings_that_come_late() {
    let samples = six_faces();
    let last = samples.len() - 200;
    let messages = samples.iter().enumerate().map(|(i, m)| {
        let stamp = START + m.at - if i >= last { 5_000_000_000 } else { 0 };
        ("/imu", START + m.at, both(m, stamp))
    });
    let said = learns_the_truth(&recording(messages), MAPPED, GYRO_BIAS);
    assert!(!said.contains("came late") && !said.contains("one is left out"), "{said}");
}

#[test]
fn readings_of_a_coarse_clock_stay_before_a_gap_that_the_recording_ends_behind() {
    let samples = six_faces();
    let end = samples.last().unwrap().at;
    let behind = (0..3).map(|i| (end + 15_200_000_000 + i * 10_000_000, samples.last().unwrap()));
    let all = samples.iter().map(|m| (m.at, m)).chain(behind);
    let messages = all.map(|(at, m)| ("/imu", START + at, both(m, (START + at) / 1_000_000_000 * 1_000_000_000)));
    let said = learns_the_truth(&recording(messages), MAPPED, GYRO_BIAS);
    assert!(!said.contains("far from those around"), "{said}");
}

#[test]
fn sensors_of_different_times_are_said_to_be_so() {
    // Without stamps, the times of writing are all there is.
    let bytes = one_behind_the_other(["/a", "/g"], |i, _| START + 10_000_000 * i, |_| 0);
    let folder = Folder::new();
    folder.write("a.mcap", &bytes);
    let run = folder.run(["annotate", "a.mcap", "-o", "b.mcap", "--json", "--set", PAIR]).ok();
    assert!(run.stderr.contains("none of one is from the time of the other"), "{}", run.stderr);
    assert!(run.stderr.contains("convert again with the sensor's time"), "{}", run.stderr);
    assert_eq!(run.json()["imus"][0]["gyroscope"]["bias"], Value::Null);
    folder.run(["tail", "a.mcap", "-o", "t.mcap", "--set", PAIR]).ok();
    assert!(folder.read("b.mcap") == folder.read("t.mcap"), "batch and tail differ");
}

#[test]
fn late_readings_are_sorted_in_however_long_the_others_were_in_order_and_the_first_costs_itself_alone() {
    for (every, late) in [(400, 60_000_000), (997, 95_000_000)] {
        let mut samples: Vec<_> = six_faces().into_iter().enumerate().collect();
        let came =
            |&(i, m): &(usize, crate::real_recordings::Measured)| m.at + if i % every == every - 1 { late } else { 0 };
        samples.sort_by_key(came);
        let count = 2 * samples.iter().filter(|(i, _)| i % every == every - 1).count();
        let messages = samples.iter().map(|one| ("/imu", START + came(one), both(&one.1, START + one.1.at)));
        let bytes = recording(messages);
        let said = learns_the_truth(&bytes, MAPPED, GYRO_BIAS);
        // Of each message both readings.
        let sorted = format!(
            "{} readings came late by up to 100 ms (still.late_s) and were sorted in, but for 1 reading before any",
            count - 1
        );
        assert!(said.contains(&sorted), "{every}: {said}");
        // Nothing is sorted in where that is not wanted.
        let folder = Folder::new();
        folder.write("a.mcap", &bytes);
        let run =
            folder.run(["annotate", "a.mcap", "-o", "b.mcap", "--json", "--set", MAPPED, "--set", "still.late_s=0"]);
        is_true(&run.json(), GYRO_BIAS);
        assert!(!run.stderr.contains("were sorted in"), "{}", run.stderr);
    }
}
