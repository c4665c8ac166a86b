//! Stillpoint's own layout, which holds everything, as JSON and as YAML.
//! Convention: `measured = bias + sensitivity · true`; [`json`](crate::report::imus) defines the fields.

use serde_json::json;

use super::comments::comments;
use super::format::{Exported, Format, RandomWalks};
use crate::report::{Findings, imus, yaml};

pub(super) const JSON: Format = Format {
    name: "json",
    help: "Everything, for programs",
    random_walks: RandomWalks::None,
    write: |findings, _| Ok(Exported::plain(format!("{:#}\n", json!({"imus": imus(findings)})))),
};

pub(super) const YAML: Format = Format {
    name: "yaml",
    help: "The same as YAML",
    random_walks: RandomWalks::None,
    write: |findings, _| Ok(Exported::plain(yaml(findings))),
};

fn yaml(findings: &[Findings]) -> String {
    let heading = [
        format!("Calibrations by Stillpoint {}", env!("CARGO_PKG_VERSION")),
        "measured = bias + sensitivity * true, rows of sensitivity one by one, so true = sensitivity^-1 * (measured - bias)"
            .to_owned(),
        "accelerometers in m/s², gyroscopes in rad/s, axes as in the recording; convention: Stillpoint's own".to_owned(),
    ];
    comments(&heading) + &yaml::document(&json!({"imus": imus(findings)}))
}
