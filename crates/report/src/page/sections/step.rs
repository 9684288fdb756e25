//! The transient of one point.

use crate::page::run_page::RunPage;
use crate::{Display, opening, step_name};
use mapper_core::step_number;
use maud::{Markup, html};

pub(crate) fn step(page: &RunPage<'_>, display: &Display) -> Markup {
    html! {
        section #step aria-labelledby="step-head" {
            h2 #step-head { "Transient of a point" }
            p.screen {
                label for="step-choice" { "Step " }
                select #step-choice {
                    @for point in page.report.identified() {
                        option value=(step_number(point.step)) {
                            (step_name(point)) " · " (display.speed(point.speed_rpm)) " " (display.units().speed)
                            @if point.valve_opening_ratio.is_finite() { " · opening " (opening(point.valve_opening_ratio)) }
                        }
                    }
                }
            }
            div #step-words aria-live="polite" {}
            div.plots #step-plots {}
        }
    }
}
