//! Files that would take more memory or time than a machine has, each by its name: every command ends soon, within 256
//! MiB, neither killed nor in a panic.

use std::os::unix::fs::symlink;
use std::process::{Command, Stdio};

use mcap::MAGIC;

use crate::common::{Folder, case};
use crate::{PROGRAM, shell};

/// Most memory that a command may ever take, in KiB.
const MEMORY: u64 = 256 << 10;
/// CPU time of a command, in seconds. Tests are hardly optimised, and files have some megabytes at most.
const SECONDS: u32 = 60;
const VERBS: [&str; 5] = [
    "topics",
    "annotate -q --force --allow-no-imu --accept-damage -o out.mcap",
    "annotate -q --sidecar --force --allow-no-imu --accept-damage -o side.mcap",
    "report -q --force -o page.html",
    "tail -q --force --allow-no-imu --accept-damage --idle-timeout 1ms -o tailed.mcap",
];

/// Runs the program; what it said, and the most memory that it had.
fn measured(folder: &Folder, line: &str) -> (Option<i32>, u64, String) {
    let said = folder.path().join(".said");
    let script = format!("ulimit -t {SECONDS}; ulimit -c 0; exec {PROGRAM} {line}");
    let mut child = Command::new("bash")
        .args(["-c", &script])
        .current_dir(folder.path())
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(std::fs::File::create(&said).unwrap())
        .spawn()
        .unwrap();
    let status = format!("/proc/{}/status", child.id());
    let mut most = 0;
    let ended = loop {
        // The highest so far, so that nothing is missed between two looks.
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let high = text.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB"));
        most = high.map_or(most, |high| most.max(high.trim().parse().unwrap()));
        if let Some(ended) = child.try_wait().unwrap() {
            break ended;
        }
        std::thread::sleep(std::time::Duration::from_millis(1));
    };
    (ended.code(), most, std::fs::read_to_string(&said).unwrap())
}

/// All commands that read a recording end well on it.
fn ends_well(folder: &Folder, name: &str) {
    for verb in VERBS {
        let (code, memory, said) = measured(folder, &format!("{verb} {name}"));
        assert!(code.is_some_and(|code| (0..=5).contains(&code)), "{verb} {name}: {code:?} {said}");
        assert!(!said.contains("panicked"), "{verb} {name}: {said}");
        assert!(memory <= MEMORY, "{verb} {name}: {memory} KiB");
    }
}

fn record(opcode: u8, body: &[u8]) -> Vec<u8> {
    [&[opcode], &(body.len() as u64).to_le_bytes()[..], body].concat()
}

fn text(text: &[u8]) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes(), text].concat()
}

fn schema(id: u16, name: &str, language: &str, data: &[u8]) -> Vec<u8> {
    record(3, &[&id.to_le_bytes()[..], &text(name.as_bytes()), &text(language.as_bytes()), &text(data)].concat())
}

fn channel(id: u16, schema: u16, topic: &str, encoding: &str) -> Vec<u8> {
    let ids = [id.to_le_bytes(), schema.to_le_bytes()].concat();
    record(4, &[&ids[..], &text(topic.as_bytes()), &text(encoding.as_bytes()), &[0; 4]].concat())
}

fn message(channel: u16, log_time: u64, data: &[u8]) -> Vec<u8> {
    let time = log_time.to_le_bytes();
    record(5, &[&channel.to_le_bytes()[..], &[0; 4], &time, &time, data].concat())
}

/// A chunk of these records, compressed.
fn chunk(records: &[u8]) -> Vec<u8> {
    let data = zstd::bulk::compress(records, 1).unwrap();
    let (size, inflated) = ((data.len() as u64).to_le_bytes(), (records.len() as u64).to_le_bytes());
    record(6, &[&[0; 16][..], &inflated, &[0; 4], &text(b"zstd"), &size, &data].concat())
}

fn recording(records: &[Vec<u8>]) -> Vec<u8> {
    let end = [record(15, &[0; 4]), record(2, &[0; 20])].concat();
    [MAGIC, &record(1, &[0; 8]), &records.concat(), &end, MAGIC].concat()
}

#[test]
fn every_file_that_once_took_too_much() {
    let Some(cases) = case("faults") else { return };
    let folder = Folder::new();
    let mut names: Vec<_> = std::fs::read_dir(cases).unwrap().map(|entry| entry.unwrap().path()).collect();
    names.retain(|path| path.extension().is_some_and(|ending| ending == "mcap"));
    names.sort();
    assert!(!names.is_empty());
    for path in names {
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        std::fs::copy(&path, folder.path().join(&name)).unwrap();
        ends_well(&folder, &name);
    }
}

#[test]
fn bombs_of_records() {
    let folder = Folder::new();
    let room = 60 << 20;
    let same = channel(1, 0, "/t", "cdr");
    folder.write("channels.mcap", &recording(&[chunk(&same.repeat(room / same.len()))]));
    let others: Vec<u8> = (0..900_000_u32).flat_map(|n| schema(n as u16, &n.to_string(), "ros2msg", b"x")).collect();
    folder.write("schemas.mcap", &recording(&[chunk(&others)]));
    let pairs: Vec<u8> = (0..300_000_u32).flat_map(|n| [text(&n.to_le_bytes()), text(b"")].concat()).collect();
    let ids = [7_u16.to_le_bytes(), 0_u16.to_le_bytes()].concat();
    let wide = record(4, &[&ids[..], &text(b"/wide"), &text(b"cdr"), &text(&pairs)].concat());
    folder.write("metadata_of_a_channel.mcap", &recording(&[chunk(&wide)]));
    folder.write("metadata.mcap", &recording(&[record(12, &[text(b"robot"), text(&pairs)].concat())]));
    let empty = message(1, 1, b"");
    folder.write("messages.mcap", &recording(&[chunk(&[same, empty.repeat(room / empty.len())].concat())]));
    let zeros = chunk(&record(0x90, &vec![0; room]));
    folder.write("chunks.mcap", &recording(&vec![zeros; 200]));
    for name in ["channels", "schemas", "metadata_of_a_channel", "metadata", "messages", "chunks"] {
        ends_well(&folder, &format!("{name}.mcap"));
    }
}

#[test]
fn bombs_of_text() {
    let folder = Folder::new();
    let json = |data: &[u8]| {
        let named =
            b"{\"type\":\"object\",\"properties\":{\"a\":{\"type\":\"array\",\"items\":{\"type\":\"number\"}}}}";
        recording(&[chunk(
            &[schema(1, "T", "jsonschema", named), channel(1, 1, "/t", "json"), message(1, 1, data)].concat(),
        )])
    };
    let numbers = b"1,".repeat(10 << 20);
    folder.write("array.mcap", &json(&[b"{\"a\":[", &numbers[..], b"1]}"].concat()));
    folder.write("nested.mcap", &json(&[b"{\"a\":", &b"[".repeat(10 << 20)[..]].concat()));
    folder.write("objects.mcap", &json(&b"{\"a\":".repeat(2 << 20)));
    let untold = |data: &[u8]| recording(&[chunk(&[channel(1, 0, "/t", "json"), message(1, 1, data)].concat())]);
    folder.write("untold.mcap", &untold(&[b"{\"a\":[", &numbers[..], b"1]}"].concat()));
    let fields: Vec<u8> = (0..200_000).flat_map(|n| format!("float64 f{n}\n").into_bytes()).collect();
    let of = |language: &str, encoding: &str, data: &[u8]| {
        recording(&[chunk(
            &[schema(1, "a/msg/T", language, data), channel(1, 1, "/t", encoding), message(1, 1, &[0; 64])].concat(),
        )])
    };
    folder.write("ros2msg.mcap", &of("ros2msg", "cdr", &fields));
    let members: Vec<u8> = (0..150_000).flat_map(|n| format!("double f{n};\n").into_bytes()).collect();
    let idl = [b"module a { module msg { struct T {", &members[..], b"}; }; };"].concat();
    folder.write("ros2idl.mcap", &of("ros2idl", "cdr", &idl));
    folder.write("idl_nested.mcap", &of("ros2idl", "cdr", &b"module a {".repeat(300_000)));
    let properties: Vec<u8> =
        (0..80_000).flat_map(|n| format!("\"f{n}\":{{\"type\":\"number\"}},").into_bytes()).collect();
    let object = [b"{\"type\":\"object\",\"properties\":{", &properties[..], b"\"x\":{\"type\":\"number\"}}}"].concat();
    folder.write("jsonschema.mcap", &of("jsonschema", "json", &object));
    folder.write("jsonschema_nested.mcap", &of("jsonschema", "json", &b"{\"items\":".repeat(400_000)));
    folder.write("protobuf.mcap", &of("protobuf", "protobuf", &[0x0a, 0x02, 0x22, 0x00].repeat(900_000)));
    for name in [
        "array",
        "nested",
        "objects",
        "untold",
        "ros2msg",
        "ros2idl",
        "idl_nested",
        "jsonschema",
        "jsonschema_nested",
        "protobuf",
    ] {
        ends_well(&folder, &format!("{name}.mcap"));
    }
}

#[test]
fn times_at_either_end_and_stamps_that_overflow() {
    let folder = Folder::with_demo();
    let demo = folder.read("demo.mcap");
    let rewritten = |time: fn(usize, u64) -> u64, stamp: fn(usize, [u8; 8]) -> [u8; 8]| {
        // Every message of the demonstration outside chunks, with other times.
        let mut out = vec![record(1, &[text(b"ros2"), text(b"")].concat())];
        let flat = mcap::read::ChunkFlattener::new(&demo).unwrap();
        for (n, found) in flat.map_while(Result::ok).enumerate() {
            match found {
                mcap::records::Record::Schema { header, data } => {
                    out.push(schema(header.id, &header.name, &header.encoding, &data));
                }
                mcap::records::Record::Channel(header) => {
                    out.push(channel(header.id, header.schema_id, &header.topic, &header.message_encoding));
                }
                mcap::records::Record::Message { header, data } => {
                    let mut data = data.into_owned();
                    let stamped = stamp(n, data[4..12].try_into().unwrap());
                    data[4..12].copy_from_slice(&stamped);
                    out.push(message(header.channel_id, time(n, header.log_time), &data));
                }
                _ => {}
            }
        }
        let end = [record(15, &[0; 4]), record(2, &[0; 20])].concat();
        [MAGIC, &out.concat(), &end, MAGIC].concat()
    };
    let same = |_: usize, stamp: [u8; 8]| stamp;
    folder.write("zero.mcap", &rewritten(|_, _| 0, same));
    folder.write("last.mcap", &rewritten(|_, _| u64::MAX, same));
    folder.write("both.mcap", &rewritten(|n, _| if n % 2 == 0 { 0 } else { u64::MAX }, same));
    folder.write("falling.mcap", &rewritten(|n, _| u64::MAX - n as u64 * 10_000_000, same));
    folder.write("negative.mcap", &rewritten(|_, time| time, |_, _| [0xff; 8]));
    folder.write("overflow.mcap", &rewritten(|_, time| time, |_, _| [0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff, 0xff]));
    folder.write(
        "jumping.mcap",
        &rewritten(
            |n, time| time.wrapping_mul(n as u64),
            |n, _| (n as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15).to_le_bytes(),
        ),
    );
    for name in ["zero", "last", "both", "falling", "negative", "overflow", "jumping"] {
        ends_well(&folder, &format!("{name}.mcap"));
    }
}

#[test]
fn numbers_beyond_all_measure() {
    let folder = Folder::with_demo();
    let demo = folder.read("demo.mcap");
    for (name, value) in [("huge", 1e308), ("tiny", 5e-324), ("minus", -1.7e308), ("square", 1e160)] {
        let mut out = vec![record(1, &[text(b"ros2"), text(b"")].concat())];
        for (n, found) in mcap::read::ChunkFlattener::new(&demo).unwrap().map_while(Result::ok).enumerate() {
            match found {
                mcap::records::Record::Schema { header, data } => {
                    out.push(schema(header.id, &header.name, &header.encoding, &data));
                }
                mcap::records::Record::Channel(header) => {
                    out.push(channel(header.id, header.schema_id, &header.topic, &header.message_encoding));
                }
                mcap::records::Record::Message { header, data } => {
                    let mut data = data.into_owned();
                    // Every reading, in one recording, and now and then in another: the last three doubles but nine.
                    let end = data.len() - 72;
                    if n % 7 == 0 || name == "huge" || name == "tiny" {
                        (1..=3).for_each(|axis| {
                            data[end - 8 * axis..end - 8 * (axis - 1)].copy_from_slice(&f64::to_le_bytes(value))
                        });
                    }
                    out.push(message(header.channel_id, header.log_time, &data));
                }
                _ => {}
            }
        }
        let end = [record(15, &[0; 4]), record(2, &[0; 20])].concat();
        folder.write("values.mcap", &[MAGIC, &out.concat(), &end, MAGIC].concat());
        ends_well(&folder, "values.mcap");
    }
}

#[test]
fn chunks_within_chunks_and_definitions_that_change() {
    let folder = Folder::new();
    let mut nested = message(1, 1, b"x");
    for _ in 0..200 {
        nested = chunk(&nested);
    }
    folder.write("recursive.mcap", &recording(&[channel(1, 0, "/t", "cdr"), nested]));
    let changing: Vec<_> = (0..5000)
        .map(|n| [schema(1, &n.to_string(), "ros2msg", b"x"), channel(1, 1, &n.to_string(), "cdr"), message(1, n, b"")])
        .map(|three| chunk(&three.concat()))
        .collect();
    folder.write("redefined.mcap", &recording(&changing));
    // Many messages that each claim the rest of the file, one within the other, and end where it does.
    let mut within = Vec::new();
    for n in 0..4000 {
        let mut head = message(1, n, b"");
        head[1..9].copy_from_slice(&(22 + within.len() as u64).to_le_bytes());
        within = [head, within].concat();
    }
    folder.write("matryoshka.mcap", &recording(&[channel(1, 0, "/t", "cdr"), within]));
    for name in ["recursive", "redefined", "matryoshka"] {
        ends_well(&folder, &format!("{name}.mcap"));
    }
}

#[test]
fn holes_loops_and_texts_that_refer_to_themselves() {
    let folder = Folder::with_demo();
    let demo = folder.read("demo.mcap");
    folder.write("hole.mcap", &demo[..60_000]);
    std::fs::File::options().write(true).open(folder.path().join("hole.mcap")).unwrap().set_len(1 << 40).unwrap();
    // A terabyte takes its time, but whoever asks to stop is heard.
    for verb in ["topics", "annotate -q --allow-no-imu -o hole.out.mcap", "tail -q --idle-timeout 1ms -o hole.out.mcap"]
    {
        let run = shell(&folder, &format!("timeout -k 5 1 $STILLPOINT {verb} hole.mcap"));
        assert!(
            run.code != 137 && !folder.path().join("hole.out.mcap").exists(),
            "{verb}: {} {}",
            run.code,
            run.stderr
        );
    }
    symlink("loop.mcap", folder.path().join("loop.mcap")).unwrap();
    std::fs::create_dir(folder.path().join("bag")).unwrap();
    symlink("..", folder.path().join("bag/up")).unwrap();
    folder.write("bag/bag_0.mcap", &demo);
    let mut yaml = b"a0: &a0 [x,x,x,x,x,x,x,x,x,x]\n".to_vec();
    (1..12).for_each(|n| {
        let refer = vec![format!("*a{}", n - 1); 10].join(",");
        yaml.extend(format!("a{n}: &a{n} [{refer}]\n").into_bytes());
    });
    yaml.extend(b"rosbag2_bagfile_information:\n  relative_file_paths: *a11\n");
    folder.write("bag/metadata.yaml", &yaml);
    for name in ["loop.mcap", "bag"] {
        ends_well(&folder, name);
    }
    folder.write("bag/metadata.yaml", &b"[".repeat(1 << 20));
    ends_well(&folder, "bag");
    folder.write("nested.toml", &[b"a = ", &b"[".repeat(900_000)[..]].concat());
    folder.write("dotted.toml", &[b"a".to_vec(), b".a".repeat(400_000), b" = 1".to_vec()].concat());
    folder.write("tables.toml", &b"[[imu]]\n".repeat(100_000));
    for name in ["nested.toml", "dotted.toml", "tables.toml"] {
        for line in [format!("config check {name}"), format!("topics demo.mcap -c {name}")] {
            let (code, memory, said) = measured(&folder, &line);
            assert!(
                code == Some(2) && memory <= MEMORY,
                "{line}: {code:?} {memory} {}",
                said.chars().take(300).collect::<String>()
            );
        }
    }
}

/// Schema and first message of the demo's IMU, the message with another `frame_id`.
fn imu(frame: &str) -> (Vec<u8>, Vec<u8>) {
    let demo = std::fs::read(crate::common::needs::root().join("testdata/demo.mcap")).unwrap();
    let first = mcap::MessageStream::new(&demo).unwrap().next().unwrap().unwrap();
    let of_it = first.channel.schema.clone().unwrap();
    let schema = schema(1, &of_it.name, &of_it.encoding, &of_it.data);
    // CDR: four bytes of its own, the stamp, then the frame, aligned to eight bytes by what follows.
    let was = u32::from_le_bytes(first.data[12..16].try_into().unwrap()) as usize;
    let mut data = [&first.data[..12], &(frame.len() as u32 + 1).to_le_bytes(), frame.as_bytes(), &[0]].concat();
    let aligned = |length: usize| (length - 4).next_multiple_of(8) + 4;
    data.resize(aligned(data.len()), 0);
    data.extend(&first.data[aligned(16 + was)..]);
    (schema, data)
}

#[test]
fn imus_without_number() {
    let folder = Folder::new();
    let (schema, data) = imu("imu");
    let channels: Vec<_> = (0..20_000_u16).map(|id| channel(id, 1, &format!("/imu/{id}"), "cdr")).collect();
    let messages: Vec<_> = (0..20_000_u16).map(|id| message(id, 1_000_000_000 + u64::from(id), &data)).collect();
    folder.write("many.mcap", &recording(&[chunk(&[schema, channels.concat(), messages.concat()].concat())]));
    ends_well(&folder, "many.mcap");
    let said = folder.say("topics many.mcap").ok();
    assert!(said.stdout.contains("limits.imus") || said.stderr.contains("limits.imus"), "{}", said.stdout);
    let own = folder.say("topics many.mcap --set limits.imus=3").ok();
    assert!(own.stdout.contains("more than 3 IMUs"), "{}", own.stdout);
}

#[test]
fn names_without_end() {
    let folder = Folder::new();
    let (plain, data) = imu("imu");
    let topic = format!("/{}", "t".repeat(3 << 20));
    let one = [plain.clone(), channel(1, 1, &topic, "cdr"), message(1, 1_000_000_000, &data).repeat(500)].concat();
    folder.write("topic.mcap", &recording(&[chunk(&one)]));
    ends_well(&folder, "topic.mcap");
    let (schema, data) = imu(&"f".repeat(30 << 20));
    folder.write(
        "frame.mcap",
        &recording(&[chunk(&[schema, channel(1, 1, "/imu", "cdr"), message(1, 1_000_000_000, &data)].concat())]),
    );
    ends_well(&folder, "frame.mcap");
    let said = folder.say("annotate frame.mcap -o o.mcap --force --allow-no-imu");
    assert!(said.stderr.contains("frame_id has more than 256 bytes"), "{}", said.stderr);
}

/// A recording with a summary section of these records.
fn with_summary(records: &[Vec<u8>], summary: &[u8]) -> Vec<u8> {
    let data = [MAGIC, &record(1, &[0; 8]), &records.concat(), &record(15, &[0; 4])].concat();
    let footer = [&(data.len() as u64).to_le_bytes()[..], &[0; 12]].concat();
    [&data, summary, &record(2, &footer), MAGIC].concat()
}

#[test]
fn attachments_metadata_records_and_damages_without_number() {
    let folder = Folder::new();
    let attachment = record(9, &[0; 36]);
    let metadata = record(12, &[0; 8]);
    folder.write("attachments.mcap", &recording(&[attachment.repeat(2_000_000)]));
    folder.write("metadata.mcap", &recording(&[metadata.repeat(4_000_000)]));
    folder.write("damages.mcap", &recording(&[record(15, &[0; 4]).repeat(800_000)]));
    for name in ["attachments", "metadata", "damages"] {
        ends_well(&folder, &format!("{name}.mcap"));
        std::fs::remove_file(folder.path().join(format!("{name}.mcap"))).unwrap();
    }
    folder.write("few.mcap", &recording(&[attachment.repeat(20_000)]));
    let said = folder.say("annotate few.mcap -o o.mcap --allow-no-imu").ok();
    assert!(!said.stderr.contains("limits."), "{}", said.stderr);
    let said = folder.say("annotate few.mcap -o p.mcap --allow-no-imu --set limits.attachments_mib=1");
    assert!(said.code == 3 && said.stderr.contains("limits.attachments_mib"), "{}", said.stderr);
}

#[test]
fn definitions_that_only_the_summary_has() {
    let folder = Folder::new();
    let named = |n: u16, long: usize| channel(n, 0, &format!("/{n}{}", "t".repeat(long)), "cdr");
    for (name, long) in [("long", 400), ("shorter", 240), ("short", 1)] {
        let summary: Vec<u8> = (0..60_000).flat_map(|n| named(n, long)).collect();
        folder.write(&format!("{name}.mcap"), &with_summary(&[chunk(&named(0, long))], &summary));
    }
    let schemas: Vec<u8> = (1..8).flat_map(|n| schema(n, "s", "ros2msg", &vec![b'z'; 3_900_000])).collect();
    folder.write("schemas.mcap", &with_summary(&[chunk(&named(0, 1))], &schemas));
    for name in ["long", "shorter", "short", "schemas"] {
        ends_well(&folder, &format!("{name}.mcap"));
    }
    for name in ["shorter", "schemas"] {
        let said = folder.say(&format!("annotate {name}.mcap -o {name}.o.mcap --allow-no-imu"));
        assert!(said.code == 3 && said.stderr.contains("limits.definitions_mib"), "{name}: {}", said.stderr);
        // Our own output says no more than that.
        let again = folder.say(&format!("annotate {name}.o.mcap -o again.mcap --force --allow-no-imu"));
        assert_eq!(again.stderr.matches("definitions_mib").count(), said.stderr.matches("definitions_mib").count());
        assert!(folder.read("again.mcap") == folder.read(&format!("{name}.o.mcap")), "{name}");
        folder.say(&format!("strip {name}.o.mcap -o original.mcap --force")).ok();
        assert!(folder.read("original.mcap") == folder.read(&format!("{name}.mcap")), "{name}");
    }
}

#[test]
fn our_own_definitions_have_room_beside_those_of_a_recording() {
    let folder = Folder::with_demo();
    let demo = folder.read("demo.mcap");
    // As many as the limit allows, in front of all that the demonstration has.
    let header = 17 + u64::from_le_bytes(demo[9..17].try_into().unwrap()) as usize;
    let rest = demo.len() - 8 - 29;
    let summary = u64::from_le_bytes(demo[rest + 9..rest + 17].try_into().unwrap()) as usize;
    let mut large: Vec<u8> = (100..104).flat_map(|n| schema(n, "large", "ros2msg", &vec![b'z'; 4_100_000])).collect();
    large.extend(schema(104, "large", "ros2msg", &vec![b'z'; 360_000]));
    let data = [&demo[..header], &chunk(&large), &demo[header..summary - 13]].concat();
    let end = [record(15, &[0; 4]), record(2, &[0; 20])].concat();
    folder.write("full.mcap", &[&data, &end, MAGIC].concat());
    for command in [
        "annotate full.mcap -o o.mcap",
        "report o.mcap",
        "export o.mcap --format json",
        "annotate o.mcap -o again.mcap",
        "strip o.mcap -o s.mcap",
        "tail o.mcap -o tailed.mcap --idle-timeout 300ms",
        "topics o.mcap",
    ] {
        let run = folder.say(command).ok();
        assert!(!run.stderr.contains("limits."), "{command}: {}", run.stderr);
    }
    assert!(folder.read("again.mcap") == folder.read("o.mcap") && folder.read("s.mcap") == folder.read("full.mcap"));
    let less = folder.say("annotate full.mcap -o less.mcap --set limits.definitions_mib=15");
    assert!(less.code == 3 && less.stderr.contains("limits.definitions_mib"), "{}", less.stderr);
}

#[test]
fn channels_that_share_a_schema() {
    let folder = Folder::new();
    let fields = |n: usize| (0..n).flat_map(|n| format!("float64 a{n}\n").into_bytes()).collect::<Vec<_>>();
    let comment = [b"float64 a\n# ".to_vec(), vec![b'x'; 300_000]].concat();
    for (name, text, many) in
        [("fields", fields(20_000), 1000), ("some", fields(2000), 30_000), ("long", comment, 2000)]
    {
        let channels: Vec<u8> = (0..many).flat_map(|n| channel(n, 1, &format!("/{n}"), "cdr")).collect();
        folder.write(
            &format!("{name}.mcap"),
            &recording(&[chunk(&[schema(1, "a/msg/T", "ros2msg", &text), channels].concat())]),
        );
        ends_well(&folder, &format!("{name}.mcap"));
    }
    // One that the configuration names is read all the same.
    let (schema, data) = imu("imu");
    let (many, mut named) = (30_000_u16, Vec::new());
    let channels: Vec<u8> = (0..many).flat_map(|n| channel(n, 1, &format!("/{n}"), "cdr")).collect();
    (0..200).for_each(|n| named.extend(message(many - 1, 1_000_000_000 + n * 10_000_000, &data)));
    folder.write("named.mcap", &recording(&[chunk(&[schema, channels, named].concat())]));
    let set = format!("imu=[{{topic=\"/{}\"}}]", many - 1);
    let run = folder.run(["topics", "named.mcap", "--json", "--set", &set]).ok();
    let used = run.json()["topics"].as_array().unwrap().iter().filter(|topic| topic["used"] == true).count();
    assert!(used > 1, "{used}");
    let run = folder.run(["annotate", "named.mcap", "-o", "o.mcap", "--json", "--set", &set]);
    assert_eq!(run.json()["imus"][0]["topic"], format!("/{}", many - 1), "{}", run.stderr);
    let line = run.stderr.lines().map(str::len).max().unwrap();
    assert!(line < 1000 && run.stderr.contains(" more topics: "), "{line} bytes in a line");
}
