//! Numbers of things in sentences.

/// "1 turn", "3 turns": the number with its noun.
pub(crate) fn counted(count: u64, noun: &str) -> String {
    let s = if count == 1 { "" } else { "s" };
    format!("{count} {noun}{s}")
}
