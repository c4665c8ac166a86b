//! Attitudes of the sensor in a world whose z axis points up. `trajectory` moves from one to the next.
//!
//! An attitude rotates the sensor's frame into the world. Angles go through `libm`, for the same bytes on every
//! machine.

use nalgebra::{Quaternion, Unit, UnitQuaternion, Vector3};

use super::Pose;

pub(super) type Attitude = UnitQuaternion<f64>;

/// The six faces of a cube, by the axis that points up.
const FACES: [(&str, [f64; 3]); 6] = [
    ("+X", [1.0, 0.0, 0.0]),
    ("-X", [-1.0, 0.0, 0.0]),
    ("+Y", [0.0, 1.0, 0.0]),
    ("-Y", [0.0, -1.0, 0.0]),
    ("+Z", [0.0, 0.0, 1.0]),
    ("-Z", [0.0, 0.0, -1.0]),
];

/// Attitude of a pose, further tilted by `scatter`: the components of a small rotation about two horizontal axes, in
/// radians. `None` if the pose does not define an attitude.
pub(super) fn attitude(pose: &Pose, scatter: [f64; 2]) -> Option<Attitude> {
    let lying = match (&pose.face, pose.up, pose.attitude) {
        (Some(face), None, None) => between(&face_normal(face)?, &Vector3::z_axis()),
        (None, Some(up), None) => between(&Unit::try_new(Vector3::from(up), 1e-9)?, &Vector3::z_axis()),
        (None, None, Some([w, x, y, z])) => Unit::try_new(Quaternion::new(w, x, y, z), 1e-9)?,
        _ => return None,
    };
    let up = up(&lying);
    let azimuth = pose.azimuth_deg.to_radians();
    let tilt = pose.tilt_deg.to_radians();
    let [along, across] = [tilt * libm::cos(azimuth) + scatter[0], tilt * libm::sin(azimuth) + scatter[1]];
    let tilted = between(&tip(&up, along, across), &up);
    Some(rotation(&Vector3::z_axis(), pose.heading_deg.to_radians()) * lying * tilted)
}

/// Direction in the sensor's frame that points up. A perfect accelerometer at rest reads g times this.
pub(super) fn up(attitude: &Attitude) -> Unit<Vector3<f64>> {
    Unit::new_normalize(attitude.inverse_transform_vector(&Vector3::z()))
}

/// Face of a cube nearest to a direction, and the angle between them in degrees.
pub(super) fn nearest_face(up: &Unit<Vector3<f64>>) -> (&'static str, f64) {
    let axis = up.iamax();
    let (name, normal) = FACES[2 * axis + usize::from(up[axis] < 0.0)];
    let normal = Vector3::from(normal);
    (name, libm::atan2(normal.cross(up).norm(), normal.dot(up)).to_degrees())
}

/// Rotation by an angle in radians about an axis.
pub(super) fn rotation(axis: &Unit<Vector3<f64>>, angle: f64) -> Attitude {
    let (sin, cos) = libm::sincos(angle / 2.0);
    Unit::new_normalize(Quaternion::from_parts(cos, axis.into_inner() * sin))
}

/// Axis and angle (0 to π) of a rotation; the x axis if there is no rotation.
pub(super) fn axis_angle(rotation: &Attitude) -> (Unit<Vector3<f64>>, f64) {
    let short = if rotation.w < 0.0 { -rotation.into_inner() } else { rotation.into_inner() };
    let imaginary = short.imag();
    let angle = 2.0 * libm::atan2(imaginary.norm(), short.w);
    (Unit::try_new(imaginary, 1e-12).unwrap_or_else(Vector3::x_axis), angle)
}

/// Normal of a face of a cube.
fn face_normal(face: &str) -> Option<Unit<Vector3<f64>>> {
    FACES.iter().find(|(name, _)| *name == face).map(|(_, normal)| Unit::new_unchecked(Vector3::from(*normal)))
}

/// Shortest rotation that takes one direction to another.
fn between(from: &Unit<Vector3<f64>>, to: &Unit<Vector3<f64>>) -> Attitude {
    let w = 1.0 + from.dot(to);
    if w < 1e-12 {
        // Opposite directions: half a turn about any horizontal axis.
        let (axis, _) = horizontal(from);
        return Unit::new_unchecked(Quaternion::from_parts(0.0, axis));
    }
    Unit::new_normalize(Quaternion::from_parts(w, from.cross(to)))
}

/// Direction tipped by the angles `along` towards the first and `across` towards the second horizontal axis, in
/// radians.
fn tip(up: &Unit<Vector3<f64>>, along: f64, across: f64) -> Unit<Vector3<f64>> {
    let (first, second) = horizontal(up);
    let tilt = libm::hypot(along, across);
    if tilt == 0.0 {
        return *up;
    }
    let towards = (first * along + second * across) / tilt;
    let (sin, cos) = libm::sincos(tilt);
    Unit::new_normalize(up.into_inner() * cos + towards * sin)
}

/// Two directions that are horizontal while `up` points up. The first points towards the axis after the one nearest to
/// `up`.
fn horizontal(up: &Unit<Vector3<f64>>) -> (Vector3<f64>, Vector3<f64>) {
    let mut next = Vector3::zeros();
    next[(up.iamax() + 1) % 3] = 1.0;
    let first = (next - up.into_inner() * up.dot(&next)).normalize();
    (first, up.cross(&first))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn face(name: &str) -> Pose {
        Pose { face: Some(name.to_owned()), ..Pose::default() }
    }

    #[test]
    fn a_face_points_its_axis_up() {
        for (name, normal) in FACES {
            let attitude = attitude(&face(name), [0.0; 2]).unwrap();
            assert!((up(&attitude).into_inner() - Vector3::from(normal)).norm() < 1e-15, "{name}");
            assert_eq!(nearest_face(&up(&attitude)).0, name);
        }
    }

    #[test]
    fn a_tilt_goes_where_its_azimuth_says() {
        let pose = Pose { tilt_deg: 30.0, azimuth_deg: 90.0, heading_deg: 77.0, ..face("+X") };
        let up = up(&attitude(&pose, [0.0; 2]).unwrap());
        let (sin, cos) = libm::sincos(30_f64.to_radians());
        assert!((up.into_inner() - Vector3::new(cos, 0.0, sin)).norm() < 1e-15);
        let (name, tilt) = nearest_face(&up);
        assert_eq!(name, "+X");
        assert!((tilt - 30.0).abs() < 1e-12);
    }

    #[test]
    fn axis_and_angle_make_the_rotation_again() {
        let axis = Unit::new_normalize(Vector3::new(1.0, -2.0, 0.5));
        for angle in [1e-9, 0.1, 1.0, 3.0, std::f64::consts::PI] {
            let (found, turned) = axis_angle(&rotation(&axis, angle));
            assert!((turned - angle).abs() < 1e-14 && (found.into_inner() - axis.into_inner()).norm() < 1e-7);
        }
    }
}
