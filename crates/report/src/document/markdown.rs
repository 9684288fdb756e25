//! Documents as Markdown.

use super::model::{Block, Cell, Document, Facts, Section, Table, Tone};
use mapper_core::terminal_text;

impl Document {
    /// The document as Markdown, its sections at level 2. Names and messages from outside are in it, but neither HTML, links nor colours.
    pub fn markdown(&self) -> String {
        self.markdown_at(2)
    }

    /// The same with sections at this level.
    pub(crate) fn markdown_at(&self, level: usize) -> String {
        let mut text = String::new();
        write(&mut text, self, level);
        text
    }
}

fn write(text: &mut String, document: &Document, level: usize) {
    for block in &document.blocks {
        if !(text.is_empty() || text.ends_with("\n\n")) {
            text.push('\n');
        }
        text.push_str(&match block {
            Block::Paragraph(words, Tone::Plain) => format!("{}\n", markdown_text(words)),
            Block::Paragraph(words, Tone::Strong | Tone::Verdict(_)) => {
                format!("**{}**\n", markdown_text(words))
            }
            Block::List { items, numbered } => {
                let item = |(index, item): (usize, &String)| match numbered {
                    true => format!("{}. {}\n", index + 1, markdown_text(item)),
                    false => format!("- {}\n", markdown_text(item)),
                };
                items.iter().enumerate().map(item).collect()
            }
            Block::Facts(Facts { caption, rows }) => {
                let rows = rows.iter().map(|(name, value)| [name.as_str(), value.as_str()]);
                captioned(caption, Table::new(["", ""]).all_texts().rows(rows))
            }
            Block::Table(table) => captioned(&table.caption, table.clone()),
            Block::Figures { .. } => continue,
            Block::Code(lines) => format!("```\n{}\n```\n", terminal_text(lines.trim_end())),
            Block::Widget(widget) if widget.markdown.is_empty() => continue,
            Block::Widget(widget) => format!("{}\n", widget.markdown),
            Block::Section(section) if section.is_for_browsers() => continue,
            Block::Section(Section { heading, body, .. }) => {
                text.push_str(&format!("{} {}\n", "#".repeat(level), markdown_text(heading)));
                write(text, body, level + 1);
                continue;
            }
        });
    }
}

fn captioned(caption: &str, table: Table) -> String {
    let table = markdown_table(&table);
    if caption.is_empty() { table } else { format!("{}:\n\n{table}", markdown_text(caption)) }
}

/// A table as Markdown; a bar in a cell is escaped.
pub fn markdown_table(table: &Table) -> String {
    let mut text = row(table.heads.iter().map(String::as_str));
    let rule = table.texts.iter().map(|is_text| if *is_text { "---|" } else { "---:|" });
    text.push_str(&format!("|{}\n", rule.collect::<String>()));
    for cells in &table.rows {
        text.push_str(&row(cells.cells.iter().map(|cell: &Cell| cell.text.as_str())));
    }
    text
}

fn row<'a>(cells: impl Iterator<Item = &'a str>) -> String {
    let cell = |cell: &str| match cell {
        "" => " |".to_owned(),
        text => format!(" {} |", markdown_text(text).replace('|', "\\|")),
    };
    format!("|{}\n", cells.map(cell).collect::<String>())
}

/// Text as one line of Markdown without control characters, HTML and links: a `<` that would begin a tag, a comment or a declaration becomes an
/// entity, which a backslash before it cannot undo, and what would begin the address of a link is escaped (CommonMark, 2.5, 4.7, 6.3 and 6.6).
pub fn markdown_text(text: &str) -> String {
    let begins = |next: Option<char>| {
        next.is_some_and(|next| next.is_ascii_alphabetic() || ['/', '!', '?'].contains(&next))
    };
    let text = terminal_text(text);
    let mut escaped = String::with_capacity(text.len());
    let mut letters = text.chars().peekable();
    while let Some(letter) = letters.next() {
        match letter {
            '<' if begins(letters.peek().copied()) => escaped.push_str("&lt;"),
            '(' | '[' | ':' if escaped.ends_with(']') => escaped.extend(['\\', letter]),
            '\n' | '\r' => escaped.push(' '),
            letter => escaped.push(letter),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    /// CommonMark's table extension requires a backslash before a bar inside a cell.
    #[test]
    fn a_bar_ends_no_cell_and_numbers_stand_right() {
        let text = markdown_table(&Table::new(["a", "b"]).rows([["1|2", "3"], ["", "4"]]));
        assert_eq!(text, "| a | b |\n|---|---:|\n| 1\\|2 | 3 |\n| | 4 |\n");
    }

    #[test]
    fn a_name_is_neither_a_tag_nor_a_link() {
        let text = "<script>x</script> a < b, T2 <- T1 <!-- --> \\<b> \\\\<i>\n[x](y) [x][y] [x]: z [K] (z)";
        let expected = "&lt;script>x&lt;/script> a < b, T2 <- T1 &lt;!-- --> \\&lt;b> \\\\&lt;i> [x]\\(y) [x]\\[y] [x]\\: z [K] (z)";
        assert_eq!(markdown_text(text), expected);
    }
}
