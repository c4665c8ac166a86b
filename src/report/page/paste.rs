//! The numbers to paste into programs: JSON, YAML, numpy, and the commands that do it without pasting, as far as they can
//! work.

use std::fmt::Write as _;
use std::path::Path;

use maud::{Markup, html};
use serde_json::{Value, json};

use super::elements;
use super::imu::Imu;
use crate::config::{Config, Layer};
use crate::messages::Triad;
use crate::printable_json;
use crate::report::{
    ExportError, Findings, Format, Options, Timeline, calibration, direction, export, matrix, model, row_major, yaml,
};
use crate::shell_word;

/// A recording that commands can name, and the settings that its annotations follow, as TOML.
#[derive(Clone, Copy)]
pub(super) struct Source<'a> {
    pub(super) recording: &'a str,
    pub(super) settings: &'a str,
    /// All of its IMUs.
    pub(super) timelines: &'a [Timeline],
}

/// Numbers and, of one recording, commands; `None` if no triad is determined.
pub(super) fn section(imu: &Imu<'_>, source: Option<Source<'_>>) -> Option<Markup> {
    let triads: Vec<_> = imu.findings.triads().filter_map(|triad| Some((triad, numbers(triad)?))).collect();
    if triads.is_empty() {
        return None;
    }
    let fields = triads.iter().map(|(triad, numbers)| (triad.sensor.clone(), numbers.clone()));
    let head = [
        ("topic".to_owned(), json!(imu.findings.topic)),
        ("direction".to_owned(), json!(direction(imu.findings.calibration.as_ref()))),
    ];
    let value = Value::Object(head.into_iter().chain(fields).collect());
    let commands: Vec<_> = source.into_iter().flat_map(|source| commands(imu, source)).collect();
    // Hidden characters are escaped as these languages do, so that they are read back as what they were.
    let content = html! {
        (block("JSON", &printable_json(&(pretty(&value, 0) + "\n"))))
        (block("YAML", &printable_json(&yaml::document(&value))))
        (block("numpy", &numpy(&triads)))
        @if !commands.is_empty() {
            @let what: Vec<_> = commands.iter().map(|(what, _)| *what).collect();
            @let lines: String = commands.iter().map(|(_, line)| format!("{line}\n")).collect();
            (block(&format!("Commands: {}", what.join(", and ")), &lines))
        }
    };
    Some(elements::section("To paste", content))
}

/// Commands that work on the recording, each with what it makes.
fn commands(imu: &Imu<'_>, source: Source<'_>) -> Vec<(&'static str, String)> {
    let Source { recording, settings, timelines } = source;
    let name = shell_word(recording);
    let kalibr = || {
        let format = Format::named("kalibr")?;
        let to = |findings: &Findings| export(std::slice::from_ref(findings), format, &Options::default());
        // One IMU that the file cannot hold makes the whole of it fail; one that is not determined is left out of it.
        let fails = |timeline: &Timeline| matches!(to(&timeline.findings), Err(ExportError::Holds { .. }));
        let works = to(imu.findings).is_ok() && !timelines.iter().any(fails);
        works.then(|| ("a file for Kalibr", format!("stillpoint export {name} --format kalibr -o imu-kalibr.yaml")))
    };
    let corrected = || {
        // A sidecar holds no readings, and settings of another version may not be known.
        let has_readings = imu.timeline.acceleration.span().is_some();
        let config = Config::load(&[Layer::file("the recording", settings)]).ok().filter(|_| has_readings)?;
        // Of a folder it is another folder.
        let output = if Path::new(recording).extension().is_some() { "corrected.mcap" } else { "corrected" };
        let line = format!("stillpoint annotate {name} -o {output} --set output.corrected=final");
        let others =
            config.changes_from(&Config::default()).into_iter().filter(|change| change.key != "output.corrected");
        let line = others.fold(line, |line, change| format!("{line} --set {}", shell_word(&change.setting())));
        Some(("the recording with corrected messages", line))
    };
    kalibr().into_iter().chain(corrected()).collect()
}

/// A text with a button that copies it, and that selects all of it on a click.
fn block(name: &str, text: &str) -> Markup {
    const COPY: &str = "getSelection().selectAllChildren(this.parentElement.querySelector('pre'));\
                        document.execCommand('copy');this.textContent='copied'";
    html! { div.copy { button type="button" onclick=(COPY) { "copy" } b { (name) } pre { (text) } } }
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
    if triad.sensitivity.is_empty() {
        value["sensitivity_is"] = json!(ASSUMED);
    }
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

/// Remark on a sensitivity that nothing told.
const ASSUMED: &str = "not estimated: the identity, as if it had no error";

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
            "\n# {}, {}: readings as rows of three{}\n{name}_bias = np.array({bias})\n{name}_S = np.array({s})\n",
            triad.sensor.escape_default(),
            unit(triad),
            if triad.sensitivity.is_empty() { format!("; S was {ASSUMED}") } else { String::new() }
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
