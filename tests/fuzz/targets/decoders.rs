//! Any bytes are a message of any schema or refused, always in the same way, and what is rewritten reads as it was written.

use arbitrary::{Result, Unstructured};
use stillpoint::imu::{Decoder, Layout};

use super::language;

/// Most vectors that one decoder reads here.
const MOST: usize = 4;

pub fn check(bytes: &[u8]) {
    let _ = checked(&mut Unstructured::new(bytes));
}

fn checked(u: &mut Unstructured<'_>) -> Result<()> {
    let (encoding, schema) = if u.ratio(1, 2)? { sound(u)? } else { language::schema(u)? };
    let Ok(layout) = Layout::new(encoding, Some(&schema)) else { return Ok(()) };
    let vectors = layout.vectors();
    let places: Vec<_> = vectors.iter().take(MOST).filter_map(|path| layout.vector(path).ok()).flatten().collect();
    let Ok(decoder) = Decoder::new(&layout, &places, None) else { return Ok(()) };
    let message = message(encoding, u)?;
    let read = |message: &[u8]| {
        let mut numbers = vec![0.0; places.len()];
        decoder
            .read(message, &mut numbers)
            .ok()
            .map(|text| (numbers.iter().map(|n| n.to_bits()).collect::<Vec<_>>(), text.into_owned()))
    };
    let before = read(&message);
    assert_eq!(before, read(&message));
    if places.is_empty() {
        return Ok(());
    }
    let slot = u.choose_index(places.len())?;
    let Some(rewritten) = decoder.rewrite(&message, places.len(), &[(slot, -2.5)]) else { return Ok(()) };
    let (before, after) =
        (before.expect("what is rewritten can be read"), read(&rewritten).expect("what was rewritten can be read"));
    for (n, (before, after)) in before.0.iter().zip(&after.0).enumerate() {
        // Several of these may be one and the same number of the message.
        let expected = if n == slot { (-2.5_f64).to_bits() } else { *before };
        assert!(
            *after == expected || places[n] == places[slot],
            "{n} of {slot}: {} is {}",
            f64::from_bits(*before),
            f64::from_bits(*after)
        );
    }
    Ok(())
}

/// A schema whose messages have all the shapes that a decoder walks over.
fn sound(u: &mut Unstructured<'_>) -> Result<(&'static str, stillpoint::record::Schema)> {
    const ROS: &str = "V v\nstring s\nuint8 pad\nfloat64[] n\nstring[] t\nV[] vs\nV[2] pair\nfloat32[3] accel\n===\nMSG: p/V\n\
                       float64 x\nfloat64 y\nfloat64 z\nuint16[] w\n";
    const IDL: &str = "module p { module msg { @appendable struct V { double x; double y; double z; sequence<uint16> w; }; \
                       struct R { V v; string s; octet pad; sequence<double> n; sequence<string> t; sequence<V> vs; V pair[2]; \
                       wstring u; float accel[3]; }; }; };";
    const JSON: &str = r#"{"properties": {"v": {"properties": {"x": {"type": "number"}, "y": {"type": "number"},
        "z": {"type": "number"}}}, "accel": {"type": "array", "items": {"type": "number"}}}}"#;
    let (encoding, language, text) = *u.choose(&[
        ("cdr", "ros2msg", ROS),
        ("ros1", "ros1msg", ROS),
        ("cdr", "ros2idl", IDL),
        ("json", "jsonschema", JSON),
    ])?;
    let (name, data) = ("p/msg/R".into(), text.as_bytes().to_vec());
    Ok((encoding, stillpoint::record::Schema { id: 1, name, encoding: language.into(), data }))
}

/// A message: small numbers and lengths, so that some of it can be read, or any bytes.
fn message(encoding: &str, u: &mut Unstructured<'_>) -> Result<Vec<u8>> {
    let mut out = match encoding {
        "cdr" => vec![0, *u.choose(&[0, 1, 6, 7, 8, 9, 0x10, 0x14, 2, 0xFF])?, 0, 0],
        _ => Vec::new(),
    };
    while !u.is_empty() && out.len() < 2000 {
        match (encoding, u.int_in_range(0..=5)?) {
            ("json", _) => out.extend_from_slice(u.choose(JSON)?.as_bytes()),
            (_, 0) => out.extend([0; 8]),
            (_, 1) => out.extend(u.int_in_range(0..=4_u32)?.to_le_bytes()),
            (_, 2) => out.extend(9.81_f64.to_le_bytes()),
            (_, 3) => out.push(u.arbitrary()?),
            // Field and wire type of protobuf, and a length.
            (_, 4) => out.extend([u.int_in_range(0..=0x2F)?, u.int_in_range(0..=12)?]),
            _ => {
                let length = u.int_in_range(0..=16)?;
                out.extend_from_slice(u.bytes(length)?);
            }
        }
    }
    Ok(out)
}

const JSON: &[&str] = &[
    "{",
    "}",
    "[",
    "]",
    ",",
    ":",
    "\"v\":",
    "\"x\":",
    "\"y\":",
    "\"z\":",
    "\"accel\":",
    "1",
    "-1.5",
    "1e5",
    "1e999",
    "-",
    "0",
    "{\"x\":1,\"y\":2,\"z\":3}",
    "[1,2,3]",
    "null",
    "true",
    "\"NaN\"",
    "\"\\u0078\":",
    "\"a\"",
    " ",
    "\n",
    "é",
    "\u{0}",
    "\"",
];
