//! The faces of the fixture: which were seen, for how long, and the direction of gravity during each rest.

use maud::{Markup, html};
use nalgebra::Vector3;

use super::elements;
use super::imu::{Imu, Rest};
use super::signal::class;
use crate::messages::Face;
use crate::report::vector;

pub(super) fn section(imu: &Imu<'_>) -> Option<Markup> {
    let faces = imu.findings.coverage.as_ref().map_or(&[][..], |coverage| &coverage.faces);
    if faces.is_empty() {
        return None;
    }
    let content = html! {
        div.faces {
            ul { @for (i, face) in faces.iter().enumerate() { (card(i, face)) } }
            div.maps { (map(faces, imu, 1.0, "z up")) (map(faces, imu, -1.0, "z down")) }
        }
    };
    Some(elements::section("Faces", content))
}

fn card(index: usize, face: &Face) -> Markup {
    let (class, text) = match face.placements {
        0 => ("missing", "not seen yet".to_owned()),
        1 => ("seen", format!("once, {:.1} s", face.seconds)),
        times => ("seen", format!("{times} times, {:.1} s", face.seconds)),
    };
    html! { li class={ "face " (class) " f" (index % 12) } { b { (face.name) } span { (text) } } }
}

/// Half of the sphere of directions, seen along z, equal areas (Lambert): rings are faces, dots are rests.
fn map(faces: &[Face], imu: &Imu<'_>, side: f64, name: &str) -> Markup {
    const DOTS: usize = 600;
    let rings = faces.iter().enumerate().filter_map(|(i, face)| {
        let up = face.normal.as_ref().map(vector).filter(|up| up.z * side > -1e-6)?;
        Some(ring(i, face, place(&up)))
    });
    let step = imu.rests.len().div_ceil(DOTS).max(1);
    let spots = imu.rests.iter().step_by(step).filter_map(|rest| {
        let up = rest.up.filter(|up| up.z * side > 0.0)?;
        Some(spot(rest, place(&up)))
    });
    html! {
        figure.map {
            svg viewBox="-122 -122 244 244" role="img" aria-label={ "Directions of gravity with " (name) } {
                circle.rim r="100" {}
                circle.rim r="54.1" {}
                path.rim d="M-100 0H100M0 -100V100" {}
                @for mark in rings.chain(spots) { (mark) }
            }
            figcaption { (name) }
        }
    }
}

/// Place of a direction on the map.
fn place(up: &Vector3<f64>) -> (f64, f64) {
    let r = 100.0 * (1.0 - up.z.abs()).max(0.0).sqrt();
    let flat = up.xy().try_normalize(1e-9).unwrap_or_default() * r;
    (flat.x, -flat.y)
}

fn ring(index: usize, face: &Face, (x, y): (f64, f64)) -> Markup {
    let tilt = 15_f64.to_radians().sin() * 70.0;
    let class = if face.placements > 0 { "ring seen" } else { "ring" };
    let below = if x.hypot(y) < 1.0 { 30.0 } else { 4.0 };
    let [cx, cy, r, x, y] = [x, y, tilt, x * 0.68, y * 0.68 + below].map(tenths);
    html! {
        circle class={ (class) " f" (index % 12) } cx=(cx) cy=(cy) r=(r) {}
        text x=(x) y=(y) { (face.name) }
    }
}

fn spot(rest: &Rest<'_>, (x, y): (f64, f64)) -> Markup {
    let tilt = rest.segment.tilt_deg.map(|tilt| format!(", tilt {tilt:.1}°")).unwrap_or_default();
    html! {
        circle class={ "spot " (class(rest)) } cx=(tenths(x)) cy=(tenths(y)) r="3.4" {
            title { "rest " (rest.number) (tilt) }
        }
    }
}

fn tenths(value: f64) -> String {
    format!("{value:.1}")
}
