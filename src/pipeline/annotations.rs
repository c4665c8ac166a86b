//! Annotations of a recording or sidecar, decoded to events.

use super::channel_table::ChannelTable;
use crate::annotate;
use crate::engine::Event;
use crate::record::Message;
use crate::topic;

/// Decodes an annotation. Returns the output name of its IMU (empty if it concerns the whole recording) and the event;
/// `None` if it is not an annotation of this version, such as a corrected reading.
pub(crate) fn read<'t>(table: &'t ChannelTable, message: &Message<'_>) -> Option<(&'t str, Event)> {
    let entry = table.get(message.channel)?;
    let imu = topic::imu_of(&entry.channel.topic)?;
    let said = annotate::read(entry.schema_name(), &entry.channel.message_encoding, message.data).ok()?;
    Some((imu, Event { log_time: message.log_time, message: said }))
}
