//! Writes all tables in Markdown.

/// Alignment of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Align {
    /// As text.
    Left,
    /// As numbers.
    Right,
}

/// A table with these heads, all columns aligned alike; a bar in a cell is escaped.
pub fn table<H: AsRef<str>, R: AsRef<[String]>>(
    heads: &[H],
    align: Align,
    rows: impl IntoIterator<Item = R>,
) -> String {
    let rule = match align {
        Align::Left => "---|",
        Align::Right => "---:|",
    };
    let mut text = row(heads);
    text.push_str(&format!("|{}\n", rule.repeat(heads.len())));
    for cells in rows {
        text.push_str(&row(cells.as_ref()));
    }
    text
}

fn row<C: AsRef<str>>(cells: &[C]) -> String {
    let cell = |cell: &C| match cell.as_ref() {
        "" => " |".to_owned(),
        text => format!(" {} |", text.replace('|', "\\|")),
    };
    format!("|{}\n", cells.iter().map(cell).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::{Align, table};

    /// CommonMark's table extension requires a backslash before a bar inside a cell.
    #[test]
    fn a_bar_ends_no_cell() {
        let text = table(&["a", "b"], Align::Left, [["1|2".to_owned(), "3".to_owned()]]);
        assert_eq!(text, "| a | b |\n|---|---|\n| 1\\|2 | 3 |\n");
    }

    #[test]
    fn numbers_stand_right() {
        let text = table(&["K", ""], Align::Right, [["1.5".to_owned(), String::new()]]);
        assert_eq!(text, "| K | |\n|---:|---:|\n| 1.5 | |\n");
    }
}
