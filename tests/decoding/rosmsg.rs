//! Corners of `ros1msg` and `ros2msg` schemas: what is understood as what, and what is refused with which reason.

use stillpoint::imu::{Decoder, Layout, SchemaError};
use stillpoint::record::Schema;

fn parse(message_encoding: &str, name: &str, text: &str) -> Result<Layout, SchemaError> {
    let encoding = if message_encoding == "ros1" { "ros1msg" } else { "ros2msg" };
    let schema = Schema { id: 1, name: name.into(), encoding: encoding.into(), data: text.into() };
    Layout::new(message_encoding, Some(&schema))
}

fn refused(text: &str) -> String {
    parse("cdr", "pkg/msg/Root", text).unwrap_err().to_string()
}

/// Whether the numbers at `paths` are read from `body` (behind a little-endian CDR header) as 1, 2, 3 …
#[track_caller]
fn reads(text: &str, paths: &[&str], body: &[u8]) {
    let layout = parse("cdr", "pkg/msg/Root", text).unwrap();
    let places: Vec<_> = paths.iter().map(|path| layout.number(&path.parse().unwrap()).unwrap()).collect();
    let mut numbers = vec![f64::NAN; places.len()];
    let payload = [&[0, 1, 0, 0], body].concat();
    Decoder::new(&layout, &places, None).unwrap().read(&payload, &mut numbers).unwrap();
    assert_eq!(numbers, (1..=paths.len()).map(|i| i as f64).collect::<Vec<_>>());
}

#[test]
fn constants_defaults_comments_and_blank_lines_are_not_fields() {
    let text = "\r\n# uint8 no\n  \nuint8 A=1\nstring B = \"# not a comment ====\"\nuint8 a 5 # default\n\
                string s \"x # y\"\nuint8[] list [1, 2]\nuint8   b#comment\n";
    reads(text, &["a", "b"], &[1, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 2]);
}

#[test]
fn bounds_do_not_change_the_bytes() {
    let text = "string<=9 s\nuint8[<=4] list\nstring<=3[<=2] strings\nuint8 end";
    let body = [[2, 0, 0, 0], [b'a', 0, 0, 0], [1, 0, 0, 0], [9, 0, 0, 0], [1, 0, 0, 0], [1, 0, 0, 0]].concat();
    reads(text, &["end"], &[&body[..], &[0, 1]].concat());
}

#[test]
fn an_empty_sequence_of_doubles_aligns_its_length_only() {
    reads("uint8 a\nfloat64[] list\nuint32 b", &["a", "b"], &[1, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0]);
    let with_one = [&[1, 0, 0, 0, 1, 0, 0, 0][..], &[0; 8], &[2, 0, 0, 0]].concat();
    reads("uint8 a\nfloat64[] list\nuint32 b", &["a", "b"], &with_one);
}

#[test]
fn an_empty_message_takes_a_byte_in_ros_2() {
    reads("pkg/E e\nuint8 a\npkg/E[2] es\nuint8 b\n===\nMSG: pkg/E\nuint8 X=1", &["a", "b"], &[0, 1, 0, 0, 2]);
}

#[test]
fn types_are_found_under_all_their_names() {
    let text = "Header header\nInner a\npkg/msg/Inner b\nother/Inner c\n===\nMSG: std_msgs/msg/Header\nbyte x\n\
                ===\nMSG: pkg/Inner\nchar x\n===\nMSG: other/msg/Inner\nuint8 x";
    reads(text, &["header.x", "a.x", "b.x", "c.x"], &[1, 2, 3, 4]);
}

#[test]
fn times_need_no_definition() {
    let body = [[1, 0, 0, 0], [2, 0, 0, 0], [3, 0, 0, 0]].concat();
    reads("builtin_interfaces/Time t\nuint32 a", &["t.sec", "t.nanosec", "a"], &body);
    let ros1 = parse("ros1", "pkg/Root", "time t\nduration d").unwrap();
    assert!(ros1.number(&"t.secs".parse().unwrap()).is_ok());
}

#[test]
fn elements_of_lists_can_be_asked_for() {
    reads("uint8[3] a\nuint16[] b", &["a[2]", "b[1]"], &[9, 9, 1, 0, 2, 0, 0, 0, 9, 9, 2, 0]);
    let text = "V[2] vs\nV[] list\n===\nMSG: pkg/V\nuint8 x\nuint8 y";
    reads(text, &["vs[1].x", "list[0].y"], &[9, 9, 1, 9, 2, 0, 0, 0, 9, 2, 9, 9]);
}

#[test]
fn a_list_shorter_than_asked_for_is_an_error() {
    let layout = parse("cdr", "pkg/msg/Root", "uint8[] a").unwrap();
    let place = layout.number(&"a[2]".parse().unwrap()).unwrap();
    let decoder = Decoder::new(&layout, &[place], None).unwrap();
    let error = decoder.read(&[0, 1, 0, 0, 2, 0, 0, 0, 9, 9], &mut [0.0]).unwrap_err();
    assert_eq!(error.to_string(), "a list has 2 elements, at least 3 are expected");
}

/// A wstring of characters of so many bytes each, behind their number or, if `in_bytes`, that of their bytes.
fn wstring(text: &str, unit: usize, in_bytes: bool) -> Vec<u8> {
    let count = text.len() * if in_bytes { unit } else { 1 };
    let characters = text.bytes().flat_map(|byte| [byte, 0, 0, 0].into_iter().take(unit));
    (count as u32).to_le_bytes().into_iter().chain(characters).collect()
}

#[test]
fn what_stands_behind_a_wstring_is_read_whoever_wrote_it() {
    let text = "uint8 a\nwstring w\nfloat64 b";
    // Fast DDS and Cyclone DDS under ROS 2, Fast CDR by itself, Cyclone DDS in XCDR2.
    for (unit, in_bytes) in [(4, false), (2, false), (2, true)] {
        let mut body = vec![1, 0, 0, 0];
        body.extend(wstring("abcde", unit, in_bytes));
        body.resize(body.len().next_multiple_of(8), 0);
        body.extend(2_f64.to_le_bytes());
        reads(text, &["a", "b"], &body);
    }
    // Here nothing tells: of two bytes or of four, the message ends where the payload does.
    let layout = parse("cdr", "pkg/msg/Root", "wstring w\nuint16[] b").unwrap();
    let b = layout.number(&"b[0]".parse().unwrap()).unwrap();
    let payload =
        [&[0, 1, 0, 0][..], &[2, 0, 0, 0], &[2, 0, 2, 0], &[4, 0, 0, 0], &[2, 0, 0, 0], &[7, 0, 8, 0]].concat();
    let error = Decoder::new(&layout, &[b], None).unwrap().read(&payload, &mut [0.0]).unwrap_err().to_string();
    assert!(error.starts_with("a wstring could be of more than one size"), "{error}");
}

#[test]
fn encapsulations_that_are_not_read_are_named() {
    let layout = parse("cdr", "pkg/msg/Root", "uint8 a").unwrap();
    let decoder = Decoder::new(&layout, &[], None).unwrap();
    let error = |identifier| decoder.read(&[0, identifier, 0, 0, 1], &mut []).unwrap_err().to_string();
    for identifier in [2, 3, 0x0a, 0x0b, 0x12, 0x13] {
        let named = "(a parameter list, as of @mutable types) is not read";
        assert!(error(identifier).contains(named), "{}", error(identifier));
    }
    assert_eq!(error(0x42), "the CDR encapsulation 0x0042 (unknown) is not read");
    assert!(decoder.read(&[0, 0x11, 0, 0, 1], &mut []).is_ok());
}

#[test]
fn absurd_sizes_end_at_the_end_of_the_payload() {
    for text in
        ["float64[] a", "string a", "string[] a", "E[] a\n===\nMSG: pkg/E\n", "E[4294967295] a\n===\nMSG: pkg/E\n"]
    {
        let layout = parse("cdr", "pkg/msg/Root", text).unwrap();
        let decoder = Decoder::new(&layout, &[], None).unwrap();
        let error = decoder.read(&[0, 1, 0, 0, 255, 255, 255, 255, 0, 0, 0, 0], &mut []).unwrap_err();
        assert!(error.to_string().contains("the payload ends after 12 bytes"), "{text}: {error}");
    }
    // Elements without bytes are not counted out one by one.
    let layout = parse("ros1", "pkg/Root", "E[] a\nuint8 b\n===\nMSG: pkg/E\n").unwrap();
    let place = layout.number(&"b".parse().unwrap()).unwrap();
    let mut numbers = [0.0];
    Decoder::new(&layout, &[place], None).unwrap().read(&[255, 255, 255, 255, 7], &mut numbers).unwrap();
    assert_eq!(numbers, [7.0]);
}

#[test]
fn a_type_that_unrolls_to_billions_of_fields_is_refused() {
    let mut text = "A0 a\nA0 b\n".to_owned();
    for i in 0..30 {
        text += &format!("===\nMSG: pkg/A{i}\nA{next} a\nA{next} b\n", next = i + 1);
    }
    text += "===\nMSG: pkg/A30\nuint8 x\n";
    let layout = parse("cdr", "pkg/msg/Root", &text).unwrap();
    assert!(layout.vectors().is_empty());
    let error = Decoder::new(&layout, &[], None).unwrap_err().to_string();
    assert_eq!(error, "pkg/Root has more than 16384 fields");
}

#[test]
fn schemas_that_contradict_themselves_are_refused_with_the_reason() {
    assert_eq!(refused("Unknown u"), "schema pkg/msg/Root: pkg/Unknown is not defined");
    assert_eq!(refused("Root r"), "schema pkg/msg/Root: pkg/Root contains itself");
    assert_eq!(refused("uint8 a\nuint8 a"), "schema pkg/msg/Root: pkg/Root has two fields `a`");
    assert_eq!(refused("uint8 a\n\nuint8"), "schema pkg/msg/Root, line 3: `uint8` is neither a field nor a constant");
    assert!(refused("uint8 a\n===\nuint8 b").contains("line 3: expected `MSG: package/Type`"));
    assert!(refused("uint8[-1] a").contains("`uint8[-1]` has no valid size"));
    assert!(refused("uint8[99999999999] a").contains("has no valid size"));
    assert!(refused("uint8<=3 a").contains("`uint8<=3` is not a type"));
    assert!(
        refused("A a\n===\nMSG: pkg/A\nuint8 x\n===\nMSG: pkg/A\nuint8 y")
            .contains("pkg/A is defined twice, differently")
    );
    let mut deep = "A0 a\n".to_owned();
    (0..50).for_each(|i| deep += &format!("===\nMSG: pkg/A{i}\nA{} a\n", i + 1));
    assert!(refused(&deep).contains("nested too deeply"));
}

#[test]
fn a_definition_may_be_repeated_and_may_be_unused() {
    let text = "A a\n===\nMSG: pkg/A\nuint8 x\n===\nMSG: pkg/A\nuint8 x\n===\nMSG: pkg/B\nUnknown u";
    assert!(parse("cdr", "pkg/msg/Root", text).is_ok());
}

#[test]
fn a_schema_that_is_no_text_is_refused() {
    let schema = Schema { id: 1, name: "a".into(), encoding: "ros2msg".into(), data: vec![b'u', 0xff] };
    let error = Layout::new("cdr", Some(&schema)).unwrap_err().to_string();
    assert_eq!(error, "the schema a is not UTF-8 at byte 1");
    assert!(Layout::new("cdr", None).unwrap_err().to_string().contains("no schema"));
}
