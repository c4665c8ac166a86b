//! YAML that parsers of 1.1 and of 1.2 understand alike.

use std::fmt::Write as _;

use serde_json::Value;

/// A document: mappings in blocks, lists of plain values on one line.
pub(crate) fn document(value: &Value) -> String {
    let mut text = String::new();
    block(value, 0, &mut text);
    text
}

fn block(value: &Value, indent: usize, out: &mut String) {
    match value {
        Value::Object(fields) => {
            for (key, value) in fields {
                let _ = write!(out, "{:indent$}{}:", "", string(key));
                inner(value, indent + 2, out);
            }
        }
        Value::Array(items) => {
            for item in items {
                match item {
                    Value::Object(fields) if !fields.is_empty() => {
                        let mut nested = String::new();
                        block(item, indent + 2, &mut nested);
                        let _ = write!(out, "{:indent$}- {}", "", nested.trim_start());
                    }
                    _ => {
                        let _ = writeln!(out, "{:indent$}- {}", "", flow(item));
                    }
                }
            }
        }
        plain => {
            let _ = writeln!(out, "{:indent$}{}", "", flow(plain));
        }
    }
}

/// Writes the value behind a key.
fn inner(value: &Value, indent: usize, out: &mut String) {
    let nested = match value {
        Value::Object(fields) => !fields.is_empty(),
        Value::Array(items) => items.iter().any(|item| item.is_object() || item.is_array()),
        _ => false,
    };
    if nested {
        out.push('\n');
        block(value, indent, out);
    } else {
        let _ = writeln!(out, " {}", flow(value));
    }
}

fn flow(value: &Value) -> String {
    match value {
        Value::Null => "null".to_owned(),
        Value::Bool(value) => value.to_string(),
        Value::Number(value) if value.is_f64() => number(value.as_f64().unwrap_or(f64::NAN)),
        Value::Number(value) => value.to_string(),
        Value::String(text) => string(text),
        Value::Array(items) => format!("[{}]", items.iter().map(flow).collect::<Vec<_>>().join(", ")),
        Value::Object(fields) => {
            let field = |(key, value): (&String, &Value)| format!("{}: {}", string(key), flow(value));
            format!("{{{}}}", fields.iter().map(field).collect::<Vec<_>>().join(", "))
        }
    }
}

/// The shortest number that reads back exactly. YAML 1.1 needs a point in it and a sign in its exponent.
pub(super) fn number(value: f64) -> String {
    let text = format!("{value:?}");
    let Some((mantissa, exponent)) = text.split_once('e') else { return text };
    let point = if mantissa.contains('.') { "" } else { ".0" };
    let sign = if exponent.starts_with('-') { "" } else { "+" };
    format!("{mantissa}{point}e{sign}{exponent}")
}

/// A plain string where it is unambiguous, else quoted as in JSON, which is YAML.
fn string(text: &str) -> String {
    let plain = text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '/')
        && text.chars().all(|c| c.is_ascii_alphanumeric() || "_-./+ ".contains(c))
        && !text.ends_with(' ')
        && !["true", "false", "null", "yes", "no", "on", "off", "y", "n"].contains(&text.to_lowercase().as_str());
    if plain { text.to_owned() } else { Value::from(text).to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn blocks_and_lists_are_written_as_people_write_them() {
        let value = json!({"imus": [{"topic": "/imu", "bias": [0.5, 1e-7], "m": [[1.0, 2.0], [3.0, 4.0]], "none": null,
            "empty": [], "model": "bias-scale", "no": "no"}], "version": 3});
        let text = "imus:\n  - bias: [0.5, 1.0e-7]\n    empty: []\n    m:\n      - [1.0, 2.0]\n      - [3.0, 4.0]\n    \
                    model: bias-scale\n    \"no\": \"no\"\n    none: null\n    topic: /imu\nversion: 3\n";
        assert_eq!(document(&value), text);
    }

    #[test]
    fn a_document_reads_back_as_it_was() {
        let value = json!({"a": {"b": [{"c": 1.0e-300, "d": "x: y\n\"z\""}, "# no comment", "1.5", true], "e": {}},
            "f": [0.1 + 0.2, -0.0, 1e21, 3.0]});
        let read: Value = serde_saphyr::from_str(&document(&value)).unwrap();
        assert_eq!(read, value);
    }
}
