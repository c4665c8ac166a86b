//! Fixture: the nominal directions of gravity in the sensor frame.

use nalgebra::{Rotation3, Vector3};
use serde::{Deserialize, Serialize};

use super::config::{FixtureConfig, Solid};

/// Face of a fixture: the direction of true specific force while the IMU rests on it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Face {
    /// Name of the face: `+X` means that the +X axis points up.
    pub name: String,
    /// Unit vector in the sensor frame.
    pub normal: Vector3<f64>,
}

/// List of faces.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fixture {
    faces: Vec<Face>,
}

impl Fixture {
    /// Returns the six face normals of a cube.
    pub fn cube() -> Self {
        Self { faces: axes().map(|(name, normal)| Face { name, normal }).collect() }
    }

    /// Returns the twelve face normals of a dodecahedron. Each is named after its nearest axis and the one it leans to:
    /// `+Z+Y` is above +Z on the side of +Y.
    pub fn dodecahedron() -> Self {
        let golden = (1.0 + 5_f64.sqrt()) / 2.0;
        let faces = axes().flat_map(|(name, main)| {
            // X leans to Z, Y to X, Z to Y.
            let aside = Vector3::new(main.y.abs(), main.z.abs(), main.x.abs());
            [("+", 1.0), ("-", -1.0)].map(|(sign, side)| {
                let axis = ["X", "Y", "Z"][aside.imax()];
                Face { name: format!("{name}{sign}{axis}"), normal: (main * golden + aside * side).normalize() }
            })
        });
        Self { faces: faces.collect() }
    }

    /// Builds the configured fixture: a solid or a list of faces, rotated by the mounting of the sensor.
    pub fn new(config: &FixtureConfig) -> Self {
        let fixture = match config.solid {
            _ if !config.faces.is_empty() => {
                let face = |face: &super::config::FaceConfig| {
                    let normal = Vector3::from(face.up).try_normalize(0.0)?;
                    Some(Face { name: face.name.clone(), normal })
                };
                Self { faces: config.faces.iter().filter_map(face).collect() }
            }
            Solid::Cube => Self::cube(),
            Solid::Dodecahedron => Self::dodecahedron(),
        };
        let mounting = Rotation3::from_scaled_axis(Vector3::from(config.mounting_deg).map(f64::to_radians));
        if mounting.angle() == 0.0 {
            return fixture;
        }
        let turned = |face: Face| Face { normal: mounting.inverse() * face.normal, ..face };
        Self { faces: fixture.faces.into_iter().map(turned).collect() }
    }

    /// Faces, in the order in which coverage lists them.
    pub fn faces(&self) -> &[Face] {
        &self.faces
    }

    /// Poses that a person can hold it in, with their names: the faces, then the edges between neighbouring faces.
    pub fn poses(&self) -> Vec<(String, Vector3<f64>)> {
        /// Cosine of the least angle between faces that share no edge.
        const APART: f64 = -0.1;
        let faces = self.faces.iter().map(|face| (face.name.clone(), face.normal));
        let edges = self.faces.iter().enumerate().flat_map(|(i, one)| {
            let neighbours = self.faces[i + 1..].iter().filter(|other| other.normal.dot(&one.normal) > APART);
            neighbours.filter_map(|other| {
                let up = (one.normal + other.normal).try_normalize(f64::MIN_POSITIVE)?;
                Some((format!("the edge between {} and {}", one.name, other.name), up))
            })
        });
        faces.chain(edges).collect()
    }

    /// Face nearest to a true specific force, and the angle to it in degrees. `None` for a zero vector.
    pub fn nearest(&self, specific_force: &Vector3<f64>) -> Option<(usize, f64)> {
        let up = specific_force.try_normalize(1e-9)?;
        let (index, face) =
            self.faces.iter().enumerate().max_by(|(_, a), (_, b)| up.dot(&a.normal).total_cmp(&up.dot(&b.normal)))?;
        // Unlike acos, atan2 keeps its precision at small angles.
        let tilt = libm::atan2(up.cross(&face.normal).norm(), up.dot(&face.normal));
        Some((index, tilt.to_degrees()))
    }
}

/// Axes of the sensor in both directions, with their names.
fn axes() -> impl Iterator<Item = (String, Vector3<f64>)> {
    [("X", Vector3::x()), ("Y", Vector3::y()), ("Z", Vector3::z())]
        .into_iter()
        .flat_map(|(name, axis)| [(format!("+{name}"), axis), (format!("-{name}"), -axis)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::config::FaceConfig;

    #[test]
    fn the_nearest_face_and_its_tilt_are_found() {
        for fixture in [Fixture::cube(), Fixture::dodecahedron()] {
            for (i, face) in fixture.faces().iter().enumerate() {
                let axis = Vector3::new(0.1, 0.6, 0.8).cross(&face.normal).normalize();
                let tilted = Rotation3::from_scaled_axis(axis * 20_f64.to_radians()) * face.normal * 9.8;
                let (index, tilt) = fixture.nearest(&tilted).unwrap();
                assert_eq!(index, i);
                assert!((tilt - 20.0).abs() < 1e-9);
            }
            assert_eq!(fixture.nearest(&Vector3::zeros()), None);
        }
    }

    #[test]
    fn the_faces_of_a_dodecahedron_are_as_far_apart_as_its_dihedral_angle_says() {
        let faces = Fixture::dodecahedron().faces().to_vec();
        assert_eq!(faces.len(), 12);
        for face in &faces {
            let mut cosines: Vec<_> = faces.iter().map(|other| face.normal.dot(&other.normal)).collect();
            cosines.sort_by(f64::total_cmp);
            // Itself, five neighbours at 63.4°, their five opposites, its opposite.
            let neighbour = 1.0 / 5_f64.sqrt();
            let expected = [[-1.0].as_slice(), &[-neighbour; 5], &[neighbour; 5], &[1.0]].concat();
            assert!(cosines.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-12));
        }
        let mut names: Vec<_> = faces.iter().map(|face| face.name.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), 12);
    }

    #[test]
    fn a_mounting_rotation_turns_the_faces_into_the_frame_of_the_sensor() {
        // The sensor is turned by 90° about z: its x axis lies along the fixture's y axis.
        let turned = Fixture::new(&FixtureConfig { mounting_deg: [0.0, 0.0, 90.0], ..FixtureConfig::default() });
        let face = turned.faces().iter().find(|face| face.name == "+Y").unwrap();
        assert!((face.normal - Vector3::x()).norm() < 1e-15);
    }

    #[test]
    fn a_solid_has_as_many_poses_as_faces_and_edges() {
        assert_eq!(Fixture::cube().poses().len(), 6 + 12);
        assert_eq!(Fixture::dodecahedron().poses().len(), 12 + 30);
        assert!(Fixture::cube().poses().iter().any(|(name, _)| name == "the edge between +X and -Z"));
    }

    #[test]
    fn a_list_of_faces_replaces_the_solid() {
        let face = |name: &str, up| FaceConfig { name: name.to_owned(), up };
        let faces = vec![face("lid", [0.0, 0.0, 2.0]), face("floor", [0.0, 0.0, -1.0])];
        let fixture = Fixture::new(&FixtureConfig { faces, ..FixtureConfig::default() });
        assert_eq!(fixture.faces()[0], Face { name: "lid".to_owned(), normal: Vector3::z() });
        assert_eq!(fixture.faces().len(), 2);
    }
}
