//! One IMU's timeline with the data that several sections need.

use nalgebra::Vector3;

use crate::Stamp;
use crate::fit::Calibration;
use crate::fit::temperature::BiasCourse;
use crate::messages::{Segment, Triad};
use crate::report::{Findings, Timeline, calibration, nanos, vector};

/// One IMU's timeline, and its rests on the clock of the page.
pub(super) struct Imu<'a> {
    pub(super) timeline: &'a Timeline,
    pub(super) findings: &'a Findings,
    /// Start of its clock, and its duration in seconds.
    pub(super) origin: Stamp,
    pub(super) seconds: f64,
    pub(super) rests: Vec<Rest<'a>>,
}

/// A rest as the sections need it.
pub(super) struct Rest<'a> {
    pub(super) segment: &'a Segment,
    /// Number, counted from 1.
    pub(super) number: usize,
    /// Seconds since the origin.
    pub(super) from: f64,
    pub(super) until: f64,
    /// Index of its face in the coverage.
    pub(super) face: Option<usize>,
    /// Residual of the primary accelerometer.
    pub(super) residual: Residual,
    /// Direction of the mean reading, corrected if possible.
    pub(super) up: Option<Vector3<f64>>,
}

/// Error of a sensor's mean reading during a rest: ‖a‖ − g of an accelerometer, m/s², ‖ω‖ of a gyroscope, rad/s.
#[derive(Clone, Copy, Default)]
pub(super) struct Residual {
    /// Before correction.
    pub(super) raw: Option<f64>,
    /// After correction, if the sensor is calibrated.
    pub(super) corrected: Option<f64>,
}

impl<'a> Imu<'a> {
    pub(super) fn new(timeline: &'a Timeline) -> Self {
        let findings = &timeline.findings;
        let first = findings.rests.keys().next().map(|&nanos| Stamp::from_nanos(nanos));
        let (origin, end) = timeline.span().unwrap_or_else(|| {
            let last = findings.rests.values().map(|rest| nanos(&rest.end)).max().unwrap_or_default();
            (first.unwrap_or_default(), Stamp::from_nanos(last))
        });
        let accelerometer = findings.calibration.as_ref().and_then(|found| found.accelerometer.as_ref());
        let known = accelerometer.and_then(Known::of);
        let faces = findings.coverage.as_ref().map_or(&[][..], |coverage| &coverage.faces);
        let rest = |(i, segment): (usize, &'a Segment)| {
            let at = |stamp| Stamp::from_nanos(nanos(stamp)).seconds_since(origin);
            let (mean, corrected) = mean(segment, "accelerometer", known.as_ref());
            Rest {
                segment,
                number: i + 1,
                from: at(&segment.start),
                until: at(&segment.end),
                face: faces.iter().position(|face| face.name == segment.face),
                residual: residual(findings, mean, corrected),
                up: corrected.or(mean).and_then(|value| value.try_normalize(1e-9)),
            }
        };
        let rests = findings.rests.values().enumerate().map(rest).collect();
        Self { timeline, findings, origin, seconds: end.seconds_since(origin).max(1e-3), rests }
    }

    pub(super) fn accelerometer(&self) -> Option<&'a Triad> {
        self.findings.calibration.as_ref()?.accelerometer.as_ref()
    }

    /// Sensors whose readings the rests tell, in the order of first appearance; of very many the first ones.
    pub(super) fn sensors(&self) -> Vec<&'a str> {
        /// More have no place on a page.
        const MOST: usize = 64;
        let mut sensors = Vec::new();
        for mean in self.rests.iter().flat_map(|rest| &rest.segment.means) {
            if sensors.len() < MOST && !sensors.contains(&mean.sensor.as_str()) {
                sensors.push(mean.sensor.as_str());
            }
        }
        sensors
    }

    /// Lengths ‖ω‖ of the gyroscope's mean rate, rest by rest, rad/s.
    pub(super) fn rates_at_rest(&self) -> Vec<Residual> {
        let triad = self.findings.calibration.as_ref().and_then(|found| found.gyroscope.as_ref());
        let known = triad.and_then(Known::of);
        let of = |rest: &Rest<'_>| {
            let (raw, corrected) = mean(rest.segment, "gyroscope", known.as_ref());
            Residual { raw: raw.map(|rate| rate.norm()), corrected: corrected.map(|rate| rate.norm()) }
        };
        self.rests.iter().map(of).collect()
    }

    /// Residuals of a secondary accelerometer, rest by rest.
    pub(super) fn residuals_of(&self, sensor: &str) -> Vec<Residual> {
        let triad = self.findings.calibration.iter().flat_map(|found| &found.secondary);
        let known = triad.filter(|triad| triad.sensor == sensor).find_map(Known::of);
        let of = |rest: &Rest<'_>| {
            let (mean, corrected) = mean(rest.segment, sensor, known.as_ref());
            residual(self.findings, mean, corrected)
        };
        self.rests.iter().map(of).collect()
    }
}

/// Calibration of a triad, its bias as far as that depends on the temperature.
pub(super) struct Known {
    pub(super) calibration: Calibration,
    pub(super) course: Option<BiasCourse>,
}

impl Known {
    /// Calibration of a triad, if it is determined.
    pub(super) fn of(triad: &Triad) -> Option<Self> {
        let course = triad.temperature.as_ref().and_then(BiasCourse::of);
        Some(Self { calibration: calibration(triad)?, course })
    }

    /// Corrects a reading at a temperature, °C, if that is known.
    pub(super) fn correct(&self, measured: &Vector3<f64>, celsius: Option<f64>) -> Vector3<f64> {
        let change = self.course.as_ref().zip(celsius.filter(|celsius| celsius.is_finite()));
        let change = change.map_or(Vector3::zeros(), |(course, celsius)| course.change(celsius));
        self.calibration.correct(&(measured - change))
    }
}

/// Mean reading of a sensor during a rest, as read and corrected.
fn mean(segment: &Segment, sensor: &str, known: Option<&Known>) -> (Option<Vector3<f64>>, Option<Vector3<f64>>) {
    let mean = segment.means.iter().find(|mean| mean.sensor == sensor);
    let mean = mean.and_then(|mean| mean.mean.as_ref()).map(vector);
    (mean, mean.zip(known).map(|(mean, known)| known.correct(&mean, segment.temperature)))
}

fn residual(findings: &Findings, mean: Option<Vector3<f64>>, corrected: Option<Vector3<f64>>) -> Residual {
    let gravity = findings.calibration.as_ref().map_or(9.80665, |found| found.gravity);
    let [raw, corrected] = [mean, corrected].map(|value| value.map(|value| value.norm() - gravity));
    Residual { raw, corrected }
}
