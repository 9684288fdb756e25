//! A document as HTML and as Markdown.

use crate::document::model::{Block, Cell, Document, Facts, Look, Row, Section, Table, Tone, verdict_word};
use mapper_core::{step_number, terminal_text};
use maud::{Markup, PreEscaped, html};

impl Document {
    pub(crate) fn html(&self) -> Markup {
        self.html_at(2)
    }

    fn html_at(&self, level: usize) -> Markup {
        html! { @for block in &self.blocks { (block_html(block, level)) } }
    }
}

fn block_html(block: &Block, level: usize) -> Markup {
    match block {
        Block::Paragraph(words, Tone::Plain) => html! { p { (prose(words)) } },
        Block::Paragraph(words, Tone::Strong) => html! { p { strong { (sentence(words)) } } },
        Block::Paragraph(words, Tone::Verdict(verdict)) => {
            html! { p class=(verdict_word(*verdict)) { (prose(words)) } }
        }
        Block::List { items, numbered: true } => {
            html! { ol { @for item in items { li { (sentence(item)) } } } }
        }
        Block::List { items, numbered: false } => {
            html! { ul { @for item in items { li { (sentence(item)) } } } }
        }
        Block::Facts(Facts { caption, rows }) => html! {
            table.facts {
                @if !caption.is_empty() { caption { (caption) } }
                tbody { @for (name, value) in rows { tr { th scope="row" { (name) } td { (prose(value)) } } } }
            }
        },
        Block::Table(table) => table_html(table),
        Block::Figures { caption, figures } => html! {
            figure {
                div.plots { @for figure in figures { div { (PreEscaped(figure.to_svg())) } } }
                figcaption { (caption) }
            }
        },
        Block::Code(lines) => html! { pre tabindex="0" { (lines) } },
        Block::Widget(widget) => widget.html.clone(),
        Block::Section(section) => section_html(section, level),
    }
}

fn section_html(section: &Section, level: usize) -> Markup {
    let Section { heading, id, folded, body } = section;
    let inner = body.html_at(level + 1);
    match id {
        _ if *folded => html! { details { summary { (heading) } (inner) } },
        Some(id) => html! {
            section id=(id) aria-labelledby=(format!("{id}-head")) {
                h2 id=(format!("{id}-head")) { (heading) }
                (inner)
            }
        },
        None if level <= 2 => html! { h2 { (heading) } (inner) },
        None if level == 3 => html! { h3 { (heading) } (inner) },
        None => html! { h4 { (heading) } (inner) },
    }
}

/// A table that may be wider than the screen: it scrolls by keyboard too. The page's script makes it sortable and adds a copy button.
fn table_html(table: &Table) -> Markup {
    let name = if table.caption.is_empty() { "table" } else { &table.caption };
    html! {
        div.scroll tabindex="0" role="region" aria-label=(name) {
            table.data {
                @if !table.caption.is_empty() { caption { (table.caption) } }
                thead {
                    tr { @for (head, text) in table.heads.iter().zip(&table.texts) { th.text[*text] scope="col" { (head) } } }
                }
                tbody { @for row in &table.rows { (row_html(table, row)) } }
            }
        }
    }
}

fn row_html(table: &Table, row: &Row) -> Markup {
    html! {
        tr data-step=[row.step.map(step_number)] {
            @for (cell, text) in row.cells.iter().zip(&table.texts) { (cell_html(cell, *text)) }
        }
    }
}

fn cell_html(cell: &Cell, is_text: bool) -> Markup {
    let verdict = match cell.look {
        Look::Verdict(verdict) => Some(verdict_word(verdict)),
        _ => is_text.then_some("text"),
    };
    html! {
        td data-sort=[cell.value] class=[verdict] style=[heat_style(cell.look)] {
            (prose(&cell.text))
            @if let Look::Bar(share) = cell.look {
                " " span.bar style=(format!("width:{:.1}em", 15.0 * share)) {}
            }
        }
    }
}

/// White to red; the letters have a contrast above 4.5 on each.
fn heat_style(look: Look) -> Option<String> {
    let Look::Heat(heat) = look else { return None };
    let fade = (255.0 * (1.0 - heat)) as u8;
    let ink = if heat > 0.75 { "#fff" } else { "#000" };
    Some(format!("color:{ink};background:rgb({},{fade},{fade})", 255 - (60.0 * heat) as u8))
}

/// The sentence as HTML; text between backticks becomes code.
fn prose(sentence: &str) -> Markup {
    let parts: Vec<&str> = sentence.split('`').collect();
    // An unmatched backtick stays a backtick.
    let is_paired = parts.len() % 2 == 1;
    html! {
        @if is_paired {
            @for (index, part) in parts.iter().enumerate() {
                @if index % 2 == 1 { code { (part) } } @else { (part) }
            }
        } @else { (sentence) }
    }
}

/// The same with a capital first letter and a final full stop.
pub(crate) fn sentence(text: &str) -> Markup {
    let text = text.trim();
    let mut letters = text.chars();
    let first = letters.next();
    // Symbols (T2, alpha_A) keep their case.
    let is_word = letters.clone().next().is_some_and(char::is_alphabetic)
        && !text.split_whitespace().next().is_some_and(|word| word.contains('_'));
    let capital: String = match first {
        Some(first) if is_word => first.to_uppercase().chain(letters).collect(),
        _ => text.to_owned(),
    };
    prose(&if capital.ends_with(['.', ':', '!', '?']) { capital } else { format!("{capital}.") })
}

impl Document {
    /// The document as Markdown, its sections at level 2. Names and messages from outside are in it, but neither HTML, links nor colours.
    pub fn markdown(&self) -> String {
        self.markdown_at(2)
    }

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
    use super::{prose, sentence};

    #[test]
    fn code_is_between_backticks_and_markup_stays_text() {
        assert_eq!(prose("`joint` finds <it>").into_string(), "<code>joint</code> finds &lt;it&gt;");
        assert_eq!(prose("one ` alone").into_string(), "one ` alone");
    }

    #[test]
    fn sentences_begin_and_end_as_sentences_do() {
        assert_eq!(sentence("no jump leads here").into_string(), "No jump leads here.");
        assert_eq!(sentence("alpha_A is assumed.").into_string(), "alpha_A is assumed.");
        assert_eq!(sentence("`joint` finds it").into_string(), "<code>joint</code> finds it.");
    }
}

#[cfg(test)]
mod markdown_tests {
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
