//! The points by speed line, as in test reports.

use crate::diagnosis::correction_text::{CORRECTION_CAPTION, CORRECTION_HEADS, correction_rows};
use crate::page::run_page::RunPage;
use crate::page::table::{Cell, Row, data_table};
use crate::{
    Display, END_S, PointCell, point_cells, point_groups, point_heads, shared_errors_text, verdict_word,
};
use mapper_core::IdentifiedPoint;
use maud::{Markup, html};

pub(crate) fn points(page: &RunPage<'_>, display: &Display) -> Markup {
    let report = page.report;
    let groups = point_groups(report.map, report.identified(), display);
    let heads = point_heads(display);
    html! {
        section #points aria-labelledby="points-head" {
            h2 #points-head { "Points by speed line" }
            p {
                "+/- covers the 95 % interval, whose ends are in points.json. T2, P2 and T3 are means over the last " (END_S) " s of the step, when the gas is settled and \
                 the housing is not; the uncertainty of readings is given with the instruments. The intervals of flow and pressure ratio are those \
                 of their sensors."
            }
            @if let Some(shared) = shared_errors_text(report.identified(), display) { p { (shared) } }
            @for group in &groups {
                @let rows: Vec<Row> = group.points.iter().map(|point| row(page, display, point)).collect();
                (data_table(&group.caption, &heads, &rows))
            }
            @if !report.corrections.is_empty() {
                @let rows: Vec<Row> = correction_rows(report.corrections).into_iter().map(corrected_row).collect();
                (data_table(&format!("Before and after the correction: {CORRECTION_CAPTION}"), &CORRECTION_HEADS.map(str::to_owned), &rows))
            }
        }
    }
}

fn row(page: &RunPage<'_>, display: &Display, point: &IdentifiedPoint) -> Row {
    let cells = point_cells(page.report.recording, point, display);
    let last = cells.len() - 1;
    let cell = |(index, PointCell { text, value }): (usize, PointCell)| {
        let cell = value.map_or_else(|| Cell::text(text.clone()), |value| Cell::number(text.clone(), value));
        if index == last { cell.class(verdict_word(point.verdict)) } else { cell }
    };
    Row { step: Some(point.step), cells: cells.into_iter().enumerate().map(cell).collect() }
}

fn corrected_row(cells: [String; 6]) -> Row {
    Row { step: None, cells: cells.into_iter().map(Cell::text).collect() }
}
