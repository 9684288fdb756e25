//! The parts of a report that work only in a browser: map, transient of a point, and plan.

use crate::formatting::Display;
use crate::point_results::points::step_name;
use crate::point_results::summary::PointResults;
use crate::test_report::zero_and_sensors::soft_criterion;
use mapper_core::{CompressorMap, Verdict, step_number, valve_area_text};
use maud::{Markup, html};

/// Another run's map.
pub struct OtherRun<'a> {
    /// Its name in the report.
    pub name: String,
    /// Its map.
    pub map: &'a CompressorMap,
}

/// Layers that can be switched: name in the script, label, whether it is on at first.
const LAYERS: [(&str, &str, bool); 6] = [
    ("lines", "speed lines", true),
    ("contours", "efficiency contours", true),
    ("extrapolated", "extrapolation", false),
    ("intervals", "95 % intervals", true),
    ("repeats", "repeats", false),
    ("dynamic", "dynamic method", false),
];

pub(crate) fn map_widget(results: &PointResults<'_>, others: &[OtherRun<'_>], display: &Display) -> Markup {
    let speed = &display.units.speed;
    let has_dynamic = !results.dynamic.is_empty();
    html! {
        fieldset.layers.screen {
            legend { "Show" }
            @for (name, words, on) in LAYERS.into_iter().filter(|(name, ..)| *name != "dynamic" || has_dynamic) {
                label { input type="checkbox" name="layer" value=(name) checked[on]; " " (words) }
            }
            @for (index, other) in others.iter().enumerate() {
                label { input type="checkbox" name="layer" value=(format!("other{index}")) checked; " " (other.name) }
            }
            button type="button" id="whole" { "Reset zoom" }
        }
        (legend(results))
        div.plots {
            figure { div #map-plot {} figcaption { "Pressure ratio over corrected flow. Numbers at lines: corrected speed in " (speed) "; numbers on contours: efficiency in %." span.screen { " Zoom with Ctrl and the wheel, move by dragging; click a point to see its transient." } } }
            figure { div #eta-plot {} figcaption { "Efficiency over corrected flow, with 95 % intervals. Numbers at lines: corrected speed in " (speed) "." } }
        }
        noscript { p { "The drawings need JavaScript; the same map is next to this file as map.svg." } }
    }
}

fn legend(results: &PointResults<'_>) -> Markup {
    let PointResults { map, points, .. } = *results;
    let has = |verdict| points.iter().any(|scored| scored.point.verdict == verdict);
    let is_fitted = map.is_some_and(|map| map.fitted.is_some());
    let is_sought = map.is_some_and(|map| !map.surge.is_empty());
    let soft = map.and_then(|map| map.surge.iter().find_map(|mark| mark.soft));
    html! {
        ul.signs aria-label="Signs" {
            @if has(Verdict::Good) { li { svg aria-hidden="true" viewBox="0 0 12 12" { circle cx="6" cy="6" r="4" {} } "good point" } }
            @if has(Verdict::Doubtful) { li { svg aria-hidden="true" viewBox="0 0 12 12" { path d="M6 1 10 6 6 11 2 6Z" {} } "doubtful point" } }
            @if has(Verdict::Unusable) {
                li { svg aria-hidden="true" viewBox="0 0 12 12" { path.hollow d="M6 1 10 6 6 11 2 6Z" {} } "no usable efficiency" }
            }
            @if is_sought { li { svg.bad aria-hidden="true" viewBox="0 0 12 12" { rect x="2" y="2" width="8" height="8" {} } "measured surge, with its 95 % interval" } }
            @if let Some(soft) = soft {
                li { svg.bad aria-hidden="true" viewBox="0 0 28 12" { path d="M0 6H28" stroke-dasharray="1 4" {} } "soft surge: " (soft_criterion(&soft)) }
            }
            @if is_fitted {
                li {
                    svg.bad aria-hidden="true" viewBox="0 0 28 12" { path d="M0 6H28" stroke-dasharray="6 3" {} }
                    @if is_sought { "surge line" } @else { "last points towards surge; surge itself was not measured" }
                }
                li { svg.doubt aria-hidden="true" viewBox="0 0 28 12" { path d="M0 6H28" stroke-dasharray="2 3" {} } "choke, fitted" }
            }
            li.screen { svg.ring aria-hidden="true" viewBox="0 0 12 12" { circle cx="6" cy="6" r="4.5" {} } "point whose transient is shown below" }
        }
    }
}

pub(crate) fn step_widget(results: &PointResults<'_>, display: &Display) -> Markup {
    html! {
        p.screen {
            label for="step-choice" { "Step " }
            select #step-choice {
                @for point in results.identified() {
                    option value=(step_number(point.step)) {
                        (step_name(point)) " · " (display.speed(point.speed_rpm)) " " (display.units.speed)
                        @if point.valve_opening_ratio.is_finite() { " · valve area " (valve_area_text(point.valve_opening_ratio)) }
                    }
                }
            }
        }
        div #step-words aria-live="polite" {}
        div.plots #step-plots {}
    }
}

pub(crate) fn plan_widget() -> Markup {
    html! {
        figure { div #plan-plot {} figcaption { "The jumps in their order, the first ones darkest. The numbers are steps; the table has those without space here." } }
    }
}
