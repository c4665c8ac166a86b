//! Text for people: as wide as the terminal, with the colours of standard error.

use console::{Term, measure_text_width};
use stillpoint::printable;

/// Style of writing for a terminal.
#[derive(Clone, Copy, Debug)]
pub struct Look {
    /// Width of a line in columns.
    pub columns: usize,
    /// Whether to include background information.
    pub verbose: bool,
}

impl Look {
    /// Style by the terminal and the command line.
    pub fn of(term: &Term) -> Self {
        Self { columns: crate::console::columns(term), verbose: tracing::enabled!(tracing::Level::DEBUG) }
    }

    /// A sentence behind its label, wrapped with a hanging indent.
    pub fn sentence(&self, label: &str, text: &str) -> Vec<String> {
        self.wrap(label, " ", text.split_whitespace().map(|word| printable(word).into_owned()))
    }

    /// Words behind a label, wrapped with a hanging indent.
    pub fn wrap(&self, label: &str, space: &str, words: impl Iterator<Item = String>) -> Vec<String> {
        let indent = " ".repeat(measure_text_width(label));
        let mut lines = vec![label.to_owned()];
        for word in words {
            let Some(line) = lines.last_mut() else { break };
            let width = measure_text_width(line);
            match width <= indent.len() {
                true => line.push_str(&word),
                false if width + space.len() + measure_text_width(&word) <= self.columns => line.extend([space, &word]),
                false => lines.push(format!("{indent}{word}")),
            }
        }
        // Many lines of few words are easier to read from the left.
        if lines.len() > 4 && indent.len() * 3 > self.columns {
            let words = lines.iter().skip(1).flat_map(|line| line.split_whitespace()).map(str::to_owned);
            let words: Vec<_> = words.collect();
            let first = lines.swap_remove(0);
            return [first].into_iter().chain(self.wrap("      ", space, words.into_iter())).collect();
        }
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_sentences_hang_behind_their_label() {
        for columns in [40, 60, 100] {
            let lines = Look { columns, verbose: false }.sentence("  next  ", &"word ".repeat(40));
            assert!(lines.len() > 1 && lines.iter().all(|line| line.len() <= columns));
            assert!(lines[0].starts_with("  next  word word") && lines[1].starts_with("        word word"));
        }
        let lines = Look { columns: 60, verbose: false }.sentence(&"label ".repeat(7), &"word ".repeat(40));
        assert!(lines.len() < 6 && lines[1].starts_with("      word"), "{lines:?}");
        assert_eq!(lines.join(" ").matches("word").count(), 40);
    }
}
