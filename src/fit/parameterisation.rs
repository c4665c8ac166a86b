//! Unknowns of a measurement model: the one description that every design matrix, bound and name follows from.
//!
//! A triad reads `measured = bias + S · own + C · other + q ∘ other²`: `own` is the quantity that it measures, `other`
//! that of the sensor beside it (angular rate for an accelerometer, specific force for a gyroscope); only a gyroscope
//! has q. Every model is linear in its unknowns.

use nalgebra::{DMatrix, DVector, Matrix3, Vector3};

use super::calibration::Calibration;

/// True quantities at a reading.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Truth {
    /// Own quantity, in the unit of the triad.
    pub own: Vector3<f64>,
    /// Other quantity, in the unit of the other sensor.
    pub other: Vector3<f64>,
}

impl Truth {
    /// Truth without the other quantity, as of an accelerometer at rest.
    pub fn of(own: Vector3<f64>) -> Self {
        Self { own, ..Self::default() }
    }
}

/// One parameter of a triad; the reading of an axis is the sum over its terms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Term {
    /// Bias of an axis, in the unit of the triad.
    Bias(usize),
    /// Entry of S, by row and column, dimensionless.
    Own(usize, usize),
    /// Entry of C, by row and column: sensitivity to the other quantity.
    Other(usize, usize),
    /// Sensitivity of an axis to the square of the other quantity along it.
    Square(usize),
}

impl Term {
    /// Axis whose reading the parameter is part of.
    pub fn axis(self) -> usize {
        match self {
            Self::Bias(axis) | Self::Own(axis, _) | Self::Other(axis, _) | Self::Square(axis) => axis,
        }
    }

    /// Name of the parameter in texts.
    pub fn name(self) -> String {
        let axis = |i: usize| ["x", "y", "z"].get(i).copied().unwrap_or("?");
        match self {
            Self::Bias(i) => format!("bias {}", axis(i)),
            Self::Own(row, column) => format!("sensitivity {}{}", axis(row), axis(column)),
            Self::Other(row, column) => format!("sensitivity of {} to the other sensor's {}", axis(row), axis(column)),
            Self::Square(i) => format!("g²-sensitivity {}", axis(i)),
        }
    }

    /// Regressor: the factor of the parameter in a reading.
    pub fn regressor(self, truth: &Truth) -> f64 {
        match self {
            Self::Bias(_) => 1.0,
            Self::Own(_, column) => truth.own[column],
            Self::Other(_, column) => truth.other[column],
            Self::Square(axis) => truth.other[axis] * truth.other[axis],
        }
    }
}

/// Free parameters of a measurement model, in the order of the parameter vector: biases, entries of S row by row,
/// entries of C row by row, squares. All other parameters are those of a perfect sensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Parameterisation(&'static [Term]);

use Term::{Bias, Other, Own, Square};

impl Parameterisation {
    /// Bias alone: three unknowns.
    pub const BIAS: Self = Self(&[Bias(0), Bias(1), Bias(2)]);
    /// Bias and diagonal S: six unknowns (the thesis' simplified model 2).
    pub const DIAGONAL: Self = Self(&[Bias(0), Bias(1), Bias(2), Own(0, 0), Own(1, 1), Own(2, 2)]);
    /// Bias and lower-triangular S, which fixes the frame to the sensor's own axes: nine unknowns.
    #[rustfmt::skip]
    pub const TRIANGULAR: Self = Self(&[
        Bias(0), Bias(1), Bias(2),
        Own(0, 0), Own(1, 0), Own(1, 1), Own(2, 0), Own(2, 1), Own(2, 2),
    ]);
    /// Bias and full S: twelve unknowns (an accelerometer in the thesis' simplified model 1).
    #[rustfmt::skip]
    pub const MATRIX: Self = Self(&[
        Bias(0), Bias(1), Bias(2),
        Own(0, 0), Own(0, 1), Own(0, 2), Own(1, 0), Own(1, 1), Own(1, 2), Own(2, 0), Own(2, 1), Own(2, 2),
    ]);
    /// Gyroscope at rest: bias, g-sensitivity and the square of specific force along each axis, fifteen unknowns (a
    /// gyroscope in the thesis' simplified model 1).
    #[rustfmt::skip]
    pub const GYROSCOPE_AT_REST: Self = Self(&[
        Bias(0), Bias(1), Bias(2),
        Other(0, 0), Other(0, 1), Other(0, 2), Other(1, 0), Other(1, 1), Other(1, 2), Other(2, 0), Other(2, 1), Other(2, 2),
        Square(0), Square(1), Square(2),
    ]);
    /// Accelerometer in the thesis' full model: 21 unknowns.
    #[rustfmt::skip]
    pub const FULL_ACCELEROMETER: Self = Self(&[
        Bias(0), Bias(1), Bias(2),
        Own(0, 0), Own(0, 1), Own(0, 2), Own(1, 0), Own(1, 1), Own(1, 2), Own(2, 0), Own(2, 1), Own(2, 2),
        Other(0, 0), Other(0, 1), Other(0, 2), Other(1, 0), Other(1, 1), Other(1, 2), Other(2, 0), Other(2, 1), Other(2, 2),
    ]);
    /// Gyroscope from the turns between rests: bias, full S and g-sensitivity, 21 unknowns.
    pub const GYROSCOPE_BY_TURNS: Self = Self::FULL_ACCELEROMETER;
    /// Gyroscope in the thesis' full model: 24 unknowns.
    #[rustfmt::skip]
    pub const FULL_GYROSCOPE: Self = Self(&[
        Bias(0), Bias(1), Bias(2),
        Own(0, 0), Own(0, 1), Own(0, 2), Own(1, 0), Own(1, 1), Own(1, 2), Own(2, 0), Own(2, 1), Own(2, 2),
        Other(0, 0), Other(0, 1), Other(0, 2), Other(1, 0), Other(1, 1), Other(1, 2), Other(2, 0), Other(2, 1), Other(2, 2),
        Square(0), Square(1), Square(2),
    ]);

    /// Name of an accelerometer's model in the configuration.
    pub fn name(self) -> &'static str {
        match self {
            Self::DIAGONAL => "bias-scale",
            Self::TRIANGULAR => "triangular",
            Self::MATRIX => "cross-axis",
            _ => "full",
        }
    }

    /// Free parameters in order.
    pub fn terms(self) -> &'static [Term] {
        self.0
    }

    /// Number of unknowns.
    pub fn unknowns(self) -> usize {
        self.0.len()
    }

    /// Whether a parameter is free.
    pub fn has(self, term: Term) -> bool {
        self.0.contains(&term)
    }

    /// Entries of S that the model leaves out: those off a diagonal S. A triangular S leaves none out, since the others
    /// only rotate the frame.
    pub fn unmodelled(self) -> impl Iterator<Item = Term> + Clone {
        let ignored = self == Self::DIAGONAL;
        (0..9).map(|k| Own(k / 3, k % 3)).filter(move |&term| ignored && !self.has(term))
    }

    /// Parameter vector of a calibration.
    pub fn vector(self, calibration: &Calibration) -> DVector<f64> {
        let value = |term: &Term| match *term {
            Bias(axis) => calibration.bias[axis],
            Own(row, column) => calibration.sensitivity[(row, column)],
            Other(..) | Square(_) => 0.0,
        };
        DVector::from_iterator(self.unknowns(), self.0.iter().map(value))
    }

    /// Bias and S of a parameter vector.
    pub fn calibration(self, parameters: &DVector<f64>) -> Calibration {
        let mut calibration = Calibration::default();
        for (&term, &value) in self.0.iter().zip(parameters) {
            match term {
                Bias(axis) => calibration.bias[axis] = value,
                Own(row, column) => calibration.sensitivity[(row, column)] = value,
                Other(..) | Square(_) => {}
            }
        }
        calibration
    }

    /// Sensitivity C to the other quantity; `None` if the model has none.
    pub fn cross(self, parameters: &DVector<f64>) -> Option<Matrix3<f64>> {
        let mut cross = None;
        for (&term, &value) in self.0.iter().zip(parameters) {
            if let Other(row, column) = term {
                cross.get_or_insert_with(Matrix3::zeros)[(row, column)] = value;
            }
        }
        cross
    }

    /// Sensitivity of each axis to the square of the other quantity along it; `None` if the model has none.
    pub fn squares(self, parameters: &DVector<f64>) -> Option<Vector3<f64>> {
        let mut squares = None;
        for (&term, &value) in self.0.iter().zip(parameters) {
            if let Square(axis) = term {
                squares.get_or_insert_with(Vector3::zeros)[axis] = value;
            }
        }
        squares
    }

    /// Jacobian ∂measured/∂parameters at a truth: 3 × unknowns.
    pub fn jacobian(self, truth: &Truth) -> DMatrix<f64> {
        let mut jacobian = DMatrix::zeros(3, self.unknowns());
        for (k, term) in self.0.iter().enumerate() {
            jacobian[(term.axis(), k)] = term.regressor(truth);
        }
        jacobian
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Parameterisation; 7] = [
        Parameterisation::BIAS,
        Parameterisation::DIAGONAL,
        Parameterisation::TRIANGULAR,
        Parameterisation::MATRIX,
        Parameterisation::GYROSCOPE_AT_REST,
        Parameterisation::FULL_ACCELEROMETER,
        Parameterisation::FULL_GYROSCOPE,
    ];

    #[test]
    fn the_models_have_the_unknowns_that_the_thesis_counts() {
        assert_eq!(ALL.map(Parameterisation::unknowns), [3, 6, 9, 12, 15, 21, 24]);
    }

    #[test]
    fn parameters_stand_in_the_documented_order() {
        let rank = |term: &Term| match *term {
            Bias(axis) => axis,
            Own(row, column) => 3 + 3 * row + column,
            Other(row, column) => 12 + 3 * row + column,
            Square(axis) => 21 + axis,
        };
        for shape in ALL {
            assert!(shape.terms().windows(2).all(|pair| rank(&pair[0]) < rank(&pair[1])), "{shape:?}");
        }
    }

    #[test]
    fn a_calibration_comes_back_from_its_vector() {
        let mut calibration = Calibration { bias: Vector3::new(1.0, 2.0, 3.0), ..Calibration::default() };
        calibration.sensitivity[(1, 0)] = 0.1;
        let shape = Parameterisation::TRIANGULAR;
        assert_eq!(shape.calibration(&shape.vector(&calibration)), calibration);
        let truth = Truth::of(Vector3::new(4.0, 5.0, 6.0));
        let linear = shape.jacobian(&truth) * shape.vector(&calibration);
        assert!((linear - calibration.measure(&truth.own)).amax() < 1e-12);
    }
}
