//! Documents as HTML.

use super::model::{Block, Cell, Document, Facts, Look, Row, Section, Table, Tone, verdict_word};
use mapper_core::step_number;
use maud::{Markup, PreEscaped, html};

impl Document {
    /// The document as HTML, its sections with headings of level 2.
    pub(crate) fn html(&self) -> Markup {
        self.html_at(2)
    }

    /// The same with sections of this level.
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

/// A table that may be wider than the screen: it scrolls separately, by keyboard too. The page's script makes it sortable and adds a copy
/// button.
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
