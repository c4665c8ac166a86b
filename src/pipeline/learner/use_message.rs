//! One message: to readings, through the engines, to annotations and its corrected copy.

use super::Learner;
use super::engine_setup::engine_config;
use super::imu_state::ImuState;
use super::publish::last_of;
use crate::annotate::{Annotator, Corrected};
use crate::engine::Engine;
use crate::fit::{EarthLocation, Gravity, Source};
use crate::imu::{ImuId, Position, Reading};
use crate::messages::foxglove::log::Level;
use crate::pipeline::events::{Notice, Notify};
use crate::record::Message as Recorded;

impl Learner {
    pub(super) fn use_message(&mut self, message: &Recorded<'_>, notify: Notify<'_>) {
        self.log_time = message.log_time;
        self.message(message, notify);
        self.correct(message, notify);
    }

    fn message(&mut self, message: &Recorded<'_>, notify: Notify<'_>) {
        if let Some(fix) = self.sources.intake.fix(message.channel, message.data) {
            self.locate(fix, notify);
        }
        if !self.imus.is_empty()
            && let Some(heading) = self.sources.intake.heading(message.channel, message.log_time, message.data)
        {
            self.imus.iter_mut().for_each(|imu| imu.engine.heading(heading.stamp, heading.angle));
        }
        let readings = &mut self.readings;
        let mut keep = |imu, sensor, reading| readings.push((imu, sensor, reading));
        self.sources.intake.message(message.channel, message.log_time, message.data, &mut keep);
        if let Some(stamp) = self.sources.intake.last_stamp(message.channel) {
            self.time_order.watch_stamp(message.channel, stamp);
        }
        let samples = self.readings.iter().filter(|(.., reading)| matches!(reading, Reading::Sample(_)));
        notify(Notice::Message { message, samples: samples.count() });
        for imu in self.sources.intake.imus().iter().skip(self.imus.len()) {
            let mut engine = Engine::new(engine_config(imu, &self.config));
            self.place.into_iter().for_each(|place| engine.locate(place));
            let findings = self.nothing_of(imu);
            self.imus.push(ImuState { engine, findings, corrections: None });
        }
        for notice in self.sources.intake.take_notices() {
            self.log(Level::Warning, notice.text, notify);
        }
        for (imu, celsius) in self.sources.intake.take_temperatures() {
            self.imus.get_mut(imu.index()).into_iter().for_each(|learning| learning.engine.warm(celsius));
        }
        let Self { timing, readings, timed, .. } = self;
        timing.pass(message.channel, message.log_time, readings, &mut |read| timed.push(read));
        self.readings.clear();
        self.push_timed(notify);
    }

    /// Passes the readings whose turn has come to the engines.
    pub(super) fn push_timed(&mut self, notify: Notify<'_>) {
        for i in 0..self.timed.len() {
            let Some(&(imu, sensor, reading)) = self.timed.get(i) else { break };
            let imu = imu.index();
            let Some(learning) = self.imus.get_mut(imu) else { continue };
            match reading {
                Reading::Sample(sample) => {
                    learning.findings.near_misses.sample(sensor, &sample);
                    learning.engine.push(sensor, &sample, &mut self.events);
                }
                Reading::Clipped(stamp) => learning.engine.clipped(sensor, stamp),
                Reading::NewRound { stamp, log_time } => {
                    learning.engine.begin_round(sensor, stamp, log_time, &mut self.events);
                }
            }
            if !self.events.is_empty() {
                self.publish(imu, notify);
            }
        }
        self.timed.clear();
    }

    /// Writes the corrected message, by the calibrations in force.
    fn correct(&mut self, message: &Recorded<'_>, notify: Notify<'_>) {
        if self.config.output.corrected == Corrected::Causal {
            let by = |imu: ImuId| self.imus.get(imu.index()).and_then(|imu| imu.corrections.as_ref());
            let notify = |annotator: &Annotator| {
                if let Some((topic, annotation)) = last_of(annotator) {
                    notify(Notice::Corrected { topic, annotation });
                }
            };
            self.corrector.correct(message, &self.sources, by, &mut self.annotator, &mut self.blocks, notify);
        }
    }

    /// Sets the place of the recording.
    fn locate(&mut self, Position { latitude_deg, height_m }: Position, notify: Notify<'_>) {
        let place = EarthLocation { latitude_deg, height_m };
        self.place = Some(place);
        self.imus.iter_mut().for_each(|imu| imu.engine.locate(place));
        if self.config.fit.gravity.is_none() && self.config.fit.latitude_deg.is_none() {
            let gravity = Gravity::at(&place, Source::FixTopic);
            let height = height_m.map(|height| format!(" and {height:.0} m")).unwrap_or_default();
            let text =
                format!("gravity is {:.5} ± {:.4} m/s² at {latitude_deg:.3}°{height}", gravity.value, gravity.std);
            self.log(Level::Info, text, notify);
        }
    }
}
