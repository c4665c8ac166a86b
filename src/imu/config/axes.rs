//! Axes of a vector, where they are not those of the sensor's frame.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Axes of a vector in a message that are the sensor's x, y and z, each with its sign.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "[String; 3]", try_from = "[String; 3]")]
pub struct AxesConfig([(usize, bool); 3]);

/// Error of axes that are none.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "axes are \"x\", \"y\" and \"z\" in any order, each once, with a minus where it is flipped: [\"y\", \"x\", \"-z\"]"
)]
pub struct AxesError;

const NAMES: [&str; 3] = ["x", "y", "z"];

impl Default for AxesConfig {
    fn default() -> Self {
        Self([(0, false), (1, false), (2, false)])
    }
}

impl AxesConfig {
    /// Vector in the sensor's axes, of one in the message's.
    pub fn apply(self, read: &Vector3<f64>) -> Vector3<f64> {
        Vector3::from(self.0.map(|(from, flipped)| if flipped { -read[from] } else { read[from] }))
    }

    /// Vector in the message's axes, of one in the sensor's.
    pub fn undo(self, value: &Vector3<f64>) -> Vector3<f64> {
        let mut read = Vector3::zeros();
        for ((from, flipped), value) in self.0.into_iter().zip(value) {
            read[from] = if flipped { -value } else { *value };
        }
        read
    }

    /// Order of what the message has for x, y and z.
    pub(in crate::imu) fn in_order<T: Clone>(self, of_message: &[T; 3]) -> [T; 3] {
        self.0.map(|(from, _)| of_message[from].clone())
    }
}

impl TryFrom<[String; 3]> for AxesConfig {
    type Error = AxesError;

    fn try_from(names: [String; 3]) -> Result<Self, AxesError> {
        let mut axes = [(0, false); 3];
        for (axis, text) in axes.iter_mut().zip(&names) {
            let name = text.strip_prefix(['-', '−']);
            let from = NAMES.iter().position(|known| *known == name.unwrap_or(text)).ok_or(AxesError)?;
            *axis = (from, name.is_some());
        }
        let each_once = (0..3).all(|from| axes.iter().any(|axis| axis.0 == from));
        each_once.then_some(Self(axes)).ok_or(AxesError)
    }
}

impl From<AxesConfig> for [String; 3] {
    fn from(axes: AxesConfig) -> Self {
        axes.0.map(|(from, flipped)| format!("{}{}", if flipped { "-" } else { "" }, NAMES[from]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axes(names: [&str; 3]) -> Result<AxesConfig, AxesError> {
        names.map(str::to_owned).try_into()
    }

    #[test]
    fn axes_are_taken_in_their_order_and_put_back() {
        let turned = axes(["y", "-x", "z"]).unwrap();
        let read = Vector3::new(1.0, 2.0, 3.0);
        assert_eq!(turned.apply(&read), Vector3::new(2.0, -1.0, 3.0));
        assert_eq!(turned.undo(&turned.apply(&read)), read);
        assert_eq!(<[String; 3]>::from(turned), ["y", "-x", "z"]);
        assert_eq!(AxesConfig::default().apply(&read), read);
    }

    #[test]
    fn axes_that_are_none_or_met_twice_are_refused() {
        for names in [["x", "x", "z"], ["x", "y", "w"], ["x", "y", "--z"], ["x", "y", ""]] {
            assert_eq!(axes(names), Err(AxesError), "{names:?}");
        }
    }
}
