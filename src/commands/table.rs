//! Table with aligned columns for a terminal, where a character may be wider than a byte and colours have no width.

use console::measure_text_width;

/// Rows of cells; the first column is left-aligned, the others right-aligned.
#[derive(Default)]
pub struct Table(Vec<Row>);

enum Row {
    Heading(String),
    Cells(Vec<String>),
}

impl Table {
    /// Adds a line outside the columns.
    pub fn heading(&mut self, text: String) {
        self.0.push(Row::Heading(text));
    }

    /// Adds a row.
    pub fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.0.push(Row::Cells(cells.into_iter().collect()));
    }

    /// Lines of the rows, each behind `indent`; rows wider than `columns` have their cells below each other.
    pub fn lines(&self, indent: &str, columns: usize) -> Vec<String> {
        let mut widths = Vec::new();
        for row in &self.0 {
            let Row::Cells(cells) = row else { continue };
            widths.resize(widths.len().max(cells.len()), 0);
            for (width, cell) in widths.iter_mut().zip(cells) {
                *width = measure_text_width(cell).max(*width);
            }
        }
        let width = indent.len() + widths.iter().sum::<usize>() + 2 * widths.len().saturating_sub(1);
        let line = |row: &Row| match row {
            Row::Cells(cells) if width > columns => {
                let behind = cells.iter().skip(1).map(|cell| format!("{indent}    {}", cell.trim_start()));
                cells.iter().take(1).map(|cell| format!("{indent}{cell}")).chain(behind).collect()
            }
            row => vec![format!("{indent}{}", row.line(&widths))],
        };
        self.0.iter().flat_map(line).collect()
    }
}

impl Row {
    fn line(&self, widths: &[usize]) -> String {
        let cells = match self {
            Self::Heading(text) => return text.clone(),
            Self::Cells(cells) => cells,
        };
        let mut line = String::new();
        for (column, (cell, width)) in cells.iter().zip(widths).enumerate() {
            let padding = " ".repeat(width - measure_text_width(cell));
            match column {
                0 => line.extend([cell.as_str(), &padding]),
                _ => line.extend(["  ", &padding, cell]),
            }
        }
        line.trim_end().to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up_whatever_their_letters() {
        let mut table = Table::default();
        table.row(["bias m/s²".into(), "1".into()]);
        table.row(["x".into(), "\u{1b}[32m22\u{1b}[0m".into()]);
        table.heading("of its own width, however long".into());
        assert_eq!(table.lines("  ", 80).pop().unwrap(), "  of its own width, however long");
        assert_eq!(table.lines("  ", 80)[..2], ["  bias m/s²   1", "  x          \u{1b}[32m22\u{1b}[0m"]);
        assert_eq!(table.lines("  ", 14)[..2], ["  bias m/s²", "      1"], "one too narrow");
    }
}
