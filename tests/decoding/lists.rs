//! Lists of readings in every encoding: read, or refused by name, without memory that they do not justify.

use allocation_counter::measure;
use proptest::prelude::*;
use prost_reflect::{DescriptorPool, DynamicMessage};
use stillpoint::imu::Sensor::{Accelerometer, Gyroscope};
use stillpoint::imu::{Cause, ChannelRole};
use stillpoint::record::{Channel, Schema};

use super::batches::{COLUMNS, offered, told};
use super::intake::{Door, channel, px4, schema};

#[test]
fn lists_that_do_not_fit_are_refused_by_name_and_take_no_memory() {
    let cdr = schema("acme/msg/C", "float32[] x\nfloat32[] y\nfloat32[] z\n");
    let list = |claimed: f64, held: usize| [vec![(claimed, 'I')], vec![(1.0, 'f'); held]].concat();
    let messages = [
        (px4(&[list(2.0, 2), list(3.0, 3), list(2.0, 2)].concat()), "the lists of its readings have 2 and 3 elements"),
        (px4(&list(4e9, 100)), "the payload ends after"),
        (px4(&[list(1e6, 1_000_000), list(1e6, 1_000_000), list(1e6, 1_000_000)].concat()), "more than 4096 readings"),
    ];
    for (data, words) in messages {
        let mut door = Door::new(COLUMNS);
        door.channel(1, "/c", &cdr);
        let memory = measure(|| door.message(1, 1, &data));
        assert!(memory.bytes_max < 2 << 20, "{words}: {memory:?}");
        assert_eq!((told(&door), door.faults()), (vec![], vec![(Cause::Malformed, 1)]));
        let text = door.intake.take_notices().pop().unwrap().text;
        assert!(text.contains(words), "{text}");
    }
    // Elements of two bytes each.
    let proto = "syntax = \"proto3\"; package t; message R { V a = 1; V g = 2; } message V { float x = 1; float y = 2; float z = 3; } message Root { repeated R r = 1; }";
    let schema =
        Schema { id: 1, name: "t.Root".into(), encoding: "protobuf".into(), data: super::protobuf::compile(proto) };
    let mut door = Door::new("[[imu]]\ntopic = '/c'\naccel = 'r[*].a'\ngyro = 'r[*].g'");
    door.intake.channel(&Channel { message_encoding: "protobuf".into(), ..channel(1, "/c") }, Some(&schema));
    let memory = measure(|| door.message(1, 1, &[0x0a, 0].repeat(500_000)));
    assert!(memory.bytes_max < 2 << 20 && door.faults() == [(Cause::Malformed, 1)], "{memory:?}");
    door.message(1, 1, &[0x0a, 0].repeat(3));
    assert_eq!(door.faults(), [(Cause::Malformed, 1), (Cause::NotFinite, 3), (Cause::NotFinite, 3)]);
    // JSON that holds no list there, or one of something else.
    let json = Channel { schema_id: 0, message_encoding: "json".into(), ..channel(1, "/c") };
    for data in [&br#"{"x": [1, 2], "y": 3, "z": null}"#[..], br#"{"x": [1], "y": ["a"], "z": [{}]}"#, b"{}"] {
        let mut door = Door::new(COLUMNS);
        door.intake.channel(&json, None);
        door.message(1, 1, br#"{"x": [1, 2], "y": [0, 0], "z": [9, 9]}"#);
        assert_eq!(told(&door).len(), 2);
        door.message(1, 2, data);
        assert_eq!(told(&door).len(), 2, "{}", String::from_utf8_lossy(data));
    }
}

#[test]
fn one_element_beside_all_of_them_and_lists_in_lists_are_refused() {
    let inner = "===\nMSG: acme/R\nfloat64[3] a\nfloat64[3] g\nfloat64[] w\n";
    let acme = schema("acme/msg/L", &format!("acme/R[] r\n{inner}"));
    for (lines, words) in [
        ("accel = 'r[*].a'\ngyro = 'r[0].g'", "all elements of `r` are read"),
        ("accel = ['r[*].w[*]', 'r[*].a[1]', 'r[*].a[2]']", "no field `r[*].w[*]`"),
        ("accel = 'r[*]'", "no field `r[*].x`"),
        ("accel = 'r'", "`r` of acme/L is acme/R[], not a message with x, y, z"),
    ] {
        let mut door = Door::new(&format!("[[imu]]\ntopic = '/l'\n{lines}"));
        let role = door.channel(1, "/l", &acme).clone();
        assert!(matches!(&role, ChannelRole::Skipped(why) if why.contains(words)), "{lines}: {role}");
    }
}

#[test]
fn lists_in_the_elements_of_a_list_begin_anew_with_each() {
    let proto = "syntax = \"proto3\"; package t; message Root { repeated S samples = 1; }
                 message S { fixed64 time_ns = 1; repeated float acceleration = 2; repeated float angular_velocity = 3; }";
    let data = super::protobuf::compile(proto);
    let schema = Schema { id: 1, name: "t.Root".into(), encoding: "protobuf".into(), data: data.clone() };
    let channel = Channel { message_encoding: "protobuf".into(), ..channel(1, "/s") };
    let lines = offered(Door::new("").intake.channel(&channel, Some(&schema)));
    assert!(
        lines.contains("\"samples[*].acceleration\"") && lines.contains("\"samples[*].angular_velocity\""),
        "{lines}"
    );
    let sample = |n: u32| {
        format!(
            "samples {{ time_ns: {n} acceleration: [{n}, 2, 9] angular_velocity: 0.5 angular_velocity: {n} angular_velocity: 0 }}"
        )
    };
    let of_type = DescriptorPool::decode(&data[..]).unwrap().get_message_by_name("t.Root").unwrap();
    let message = DynamicMessage::parse_text_format(of_type, &[1, 2, 3].map(sample).join(" ")).unwrap();
    let mut door = Door::new(&lines);
    door.intake.channel(&channel, Some(&schema));
    door.message(1, 9, &prost::Message::encode_to_vec(&message));
    let expected = [1, 2, 3].map(|n| {
        let value = f64::from(n);
        [(Gyroscope, i64::from(n), [0.5, value, 0.0]), (Accelerometer, i64::from(n), [value, 2.0, 9.0])]
    });
    assert_eq!(told(&door), expected.concat());
}

#[test]
fn lists_are_read_in_every_encapsulation_of_cdr_and_in_ros_1() {
    let inner = "===\nMSG: acme/R\nuint8 flags\nfloat64[3] a\n";
    let acme =
        |encoding: &str| Schema { encoding: encoding.into(), ..schema("acme/msg/L", &format!("acme/R[] r\n{inner}")) };
    // Offsets count behind the encapsulation; each double is aligned to so many bytes.
    let message = |head: &[u8], sized: bool, align: usize, big: bool| {
        let mut bytes = Vec::new();
        let word = |n: u32| if big { n.to_be_bytes() } else { n.to_le_bytes() };
        if sized {
            bytes.extend(word(4 + 2 * 28));
        }
        bytes.extend(word(2));
        for n in [1.0, 2.0] {
            bytes.push(7);
            bytes.resize(bytes.len().next_multiple_of(align), 0);
            let numbers = [n, 2.0, 9.5].map(|x: f64| if big { x.to_be_bytes() } else { x.to_le_bytes() });
            bytes.extend(numbers.concat());
        }
        [head, &bytes].concat()
    };
    for (message_encoding, encoding, data) in [
        ("cdr", "ros2msg", message(&[0, 1, 0, 0], false, 8, false)),
        ("cdr", "ros2msg", message(&[0, 0, 0, 0], false, 8, true)),
        ("cdr", "ros2msg", message(&[0, 7, 0, 0], true, 4, false)),
        ("ros1", "ros1msg", message(&[], false, 1, false)),
    ] {
        let mut door = Door::new("[[imu]]\ntopic = '/l'\naccel = 'r[*].a'");
        let channel = Channel { message_encoding: message_encoding.into(), ..channel(1, "/l") };
        let role = door.intake.channel(&channel, Some(&acme(encoding))).to_string();
        door.message(1, 9, &data);
        let found: Vec<_> = told(&door).into_iter().map(|(.., value)| value).collect();
        assert_eq!(found, [[1.0, 2.0, 9.5], [2.0, 2.0, 9.5]], "{data:?} {role}");
    }
}

proptest! {
    #![proptest_config(super::cases(300))]

    /// Whatever stands in a message, its lists are read or refused, without memory beyond that of the longest lists.
    #[test]
    fn any_bytes_are_lists_of_readings_or_refused(
        bytes in prop::collection::vec(prop_oneof![3 => any::<u8>(), 2 => Just(0), 1 => Just(255)], 0..400),
    ) {
        let ros = "acme/R[] r\n===\nMSG: acme/R\nuint8 n\nfloat32[3] a\nstring s\n";
        let proto = "syntax = \"proto3\"; package t; message R { repeated float a = 2; } message Root { repeated R r = 1; }";
        let json = r#"{"properties": {"r": {"type": "array", "items": {"properties": {"a": {"type": "array", "items": {"type": "number"}}}}}}}"#;
        for (message_encoding, encoding, name, data) in [
            ("cdr", "ros2msg", "acme/msg/L", ros.into()),
            ("ros1", "ros1msg", "acme/L", ros.into()),
            ("protobuf", "protobuf", "t.Root", super::protobuf::compile(proto)),
            ("json", "jsonschema", "L", json.into()),
        ] {
            let schema = Schema { id: 1, name: name.into(), encoding: encoding.into(), data };
            let mut door = Door::new("[[imu]]\ntopic = '/l'\naccel = 'r[*].a'");
            let channel = Channel { message_encoding: message_encoding.into(), ..channel(1, "/l") };
            let role = door.intake.channel(&channel, Some(&schema)).clone();
            prop_assert!(matches!(role, ChannelRole::Used(_)), "{}", role);
            let mut payload = bytes.clone();
            if message_encoding == "cdr" && payload.len() > 2 {
                payload[..2].copy_from_slice(&[0, 1]);
            }
            let memory = measure(|| door.message(1, 1, &payload));
            prop_assert!(memory.bytes_max < 2 << 20, "{:?}", memory);
        }
    }
}
