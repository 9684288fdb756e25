//! The interactive map.

use crate::run_page::RunPage;
use maud::{Markup, html};

/// Layers that can be switched: name in the script, name for people, whether it is on at first.
const LAYERS: [(&str, &str, bool); 6] = [
    ("lines", "speed lines", true),
    ("contours", "efficiency contours", true),
    ("extrapolated", "extrapolation", false),
    ("intervals", "95 % intervals", true),
    ("repeats", "repeats", false),
    ("dynamic", "two-parameter method", false),
];

pub(crate) fn map(page: &RunPage<'_>) -> Markup {
    let has_dynamic = !page.report.two_parameter.is_empty();
    html! {
        section #map aria-labelledby="map-head" {
            h2 #map-head { "Map" }
            fieldset.layers.screen {
                legend { "Show" }
                @for (name, words, on) in LAYERS.into_iter().filter(|(name, ..)| *name != "dynamic" || has_dynamic) {
                    label { input type="checkbox" name="layer" value=(name) checked[on]; " " (words) }
                }
                @for (index, other) in page.others.iter().enumerate() {
                    label { input type="checkbox" name="layer" value=(format!("other{index}")) checked; " " (other.name) }
                }
                button type="button" id="whole" { "whole map" }
            }
            div.plots {
                figure { div #map-plot {} figcaption { "Pressure ratio over corrected flow." span.screen { " Ctrl and the wheel zoom, dragging moves; a click on a point shows its transient." } } }
                figure { div #eta-plot {} figcaption { "Efficiency over corrected flow, with 95 % intervals." } }
            }
            noscript { p { "The drawings need the page's own script; the same map stands beside this file as map.svg." } }
        }
    }
}
