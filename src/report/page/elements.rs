//! Elements and words that several sections use.

use maud::{Markup, html};

/// A section under its heading.
pub(super) fn section(heading: &str, content: Markup) -> Markup {
    html! { section { h3 { (heading) } (content) } }
}

/// Notes, one line each; `None` without any.
pub(super) fn notes(lines: &[String]) -> Option<Markup> {
    let list = || html! { ul.notes { @for line in lines { li { (line) } } } };
    (!lines.is_empty()).then(list)
}

/// A table that scrolls by itself where the page is too narrow for it.
pub(super) fn table(class: Option<&str>, head: Option<Markup>, rows: &[Markup]) -> Markup {
    html! {
        div.scroll {
            table class=[class] {
                @if let Some(head) = head { thead { tr { (head) } } }
                @for row in rows { (row) }
            }
        }
    }
}

/// Heads of the columns of a triad's axes, behind one for the names of the rows.
pub(super) fn axes() -> Markup {
    html! { th {} th.n { "x" } th.n { "y" } th.n { "z" } }
}

/// Number of those beyond the ones listed.
pub(super) fn more(count: usize, listed: usize) -> Markup {
    let further = count.saturating_sub(listed);
    html! { @if further > 0 { p.dim { "… and " (further) " more." } } }
}

/// A name that breaks only between its parts.
pub(super) fn breakable(name: &str) -> Markup {
    html! {
        @for part in name.split_inclusive(['/', '_']) {
            (part)
            @if part.ends_with(['/', '_']) { wbr; }
        }
    }
}

/// Text with a capital at its beginning and a full stop at its end.
pub(super) fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    let first: String = letters.next().into_iter().flat_map(char::to_uppercase).collect();
    format!("{first}{}.", letters.as_str().trim_end_matches('.'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sentence_has_one_full_stop() {
        assert_eq!(sentence("turn it."), "Turn it.");
    }

    #[test]
    fn a_name_breaks_between_its_parts_alone() {
        assert_eq!(breakable("/imu/data_raw").into_string(), "/<wbr>imu/<wbr>data_<wbr>raw");
        assert_eq!(breakable("<b>/\"").into_string(), "&lt;b&gt;/<wbr>&quot;");
    }
}
