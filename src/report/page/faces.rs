//! The faces of the fixture: which were seen, for how long, and the direction of gravity during each rest.

use maud::{Markup, html};
use nalgebra::Vector3;

use super::elements;
use super::imu::{Imu, Rest};
use super::signal::class;
use crate::messages::Face;
use crate::report::vector;

pub(super) fn section(imu: &Imu<'_>) -> Option<Markup> {
    let coverage = imu.findings.coverage.as_ref().filter(|coverage| !coverage.faces.is_empty())?;
    let faces = &coverage.faces[..];
    let content = html! {
        div.faces {
            ul { @for (i, face) in faces.iter().enumerate() { (card(i, face, coverage.complete)) } }
            div.maps { (map(faces, imu, 1.0, "z up")) (map(faces, imu, -1.0, "z down")) }
        }
    };
    Some(elements::section("Faces", content))
}

/// A face; one that was not seen is not asked for either once the coverage is complete, as where poses are spread.
fn card(index: usize, face: &Face, complete: bool) -> Markup {
    let (class, text) = match face.placements {
        0 if complete => ("missing", "not needed".to_owned()),
        0 => ("missing", "not seen yet".to_owned()),
        1 => ("seen", format!("once, {:.1} s", face.seconds)),
        times => ("seen", format!("{times} times, {:.1} s", face.seconds)),
    };
    html! { li class={ "face " (class) " f" (index % 12) } { b { (face.name) } span { (text) } } }
}

/// Half of the sphere of directions, seen along z, equal areas (Lambert): rings are faces, dots are rests.
fn map(faces: &[Face], imu: &Imu<'_>, side: f64, name: &str) -> Markup {
    const DOTS: usize = 600;
    let centred = faces.iter().enumerate().filter_map(|(i, face)| {
        let up = face.normal.as_ref().map(vector).filter(|up| up.z * side > -1e-6)?;
        Some((i, face, place(&up)))
    });
    let centred: Vec<_> = centred.collect();
    let step = imu.rests.len().div_ceil(DOTS).max(1);
    let dots = imu.rests.iter().step_by(step).filter_map(|rest| {
        let up = rest.up.filter(|up| up.z * side > 0.0)?;
        Some((rest, place(&up)))
    });
    let dots: Vec<_> = dots.collect();
    // Names stand where they cover no dot and no other name, as far as there is such a place.
    let mut taken: Vec<(f64, f64)> = dots.iter().map(|(_, place)| *place).collect();
    let names: Vec<_> = centred
        .iter()
        .map(|(_, face, centre)| {
            let place = beside(*centre, &taken);
            // As wide as two dots, which another name is to keep from.
            taken.extend([-HALF.0, 0.0, HALF.0].map(|x| (place.0 + x, place.1)));
            (face.name.as_str(), place)
        })
        .collect();
    html! {
        figure.map {
            svg viewBox="-154 -154 308 308" role="img" aria-label={ "Directions of gravity with " (name) } {
                circle.rim r="100" {}
                circle.rim r="54.1" {}
                path.rim d="M-100 0H100M0 -100V100" {}
                @for (i, face, place) in &centred { (ring(*i, face, *place)) }
                @for (name, (x, y)) in &names { text x=(tenths(*x)) y=(tenths(*y + 7.0)) { (name) } }
                @for (rest, place) in &dots { (spot(rest, *place)) }
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

/// Radius of a ring: the largest tilt, about.
const RING: f64 = 18.1;
/// Half of the width and of the height of a name, and of what no dot may stand in for its sake.
const NAME: (f64, f64) = (17.0, 11.0);
const HALF: (f64, f64) = (20.0, 14.0);
/// Half of the map's width.
const EDGE: f64 = 154.0;

/// Middle of a name beside a ring, where it covers the fewest of these places; outwards if that is as good as others.
fn beside((x, y): (f64, f64), taken: &[(f64, f64)]) -> (f64, f64) {
    let outwards = if x.hypot(y) < 1.0 { std::f64::consts::FRAC_PI_2 } else { libm::atan2(y, x) };
    let places = (0..8).map(|eighth| {
        // Outwards, then to both sides of that in turn.
        let turn = f64::from((eighth + 1) / 2) * std::f64::consts::FRAC_PI_4 * if eighth % 2 == 0 { 1.0 } else { -1.0 };
        let (sin, cos) = libm::sincos(outwards + turn);
        let far = RING + NAME.0 * cos.abs() + NAME.1 * sin.abs();
        (x + cos * far, y + sin * far)
    });
    let covers = |place: &(f64, f64)| {
        taken.iter().filter(|dot| (dot.0 - place.0).abs() < HALF.0 && (dot.1 - place.1).abs() < HALF.1).count()
    };
    let is_inside = |place: &(f64, f64)| place.0.abs() <= EDGE - NAME.0 && place.1.abs() <= EDGE - NAME.1;
    places.filter(is_inside).min_by_key(covers).unwrap_or((x, y))
}

fn ring(index: usize, face: &Face, (x, y): (f64, f64)) -> Markup {
    let class = if face.placements > 0 { "ring seen" } else { "ring" };
    html! { circle class={ (class) " f" (index % 12) } cx=(tenths(x)) cy=(tenths(y)) r=(tenths(RING)) {} }
}

fn spot(rest: &Rest<'_>, (x, y): (f64, f64)) -> Markup {
    let tilt = rest.segment.tilt_deg.map(|tilt| format!(", tilt {tilt:.1}°")).unwrap_or_default();
    html! {
        circle class={ "spot " (class(rest)) } cx=(tenths(x)) cy=(tenths(y)) r="4" {
            title { "rest " (rest.number) (tilt) }
        }
    }
}

fn tenths(value: f64) -> String {
    format!("{value:.1}")
}
