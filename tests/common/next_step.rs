//! What an operator reads in a next step: the pose to show, and what is promised for it.
#![allow(dead_code)]

use nalgebra::Vector3;

/// Names of the faces of a cube, with the direction that points up.
pub const FACES: [(&str, [f64; 3]); 6] = [
    ("+X", [1.0, 0.0, 0.0]),
    ("-X", [-1.0, 0.0, 0.0]),
    ("+Y", [0.0, 1.0, 0.0]),
    ("-Y", [0.0, -1.0, 0.0]),
    ("+Z", [0.0, 0.0, 1.0]),
    ("-Z", [0.0, 0.0, -1.0]),
];

/// Direction that a next step asks to be up.
pub fn pose(next_step: &str) -> Option<Vector3<f64>> {
    let face = |text: &str| FACES.iter().find(|(name, _)| text.starts_with(name)).map(|(_, up)| Vector3::from(*up));
    let of = |text: &str| match text.strip_prefix("the edge between ").and_then(|edge| edge.split_once(" and ")) {
        Some((one, other)) => Some((face(one)? + face(other)?).normalize()),
        None => face(text),
    };
    let asked = [
        "and place ",
        "once more near ",
        "hold it for 3 s with ",
        "surface, with ",
        "poses, with ",
        "Turn the sensor so that ",
        "so that ",
    ];
    asked.into_iter().find_map(|words| of(next_step.split_once(words)?.1))
}

/// Number of poses, and the worst-case error that a next step promises after them, m/s².
pub fn promise(next_step: &str) -> Option<(usize, f64)> {
    let (_, behind) = next_step.split_once(" → ")?;
    let error = behind.split_once(" m/s²")?.0.parse().ok()?;
    let more =
        next_step.split_once("(and ").and_then(|(_, behind)| behind.split_once(" more")?.0.parse::<usize>().ok());
    Some((1 + more.unwrap_or(0), error))
}
