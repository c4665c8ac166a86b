//! Corrected messages: those of the sources, with true values instead of the measured ones. The
//! [`Learner`](crate::pipeline::learner::Learner) or the [correction pass](crate::pipeline::correction_pass) says when and by
//! which calibration.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::sources::Sources;
use crate::annotate::{Annotator, Corrections};
use crate::imu::{ImuId, Intake, Sensor};
use crate::record::{Block, Channel, Message, Schema, Topic};
use crate::topic::{self, Kind};

/// Writer of corrected messages.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Corrector {
    /// Names of the IMUs with corrected messages.
    written: BTreeSet<String>,
}

/// Topic of the corrected messages of an IMU: the same as that of its source channel, except for the name.
pub(crate) fn corrected_topic(imu: &str, channel: &Channel, schema: Option<&Schema>) -> Topic {
    Topic {
        name: topic::of(imu, Kind::Corrected),
        schema_name: schema.map(|schema| schema.name.clone()).unwrap_or_default(),
        schema_encoding: schema.map(|schema| schema.encoding.clone()).unwrap_or_default(),
        schema: schema.map(|schema| schema.data.clone()).unwrap_or_default(),
        message_encoding: channel.message_encoding.clone(),
        metadata: channel.metadata.clone(),
    }
}

/// Corrects the last message of the intake, for each IMU that reads it.
pub(crate) fn corrected<'i, 'c>(
    intake: &'i Intake,
    message: &Message<'_>,
    by: impl Fn(ImuId) -> Option<&'c Corrections>,
) -> Vec<(&'i str, Vec<u8>)> {
    // Accelerations first, which gyroscopes with g-sensitivity need.
    let mut accelerations: BTreeMap<(ImuId, usize), Vector3<f64>> = BTreeMap::new();
    intake.rewrite(message.channel, message.data, |imu, sensor, reading, value| {
        let corrections = by(imu).filter(|corrections| corrections.need_acceleration())?;
        if sensor == Sensor::Accelerometer {
            accelerations.insert((imu, reading), corrections.correct_at(intake.temperature(imu), sensor, value, None)?);
        }
        None
    });
    let change = |imu, sensor, reading, value| {
        by(imu)?.correct_at(intake.temperature(imu), sensor, value, accelerations.get(&(imu, reading)).copied())
    };
    intake.rewrite(message.channel, message.data, change)
}

impl Corrector {
    /// Whether there is a corrected message of the IMU with this name.
    pub(crate) fn has_written(&self, name: &str) -> bool {
        self.written.contains(name)
    }

    /// Corrects the last message of the intake, appends the blocks that were closed before it, and reports each message
    /// that was written.
    pub(crate) fn correct<'c>(
        &mut self,
        message: &Message<'_>,
        sources: &Sources,
        by: impl Fn(ImuId) -> Option<&'c Corrections>,
        annotator: &mut Annotator,
        blocks: &mut Vec<Block>,
        mut tell: impl FnMut(&Annotator),
    ) {
        let Some(source) = sources.table.by_id(message.channel) else { return };
        for (imu, data) in corrected(&sources.intake, message, by) {
            let topic = || corrected_topic(imu, source.channel, source.schema);
            blocks.extend(annotator.push_message(&topic::of(imu, Kind::Corrected), topic, message.log_time, data));
            tell(annotator);
            if !self.written.contains(imu) {
                self.written.insert(imu.to_owned());
            }
        }
    }
}
