//! The numbers to paste into programs: JSON, YAML, numpy, and the commands that do it without pasting.

use std::fmt::Write as _;

use serde_json::{Value, json};

use super::{Imu, escape, section as framed};
use crate::messages::Triad;
use crate::report::{calibration, matrix, model, row_major, yaml};

pub(super) fn section(imu: &Imu<'_>, recording: &str) -> String {
    let triads: Vec<_> = imu.triads().filter_map(|triad| Some((triad, numbers(triad)?))).collect();
    if triads.is_empty() {
        return String::new();
    }
    let fields = triads.iter().map(|(triad, numbers)| (triad.sensor.clone(), numbers.clone()));
    let head = [
        ("topic".to_owned(), json!(imu.findings.topic)),
        ("direction".to_owned(), json!("measured = bias + sensitivity * true")),
    ];
    let value = Value::Object(head.into_iter().chain(fields).collect());
    let name = quoted(recording);
    let commands = format!(
        "stillpoint export {name} --format kalibr -o imu-kalibr.yaml\nstillpoint annotate {name} -o corrected.mcap --set output.corrected=final\n"
    );
    let blocks = [
        ("JSON", pretty(&value, 0) + "\n"),
        ("YAML", yaml::document(&value)),
        ("numpy", numpy(&triads)),
        ("Commands: a file for Kalibr, and the recording with corrected messages", commands),
    ];
    framed("To paste", &blocks.map(|(name, text)| block(name, &text)).concat())
}

/// A text with a button that copies it, and that selects all of it on a click.
fn block(name: &str, text: &str) -> String {
    const COPY: &str = "getSelection().selectAllChildren(this.parentElement.querySelector('pre'));\
                        document.execCommand('copy');this.textContent='copied'";
    format!(
        "<div class=\"copy\"><button type=\"button\" onclick=\"{COPY}\">copy</button><b>{name}</b><pre>{}</pre></div>",
        escape(text)
    )
}

/// Parameters that correct a reading; `None` if the triad is not determined.
fn numbers(triad: &Triad) -> Option<Value> {
    let known = calibration(triad)?;
    let rows = |values: &[f64]| values.chunks(3).map(|row| json!(row)).collect::<Value>();
    let bias: [f64; 3] = known.bias.into();
    let mut value = json!({
        "unit": unit(triad),
        "status": triad.status().as_str_name(),
        "model": model(triad.model()),
        "bias": bias.map(|entry| entry + 0.0),
        "sensitivity": rows(&row_major(&known.sensitivity)),
    });
    for (name, values) in [
        ("g_sensitivity", &triad.g_sensitivity),
        ("g2_sensitivity", &triad.g2_sensitivity),
        ("rate_sensitivity", &triad.rate_sensitivity),
    ] {
        match values.len() {
            0 => {}
            3 => value[name] = json!(values),
            _ => value[name] = rows(values),
        }
    }
    let is_finite = bias.iter().chain(known.sensitivity.iter()).all(|entry| entry.is_finite());
    is_finite.then_some(value)
}

fn unit(triad: &Triad) -> &'static str {
    if triad.sensor == "gyroscope" { "rad/s" } else { "m/s²" }
}

/// JSON with one line per field; lists stay on one line.
fn pretty(value: &Value, indent: usize) -> String {
    let Value::Object(fields) = value else { return value.to_string() };
    let line = |(key, value): (&String, &Value)| {
        format!("{:1$}{2}: {3}", "", indent + 2, Value::from(key.as_str()), pretty(value, indent + 2))
    };
    format!("{{\n{}\n{:2$}}}", fields.iter().map(line).collect::<Vec<_>>().join(",\n"), "", indent)
}

fn numpy(triads: &[(&Triad, Value)]) -> String {
    let mut text = "import numpy as np\n".to_owned();
    for (triad, numbers) in triads {
        let name: String = triad.sensor.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
        let (bias, s) = (&numbers["bias"], &numbers["sensitivity"]);
        let _ = write!(
            text,
            "\n# {}, {}: readings as rows of three\n{name}_bias = np.array({bias})\n{name}_S = np.array({s})\n",
            triad.sensor.escape_default(),
            unit(triad)
        );
        match matrix(&triad.g_sensitivity) {
            Some(_) => {
                let _ = write!(
                    text,
                    "{name}_G = np.array({})\ndef correct_{name}(measured, acceleration):\n    \
                     return (np.asarray(measured) - {name}_bias - np.asarray(acceleration) @ {name}_G.T) @ np.linalg.inv({name}_S).T\n",
                    numbers["g_sensitivity"]
                );
            }
            None => {
                let _ = write!(
                    text,
                    "def correct_{name}(measured):\n    return (np.asarray(measured) - {name}_bias) @ np.linalg.inv({name}_S).T\n"
                );
            }
        }
    }
    text
}

/// A name quoted for a shell.
fn quoted(name: &str) -> String {
    format!("'{}'", name.replace('\'', r"'\''"))
}
