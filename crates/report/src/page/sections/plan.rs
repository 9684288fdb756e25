//! The executed plan compared with the expected results.

use crate::page::run_page::RunPage;
use crate::page::table::{Cell, Row, data_table};
use crate::{Display, duration, number, percent};
use mapper_core::{PlanStep, standard_error_of, step_number};
use maud::{Markup, html};

pub(crate) fn plan(page: &RunPage<'_>, display: &Display) -> Markup {
    let Some(plan) = page.report.plan else {
        return html! {
            section #plan aria-labelledby="plan-head" {
                h2 #plan-head { "Executed plan" }
                p { "The run has no plan; its steps were found in the recording." }
            }
        };
    };
    let heads = [
        "step".to_owned(),
        display.speed_head("from @ opening,"),
        display.speed_head("to @ opening,"),
        display.speed_head("N reached"),
        "lasted s".to_owned(),
        "planned s".to_owned(),
        "dTc K".to_owned(),
        "sigma of eta expected, points".to_owned(),
        "sigma of eta achieved, points".to_owned(),
    ];
    let rows: Vec<Row> = plan.steps.iter().map(|step| row(page, display, step)).collect();
    let missing = plan.steps.iter().filter(|step| !was_run(page, step)).count();
    html! {
        section #plan aria-labelledby="plan-head" {
            h2 #plan-head { "Executed plan" }
            p {
                "Order " code { (plan.objective) } ", " (duration(plan.duration_s())) " planned"
                @if missing > 0 { "; " (missing) " of " (plan.steps.len()) " steps were not run" } "."
                " The thermal gradient of a step, dTc, is the change of the housing temperature within the window that was used; sigma is one standard error."
            }
            figure { div #plan-plot {} figcaption { "The jumps in their order, the first ones darkest. The numbers are steps; the table has those without space here." } }
            (data_table("Steps", &heads, &rows))
        }
    }
}

fn was_run(page: &RunPage<'_>, step: &PlanStep) -> bool {
    page.report.recording.steps.iter().any(|marker| marker.index == step.index)
}

fn row(page: &RunPage<'_>, display: &Display, step: &PlanStep) -> Row {
    let marker = page.report.recording.steps.iter().find(|marker| marker.index == step.index);
    let point = page.report.identified().find(|point| point.step == step.index);
    let optional = |value: Option<f64>, decimals| match value {
        Some(value) => Cell::number(number(Some(value), decimals), value),
        None => Cell::text("-"),
    };
    let sigma = point.and_then(|point| Some(standard_error_of(point.eta_low?, point.eta_high?)));
    let expected = step.predicted.reported_sigma_eta.or(step.predicted.sigma_eta);
    let lasted_s = marker.map(|marker| marker.end_s - marker.start_s);
    Row {
        step: point.map(|point| point.step),
        cells: vec![
            Cell::number(step_number(step.index).to_string(), step.index as f64),
            Cell::text(step.from.map_or_else(|| "-".to_owned(), |from| display.place(from))),
            Cell::text(display.place(step.to)),
            match point {
                Some(point) => Cell::number(display.speed(point.speed_rpm), point.speed_rpm),
                None => Cell::text("-"),
            },
            optional(lasted_s, 1),
            optional(Some(step.dwell_s), 1),
            optional(point.and_then(|point| point.dtc_k), 1),
            Cell::number(percent(expected, 2), expected.unwrap_or(f64::NAN)),
            Cell::number(percent(sigma, 2), sigma.unwrap_or(f64::NAN)),
        ],
    }
}
