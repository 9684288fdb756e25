//! A diagnosis as a page with pictures: one HTML file that needs nothing else.

use crate::gap_text::{gap_text, headline};
use mapper_chart::palette::{self, Colour};
use mapper_chart::{Axis, Figure, Line, Panel, Scatter};
use mapper_core::Channel;
use mapper_gap::diagnose::Diagnosed;
use mapper_gap::nuisance::OUTPUTS;
use mapper_gap::study::Study;
use std::fmt::Write;

/// The page.
pub fn gap_page(title: &str, done: &Diagnosed) -> String {
    let diagnosis = &done.diagnosis;
    let mut html = String::from(
        "<!doctype html><html lang=\"en\"><meta charset=\"utf-8\"><title>gap diagnosis</title>\
         <style>body{font:15px/1.5 sans-serif;max-width:1100px;margin:2em auto;color:#222}\
         table{border-collapse:collapse}td,th{padding:.2em .6em;text-align:right}\
         td:first-child,th:first-child{text-align:left}.bar{background:#4477aa;height:1em;display:inline-block}\
         svg{max-width:100%;height:auto}pre{background:#f4f4f4;padding:1em;overflow:auto;white-space:pre-wrap}</style>",
    );
    let _ = write!(html, "<h1>{}</h1><p>{}</p>", escape(&headline(diagnosis)), escape(title));
    html += "<h2>Which</h2><table><tr><th>cause</th><th>probability</th><th></th></tr>";
    let mut row = |name: &str, probability: f64| {
        let _ = write!(
            html,
            "<tr><td>{}</td><td>{:.1} %</td><td style=\"text-align:left\"><span class=\"bar\" style=\"width:{:.0}px\"></span></td></tr>",
            escape(name),
            100.0 * probability,
            300.0 * probability.clamp(0.0, 1.0)
        );
    };
    for candidate in diagnosis.candidates.iter().take(8) {
        row(&candidate.effects.join(" + "), candidate.probability);
    }
    row("nothing beyond tolerance", diagnosis.probability_none);
    row("a cause outside the catalogue", diagnosis.probability_outside);
    html += "</table><h2>Where</h2><table><tr><th>part</th><th>share</th><th>sigma</th><th>channel</th><th>phase</th><th>region</th></tr>";
    for place in &diagnosis.r#where {
        let _ = write!(
            html,
            "<tr><td>{}</td><td>{:.0} %</td><td>{:.0}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            escape(&place.submodel),
            100.0 * place.share,
            place.sigma,
            escape(&place.channel),
            escape(&place.phase),
            escape(&place.region)
        );
    }
    html += "</table>";
    html += &map_of_where(done);
    html += "<h2>Residuals without the cause, step by channel, in sigma</h2><p>Each number is the root mean square of a step and channel in units of what is declared: 1 is noise. Tolerances are those fitted together with the first cause.</p>";
    html += &heat_map(done, &done.without_cause.1);
    if let Some(best) = done.fits.first() {
        html += "<h2>Residuals with the first cause</h2>";
        html += &heat_map(done, &best.residual);
        html += "<h2>Before and after</h2>";
        html += &traces(done);
    }
    let _ = writeln!(html, "<h2>In words</h2><pre>{}</pre></html>", escape(&gap_text(diagnosis)));
    html
}

/// Classes of residuals in the map of where: up to so many sigma, colour and name.
const CLASSES: [(f64, Colour, &str); 4] = [
    (1.3, palette::GREY, "noise"),
    (3.0, palette::SKY, "up to 3 sigma"),
    (10.0, palette::ORANGE, "up to 10 sigma"),
    (f64::INFINITY, palette::VERMILLION, "beyond 10 sigma"),
];

/// Where on the compressor map the steps end, coloured by their residual, before and after.
fn map_of_where(done: &Diagnosed) -> String {
    let mut figure = Figure::new("Where on the map").columns(2).panel_size_px(430.0, 300.0);
    let after = done.fits.first().map(|fit| ("with the first cause", &fit.residual));
    for (title, residual) in [("without the cause", &done.without_cause.1)].into_iter().chain(after) {
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
    let mean = |channel: Channel| {
        let values = &study.table.column(channel)?[study.table.range(end_s - 10.0, end_s)];
        let values: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
    };
    let p1_pa = mean(Channel::P1).unwrap_or(study.declared.nominal.p1_pa);
    Some((1e3 * mean(Channel::CompressorFlow)?, mean(Channel::P2)? / p1_pa))
}

/// Root mean square of the whitened residual of each step and channel, as a table of colours with its numbers.
fn heat_map(done: &Diagnosed, residual: &[f64]) -> String {
    let mut html = String::from("<table><tr><th>channel</th>");
    for step in 0..done.study.steps.len() {
        let _ = write!(html, "<th>{}</th>", step + 1);
    }
    html += "</tr>";
    for (output, channel) in OUTPUTS.iter().enumerate() {
        let _ = write!(html, "<tr><td>{channel}</td>");
        for step in 0..done.study.steps.len() {
            let group = done.study.groups.iter().find(|g| g.step == step && g.output == output);
            let Some(group) = group else {
                html += "<td>-</td>";
                continue;
            };
            let here = &residual[group.rows.clone()];
            let rms = (here.iter().map(|r| r * r).sum::<f64>() / here.len().max(1) as f64).sqrt();
            // White at 1, red from 30 on, evenly in the logarithm.
            let heat = (rms.max(1.0).ln() / 30f64.ln()).clamp(0.0, 1.0);
            let fade = (255.0 * (1.0 - heat)) as u8;
            let ink = if heat > 0.6 { "#fff" } else { "#222" };
            let _ = write!(
                html,
                "<td style=\"color:{ink};background:rgb({},{fade},{fade})\">{rms:.1}</td>",
                255 - (60.0 * heat) as u8
            );
        }
        html += "</tr>";
    }
    html + "</table>"
}

/// Measured minus predicted over time, before and after, for the four channels with the largest gap.
fn traces(done: &Diagnosed) -> String {
    let Some(best) = done.fits.first() else { return String::new() };
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
            .with(Line::new(points(&best.prediction.values), palette::BLUE).label("with the first cause"));
        figure = figure.panel(panel);
    }
    figure.to_svg()
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
