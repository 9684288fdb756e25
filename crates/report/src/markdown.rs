//! Tables in Markdown.

/// A table with these heads; a bar in a cell is written so that it ends no cell.
pub fn table<const N: usize>(heads: &[&str; N], rows: &[[String; N]]) -> String {
    let cell =
        |cell: &str| if cell.is_empty() { " ".to_owned() } else { format!(" {} ", cell.replace('|', "\\|")) };
    let row = |cells: [&str; N]| format!("|{}|\n", cells.map(cell).join("|"));
    let mut text = row(*heads);
    text.push_str(&format!("|{}\n", "---|".repeat(N)));
    for cells in rows {
        text.push_str(&row(cells.each_ref().map(String::as_str)));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::table;

    /// As CommonMark's table extension asks: a bar inside a cell stands behind a backslash.
    #[test]
    fn a_bar_ends_no_cell() {
        let text = table(&["a", "b"], &[["1|2".to_owned(), "3".to_owned()]]);
        assert_eq!(text, "| a | b |\n|---|---|\n| 1\\|2 | 3 |\n");
    }
}
