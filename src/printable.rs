//! Escaping of outside text for printing: characters that would control a terminal, fake a line or reorder letters, and
//! what a shell would not take for one word.
//!
//! Every place that shows text to people uses it: terminal, logs, errors, metric labels, pages, viewers.

use std::borrow::Cow;
use std::fmt::Write as _;

/// The text with hidden characters escaped: `\n`, `\u{1b}`.
pub fn printable(text: &str) -> Cow<'_, str> {
    if !text.contains(is_hidden) {
        return Cow::Borrowed(text);
    }
    let mut escaped = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match is_hidden(c) {
            true => escaped.extend(c.escape_default()),
            false => escaped.push(c),
        }
    }
    Cow::Owned(escaped)
}

/// A JSON document with hidden characters escaped as in JSON. They only occur in strings there.
pub fn printable_json(document: &str) -> Cow<'_, str> {
    // Characters below are those that JSON must escape itself, and the line breaks of a document for people.
    let hidden = |c: char| c >= '\u{7f}' && is_hidden(c);
    if !document.contains(hidden) {
        return Cow::Borrowed(document);
    }
    let mut escaped = String::with_capacity(document.len() + 16);
    for c in document.chars() {
        match hidden(c) {
            true => c.encode_utf16(&mut [0; 2]).iter().for_each(|unit| _ = write!(escaped, "\\u{unit:04x}")),
            false => escaped.push(c),
        }
    }
    Cow::Owned(escaped)
}

/// The text as one word of a shell's command line: in quotes, unless it needs none.
pub fn shell_word(text: &str) -> Cow<'_, str> {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "_-./=:,+@%".contains(c);
    // Some shells expand a word that begins with =.
    match !text.is_empty() && !text.starts_with('=') && text.chars().all(is_plain) {
        true => Cow::Borrowed(text),
        false => Cow::Owned(format!("'{}'", text.replace('\'', r"'\''"))),
    }
}

/// Whether a character is a control character, has no width, or changes the direction of what follows (Unicode's
/// general categories Cc, Cf, Zl and Zp, as far as terminals act on them).
fn is_hidden(c: char) -> bool {
    c.is_control()
        || matches!(c,
            '\u{ad}' | '\u{61c}' | '\u{180e}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}'
            | '\u{2060}'..='\u{206f}' | '\u{feff}' | '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e007f}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_stay_and_what_steers_a_terminal_does_not() {
        assert_eq!(printable("/imu/größe 加速度 x\\y"), "/imu/größe 加速度 x\\y");
        assert_eq!(printable("/a\u{1b}]0;x\u{7}\r\nerror: no"), "/a\\u{1b}]0;x\\u{7}\\r\\nerror: no");
        assert_eq!(printable("\u{9b}2J\u{202e}\u{7f}"), "\\u{9b}2J\\u{202e}\\u{7f}");
    }

    #[test]
    fn a_word_of_a_shell_is_quoted_where_it_must_be() {
        assert_eq!(shell_word("a/b-1.mcap"), "a/b-1.mcap");
        assert_eq!(shell_word("fit.gravity=9.81"), "fit.gravity=9.81");
        assert_eq!(shell_word("it's; $x"), r"'it'\''s; $x'");
        assert_eq!(shell_word(""), "''");
    }

    #[test]
    fn json_says_the_same_without_them() {
        let value = serde_json::json!({"a\u{9b}": ["\u{202e}x\u{1b}", "\u{e0041}", "ü"]});
        let text = printable_json(&value.to_string()).into_owned();
        assert!(!text.contains(is_hidden), "{text}");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&text).unwrap(), value);
    }
}
