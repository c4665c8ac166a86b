//! What an engine learned from a session, held against the truth.

use nalgebra::Vector3;
use stillpoint::engine::{Config, Engine, Event, Message};
use stillpoint::messages::triad::Status;
use stillpoint::messages::{self, Calibration};

use super::Fate;
use super::sessions::{Session, Truth};

#[derive(Clone, Copy, Debug)]
pub enum Triad {
    Accelerometer,
    Gyroscope,
}

pub struct Learned {
    calibrations: Vec<Calibration>,
    /// Everything that people were told, once.
    said: Vec<String>,
}

impl Learned {
    pub fn from(session: &Session) -> Self {
        let mut engine = Engine::new(Config::default());
        let mut events = Vec::new();
        for (sensor, sample) in &session.samples {
            engine.push(*sensor, sample, &mut events);
        }
        engine.finish(&mut events);
        Self::new(events)
    }

    pub fn new(events: Vec<Event>) -> Self {
        let mut learned = Self { calibrations: Vec::new(), said: Vec::new() };
        for event in events {
            match event.message {
                Message::Segment(segment) => learned.hear(segment.explanation),
                Message::Turn(turn) => learned.hear(turn.explanation),
                Message::Coverage(coverage) => learned.hear(coverage.next_step),
                Message::Log(log) => learned.hear(log.message),
                Message::Calibration(calibration) => {
                    let triads = calibration.accelerometer.iter().chain(&calibration.gyroscope);
                    triads.flat_map(|triad| triad.notes.clone()).for_each(|note| learned.hear(note));
                    learned.calibrations.push(*calibration);
                }
                Message::Noise(_) | Message::Stillness(_) => {}
            }
        }
        learned
    }

    pub fn calibrations(&self) -> &[Calibration] {
        &self.calibrations
    }

    pub fn says(&self, words: &str) -> bool {
        self.said.iter().any(|text| text.contains(words))
    }

    pub fn said(&self) -> &[String] {
        &self.said
    }

    fn hear(&mut self, text: String) {
        if !self.said.contains(&text) {
            self.said.push(text);
        }
    }

    /// Whether the triad met its fate.
    pub fn meets(&self, triad: Triad, fate: Fate, truth: &Truth) -> Result<(), String> {
        let published: Vec<_> = self
            .calibrations
            .iter()
            .filter_map(|calibration| match triad {
                Triad::Accelerometer => calibration.accelerometer.as_ref(),
                Triad::Gyroscope => calibration.gyroscope.as_ref(),
            })
            .collect();
        let determined = |published: &&&messages::Triad| published.status() != Status::Undetermined;
        let determined: Vec<_> = published.iter().filter(determined).collect();
        match fate {
            Fate::Refused if determined.is_empty() => Ok(()),
            Fate::Refused => Err(format!("{triad:?} is published: {:#?}", determined.last())),
            Fate::Learned if determined.is_empty() => Err(format!("{triad:?} is refused: {:#?}", self.said)),
            _ => determined.iter().try_for_each(|published| right(triad, published, truth)),
        }
    }
}

/// Whether the truth is within the bars, or not far beyond.
fn right(triad: Triad, published: &messages::Triad, truth: &Truth) -> Result<(), String> {
    const FAR: f64 = 5.0;
    let far = |value: f64, std: f64, low: f64, high: f64| {
        (value - value.clamp(low.min(high), low.max(high))).abs() > FAR * std
    };
    let vector = |v: &Option<messages::Vector3>| v.as_ref().map(|v| Vector3::new(v.x, v.y, v.z)).unwrap();
    let wrong = |what: &str, value: Vector3<f64>, std: Vector3<f64>, from: Vector3<f64>, to: Vector3<f64>| {
        if (0..3).any(|axis| far(value[axis], std[axis], from[axis], to[axis])) {
            return Err(format!("{triad:?} {what} {value:?} ± {std:?} where the truth is {from:?} to {to:?}"));
        }
        Ok(())
    };
    let (bias, std) = (vector(&published.bias), vector(&published.bias_std));
    match triad {
        Triad::Gyroscope => wrong("bias", bias, std, truth.gyro_bias, truth.gyro_bias),
        Triad::Accelerometer => {
            wrong("bias", bias, std, truth.bias, truth.bias + truth.drift)?;
            wrong("scale", vector(&published.scale), vector(&published.scale_std), truth.scale, truth.scale)
        }
    }
}
