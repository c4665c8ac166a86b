//! JSON: what a schema or a first message says, and which numbers are read.

use proptest::prelude::*;
use serde_json::json;
use stillpoint::imu::{Decoder, Layout, SchemaError};
use stillpoint::record::Schema;

fn parse(text: &str) -> Result<Layout, SchemaError> {
    let schema = Schema { id: 1, name: "Sample".into(), encoding: "jsonschema".into(), data: text.into() };
    Layout::new("json", Some(&schema))
}

fn vectors(layout: &Layout) -> Vec<String> {
    layout.vectors().iter().map(ToString::to_string).collect()
}

fn read(paths: &[&str], example: &str, message: &str) -> Result<Vec<f64>, String> {
    let layout = Layout::of_example("Sample", example.as_bytes()).unwrap();
    let places: Vec<_> = paths.iter().map(|path| layout.number(&path.parse().unwrap()).unwrap()).collect();
    let mut numbers = vec![-77.0; places.len()];
    let decoder = Decoder::new(&layout, &places, None).unwrap();
    decoder.read(message.as_bytes(), &mut numbers).map_err(|e| e.to_string())?;
    Ok(numbers)
}

#[test]
fn a_schema_tells_the_fields() {
    let vector = json!({"type": "object", "properties": {"x": {"type": "number"}, "y": {"type": ["number", "null"]}, "z": {"type": "number"}}});
    let schema = json!({
        "title": "Sample",
        "$defs": {"vector": vector, "three": {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}},
        "properties": {
            "accel": {"$ref": "#/$defs/vector"},
            "imu": {"type": "object", "properties": {"gyro": {"$ref": "#/$defs/three"}}},
            "any": {"type": "array", "items": {"type": "number"}},
            "names": {"type": "array", "items": {"type": "string"}},
            "count": {"type": "integer"},
            "whatever": {},
        },
    });
    let layout = parse(&schema.to_string()).unwrap();
    assert_eq!(vectors(&layout), ["accel", "any", "imu.gyro"]);
    let why = layout.number(&"whatever".parse().unwrap()).unwrap_err().to_string();
    assert_eq!(why, "`whatever` of Sample is of no one type, not a number");
}

#[test]
fn a_schema_without_fields_leaves_it_to_the_messages() {
    for schema in ["{}", r#"{"type": "object"}"#, r#"{"type": "object", "properties": {}}"#] {
        assert_eq!(parse(schema), Err(SchemaError::Untold));
    }
    assert_eq!(Layout::new("json", None), Err(SchemaError::Untold));
    assert!(parse("{").unwrap_err().to_string().starts_with("schema Sample: is not JSON"));
}

#[test]
fn references_that_lead_round_end() {
    let text = r##"{"properties": {"a": {"$ref": "#"}, "b": {"$ref": "#/properties/b"}}}"##;
    assert!(parse(text).unwrap_err().to_string().contains("nested too deeply"));
    let wide = r##"{"$defs": {"d": {"properties": {"p": {"$ref": "#/$defs/e"}, "q": {"$ref": "#/$defs/e"}}},
                   "e": {"properties": {"p": {"$ref": "#/$defs/d"}, "q": {"$ref": "#/$defs/d"}}}},
                   "properties": {"a": {"$ref": "#/$defs/d"}}}"##;
    let error = parse(wide).unwrap_err().to_string();
    assert!(error.contains("nested too deeply") || error.contains("more than"), "{error}");
}

#[test]
fn without_a_schema_a_message_tells_the_fields() {
    let text = r#"{"a": {"x": 1, "y": 2.5, "z": -3}, "b": [1, 2, 3], "c": [{"x": 1}], "d": "x", "e": null, "f": [1, "a", 2], "g h": {"x": 1, "y": 2, "z": 3}}"#;
    let layout = Layout::of_example("Sample", text.as_bytes()).unwrap();
    assert_eq!(vectors(&layout), ["a", "b"]);
    assert!(layout.number(&"c[0].x".parse().unwrap()).is_ok());
    assert!(layout.text(&"d".parse().unwrap()).is_ok());
    for none in ["", "[1]", "3", "{", "{} {}"] {
        assert_eq!(Layout::of_example("Sample", none.as_bytes()), None, "{none}");
    }
}

#[test]
fn numbers_are_read_wherever_they_stand_and_what_is_none_is_nan() {
    let example = r#"{"a": {"x": 1, "y": 1, "z": 1}, "b": [1, 2, 3], "c": [{"x": 1}]}"#;
    let paths = ["a.x", "a.y", "b[0]", "b[2]", "c[1].x"];
    let message =
        r#" {"z": {"a": {"x": 9}}, "c": [{"x": 8}, {"x": 5, "x": 6}], "a": {"y": 2e0, "x": 1}, "b": [3, [7], 4, 9]} "#;
    assert_eq!(read(&paths, example, message).unwrap(), [1.0, 2.0, 3.0, 4.0, 6.0]);
    let message = r#"{"a": {"x": "NaN", "y": null}, "b": [true, 1], "c": {"x": 1}}"#;
    let numbers = read(&paths, example, message).unwrap();
    assert!(numbers.iter().all(|number| number.is_nan()), "{numbers:?}");
    assert_eq!(read(&["a.x"], example, r#"{"a": 3, "a\u002ex": 4}"#).map(|n| n[0].is_nan()), Ok(true));
}

#[test]
fn what_is_no_json_is_refused_with_the_place() {
    let example = r#"{"a": 1}"#;
    for (message, place) in [
        ("", "line 1, column 0"),
        (r#"{"a": 1"#, "line 1, column 7"),
        ("{\"a\": 1,\n}", "line 2, column 1"),
        (r#"{"a": 1} x"#, "line 1, column 10"),
        (r#"{"a": NaN}"#, "line 1, column 7"),
        (r#"{"a": Infinity}"#, "line 1, column 7"),
        (r#"{"a": 1e999}"#, "line 1, column 11"),
        (r#"{"a": 01}"#, "line 1, column 8"),
    ] {
        let error = read(&["a"], example, message).unwrap_err();
        assert_eq!(error, format!("the payload is not JSON at {place}"), "{message}");
    }
    let deep = format!("{}1{}", "[".repeat(100_000), "]".repeat(100_000));
    assert!(read(&["a"], example, &deep).is_ok_and(|n| n[0].is_nan()));
    assert!(read(&["a"], example, &format!(r#"{{"b": {deep}, "a": 1}}"#)).is_ok_and(|n| n == [1.0]));
}

#[test]
fn a_text_is_read_as_it_is_meant() {
    let layout = Layout::of_example("Sample", br#"{"f": "x"}"#).unwrap();
    let place = layout.text(&"f".parse().unwrap()).unwrap();
    let decoder = Decoder::new(&layout, &[], Some(&place)).unwrap();
    assert_eq!(&*decoder.read(br#"{"f": "imu"}"#, &mut []).unwrap(), b"imu");
    assert_eq!(&*decoder.read(br#"{"f": "\/imu\u00b2"}"#, &mut []).unwrap(), "/imu²".as_bytes());
    assert_eq!(&*decoder.read(br#"{"f": 3}"#, &mut []).unwrap(), b"");
}

proptest! {
    #![proptest_config(super::cases(400))]

    #[test]
    fn numbers_are_read_exactly(bits: u64, integer: i64) {
        let number = f64::from_bits(bits);
        prop_assume!(number.is_finite());
        let example = r#"{"a": 1, "b": 1}"#;
        let message = format!(r#"{{"b": {integer}, "a": {number:e}}}"#);
        prop_assert_eq!(read(&["a", "b"], example, &message).unwrap(), [number, integer as f64]);
        prop_assert_eq!(read(&["a"], example, &format!(r#"{{"a": {number}}}"#)).unwrap(), [number]);
    }
}
