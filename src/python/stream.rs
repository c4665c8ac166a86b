//! Readings of one IMU to findings, as the messages of a recording get there: times are put right, then the engine learns.

use nalgebra::Vector3;
use stillpoint::config::Config;
use stillpoint::engine::{self, Engine, Event, Message};
use stillpoint::imu::{AccelUnit, ImuId, Preset, RateUnit, Reading, Sample, Sensor, Timing};
use stillpoint::messages::foxglove::log::Level;
use stillpoint::report::Findings;
use stillpoint::still::State;
use stillpoint::{Stamp, printable};

/// Knowledge of the IMU besides its readings.
pub struct Imu {
    pub name: String,
    pub preset: Option<Preset>,
    /// Units of the readings; `None` are m/s² and rad/s, which the readings have to confirm.
    pub accel_unit: Option<AccelUnit>,
    pub gyro_unit: Option<RateUnit>,
}

/// Learner of one IMU.
pub struct Stream {
    timing: Timing,
    engine: Engine,
    pub findings: Findings,
    /// Decisions and warnings that were not taken yet.
    pub log: Vec<(Level, String)>,
    accelerometer: Triad,
    gyroscope: Triad,
    events: Vec<Event>,
}

/// State of one triad's readings.
struct Triad {
    sensor: Sensor,
    factor: f64,
    /// Whether it has read anything but zeros.
    speaks: bool,
    /// Number of readings that are none.
    refused: u64,
}

impl Stream {
    pub fn new(imu: &Imu, config: &Config) -> Self {
        let Imu { name, preset, accel_unit, gyro_unit } = imu;
        let engine = engine::Config {
            name: name.clone(),
            accelerometer: name.clone(),
            accel_unit: *accel_unit,
            gyro_unit: *gyro_unit,
            still: config.still.clone(),
            fit: config.fit.clone(),
            ..engine::Config::default()
        };
        let triad = |sensor, factor| Triad { sensor, factor, speaks: false, refused: 0 };
        Self {
            timing: Timing::new(config.still.late_s),
            engine: Engine::new(preset.map_or(engine.clone(), |preset| engine.of(preset))),
            findings: Findings::new(name, name),
            log: Vec::new(),
            accelerometer: triad(Sensor::Accelerometer, accel_unit.unwrap_or_default().factor()),
            gyroscope: triad(Sensor::Gyroscope, gyro_unit.unwrap_or_default().factor()),
            events: Vec::new(),
        }
    }

    /// Takes the readings of one instant.
    pub fn push(&mut self, stamp: Stamp, accel: Option<&Vector3<f64>>, gyro: Option<&Vector3<f64>>) {
        // Readings that come by themselves repeat each other's stamps.
        let channel = u16::from(accel.is_some()) + 2 * u16::from(gyro.is_some());
        let log_time = stamp.nanos().max(0) as u64;
        let Self { timing, engine, accelerometer, gyroscope, events, findings, .. } = self;
        if gyro.is_some() && !gyroscope.speaks {
            engine.gyroscope_on(&findings.topic);
        }
        let read = |triad: &mut Triad, value: Option<&Vector3<f64>>| {
            let value = triad.admit(value?)?;
            Some((ImuId::of(0), triad.sensor, Reading::Sample(Sample { stamp, log_time, value })))
        };
        let push = &mut |(_, sensor, reading): (ImuId, _, _)| push(engine, sensor, reading, events);
        match (read(accelerometer, accel), read(gyroscope, gyro)) {
            // The accelerometer's comes last, as from a message: with it the instant is judged.
            (Some(accel), Some(gyro)) => timing.pass(channel, log_time, &[gyro, accel], push),
            (Some(one), None) | (None, Some(one)) => timing.pass(channel, log_time, &[one], push),
            (None, None) => {}
        }
        if !self.events.is_empty() {
            self.hear();
        }
    }

    /// Ends the recording.
    pub fn finish(&mut self) {
        let Self { timing, engine, events, .. } = self;
        timing.finish(&mut |(_, sensor, reading)| push(engine, sensor, reading, events));
        engine.finish(events);
        self.hear();
        let name = &self.findings.name;
        let remarks = self.timing.remarks(ImuId::of(0)).into_iter().map(|text| format!("{name}: {text}"));
        let refused = [(&self.accelerometer, "accelerometer"), (&self.gyroscope, "gyroscope")].into_iter();
        let refused = refused.filter(|(triad, _)| triad.refused > 0);
        let refused = refused.map(|(triad, sensor)| {
            let readings = match triad.refused {
                1 => "1 reading is".to_owned(),
                count => format!("{count} readings are"),
            };
            format!("{name}, {sensor}: {readings} NaN, infinite, or beyond what any sensor reads, and left out")
        });
        self.log.extend(remarks.chain(refused).map(|text| (Level::Warning, printable(&text).into_owned())));
    }

    /// Whether it rests.
    pub fn state(&self) -> State {
        self.engine.status().state
    }

    fn hear(&mut self) {
        for event in self.events.drain(..) {
            self.findings.note(&event);
            if let Message::Log(log) = event.message {
                self.log.push((log.level(), log.message));
            }
        }
    }
}

impl Triad {
    /// A reading in m/s² or rad/s, unless it cannot be one, or there were only zeros so far.
    fn admit(&mut self, value: &Vector3<f64>) -> Option<Vector3<f64>> {
        let value = value * self.factor;
        if !Sample::is_reading(&value) {
            self.refused += 1;
            return None;
        }
        self.speaks |= value.iter().any(|axis| *axis != 0.0);
        self.speaks.then_some(value)
    }
}

fn push(engine: &mut Engine, sensor: Sensor, reading: Reading, events: &mut Vec<Event>) {
    if let Reading::Sample(sample) = reading {
        engine.push(sensor, &sample, events);
    }
}
