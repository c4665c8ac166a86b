//! What keeps topics from being IMUs: refusals so far, topics that lack a half, and configured topics that are missing.

use std::collections::{BTreeMap, BTreeSet};

use super::assignment::Assignment;
use super::refusal::{Cause, RefusalCount, ZEROS};
use super::route::Route;
use super::source::Source;
use crate::imu::schema::lookup::nearest;

/// A topic that the configuration names and the recording lacks.
#[derive(Clone, Debug, PartialEq)]
pub struct MissingTopic {
    /// Name in the configuration.
    pub topic: String,
    /// Topic of the recording with the most similar spelling.
    pub nearest: Option<String>,
}

impl Assignment {
    /// Refusals so far, by topic.
    pub(in crate::imu) fn faults(&self) -> Vec<RefusalCount> {
        let mut faults = Vec::new();
        for route in self.routes.values().flatten() {
            let whole = route.counts.iter().map(|(cause, count)| (None, cause, count));
            let parts = route
                .taps
                .iter()
                .flat_map(|tap| tap.counts.iter().map(|(cause, count)| (Some(tap.name.clone()), cause, count)));
            let parts = parts.filter(|&(_, cause, count)| cause != Cause::Zero || count >= ZEROS);
            faults.extend(whole.chain(parts).map(|(sensor, cause, count)| {
                let detail = route.malformed.clone().filter(|_| cause == Cause::Malformed && sensor.is_none());
                RefusalCount { topic: route.topic.clone(), sensor, cause, count, detail }
            }));
        }
        faults
    }

    /// Reasons why topics that might be IMUs are none so far, one line each.
    pub(in crate::imu) fn obstacles(&self) -> Vec<String> {
        let none_seen = |route: &&Route| self.sources.get(route.source).is_some_and(|source| source.imus.is_empty());
        let mut topics: BTreeMap<&str, Vec<String>> = BTreeMap::new();
        for route in self.routes.values().flatten().filter(none_seen) {
            let reasons = topics.entry(&route.topic).or_default();
            let refused = !route.counts.is_empty() || route.taps.iter().any(|tap| !tap.counts.is_empty());
            if route.messages == 0 && !refused {
                reasons.push("has no messages".to_owned());
            } else if route.is_gyroscope_alone() {
                reasons.push("is a gyroscope alone; an IMU needs an accelerometer".to_owned());
            }
        }
        for topic in self.halves.gyroscopes_alone() {
            topics.entry(topic).or_default().push("is a gyroscope alone; an IMU needs an accelerometer".to_owned());
        }
        let faults = self.faults();
        let refused = faults.iter().filter(|fault| topics.contains_key(&*fault.topic)).map(ToString::to_string);
        let told =
            topics.iter().flat_map(|(topic, reasons)| reasons.iter().map(move |reason| format!("{topic} {reason}")));
        told.chain(refused).collect()
    }

    /// Topics that the configuration names and no channel has had so far.
    pub(in crate::imu) fn missing_topics(&self) -> Vec<MissingTopic> {
        let configured = self.sources.iter().take(self.configured);
        let missing: BTreeSet<_> = configured
            .flat_map(Source::topics)
            .chain(self.positions.topic())
            .chain(self.headings.topic())
            .filter(|&t| !self.topics.contains(t))
            .collect();
        let nearest = |topic: &str| nearest(topic, self.topics.iter().cloned());
        missing.into_iter().map(|topic| MissingTopic { topic: topic.to_owned(), nearest: nearest(topic) }).collect()
    }
}
