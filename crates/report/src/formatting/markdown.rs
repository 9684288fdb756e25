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

/// Markdown without HTML and links: a `<` that would begin a tag, a comment or a declaration, and a `(` that would begin an address are escaped
/// (CommonMark, 6.3 and 6.6).
pub fn without_html_and_links(text: &str) -> String {
    let begins = |next: Option<char>| {
        next.is_some_and(|next| next.is_ascii_alphabetic() || ['/', '!', '?'].contains(&next))
    };
    let mut escaped = String::with_capacity(text.len());
    let mut letters = text.chars().peekable();
    while let Some(letter) = letters.next() {
        let tag = letter == '<' && begins(letters.peek().copied()) && !escaped.ends_with('\\');
        if tag || letter == '(' && escaped.ends_with(']') {
            escaped.push('\\');
        }
        escaped.push(letter);
    }
    escaped
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
    use super::{Align, table, without_html_and_links};

    /// CommonMark's table extension requires a backslash before a bar inside a cell.
    #[test]
    fn a_bar_ends_no_cell() {
        let text = table(&["a", "b"], Align::Left, [["1|2".to_owned(), "3".to_owned()]]);
        assert_eq!(text, "| a | b |\n|---|---|\n| 1\\|2 | 3 |\n");
    }

    #[test]
    fn a_name_is_neither_a_tag_nor_a_link() {
        let text = "<script>x</script> a < b, T2 <- T1 <!-- --> \\<b> [x](y) [K] (z)";
        let inert = "\\<script>x\\</script> a < b, T2 <- T1 \\<!-- --> \\<b> [x]\\(y) [K] (z)";
        assert_eq!(without_html_and_links(text), inert);
    }

    #[test]
    fn numbers_stand_right() {
        let text = table(&["K", ""], Align::Right, [["1.5".to_owned(), String::new()]]);
        assert_eq!(text, "| K | |\n|---:|---:|\n| 1.5 | |\n");
    }
}
