//! Tables that can be sorted and copied.

use maud::{Markup, html};

/// A cell: what stands there, and what it is sorted by where that is a number.
pub(crate) struct Cell {
    pub(crate) text: String,
    pub(crate) sorted_by: Option<f64>,
    pub(crate) class: Option<&'static str>,
}

impl Cell {
    /// Text, sorted as such.
    pub(crate) fn text(text: impl Into<String>) -> Self {
        Cell { text: text.into(), sorted_by: None, class: None }
    }

    /// A number as it is shown, sorted by itself.
    pub(crate) fn number(text: impl Into<String>, value: f64) -> Self {
        Cell { text: text.into(), sorted_by: value.is_finite().then_some(value), class: None }
    }

    pub(crate) fn class(mut self, class: &'static str) -> Self {
        self.class = Some(class);
        self
    }
}

/// Rows of cells, each row with the step that a click on it shows.
pub(crate) struct Row {
    pub(crate) step: Option<usize>,
    pub(crate) cells: Vec<Cell>,
}

/// A table of data with a caption, which the page's script makes sortable and gives a button that copies it.
pub(crate) fn data_table(caption: &str, heads: &[String], rows: &[Row]) -> Markup {
    html! {
        div.scroll tabindex="0" role="region" aria-label=(caption) {
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
        }
    }
}

/// A table whose first two columns are words, made sortable as all are.
pub(crate) fn words_table<const COLUMNS: usize>(
    caption: &str,
    heads: &[&str; COLUMNS],
    rows: &[[String; COLUMNS]],
) -> Markup {
    html! {
        div.scroll tabindex="0" role="region" aria-label=(caption) {
            table.data.words {
                caption { (caption) }
                thead { tr { @for head in heads { th scope="col" { (head) } } } }
                tbody { @for row in rows { tr { @for cell in row { td { (cell) } } } } }
            }
        }
    }
}

/// What and its value, a row each.
pub(crate) fn facts(caption: &str, rows: &[(&str, String)]) -> Markup {
    html! {
        table.facts {
            caption { (caption) }
            tbody { @for (what, value) in rows { tr { th scope="row" { (what) } td { (value) } } } }
        }
    }
}
