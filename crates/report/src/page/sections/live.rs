//! The parts of the live page, filled by its script.

use maud::{Markup, html};

/// Buttons: request, label, confirmation question.
const BUTTONS: [(&str, &str, &str); 4] = [
    ("hold", "Hold", "Stay at this step until the operator continues?"),
    ("go-on", "Go on", "Let the held step end as planned?"),
    (
        "stop",
        "Stop at the end of the step",
        "Stop the run at the end of this step, and identify the measured steps?",
    ),
    ("safe", "Safe now", "Bring the rig into its safe state now? The step that is under way is lost."),
];

pub(crate) fn live() -> Markup {
    html! {
        header {
            h1 #title { "Run" }
            p #connection role="status" { "Connecting." }
        }
        main {
            section.verdict #now aria-labelledby="phase" {
                h2 #phase { "-" }
                progress #bar max="1" value="0" aria-label="share of the planned rig time" {}
                p #where {}
                p #left {}
                div.buttons {
                    @for (ask, words, question) in BUTTONS {
                        button type="button" data-ask=(ask) data-question=(question) disabled { (words) }
                    }
                }
            }
            dialog #sure aria-labelledby="question" {
                p #question {}
                div.buttons {
                    button type="button" #yes { "Yes" }
                    button type="button" #no { "No" }
                }
            }
            section aria-labelledby="map-head" {
                h2 #map-head { "Map so far" }
                p { "Rings: expected points. Each point is preliminary: it is identified by itself at the end of its step, before the zero is subtracted. At the end of the \
                     run all points are identified together, with narrower intervals and final verdicts." }
                fieldset.layers.screen {
                    legend { "Show" }
                    @for (name, words) in [("lines", "speed lines"), ("contours", "efficiency contours"), ("intervals", "95 % intervals"), ("repeats", "repeats")] {
                        label { input type="checkbox" name="layer" value=(name) checked[name != "repeats"]; " " (words) }
                    }
                    button type="button" id="whole" { "whole map" }
                }
                div.plots {
                    figure { div #map-plot {} figcaption { "Pressure ratio over corrected flow." } }
                    figure { div #eta-plot {} figcaption { "Efficiency over corrected flow." } }
                }
            }
            section aria-labelledby="traces-head" {
                h2 #traces-head { "The last minutes" }
                div.plots #traces {}
            }
            section aria-labelledby="readings-head" {
                h2 #readings-head { "Readings and their limits" }
                div.scroll tabindex="0" role="region" aria-label="Readings and their limits" {
                    table.data.words {
                        thead { tr { @for head in ["channel", "reads", "unit", "state", "min", "max", "description"] { th scope="col" { (head) } } } }
                        tbody #readings {}
                    }
                }
            }
            section aria-labelledby="points-head" {
                h2 #points-head { "Points so far" }
                div.scroll tabindex="0" role="region" aria-label="Points so far" {
                    table.data.remarks {
                        thead {
                            tr {
                                th scope="col" { "step" }
                                th scope="col" #speed-head { "speed" }
                                th scope="col" #flow-head { "flow" }
                                @for head in ["PR", "eta %", "+/-", "h W/(m2 K)", "verdict", "why"] { th scope="col" { (head) } }
                            }
                        }
                        tbody #points {}
                    }
                }
            }
            section aria-labelledby="events-head" {
                h2 #events-head { "Events" }
                ol #events reversed {}
            }
        }
    }
}
