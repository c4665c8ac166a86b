//! The log, collapsed.

use maud::{Markup, html};

use super::elements::table;
use super::imu::Imu;
use crate::Stamp;
use crate::messages::foxglove::log::Level;
use crate::report::plot::moment;

pub(super) fn section(imu: &Imu<'_>) -> Option<Markup> {
    let (log, unlogged) = (&imu.timeline.log, imu.timeline.unlogged);
    if log.is_empty() {
        return None;
    }
    let row = |(at, level, text): &(u64, Level, String)| {
        let at = Stamp::from_log_time(*at).seconds_since(imu.origin);
        let class = if *level >= Level::Warning { "warning" } else { "info" };
        html! { tr class=(class) { td.n { (moment(at)) } td { (text) } } }
    };
    let more = (unlogged > 0).then(|| html! { tr { td {} td { "… and " (unlogged) " more" } } });
    let rows: Vec<_> = log.iter().map(row).chain(more).collect();
    Some(html! { details { summary { "Log" } (table(Some("log"), None, &rows)) } })
}
