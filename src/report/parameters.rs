//! Parameter files of autopilots: names and values, whichever program wrote them. The formats interpret them.

use std::collections::BTreeMap;

/// The parameters of an autopilot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Parameters(BTreeMap<String, f64>);

impl Parameters {
    /// Parses files of QGroundControl (vehicle, component, name, value, type), Mission Planner (`NAME,VALUE`) and
    /// MAVProxy (`NAME VALUE`). `None` if the text is none of these.
    pub fn parse(text: &str) -> Option<Self> {
        let mut parameters = BTreeMap::new();
        for line in text.lines() {
            let line = line.split('#').next().unwrap_or_default();
            let fields: Vec<_> = line.split([',', '\t', ' ']).filter(|field| !field.is_empty()).collect();
            let (name, value) = match fields.as_slice() {
                [] => continue,
                [name, value] | [_, _, name, value, _] => (name, value),
                _ => return None,
            };
            let is_name = |c: char| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_';
            if !name.starts_with(|c: char| c.is_ascii_uppercase()) || !name.chars().all(is_name) {
                return None;
            }
            parameters.insert((*name).to_owned(), value.parse().ok().filter(|value: &f64| value.is_finite())?);
        }
        (!parameters.is_empty()).then_some(Self(parameters))
    }

    /// Value of a parameter.
    pub fn get(&self, name: &str) -> Option<f64> {
        self.0.get(name).copied()
    }

    /// Three parameters whose names differ in the axis, which replaces the `*`; `None` unless all exist.
    pub(super) fn vector(&self, pattern: &str) -> Option<[f64; 3]> {
        let axis = |axis| self.get(&pattern.replace('*', axis));
        Some([axis("X")?, axis("Y")?, axis("Z")?])
    }
}

/// Value as stored in a 32-bit parameter.
pub(super) fn rounded(value: f64) -> f32 {
    value as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_files_of_three_ground_stations_are_read() {
        let qgroundcontrol =
            "# Onboard parameters for Vehicle 1\n#\n1\t1\tCAL_ACC0_XOFF\t0.25\t9\n1\t1\tCAL_ACC0_ID\t7\t6\n";
        let read = Parameters::parse(qgroundcontrol).unwrap();
        assert_eq!((read.get("CAL_ACC0_XOFF"), read.get("CAL_ACC0_ID")), (Some(0.25), Some(7.0)));
        for text in ["INS_ACCOFFS_X,0.5\nINS_ACCOFFS_Y,-1 # kept\r\n", "INS_ACCOFFS_X   0.5\nINS_ACCOFFS_Y -1\n"] {
            let read = Parameters::parse(text).unwrap();
            assert_eq!((read.get("INS_ACCOFFS_X"), read.get("INS_ACCOFFS_Y")), (Some(0.5), Some(-1.0)));
            assert_eq!(read.vector("INS_ACCOFFS_*"), None, "z is missing");
        }
    }

    #[test]
    fn what_is_no_parameter_file_is_told() {
        for text in ["", "# nothing", "SM: [1, 2]", "imu0:\n  model: x", "A b c", "NAME,nan", "NAME,x", "name,1"] {
            assert_eq!(Parameters::parse(text), None, "{text}");
        }
    }
}
