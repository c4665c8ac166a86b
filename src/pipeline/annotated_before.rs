//! Refusal of a recording that holds annotations already, without their original: another program copied or filtered it
//! since. Beside new ones nobody could tell which count.

use std::path::Path;

use super::sources::Sources;
use crate::Error;

/// Error of a recording whose channels hold annotations; `None` if none do.
pub(crate) fn annotated_before(path: &Path, sources: &Sources) -> Option<Error> {
    let mut topics = sources.annotations();
    let first = topics.next()?;
    let further = match topics.count() {
        0 => String::new(),
        further => format!(" and {further} more topics"),
    };
    let why = format!(
        "holds annotations of an earlier run ({first}{further}), which another program copied or filtered: new ones would \
         stand among them. Leave them out first, `mcap filter RECORDING -o FILTERED --exclude-topic-regex \
         '.*/stillpoint/.*'`, and annotate that; or write the new ones apart, with annotate --sidecar"
    );
    Some(Error::unfit(path, why))
}
