//! Tables that can be sorted and copied.

use maud::{Markup, html};

/// A cell: its text, and its sort key if that is a number.
pub(crate) struct Cell {
    pub(crate) text: String,
    pub(crate) sorted_by: Option<f64>,
    pub(crate) class: Option<&'static str>,
}

impl Cell {
    /// Text, sorted as text.
    pub(crate) fn text(text: impl Into<String>) -> Self {
        Cell { text: text.into(), sorted_by: None, class: None }
    }

    /// A number as displayed, sorted by value.
    pub(crate) fn number(text: impl Into<String>, value: f64) -> Self {
        Cell { text: text.into(), sorted_by: value.is_finite().then_some(value), class: None }
    }

    pub(crate) fn class(mut self, class: &'static str) -> Self {
        self.class = Some(class);
        self
    }
}

/// Rows of cells; a click on a row shows its step.
pub(crate) struct Row {
    pub(crate) step: Option<usize>,
    pub(crate) cells: Vec<Cell>,
}

/// A table that may be wider than the screen: it scrolls separately, by keyboard too.
pub(crate) fn scrolling(name: &str, table: &Markup) -> Markup {
    html! { div.scroll tabindex="0" role="region" aria-label=(name) { (table) } }
}

/// A table of data with a caption. The page's script makes it sortable and adds a copy button.
pub(crate) fn data_table(caption: &str, heads: &[String], rows: &[Row]) -> Markup {
    let table = html! {
        table.data {
            caption { (caption) }
            thead { tr { @for head in heads { th scope="col" { (head) } } } }
            tbody {
                @for row in rows {
                    tr data-step=[row.step.map(mapper_core::step_number)] {
                        @for cell in &row.cells {
                            td data-sort=[cell.sorted_by] class=[cell.class] { (cell.text) }
                        }
                    }
                }
            }
        }
    };
    scrolling(caption, &table)
}

/// A table whose first two columns are text; sortable like the others.
pub(crate) fn words_table<const COLUMNS: usize>(
    caption: &str,
    heads: &[&str; COLUMNS],
    rows: &[[String; COLUMNS]],
) -> Markup {
    let table = html! {
        table.data.words {
            caption { (caption) }
            thead { tr { @for head in heads { th scope="col" { (head) } } } }
            tbody { @for row in rows { tr { @for cell in row { td { (cell) } } } } }
        }
    };
    scrolling(caption, &table)
}

/// A table of names and values, one row each.
pub(crate) fn facts(caption: &str, rows: &[(&str, String)]) -> Markup {
    html! {
        table.facts {
            caption { (caption) }
            tbody { @for (what, value) in rows { tr { th scope="row" { (what) } td { (value) } } } }
        }
    }
}
