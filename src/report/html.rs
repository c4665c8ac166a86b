//! Escaping of text for HTML.

use std::borrow::Cow;

use crate::printable;

/// Escapes text so that it cannot break out of its element. Line breaks stay.
pub(super) fn escape(text: &str) -> Cow<'_, str> {
    if text.contains('\n') {
        return text.split('\n').map(escape).collect::<Vec<_>>().join("\n").into();
    }
    let text = printable(text);
    if !text.contains(|c: char| "<>&\"'".contains(c)) {
        return text;
    }
    let mut escaped = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match c {
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '&' => escaped.push_str("&amp;"),
            '"' => escaped.push_str("&quot;"),
            '\'' => escaped.push_str("&#39;"),
            c => escaped.push(c),
        }
    }
    Cow::Owned(escaped)
}
