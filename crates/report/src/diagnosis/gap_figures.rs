//! The evidence of a diagnosis: residuals on the map, by step and channel, and over time.

use crate::document::{Cell, Table};
use crate::formatting::display_scale;
use mapper_chart::palette::{self, Colour};
use mapper_chart::{Axis, Figure, Line, Panel, Scatter};
use mapper_core::{Channel, step_number};
use mapper_diagnose::gap::{Diagnosed, Study};
use mapper_numerics::statistics::{mean, rms};

/// Classes of residuals in the map: upper bound in sigma, colour and name.
const CLASSES: [(f64, Colour, &str); 4] = [
    (1.3, palette::GREY, "noise"),
    (3.0, palette::SKY, "up to 3 sigma"),
    (10.0, palette::ORANGE, "up to 10 sigma"),
    (f64::INFINITY, palette::VERMILLION, "beyond 10 sigma"),
];

/// Ends of the steps on the compressor map, coloured by their residual, before and after.
pub(crate) fn residual_maps(diagnosed: &Diagnosed) -> Vec<Figure> {
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
        pictures.push(Figure::new("").columns(1).panel_size_px(430.0, 300.0).panel(panel));
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

/// Root mean square of the whitened residual of each step and channel, on a ground that shows its size.
pub(crate) fn heat_table(diagnosed: &Diagnosed, caption: &str, residual: &[f64]) -> Table {
    let heads = ["step".to_owned()].into_iter().chain(Study::OUTPUTS.iter().map(ToString::to_string));
    let mut table = Table::new(heads).caption(caption);
    for step in 0..diagnosed.study.steps.len() {
        let cell = |output: usize| {
            let group = diagnosed.study.groups.iter().find(|g| g.step == step && g.output == output);
            let Some(group) = group else { return "-".into() };
            let rms = rms(&residual[group.rows.clone()]).unwrap_or(0.0);
            // White at 1, red from 30 on, logarithmic.
            Cell::number(format!("{rms:.1}"), rms).heat(rms.max(1.0).ln() / 30f64.ln())
        };
        let number = Cell::number(step_number(step).to_string(), step as f64);
        table.row_of_step(None, [number].into_iter().chain((0..Study::OUTPUTS.len()).map(cell)).collect());
    }
    table
}

/// Measured minus predicted over time, before and after, for the four channels with the largest gap.
pub(crate) fn traces(diagnosed: &Diagnosed) -> Vec<Figure> {
    let Some((cause, best)) = &diagnosed.with_cause else { return Vec::new() };
    let energy = |output: usize| {
        let groups = diagnosed.study.groups.iter().filter(|g| g.output == output);
        groups.flat_map(|g| &diagnosed.without_cause.1[g.rows.clone()]).map(|r| r * r).sum::<f64>()
    };
    let mut order: Vec<usize> = (0..Study::OUTPUTS.len()).collect();
    order.sort_by(|a, b| energy(*b).total_cmp(&energy(*a)));
    let picture = |output: usize| {
        let channel = Study::OUTPUTS[output];
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
        Figure::new("").columns(1).panel_size_px(430.0, 180.0).panel(panel)
    };
    order.into_iter().take(4).map(picture).collect()
}
