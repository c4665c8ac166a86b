//! Note on a recording that holds annotations already, without their original: another program copied or filtered it
//! since. They are part of what `strip` gives back, so they stay.

use super::sources::Sources;
use crate::topic::MARK;

/// Note on a recording whose channels hold annotations; `None` if none do.
pub(crate) fn annotated_before(sources: &Sources) -> Option<String> {
    let mut topics = sources.annotations();
    let first = topics.next()?;
    let further = match topics.count() {
        0 => String::new(),
        further => format!(" and {further} more topics"),
    };
    Some(format!(
        "holds annotations of an earlier run ({first}{further}), which another program copied or filtered: they stay, and the new \
         ones stand beside them. To leave the old ones out, `mcap filter RECORDING -o FILTERED --exclude-topic-regex \
         '.*{MARK}.*'` first, and annotate that; to write the new ones apart, annotate --sidecar"
    ))
}
