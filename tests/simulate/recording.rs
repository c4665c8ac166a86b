//! Simulated recordings are whole MCAP files in every encoding, and unusable scenarios are refused by key.

use std::collections::BTreeMap;

use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use proptest::prelude::*;
use stillpoint::simulate::{Compression, Encoding, Scenario, Sensitivity, record, samples};

fn short(edit: impl FnOnce(&mut Scenario)) -> Scenario {
    let mut scenario = Scenario::builtin("thesis-sequence-3").unwrap();
    scenario.pose.truncate(2);
    scenario.pose.iter_mut().for_each(|pose| pose.rest_s = 2.0);
    scenario.recording.chunk_bytes = 16 * 1024;
    edit(&mut scenario);
    scenario
}

fn bytes(scenario: &Scenario) -> Vec<u8> {
    let mut bytes = Vec::new();
    record(scenario, &mut bytes).unwrap();
    bytes
}

/// Every record of the file, chunks opened and their checksums compared; fails on what is not whole.
fn opcodes(bytes: &[u8]) -> BTreeMap<u8, usize> {
    let options = LinearReaderOptions::default()
        .with_validate_chunk_crcs(true)
        .with_validate_data_section_crc(true)
        .with_validate_summary_section_crc(true);
    let mut reader = LinearReader::new_with_options(options);
    let mut rest = bytes;
    let mut counts = BTreeMap::new();
    while let Some(event) = reader.next_event() {
        match event.unwrap() {
            LinearReadEvent::ReadRequest(wanted) => {
                let (head, tail) = rest.split_at(wanted.min(rest.len()));
                reader.insert(head.len()).copy_from_slice(head);
                reader.notify_read(head.len());
                rest = tail;
            }
            LinearReadEvent::Record { opcode, .. } => *counts.entry(opcode).or_insert(0) += 1,
        }
    }
    counts
}

#[test]
fn every_encoding_and_compression_makes_a_whole_file() {
    for encoding in [Encoding::Ros2, Encoding::Ros1, Encoding::Protobuf, Encoding::Json] {
        for compression in [Compression::None, Compression::Lz4, Compression::Zstd] {
            let scenario = short(|scenario| {
                scenario.recording.encoding = encoding;
                scenario.recording.compression = compression;
            });
            let bytes = bytes(&scenario);
            let counts = opcodes(&bytes);
            let readings = samples(&scenario).unwrap().count();
            let messages = readings - readings / 3; // accelerometer and gyroscope share theirs
            assert_eq!(counts.get(&mcap::records::op::MESSAGE), Some(&messages), "{encoding:?} {compression:?}");
            let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
            assert!(summary.chunk_indexes.len() > 2, "{encoding:?} {compression:?}");
        }
    }
}

/// Specific force and rate, in the order in which they were written.
type Vectors = (Vec<f64>, Vec<f64>);

fn decoded(encoding: Encoding) -> Vec<Vectors> {
    let bytes = bytes(&short(|scenario| {
        scenario.recording.encoding = encoding;
        scenario.secondary.clear();
    }));
    let messages = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap);
    messages.map(|message| vectors(encoding, &message)).collect()
}

fn vectors(encoding: Encoding, message: &mcap::Message<'_>) -> Vectors {
    match encoding {
        // Both end with rate, its covariance, specific force, its covariance.
        Encoding::Ros2 | Encoding::Ros1 => {
            let doubles: Vec<_> = message.data.rchunks_exact(8).take(24).collect();
            let doubles: Vec<_> =
                doubles.iter().rev().map(|bytes| f64::from_le_bytes((*bytes).try_into().unwrap())).collect();
            (doubles[12..15].to_vec(), doubles[..3].to_vec())
        }
        Encoding::Protobuf => {
            let schema = message.channel.schema.as_ref().unwrap();
            let pool = prost_reflect::DescriptorPool::decode(&schema.data[..]).unwrap();
            let descriptor = pool.get_message_by_name(&schema.name).unwrap();
            let sample = prost_reflect::DynamicMessage::decode(descriptor, &message.data[..]).unwrap();
            let vector = |name: &str| {
                let vector = sample.get_field_by_name(name).unwrap().into_owned();
                let vector = vector.as_message().unwrap().clone();
                ["x", "y", "z"].map(|axis| vector.get_field_by_name(axis).unwrap().as_f64().unwrap()).to_vec()
            };
            (vector("accel"), vector("gyro"))
        }
        Encoding::Json => {
            let sample: serde_json::Value = serde_json::from_slice(&message.data).unwrap();
            let vector = |name: &str| ["x", "y", "z"].map(|axis| sample[name][axis].as_f64().unwrap()).to_vec();
            (vector("accel"), vector("gyro"))
        }
    }
}

#[test]
fn every_encoding_carries_the_readings_exactly() {
    let scenario = short(|scenario| scenario.secondary.clear());
    let readings: Vec<_> = samples(&scenario).unwrap().map(|reading| reading.measured.as_slice().to_vec()).collect();
    let expected: Vec<_> = readings.chunks_exact(2).map(|pair| (pair[0].clone(), pair[1].clone())).collect();
    assert!(expected.len() > 500);
    for encoding in [Encoding::Ros2, Encoding::Ros1, Encoding::Protobuf, Encoding::Json] {
        assert_eq!(decoded(encoding), expected, "{encoding:?}");
    }
}

#[test]
fn chunks_are_written_whole_so_that_a_growing_recording_can_be_followed() {
    /// Keeps each write apart.
    #[derive(Default)]
    struct Growing(Vec<u8>, bool);
    impl std::io::Write for &mut Growing {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            self.0.extend(bytes);
            self.1 |= self
                .0
                .windows(9)
                .rev()
                .take(bytes.len() + 9)
                .any(|nine| nine == b"\x06\xff\xff\xff\xff\xff\xff\xff\xff");
            Ok(bytes.len())
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }
    let mut growing = Growing::default();
    record(&short(|_| ()), &mut growing).unwrap();
    assert!(!growing.1 && growing.0.len() > 10_000);
}

#[test]
fn a_gyroscope_with_a_topic_of_its_own_leaves_each_other_vector_unmeasured() {
    let scenario = short(|scenario| {
        let gyroscope = scenario.gyroscope.as_mut().unwrap();
        gyroscope.topic = Some("/gyro/sample".to_owned());
        gyroscope.rate_hz = 200.0;
        scenario.recording.frame_id = "abc".to_owned(); // with its NUL, the header takes 16 bytes
    });
    let bytes = bytes(&scenario);
    let mut gyroscopes = 0;
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        if message.channel.topic == "/highg/acceleration" {
            continue;
        }
        let double = |at: usize| f64::from_le_bytes(message.data[at..at + 8].try_into().unwrap());
        // Encapsulation 4, header 16, orientation 32, its covariance 72, then rate 24, covariance 72, force 24.
        let unmeasured = (double(52), double(148), double(244));
        match message.channel.topic.as_str() {
            "/imu/data_raw" => assert_eq!(unmeasured, (-1.0, -1.0, 0.0)),
            topic => {
                assert_eq!((topic, unmeasured), ("/gyro/sample", (-1.0, 0.0, -1.0)));
                gyroscopes += 1;
            }
        }
    }
    assert!(gyroscopes > 500);
}

#[test]
fn a_recording_that_cannot_be_written_is_an_error() {
    struct Full(usize);
    impl std::io::Write for Full {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            self.0 = self.0.checked_sub(bytes.len()).ok_or(std::io::ErrorKind::StorageFull)?;
            Ok(bytes.len())
        }
        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }
    for room in [0, 20, 1000, 50_000] {
        let problem = record(&short(|_| ()), Full(room)).unwrap_err().to_string();
        assert!(problem.starts_with("the simulated recording could not be written: "), "{problem}");
    }
}

/// What the parser says about the demo with one line replaced.
fn refusal(line: &str, replacement: &str) -> String {
    let (_, text) = stillpoint::simulate::BUILTIN[0];
    assert!(text.contains(line), "{line}");
    Scenario::parse(&text.replacen(line, replacement, 1)).unwrap_err().to_string()
}

#[test]
fn a_refused_scenario_names_the_key() {
    for (line, replacement, said) in [
        ("seed = 1", "seeed = 1", "recording: unknown field `seeed`"),
        ("seed = 1", "seed = \"one\"", "recording.seed: invalid type"),
        ("noise = 0.02", "noise = -0.02", "accelerometer.noise: must lie between 0 and"),
        ("noise = 0.02", "noise = nan", "accelerometer.noise: must lie between 0 and"),
        ("rate_hz = 100", "rate_hz = 0", "accelerometer.rate_hz: must lie between"),
        ("rate_hz = 100", "rate_hz = 200", "gyroscope.rate_hz: rate and phase must be the accelerometer's"),
        (
            "sensitivity = [1.004, 0.996, 1.011]",
            "sensitivity = [1.0, 1.0]",
            "accelerometer.sensitivity: expected three",
        ),
        ("bias = [0.255, -0.142, 0.310]", "bias = [inf, 0, 0]", "accelerometer.bias: must lie between"),
        (
            "bias = [0.255, -0.142, 0.310]",
            "g2_sensitivity = [0, 0, 0]",
            "accelerometer.g2_sensitivity: an accelerometer",
        ),
        ("face = \"+X\"", "face = \"X\"", "pose[1]: give exactly one of face"),
        ("face = \"+X\"", "face = \"+X\"\nup = [1, 0, 0]", "pose[1]: give exactly one of face"),
        ("rest_s = 3.0", "rest_s = -3.0", "pose[0].rest_s: must lie between"),
        ("encoding = \"ros2\"", "encoding = \"ros3\"", "recording.encoding: unknown variant `ros3`"),
        ("duration_s = 1.2", "duration_s = 0", "motion.duration_s: must lie between"),
    ] {
        let problem = refusal(line, replacement);
        assert!(problem.contains(said), "{replacement}: {problem}");
        assert!(!problem.contains('\n'), "{problem}");
    }
}

proptest! {
    /// Whatever validates can be simulated: finite readings, in order, none after the end.
    #[test]
    fn extreme_values_are_refused_or_simulated(key in 0..12_usize, value in prop_oneof![any::<f64>(), -1e10..1e10, 0.0..1e-6]) {
        let mut scenario = short(|_| ());
        let (triad, pose) = (&mut scenario.accelerometer, &mut scenario.pose[1]);
        match key {
            0 => triad.noise = value,
            1 => triad.step = value,
            2 => triad.range = Some(value),
            3 => triad.noise_correlation_s = value,
            4 => triad.sensitivity = Sensitivity::Diagonal([1.0, value, 1.0]),
            5 => pose.up = { pose.face = None; Some([value, 0.0, -value]) },
            6 => pose.attitude = { pose.face = None; Some([0.0, value, 0.0, 1.0]) },
            7 => pose.tilt_deg = value,
            8 => pose.turn_deg_s = [value, 0.0, 1.0],
            9 => pose.motion_s = Some(value),
            10 => scenario.motion.shake_hz = value,
            _ => scenario.gravity = value,
        }
        let Ok(readings) = samples(&scenario) else { return Ok(()) };
        let readings: Vec<_> = readings.take(2000).collect();
        prop_assert!(readings.is_sorted_by_key(|reading| (reading.stamp, reading.sensor)));
        let finite = |vector: &nalgebra::Vector3<f64>| vector.iter().all(|value| value.is_finite());
        prop_assert!(readings.iter().all(|r| finite(&r.measured) && finite(&r.force) && finite(&r.rate)));
    }

    /// No text makes the parser panic, and what it says about it is one line.
    #[test]
    fn any_text_is_a_scenario_or_refused_in_a_line(text in "\\PC{0,40}", at in 0..40_usize) {
        let lines: Vec<_> = stillpoint::simulate::BUILTIN[0].1.lines().collect();
        let text = [&lines[..at], &[&text], &lines[at..]].concat().join("\n");
        if let Err(problem) = Scenario::parse(&text) {
            prop_assert!(!problem.to_string().contains('\n'));
        }
    }
}

#[test]
fn a_malformed_text_is_refused_by_line() {
    let problem = refusal("seed = 1", "seed = ");
    assert!(problem.starts_with("scenario, line 7"), "{problem}");
}

#[test]
fn a_table_with_overrides_is_the_same_scenario() {
    let (_, text) = stillpoint::simulate::BUILTIN[0];
    let mut table: toml::Table = text.parse().unwrap();
    table["recording"]["seed"] = 9.into();
    let scenario = Scenario::from_table(table.clone()).unwrap();
    assert_eq!(scenario.recording.seed, 9);
    table["accelerometer"]["noise"] = "much".into();
    let problem = Scenario::from_table(table.clone()).unwrap_err().to_string();
    assert!(problem.contains("accelerometer.noise: invalid type: string \"much\", expected a number"), "{problem}");
    table["accelerometer"]["noise"] = 0.02.into();
    table["accelerometer"].as_table_mut().unwrap().insert("fault".to_owned(), "x".into());
    let problem = Scenario::from_table(table).unwrap_err().to_string();
    let said = "accelerometer.fault: invalid type: string \"x\", expected a table, {key = value, …}; for example {flipped = [\"z\"]}";
    assert!(problem.ends_with(said), "{problem}");
}

#[test]
fn an_unknown_built_in_scenario_is_refused_with_those_there_are() {
    let problem = Scenario::builtin("thesis").unwrap_err().to_string();
    assert!(problem.contains("demo, thesis-sequence-1, thesis-sequence-3, rate-table, six-faces"), "{problem}");
}
