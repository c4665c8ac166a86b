//! Random messages of random ROS types, decoded by programs that are not ours to the same numbers:
//! `tests/interop/decoders.py`, run by the interpreter that `STILLPOINT_PYTHON` names.

use std::collections::BTreeMap;
use std::process::Command;

use proptest::strategy::{Strategy as _, ValueTree as _};
use proptest::test_runner::{Config, TestRunner};
use stillpoint::imu::{Decoder, Layout};

use crate::needs::{python, root};

use super::cdr::{Encoder, Language, Wire, described, fields, languages, wires};

#[test]
fn decoders_that_are_not_ours_read_the_same_numbers() {
    let Some(python) = python() else { return };
    let cases =
        std::env::var("PROPTEST_CASES").ok().and_then(|cases| cases.parse::<u64>().ok()).unwrap_or(100).min(300);
    let folder = tempfile::tempdir().unwrap();
    let (recording, numbers) = (folder.path().join("random.mcap"), folder.path().join("numbers.json"));
    let mut writer = mcap::Writer::new(std::fs::File::create(&recording).unwrap()).unwrap();
    let mut expected = Vec::new();
    let mut runner = TestRunner::new(Config::default());
    for case in 0..cases {
        let wire: Wire = wires().new_tree(&mut runner).unwrap().current();
        let language: Language = languages().new_tree(&mut runner).unwrap().current();
        let fields = fields(false).new_tree(&mut runner).unwrap().current();
        let (message_encoding, schema) = described(wire, language, &fields);
        let layout = Layout::new(message_encoding, Some(&schema)).unwrap();
        let schema = writer.add_schema(&schema.name, &schema.encoding, &schema.data).unwrap();
        let channel = writer.add_channel(schema, &format!("/{case}"), message_encoding, &BTreeMap::new()).unwrap();
        for sequence in 0..2 {
            let encoder = Encoder::new(&fields, wire, language, case * 2 + u64::from(sequence));
            let paths: Vec<_> =
                encoder.numbers.iter().filter(|(_, n)| !n.is_nan()).map(|(path, _)| path.clone()).collect();
            let places: Vec<_> = paths.iter().map(|path| layout.number(&path.parse().unwrap()).unwrap()).collect();
            let mut found = vec![f64::NAN; places.len()];
            let payload = encoder.payload();
            Decoder::new(&layout, &places, None).unwrap().read(&payload, &mut found).unwrap();
            expected.push(paths.into_iter().zip(found).collect::<BTreeMap<_, _>>());
            let header =
                mcap::records::MessageHeader { channel_id: channel, sequence, log_time: case, publish_time: case };
            writer.write_to_known_channel(&header, &payload).unwrap();
        }
    }
    writer.finish().unwrap();
    std::fs::write(&numbers, serde_json::to_vec(&expected).unwrap()).unwrap();
    let script = root().join("tests/interop/decoders.py");
    let run = Command::new(python).arg(script).arg(&recording).arg(&numbers).output().unwrap();
    assert!(run.status.success(), "{}{}", String::from_utf8_lossy(&run.stdout), String::from_utf8_lossy(&run.stderr));
    eprintln!("{}", String::from_utf8_lossy(&run.stdout));
}
