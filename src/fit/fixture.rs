//! The directions that gravity is meant to take in the sensor frame. Which rests are good is left to the caller.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// One direction of a fixture: the direction of true specific force while the IMU rests on it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Face {
    /// What people call it: `+X` means that the +X axis points up.
    pub name: String,
    /// Unit vector in the sensor frame.
    pub normal: Vector3<f64>,
}

/// A list of faces.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fixture {
    faces: Vec<Face>,
}

impl Fixture {
    /// The six face normals of a cube.
    pub fn cube() -> Self {
        let face = |name: &str, normal| Face { name: name.to_owned(), normal };
        Self {
            faces: vec![
                face("+X", Vector3::x()),
                face("-X", -Vector3::x()),
                face("+Y", Vector3::y()),
                face("-Y", -Vector3::y()),
                face("+Z", Vector3::z()),
                face("-Z", -Vector3::z()),
            ],
        }
    }

    /// The faces, in the order in which coverage lists them.
    pub fn faces(&self) -> &[Face] {
        &self.faces
    }

    /// The face nearest to a true specific force, and the angle to it in degrees. `None` for a zero vector.
    pub fn nearest(&self, specific_force: &Vector3<f64>) -> Option<(usize, f64)> {
        let up = specific_force.try_normalize(1e-9)?;
        let (index, face) =
            self.faces.iter().enumerate().max_by(|(_, a), (_, b)| up.dot(&a.normal).total_cmp(&up.dot(&b.normal)))?;
        // atan2 keeps its precision where the angle is small, which acos does not.
        let tilt = libm::atan2(up.cross(&face.normal).norm(), up.dot(&face.normal));
        Some((index, tilt.to_degrees()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_face_and_its_tilt_are_found() {
        let cube = Fixture::cube();
        for (i, face) in cube.faces().iter().enumerate() {
            let axis = Vector3::new(0.0, 0.6, 0.8).cross(&face.normal).normalize();
            let tilted = nalgebra::Rotation3::from_scaled_axis(axis * 20_f64.to_radians()) * face.normal * 9.8;
            let (index, tilt) = cube.nearest(&tilted).unwrap();
            assert_eq!(index, i);
            assert!((tilt - 20.0).abs() < 1e-9);
        }
        assert_eq!(cube.nearest(&Vector3::zeros()), None);
    }
}
