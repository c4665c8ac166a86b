//! Corners of `ros2idl` and `omgidl` schemas: what is understood as what, and what is refused with which reason.

use stillpoint::imu::{Decoder, Layout, SchemaError};
use stillpoint::record::Schema;

fn parse(name: &str, text: &str) -> Result<Layout, SchemaError> {
    let schema = Schema { id: 1, name: name.into(), encoding: "ros2idl".into(), data: text.into() };
    Layout::new("cdr", Some(&schema))
}

/// A module around the definitions, as recorders write it.
fn in_module(text: &str) -> String {
    format!("{}\nIDL: pkg/msg/Root\nmodule pkg {{\n  module msg {{\n{text}\n  }};\n}};\n", "=".repeat(80))
}

fn refused(text: &str) -> String {
    parse("pkg/msg/Root", &in_module(text)).unwrap_err().to_string()
}

/// Whether the numbers at `paths` are read as 1, 2, 3 … from a payload with this encapsulation.
#[track_caller]
fn reads_as(encapsulation: u8, text: &str, paths: &[&str], body: &[u8]) {
    let layout = parse("pkg/msg/Root", &in_module(text)).unwrap();
    assert_eq!(layout.name(), "pkg/Root");
    let places: Vec<_> = paths.iter().map(|path| layout.number(&path.parse().unwrap()).unwrap()).collect();
    let mut numbers = vec![f64::NAN; places.len()];
    let payload = [&[0, encapsulation, 0, 0], body].concat();
    Decoder::new(&layout, &places, None).unwrap().read(&payload, &mut numbers).unwrap();
    assert_eq!(numbers, (1..=paths.len()).map(|i| i as f64).collect::<Vec<_>>());
}

#[track_caller]
fn reads(text: &str, paths: &[&str], body: &[u8]) {
    reads_as(1, text, paths, body);
}

#[test]
fn a_schema_of_a_recorder_is_understood() {
    let rule = "=".repeat(80);
    let text = format!(
        "{rule}
IDL: sensor_msgs/msg/Imu
// generated from rosidl_adapter/resource/msg.idl.em
// with input from sensor_msgs/msg/Imu.msg

#include \"geometry_msgs/msg/Vector3.idl\"
#include \"std_msgs/msg/Header.idl\"

module sensor_msgs {{
  module msg {{
    typedef double double__9[9];
    @verbatim (language=\"comment\", text=
      \"This is a message to hold data from an IMU; \\\"quoted\\\"\" \"\\n\"
      \"============\")
    struct Imu {{
      std_msgs::msg::Header header;

      @verbatim (language=\"comment\", text=
        \"rad/sec\")
      @unit (value=\"rad/s\")
      geometry_msgs::msg::Vector3 angular_velocity;
      double__9 angular_velocity_covariance;
      geometry_msgs::msg::Vector3 linear_acceleration;
      double__9 linear_acceleration_covariance;
    }};
  }};
}};
{rule}
IDL: geometry_msgs/msg/Vector3
module geometry_msgs {{
  module msg {{
    struct Vector3 {{
      @default (value=0.0)
      double x;
      double y, z;
    }};
  }};
}};
{rule}\r
IDL: std_msgs/msg/Header\r
#include \"builtin_interfaces/msg/Time.idl\"\r
module std_msgs {{ module msg {{ struct Header {{\r
  builtin_interfaces::msg::Time stamp; string frame_id; }}; }}; }};\r
{rule}
IDL: builtin_interfaces/msg/Time
module builtin_interfaces {{ module msg {{
  struct Time {{ int32 sec; uint32 nanosec; }}; }}; }};
"
    );
    let layout = parse("sensor_msgs/msg/Imu", &text).unwrap();
    assert_eq!(layout.name(), "sensor_msgs/Imu");
    let vectors: Vec<_> = layout.vectors().iter().map(ToString::to_string).collect();
    assert_eq!(vectors, ["angular_velocity", "linear_acceleration"]);
    let acceleration = layout.vector(&"linear_acceleration".parse().unwrap()).unwrap();
    let frame = layout.text(&"header.frame_id".parse().unwrap()).unwrap();
    let mut payload = vec![0, 1, 0, 0];
    payload.extend([[1, 0, 0, 0], [2, 0, 0, 0], [4, 0, 0, 0], *b"imu\0"].concat());
    (0..24).for_each(|i| payload.extend(f64::from(i).to_le_bytes()));
    let mut numbers = [0.0; 3];
    let decoder = Decoder::new(&layout, &acceleration, Some(&frame)).unwrap();
    assert_eq!(&*decoder.read(&payload, &mut numbers).unwrap(), b"imu");
    assert_eq!(numbers, [12.0, 13.0, 14.0]);
}

#[test]
fn every_number_has_its_size() {
    let text =
        "struct Root { octet a; boolean b; char c; int8 d; uint8 e; short f; unsigned short g; int16 h; uint16 i;
                long j; unsigned long k; int32 l; uint32 m; float n; long long o; unsigned long long p; int64 q;
                uint64 r; double s; string<9> t; wstring<9> u; octet v; };";
    let mut body = vec![1, 0, 2, 3, 4, 0, 5, 0, 6, 0, 7, 0, 8, 0, 0, 0];
    for value in [9, 10, 11, 12] {
        body.extend(i32::to_le_bytes(value));
    }
    body.extend(13_f32.to_le_bytes());
    body.extend([0; 4]);
    (14..18).for_each(|value| body.extend(i64::to_le_bytes(value)));
    body.extend(18_f64.to_le_bytes());
    body.extend([[2, 0, 0, 0], [b'x', 0, 0, 0], [1, 0, 0, 0], [b'w', 0, 0, 0]].concat());
    body.push(19);
    let names = ["a", "c", "d", "e", "f", "g", "h", "i", "j", "k", "l", "m", "n", "o", "p", "q", "r", "s", "v"];
    reads(text, &names, &body);
}

#[test]
fn typedefs_constants_and_enumerations_are_followed() {
    let text = "module Root_Constants { const long SIZE = 0x2; const string NAME = \"a;b\"; };
                const unsigned long N = 3;
                enum Mode { @value(7) OFF, ON = 2 };
                @bit_bound(8) enum Small { A, B };
                typedef octet Bytes[N];
                typedef Bytes Alias;
                typedef sequence<octet, 5> Some;
                struct Root {
                  Mode mode; Small small; Alias bytes; Some some; octet pairs[Root_Constants::SIZE][2]; octet last;
                };";
    let body = [&[1, 0, 0, 0, 2, 9, 9, 3][..], &[1, 0, 0, 0, 4], &[9, 9, 5, 9], &[6]].concat();
    reads(text, &["mode", "small", "bytes[2]", "some[0]", "pairs[2]", "last"], &body);
}

#[test]
fn lists_of_lists_are_walked() {
    let text = "typedef octet Pair[2];
                struct Root { sequence<Pair> pairs; sequence<sequence<octet>> ragged; octet a; };";
    let body =
        [&[2, 0, 0, 0, 9, 9, 9, 9][..], &[2, 0, 0, 0], &[1, 0, 0, 0, 9, 0, 0, 0], &[2, 0, 0, 0, 9, 9], &[1]].concat();
    reads(text, &["a"], &body);
}

#[test]
fn names_are_looked_up_from_the_inside() {
    let text = "struct A { octet x; };
                module inner { struct A { octet y; }; struct B { A a; msg::A b; ::pkg::msg::A c; pkg::msg::inner::A d; }; };
                struct Root { inner::B b; };";
    reads(text, &["b.a.y", "b.b.x", "b.c.x", "b.d.y"], &[1, 2, 3, 4]);
}

#[test]
fn members_of_what_a_struct_inherits_come_first() {
    reads("struct Base { octet a; }; struct Root : Base { octet b; };", &["a", "b"], &[1, 2]);
}

#[test]
fn appendable_messages_have_their_size_in_front_in_xcdr2_alone() {
    let text = "@appendable struct A { octet x; }; @final struct F { octet x; }; struct U { octet x; };
                struct Root { A a; F f; U u; A list[2]; octet end; };";
    let paths = ["a.x", "f.x", "u.x", "list[1].x", "end"];
    reads_as(1, text, &paths, &[1, 2, 3, 9, 4, 5]);
    // Plain: the message itself is final, and so is what is not said to be anything.
    let list = [&[14, 0, 0, 0][..], &[1, 0, 0, 0, 9, 0, 0, 0], &[1, 0, 0, 0, 4, 5]].concat();
    let plain = [&[1, 0, 0, 0, 1, 2, 3, 0][..], &list].concat();
    reads_as(7, text, &paths, &plain);
    // Delimited: a later version of `U` has a further member.
    let delimited = [&[1, 0, 0, 0, 1, 2, 0, 0][..], &[5, 0, 0, 0, 3, 7, 7, 7, 7, 0, 0, 0], &list].concat();
    let delimited = [&(delimited.len() as u32).to_le_bytes()[..], &delimited].concat();
    reads_as(9, text, &paths, &delimited);
}

#[test]
fn what_is_not_said_to_be_final_is_appendable_if_the_whole_is_said_to_be_anything() {
    let text = "struct A { octet x; }; @final struct Root { A a; octet end; };";
    reads_as(7, text, &["a.x", "end"], &[1, 0, 0, 0, 1, 2]);
}

#[test]
fn lists_of_enumerations_have_their_size_in_front_in_xcdr2() {
    let text = "enum E { A, B }; struct Root { sequence<E> list; octet a; };";
    reads_as(1, text, &["a"], &[&[1, 0, 0, 0][..], &[9, 0, 0, 0, 1]].concat());
    reads_as(7, text, &["a"], &[&[8, 0, 0, 0][..], &[1, 0, 0, 0], &[9, 0, 0, 0, 1]].concat());
}

#[test]
fn what_is_not_read_is_refused_by_name_if_it_is_needed() {
    assert_eq!(
        refused("struct Root { octet a; @optional double b; };"),
        "schema pkg/msg/Root: `b` of Root is @optional, which is not read"
    );
    for mutable in ["@mutable", "@extensibility(MUTABLE)"] {
        let why = "schema pkg/msg/Root: M is @mutable, which is not read";
        assert_eq!(refused(&format!("{mutable} struct M {{ octet a; }}; struct Root {{ M m; }};")), why);
    }
    let union = "union U switch (long) { case 1: octet a; default: double b; };";
    assert_eq!(
        refused(&format!("{union} struct Root {{ U u; }};")),
        "schema pkg/msg/Root: U is a union, which is not read"
    );
    assert!(
        refused("struct Root { long double a; };")
            .ends_with("`a` of pkg::msg::Root is a long double, which is not read")
    );
    assert!(refused("struct Root { map<long, string> a; };").contains("is a map, which is not read"));
    let harmless = format!("{union} @mutable struct M {{ octet a; }}; struct Root {{ @optional(FALSE) octet a; }};");
    reads(&harmless, &["a"], &[1]);
}

#[test]
fn schemas_that_contradict_themselves_are_refused_with_the_reason() {
    assert_eq!(refused("struct Root { Unknown u; };"), "schema pkg/msg/Root: Unknown is not defined");
    assert!(refused("struct Other { octet a; };").contains("pkg::msg::Root is not defined"));
    assert!(refused("struct Root { Root r; };").contains("pkg::msg::Root contains itself"));
    assert!(refused("struct Root { sequence<Root> r; };").contains("pkg::msg::Root contains itself"));
    assert!(refused("struct Root : Root { octet a; };").contains("nested too deeply"));
    assert!(refused("typedef B A; typedef A B; struct Root { A a; };").contains("nested too deeply"));
    assert!(refused("struct Root { octet a, a; };").contains("two members `a`"));
    assert!(refused("struct Root { octet a[N]; };").contains("the size `N` of an array"));
    assert!(refused("struct Root { octet a[99999][99999]; };").contains("absurd size"));
    assert!(
        refused("struct A { octet a; }; struct A { octet b; }; struct Root { A a; };")
            .contains("defined twice, differently")
    );
    assert!(refused("struct Root {\n octet a;\n octet };").contains("line 7: expected a name, found `}`"));
    assert!(refused("/* for ever").contains("line 5: a comment or text that never ends"));
    assert!(refused("};").contains("too many"));
    assert!(
        parse("pkg/msg/Root", "module pkg { struct Root { octet a; };").unwrap_err().to_string().contains("never ends")
    );
}

#[test]
fn a_definition_may_be_repeated_and_the_module_left_out() {
    let text = "struct A { octet a; }; struct A { octet a; }; struct Root { A a; };";
    reads(text, &["a.a"], &[1]);
    assert_eq!(parse("pkg/msg/Root", "struct Root { octet a; };").unwrap().name(), "Root");
    let mangled = "module pkg { module msg { module dds_ { struct Root_ { octet a; }; }; }; };";
    assert_eq!(parse("pkg::msg::dds_::Root_", mangled).unwrap().name(), "pkg/Root");
}
