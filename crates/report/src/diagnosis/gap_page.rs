//! A diagnosis as a page with pictures: one self-contained HTML file.

use crate::diagnosis::gap_text::{gap_text, headline, named};
use crate::formatting::number::four_figures;
use mapper_chart::palette::{self, Colour};
use mapper_chart::{Axis, Figure, Line, Panel, Scatter};
use mapper_core::Channel;
use mapper_diagnose::gap::diagnose::Diagnosed;
use mapper_diagnose::gap::residuals::nuisance::OUTPUTS;
use mapper_diagnose::gap::residuals::study::Study;
use mapper_numerics::statistics::mean;
use maud::{DOCTYPE, Markup, PreEscaped, html};

const STYLE: &str = "\
:root{--ink:#1b1f24;--soft:#545d68;--line:#d0d7de;--ground:#fff;--card:#f6f8fa;--bar:#4477aa}\
@media (prefers-color-scheme:dark){:root{--ink:#e6edf3;--soft:#a9b4c0;--line:#3d444d;--ground:#0d1117;--card:#161b22;--bar:#79b8ff}\
svg{background:#fff;border-radius:.4rem}}\
*{box-sizing:border-box}\
body{font:16px/1.5 system-ui,sans-serif;max-width:72rem;margin:0 auto;padding:1rem;color:var(--ink);background:var(--ground)}\
h1{font-size:1.5rem;line-height:1.3}h2{font-size:1.2rem;margin:2rem 0 .5rem}\
h1,p{overflow-wrap:anywhere;max-width:65rem}p{color:var(--soft)}\
.scroll{overflow-x:auto;margin:0 0 1rem}\
:focus-visible{outline:3px solid var(--bar)}\
table{border-collapse:collapse;font-size:.88rem;font-variant-numeric:tabular-nums}\
td,th{padding:.2em .6em;text-align:right;white-space:nowrap;border-bottom:1px solid var(--line)}\
th{color:var(--soft)}\
td:first-child,th:first-child,td.left{text-align:left}\
td:first-child,th:first-child{position:sticky;left:0;background:var(--ground)}\
.bar{background:var(--bar);height:1em;display:inline-block}\
svg{max-width:100%;height:auto}\
pre{background:var(--card);padding:1em;overflow:auto;white-space:pre-wrap}\
@media print{:root{--ink:#000;--soft:#333;--line:#999;--ground:#fff;--card:#fff}.scroll{overflow:visible}table{font-size:7pt}}";

/// No requests in or out.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'";

/// A table that may be wider than the screen: it scrolls separately, by keyboard too.
fn wide(name: &str, table: &Markup) -> Markup {
    html! { div.scroll tabindex="0" role="region" aria-label=(name) { (table) } }
}

/// The page.
pub fn gap_page(title: &str, done: &Diagnosed) -> String {
    let diagnosis = &done.diagnosis;
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { "Gap diagnosis of " (title) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                main {
                    h1 { (headline(diagnosis)) }
                    p { (title) }
                    (sections(done, &|title| html! { h2 { (title) } }))
                }
            }
        }
    };
    page.into_string()
}

/// The diagnosis as a section of another page, below a heading of its own: its headline and the full content of its page.
pub fn gap_part(done: &Diagnosed) -> Markup {
    html! {
        p { b { (headline(&done.diagnosis)) } }
        (sections(done, &|title| html! { h3 { (title) } }))
    }
}

/// The findings and their evidence, each below a heading.
fn sections(done: &Diagnosed, heading: &dyn Fn(&str) -> Markup) -> Markup {
    let diagnosis = &done.diagnosis;
    html! {
        // The closure term in the headline is not repeated.
        @for law in diagnosis.laws.iter().filter(|law| !headline(diagnosis).contains(&law.sentence)) {
            p { "A law for what is missing in " (law.submodel) ": " b { (law.sentence) } }
        }
        (heading("Which"))
        (causes(done))
        (heading("Where"))
        @if diagnosis.r#where.is_empty() { p { "No part departs from the model by more than noise." } }
        @else { (places(done)) }
        (PreEscaped(map_of_where(done)))
        @if !diagnosis.forces.is_empty() {
            (heading("Missing forces, each as if it were the only one"))
            (forces(done))
        }
        (heading("Residuals without the cause, step by channel, in sigma"))
        p {
            "Each number is the root mean square of a step and channel in units of what is declared: 1 is noise. \
             Tolerances are those fitted together with the cause or law."
        }
        (heat_map(done, &done.without_cause.1))
        @if let Some((what, fit)) = &done.with_cause {
            (heading(&format!("Residuals with {what}")))
            (heat_map(done, &fit.residual))
            (heading("Before and after"))
            (PreEscaped(traces(done)))
        }
        (heading("In words"))
        pre tabindex="0" role="region" aria-label="the diagnosis in words" { (gap_text(diagnosis)) }
    }
}

/// The most probable causes with their probabilities as bars.
fn causes(done: &Diagnosed) -> Markup {
    let diagnosis = &done.diagnosis;
    let candidates = diagnosis.candidates.iter().take(8);
    let rows = candidates.map(|candidate| (named(candidate), candidate.probability)).chain([
        ("nothing beyond tolerance".to_owned(), diagnosis.probability_none),
        ("a cause outside the catalogue".to_owned(), diagnosis.probability_outside),
    ]);
    let mut rows: Vec<(String, f64)> = rows.collect();
    rows.sort_by(|a, b| b.1.total_cmp(&a.1));
    let table = html! {
        table {
            tr { th { "cause" } th { "probability" } th {} }
            @for (name, probability) in rows {
                tr {
                    td { (name) }
                    td { (format!("{:.1} %", 100.0 * probability)) }
                    td.left {
                        span.bar style=(format!("width:{:.0}px", 300.0 * probability.clamp(0.0, 1.0))) {}
                    }
                }
            }
        }
    };
    wide("causes and their probabilities", &table)
}

/// The residual source term of each balance at the end of each step, if that balance alone has one.
fn forces(done: &Diagnosed) -> Markup {
    let table = html! {
        table {
            tr {
                th { "balance" }
                th { "unit" }
                @for step in 1..=done.study.steps.len() { th { (step) } }
            }
            @for force in &done.diagnosis.forces {
                tr {
                    td { (force.force) }
                    td { (force.unit) }
                    @for [value, low, high] in &force.steps {
                        td title=(format!("{low:.3e} .. {high:.3e}")) { (four_figures(*value)) }
                    }
                }
            }
        }
    };
    wide("missing forces by balance and step", &table)
}

/// The parts of the machine in order of their share of the gap.
fn places(done: &Diagnosed) -> Markup {
    let table = html! {
        table {
            tr { @for head in ["part", "share", "sigma", "channel", "phase", "region"] { th { (head) } } }
            @for place in &done.diagnosis.r#where {
                tr {
                    td { (place.submodel) }
                    td { (format!("{:.0} %", 100.0 * place.share)) }
                    td { (format!("{:.0}", place.sigma)) }
                    td { (place.channel) }
                    td { (place.phase) }
                    td { (place.region) }
                }
            }
        }
    };
    wide("where the gap lies", &table)
}

/// Classes of residuals in the map: upper bound in sigma, colour and name.
const CLASSES: [(f64, Colour, &str); 4] = [
    (1.3, palette::GREY, "noise"),
    (3.0, palette::SKY, "up to 3 sigma"),
    (10.0, palette::ORANGE, "up to 10 sigma"),
    (f64::INFINITY, palette::VERMILLION, "beyond 10 sigma"),
];

/// Ends of the steps on the compressor map, coloured by their residual, before and after.
fn map_of_where(done: &Diagnosed) -> String {
    let mut figure = Figure::new("Where on the map").columns(2).panel_size_px(430.0, 300.0);
    let after = done.with_cause.as_ref().map(|(what, fit)| (format!("with {what}"), &fit.residual));
    for (title, residual) in
        [("without the cause".to_owned(), &done.without_cause.1)].into_iter().chain(after)
    {
        let mut classes: [Vec<(f64, f64)>; CLASSES.len()] = Default::default();
        for step in 0..done.study.steps.len() {
            let Some(place) = place_on_map(&done.study, step) else { continue };
            let here: Vec<f64> = done
                .study
                .groups
                .iter()
                .filter(|group| group.step == step)
                .flat_map(|group| &residual[group.rows.clone()])
                .map(|r| r * r)
                .collect();
            let rms = (here.iter().sum::<f64>() / here.len().max(1) as f64).sqrt();
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
        figure = figure.panel(panel);
    }
    figure.to_svg()
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
fn heat_map(done: &Diagnosed, residual: &[f64]) -> Markup {
    let steps = done.study.steps.len();
    let table = html! {
        table {
            tr {
                th { "channel" }
                @for step in 1..=steps { th { (step) } }
            }
            @for (output, channel) in OUTPUTS.iter().enumerate() {
                tr {
                    td { (channel) }
                    @for step in 0..steps { (heat_cell(done, residual, step, output)) }
                }
            }
        }
    };
    wide("residuals by channel and step", &table)
}

fn heat_cell(done: &Diagnosed, residual: &[f64], step: usize, output: usize) -> Markup {
    let group = done.study.groups.iter().find(|g| g.step == step && g.output == output);
    let Some(group) = group else { return html! { td { "-" } } };
    let here = &residual[group.rows.clone()];
    let rms = (here.iter().map(|r| r * r).sum::<f64>() / here.len().max(1) as f64).sqrt();
    // White at 1, red from 30 on, logarithmic.
    let heat = (rms.max(1.0).ln() / 30f64.ln()).clamp(0.0, 1.0);
    let fade = (255.0 * (1.0 - heat)) as u8;
    // Both have a contrast above 4.5 there.
    let ink = if heat > 0.75 { "#fff" } else { "#000" };
    let style = format!("color:{ink};background:rgb({},{fade},{fade})", 255 - (60.0 * heat) as u8);
    html! { td style=(style) { (format!("{rms:.1}")) } }
}

/// Measured minus predicted over time, before and after, for the four channels with the largest gap.
fn traces(done: &Diagnosed) -> String {
    let Some((what, best)) = &done.with_cause else { return String::new() };
    let energy = |output: usize| {
        let groups = done.study.groups.iter().filter(|g| g.output == output);
        groups.flat_map(|g| &done.without_cause.1[g.rows.clone()]).map(|r| r * r).sum::<f64>()
    };
    let mut order: Vec<usize> = (0..OUTPUTS.len()).collect();
    order.sort_by(|a, b| energy(*b).total_cmp(&energy(*a)));
    let mut figure = Figure::new("Measured minus predicted").columns(1).panel_size_px(900.0, 180.0);
    for output in order.into_iter().take(4) {
        let points = |values: &[f64]| {
            let of_output = done.study.groups.iter().filter(|g| g.output == output);
            of_output
                .flat_map(|g| {
                    g.rows.clone().zip(&g.blocks).map(|(row, block)| {
                        let t_s = done.study.steps[g.step].blocks[*block].mean_s;
                        (t_s / 60.0, done.study.measured[row] - values[row])
                    })
                })
                .collect::<Vec<(f64, f64)>>()
        };
        let channel = OUTPUTS[output];
        let panel = Panel::new(Axis::new("time, min"), Axis::new(format!("{channel}, {}", channel.unit())))
            .with(
                Line::new(points(&done.without_cause.0.values), palette::VERMILLION)
                    .label("without the cause"),
            )
            .with(Line::new(points(&best.prediction.values), palette::BLUE).label(format!("with {what}")));
        figure = figure.panel(panel);
    }
    figure.to_svg()
}
