//! A diagnosis as a page with pictures: one self-contained HTML file.

use crate::diagnosis::gap_text::{cause, display_scale, part_name};
use crate::page::prose::sentence;
use crate::page::shell::{Purpose, shell};
use crate::page::table::scrolling;
use crate::{
    NOTHING, OUTSIDE, UNLISTED, four_figures, gap_text, headline, next_measurement, stand_actions,
    suspect_text,
};
use mapper_chart::palette::{self, Colour};
use mapper_chart::{Axis, Figure, Line, Panel, Scatter};
use mapper_core::{Channel, probability_text, step_number};
use mapper_diagnose::gap::{Diagnosed, OUTPUTS, Study, Verdict};
use mapper_numerics::statistics::{mean, rms};
use maud::{Markup, PreEscaped, html};

/// The page. `machine` and `recording` are names for its title.
///
/// # Errors
/// None in practice: JSON of numbers and strings can always be written.
pub fn gap_page(machine: &str, recording: &str, diagnosed: &Diagnosed) -> Result<String, serde_json::Error> {
    let title = format!("Gap between {machine} and its nominal model");
    let body = html! {
        header {
            h1 { (title) }
            p.under { "Recording: " (recording) }
            section.verdict.clean[diagnosed.diagnosis.verdict == Verdict::WithinTolerance] aria-labelledby="verdict" {
                h2 #verdict { (sentence(&headline(&diagnosed.diagnosis))) }
            }
        }
        main #gap { (sections(diagnosed, &|title| html! { h2 { (title) } })) }
    };
    shell(&title, &title, Purpose::Still, &(), &body)
}

/// The diagnosis as a section of another page, below a heading of its own: its headline and the full content of its page.
pub fn gap_part(diagnosed: &Diagnosed) -> Markup {
    html! {
        p { b { (headline(&diagnosed.diagnosis)) } }
        (sections(diagnosed, &|title| html! { h3 { (title) } }))
    }
}

/// The findings and their evidence, each below a heading, and the recommended actions.
fn sections(diagnosed: &Diagnosed, heading: &dyn Fn(&str) -> Markup) -> Markup {
    let diagnosis = &diagnosed.diagnosis;
    let (actions, measurement) = (stand_actions(diagnosis), next_measurement(diagnosis));
    // The nearest cause of a rig without a gap explains nothing.
    let with_cause = diagnosed.with_cause.as_ref().filter(|_| diagnosis.verdict != Verdict::WithinTolerance);
    html! {
        // The closure term in the headline is not repeated.
        @for term in diagnosis.closure_terms.iter().filter(|term| !headline(diagnosis).contains(&term.sentence)) {
            p { "Closure term for " (term.submodel) ": " b { (term.sentence) } }
        }
        (heading("Causes"))
        (causes(diagnosed))
        @for suspect in &diagnosis.suspects { p { "Suspect: " (suspect_text(suspect)) "." } }
        (heading("Place in the machine"))
        @if diagnosis.locations.is_empty() { p { "No part departs from the model by more than noise." } }
        @else { (places(diagnosed)) }
        @if !diagnosis.inseparable.is_empty() {
            p { "Inseparable in this recording: " (diagnosis.inseparable.join(", ")) "." }
        }
        (pictures("Ends of the steps on the map, coloured by the difference between measured and computed readings.", residual_maps(diagnosed)))
        @if !diagnosis.closure_terms_by_balance.is_empty() {
            (heading("Missing heat, power or flow of each balance, if it alone has one"))
            (closure_terms_by_balance(diagnosed))
        }
        (heading("Difference between measured and computed readings"))
        p {
            "Root mean square for each step and channel, in units of the declared uncertainty: 1 is noise. \
             Tolerances are fitted."
        }
        div.plots {
            (heat_map(diagnosed, "without a cause", &diagnosed.without_cause.1))
            @if let Some((cause, fit)) = with_cause { (heat_map(diagnosed, &format!("with {cause}"), &fit.residual)) }
        }
        @if with_cause.is_some() {
            (pictures("Measured minus computed readings over time, of the four channels with the largest gap.", traces(diagnosed)))
        }
        (heading("What to do"))
        @if actions.is_empty() && measurement.is_none() { p { "Nothing: the rig is as declared." } }
        @else {
            ol {
                @for action in &actions { li { (sentence(action)) } }
                @if let Some(measurement) = measurement { li { (sentence(&measurement)) } }
                li { "Then record again, and repeat the diagnosis." }
            }
        }
        details {
            summary { "All results as text" }
            pre tabindex="0" role="region" aria-label="the diagnosis as text" { (gap_text(diagnosis)) }
        }
    }
}

/// Pictures next to each other, on a phone below each other.
fn pictures(caption: &str, svgs: Vec<String>) -> Markup {
    html! {
        figure {
            div.plots { @for svg in svgs { div { (PreEscaped(svg)) } } }
            figcaption { (caption) }
        }
    }
}

/// The most probable causes with their probabilities as bars.
fn causes(diagnosed: &Diagnosed) -> Markup {
    let diagnosis = &diagnosed.diagnosis;
    let candidates = diagnosis.listed().take(8);
    let rows = candidates.map(|candidate| (cause(candidate), candidate.probability)).chain([
        (NOTHING.to_owned(), diagnosis.probability_none),
        (UNLISTED.to_owned(), diagnosis.probability_unlisted),
        (OUTSIDE.to_owned(), diagnosis.probability_outside),
    ]);
    let mut rows: Vec<(String, f64)> = rows.collect();
    rows.sort_by(|a, b| b.1.total_cmp(&a.1));
    let table = html! {
        table {
            tr { th { "cause" } th { "probability" } th {} }
            @for (name, probability) in rows {
                tr {
                    td { (name) }
                    td { (probability_text(probability)) }
                    td.left {
                        span.bar style=(format!("width:{:.1}em", 15.0 * probability.clamp(0.0, 1.0))) {}
                    }
                }
            }
        }
    };
    scrolling("causes and their probabilities", &table)
}

/// The residual source term of each balance at the end of each step, if that balance alone has one.
fn closure_terms_by_balance(diagnosed: &Diagnosed) -> Markup {
    let terms = &diagnosed.diagnosis.closure_terms_by_balance;
    let table = html! {
        table {
            tr {
                th { "step" }
                @for source in terms { th { (source.quantity) ", " (source.unit) } }
            }
            @for step in 0..diagnosed.study.steps.len() {
                tr {
                    td { (step_number(step)) }
                    @for [value, low, high] in terms.iter().filter_map(|source| source.steps.get(step)) {
                        td title=(format!("{low:.3e} .. {high:.3e}")) { (four_figures(*value)) }
                    }
                }
            }
        }
    };
    scrolling("missing heat, power or flow by step and balance", &table)
}

/// The parts of the machine in order of their share of the gap.
fn places(diagnosed: &Diagnosed) -> Markup {
    let table = html! {
        table {
            tr { @for head in ["part", "share", "sigma", "channel", "after the jump", "region"] { th { (head) } } }
            @for place in &diagnosed.diagnosis.locations {
                tr {
                    td { (part_name(&place.submodel)) }
                    td { (format!("{:.0} %", 100.0 * place.share)) }
                    td { (format!("{:.0}", place.sigma)) }
                    td { (place.channel) }
                    td { (place.phase) }
                    td { (place.region) }
                }
            }
        }
    };
    scrolling("where the gap lies", &table)
}

/// Classes of residuals in the map: upper bound in sigma, colour and name.
const CLASSES: [(f64, Colour, &str); 4] = [
    (1.3, palette::GREY, "noise"),
    (3.0, palette::SKY, "up to 3 sigma"),
    (10.0, palette::ORANGE, "up to 10 sigma"),
    (f64::INFINITY, palette::VERMILLION, "beyond 10 sigma"),
];

/// Ends of the steps on the compressor map, coloured by their residual, before and after.
fn residual_maps(diagnosed: &Diagnosed) -> Vec<String> {
    let mut pictures = Vec::new();
    let after = diagnosed.with_cause.as_ref().map(|(cause, fit)| (format!("with {cause}"), &fit.residual));
    for (title, residual) in
        [("without the cause".to_owned(), &diagnosed.without_cause.1)].into_iter().chain(after)
    {
        let mut classes: [Vec<(f64, f64)>; CLASSES.len()] = Default::default();
        for step in 0..diagnosed.study.steps.len() {
            let Some(place) = place_on_map(&diagnosed.study, step) else { continue };
            let groups = diagnosed.study.groups.iter().filter(|group| group.step == step);
            let rms = rms(groups.flat_map(|group| &residual[group.rows.clone()])).unwrap_or(0.0);
            let class = CLASSES.iter().position(|(up_to, ..)| rms <= *up_to).unwrap_or(CLASSES.len() - 1);
            classes[class].push(place);
        }
        let mut panel =
            Panel::new(Axis::new("compressor flow, g/s"), Axis::new("pressure ratio P2/P1")).title(title);
        for ((_, colour, name), points) in CLASSES.iter().zip(classes) {
            if !points.is_empty() {
                panel.add(Scatter::new(points, *colour).size_px(9.0).label(*name));
            }
        }
        pictures.push(Figure::new("").columns(1).panel_size_px(430.0, 300.0).panel(panel).to_svg());
    }
    pictures
}

/// Flow in g/s and pressure ratio as measured in the last 10 s of a step.
fn place_on_map(study: &Study, step: usize) -> Option<(f64, f64)> {
    let end_s = study.steps[step].marker.end_s;
    let read = |channel: Channel| {
        let values = &study.table.column(channel)?[study.table.range(end_s - 10.0, end_s)];
        let values: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
        mean(&values)
    };
    let p1_pa = read(Channel::P1).unwrap_or(study.declared.nominal.p1_pa);
    Some((1e3 * read(Channel::CompressorFlow)?, read(Channel::P2)? / p1_pa))
}

/// Root mean square of the whitened residual of each step and channel, as a table of colours with its numbers.
fn heat_map(diagnosed: &Diagnosed, caption: &str, residual: &[f64]) -> Markup {
    let table = html! {
        table {
            caption { (caption) }
            thead { tr { th { "step" } @for channel in OUTPUTS { th { (channel) } } } }
            tbody {
                @for step in 0..diagnosed.study.steps.len() {
                    tr {
                        td { (step_number(step)) }
                        @for output in 0..OUTPUTS.len() { (heat_cell(diagnosed, residual, step, output)) }
                    }
                }
            }
        }
    };
    scrolling(caption, &table)
}

fn heat_cell(diagnosed: &Diagnosed, residual: &[f64], step: usize, output: usize) -> Markup {
    let group = diagnosed.study.groups.iter().find(|g| g.step == step && g.output == output);
    let Some(group) = group else { return html! { td { "-" } } };
    let rms = rms(&residual[group.rows.clone()]).unwrap_or(0.0);
    // White at 1, red from 30 on, logarithmic.
    let heat = (rms.max(1.0).ln() / 30f64.ln()).clamp(0.0, 1.0);
    let fade = (255.0 * (1.0 - heat)) as u8;
    // Both have a contrast above 4.5 there.
    let ink = if heat > 0.75 { "#fff" } else { "#000" };
    let style = format!("color:{ink};background:rgb({},{fade},{fade})", 255 - (60.0 * heat) as u8);
    html! { td style=(style) { (format!("{rms:.1}")) } }
}

/// Measured minus predicted over time, before and after, for the four channels with the largest gap.
fn traces(diagnosed: &Diagnosed) -> Vec<String> {
    let Some((cause, best)) = &diagnosed.with_cause else { return Vec::new() };
    let energy = |output: usize| {
        let groups = diagnosed.study.groups.iter().filter(|g| g.output == output);
        groups.flat_map(|g| &diagnosed.without_cause.1[g.rows.clone()]).map(|r| r * r).sum::<f64>()
    };
    let mut order: Vec<usize> = (0..OUTPUTS.len()).collect();
    order.sort_by(|a, b| energy(*b).total_cmp(&energy(*a)));
    let picture = |output: usize| {
        let channel = OUTPUTS[output];
        let (scale, unit) = display_scale(channel.unit());
        let points = |values: &[f64]| {
            let of_output = diagnosed.study.groups.iter().filter(|g| g.output == output);
            of_output
                .flat_map(|g| {
                    g.rows.clone().zip(&g.blocks).map(|(row, block)| {
                        let t_s = diagnosed.study.steps[g.step].blocks[*block].mean_s;
                        (t_s / 60.0, scale * (diagnosed.study.measured[row] - values[row]))
                    })
                })
                .collect::<Vec<(f64, f64)>>()
        };
        let panel = Panel::new(Axis::new("time, min"), Axis::new(format!("{channel}, {unit}")))
            .with(
                Line::new(points(&diagnosed.without_cause.0.values), palette::VERMILLION)
                    .label("without the cause"),
            )
            .with(Line::new(points(&best.prediction.values), palette::BLUE).label(format!("with {cause}")));
        Figure::new("").columns(1).panel_size_px(430.0, 180.0).panel(panel).to_svg()
    };
    order.into_iter().take(4).map(picture).collect()
}
