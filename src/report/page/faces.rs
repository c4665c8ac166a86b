//! The faces of the fixture: which were seen, for how long, and the direction of gravity during each rest.

use std::fmt::Write as _;

use nalgebra::Vector3;

use super::{Imu, escape, signal};
use crate::messages::Face;
use crate::report::vector;

pub(super) fn section(imu: &Imu<'_>) -> String {
    let faces = imu.findings.coverage.as_ref().map_or(&[][..], |coverage| &coverage.faces);
    if faces.is_empty() {
        return String::new();
    }
    let mut cards = String::new();
    for (i, face) in faces.iter().enumerate() {
        let (class, text) = match face.placements {
            0 => ("face missing", "not seen yet".to_owned()),
            1 => ("face seen", format!("once, {:.1} s", face.seconds)),
            times => ("face seen", format!("{times} times, {:.1} s", face.seconds)),
        };
        let _ =
            write!(cards, "<li class=\"{class} f{}\"><b>{}</b><span>{text}</span></li>", i % 12, escape(&face.name));
    }
    let maps = format!("{}{}", map(faces, imu, 1.0, "z up"), map(faces, imu, -1.0, "z down"));
    super::section("Faces", &format!("<div class=\"faces\"><ul>{cards}</ul><div class=\"maps\">{maps}</div></div>"))
}

/// Half of the sphere of directions, seen along z, equal areas (Lambert): rings are faces, dots are rests.
fn map(faces: &[Face], imu: &Imu<'_>, side: f64, name: &str) -> String {
    const DOTS: usize = 600;
    let place = |v: &Vector3<f64>| {
        let r = 100.0 * (1.0 - v.z.abs()).max(0.0).sqrt();
        let flat = v.xy().try_normalize(1e-9).unwrap_or_default() * r;
        (flat.x, -flat.y)
    };
    let mut svg = String::from(
        "<circle class=\"rim\" r=\"100\"/><circle class=\"rim\" r=\"54.1\"/><path class=\"rim\" d=\"M-100 0H100M0 -100V100\"/>",
    );
    let tilt = 15_f64.to_radians().sin() * 70.0;
    for (i, face) in faces.iter().enumerate() {
        let Some(up) = face.normal.as_ref().map(vector).filter(|up| up.z * side > -1e-6) else { continue };
        let (x, y) = place(&up);
        let class = if face.placements > 0 { "ring seen" } else { "ring" };
        let _ = write!(
            svg,
            "<circle class=\"{class} f{}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{tilt:.1}\"/><text x=\"{:.1}\" y=\"{:.1}\">{}</text>",
            i % 12,
            x * 0.68,
            y * 0.68 + if x.hypot(y) < 1.0 { 30.0 } else { 4.0 },
            escape(&face.name)
        );
    }
    let step = imu.rests.len().div_ceil(DOTS).max(1);
    for rest in imu.rests.iter().step_by(step) {
        let Some(up) = rest.up.filter(|up| up.z * side > 0.0) else { continue };
        let (x, y) = place(&up);
        let tilt = rest.segment.tilt_deg.map(|tilt| format!(", tilt {tilt:.1}°")).unwrap_or_default();
        let _ = write!(
            svg,
            "<circle class=\"spot {}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.4\"><title>rest {}{tilt}</title></circle>",
            signal::class(rest),
            rest.number
        );
    }
    let label = format!("Directions of gravity with {name}");
    format!(
        "<figure class=\"map\"><svg viewBox=\"-122 -122 244 244\" role=\"img\" aria-label=\"{label}\">{svg}</svg><figcaption>{name}</figcaption></figure>"
    )
}
