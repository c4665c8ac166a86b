//! Figures of a sensor's datasheet.

/// Standard gravity, m/s² (CGPM 1901): the unit of datasheets.
pub(super) const G: f64 = 9.80665;

/// Datasheet of a sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Datasheet {
    /// Name of the sensor in the configuration.
    pub name: &'static str,
    /// Document, revision and tables.
    pub source: &'static str,
    /// Figures of the accelerometer.
    pub accelerometer: TriadDatasheet,
    /// Figures of the gyroscope; `None` if there is none, or no figure is available.
    pub gyroscope: Option<TriadDatasheet>,
}

/// Datasheet figures of one triad, in m/s² or rad/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriadDatasheet {
    /// Largest reading of its widest range.
    pub range: f64,
    /// Step of the converter in that range.
    pub step: f64,
    /// Standard deviation of an axis at the bandwidth for which the datasheet states it, or else at the widest.
    pub noise: Option<f64>,
    /// Largest bias of an axis.
    pub bias: Option<f64>,
    /// Smallest and largest scale of an axis.
    pub scale: Option<[f64; 2]>,
    /// Repeatability of the mean of a rest from placement to placement, one standard deviation.
    pub placement: Option<f64>,
    /// Cross-axis sensitivity, as a fraction.
    pub cross_axis: Option<f64>,
    /// Nonlinearity: deviation from a straight line, as a fraction of full scale.
    pub nonlinearity: Option<f64>,
}

impl TriadDatasheet {
    /// Quadratic error at 1 g, m/s², if all of the nonlinearity is quadratic. The range that the sensor is set to is
    /// unknown, so the geometric mean of its ranges is assumed: 5.7 g for 2 g to 16 g.
    pub fn squared_at_one_g(&self) -> Option<f64> {
        /// Ratio of the widest range to the geometric mean: √8.
        const MIDDLE: f64 = 2.828;
        self.nonlinearity.map(|share| share * G * G / (self.range / MIDDLE))
    }
}
