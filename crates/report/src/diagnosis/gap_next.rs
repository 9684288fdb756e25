//! The next experiment and the figures of a gap.

use crate::document::{Cell, Document, Table};
use crate::formatting::{Message, display_scale};
use mapper_chart::palette::{self, Colour};
use mapper_chart::{Axis, Figure, Line, Panel, Scatter};
use mapper_core::{Channel, probability_text, step_number, valve_area_text};
use mapper_diagnose::gap::{Diagnosis, Evidence, GapWarning, Kind, Next, OffsetAtRest, Study, Suggestion};
use mapper_numerics::statistics::{mean, rms};

/// 0 degC, K.
const ZERO_C_K: f64 = 273.15;

pub(crate) fn next_section(diagnosis: &Diagnosis) -> Document {
    let mut document = Document::default();
    let Some(next) = &diagnosis.next else { return document };
    match (next, diagnosis.experiments.first()) {
        (Next::Sensor { sensor, reason }, _) => {
            document.text(format!("{sensor}: {reason}"));
            if diagnosis.baseline.is_none() {
                document.text(
                    "if the model's equations only approximate this rig: give a fault-free recording with --baseline, or declare what they \
                     may miss under `tolerances: structure`",
                );
            }
        }
        (Next::Jump { .. } | Next::Soak { .. }, Some(first)) => {
            document.text(format!(
                "{}: {:.1} min, after which the true cause should reach {}",
                name_experiment(first),
                first.minutes,
                probability_text(first.expected_probability)
            ));
            document.text(describe_experiment(first));
        }
        (Next::Jump { .. } | Next::Soak { .. }, None) => {}
    }
    let Some(first) = diagnosis.experiments.first() else { return document };
    let heads = ["experiment", "min", "bit/min", "bit", "chance of 95 %"];
    let mut table = Table::new(heads).caption(format!(
        "Of {:.2} bit still open: information per minute and in total, and the chance that the true cause then has 95 %",
        first.entropy_bit
    ));
    for experiment in &diagnosis.experiments {
        table.row([
            name_experiment(experiment),
            format!("{:.1}", experiment.minutes),
            format!("{:.3}", experiment.entropy_drop_bit / experiment.minutes),
            format!("{:.2}", experiment.entropy_drop_bit),
            probability_text(experiment.probability_settled),
        ]);
    }
    document.table(table);
    document
}

pub(crate) fn name_experiment(experiment: &Suggestion) -> String {
    let Suggestion { from, to, .. } = experiment;
    let (from_valve, to_valve) = (valve_area_text(from.valve), valve_area_text(to.valve));
    let at = format!("at {:.0} krpm and valve area {to_valve}", to.speed_rpm / 1e3);
    let celsius = |change: Option<[f64; 2]>| {
        let [before_k, after_k] = change.unwrap_or([f64::NAN; 2]);
        format!("from {:.0} to {:.0} degC {at}", before_k - ZERO_C_K, after_k - ZERO_C_K)
    };
    let jump = || {
        format!(
            "jump from {:.0} krpm at valve area {from_valve} to {:.0} krpm at {to_valve}",
            from.speed_rpm / 1e3,
            to.speed_rpm / 1e3,
        )
    };
    match experiment.kind {
        Kind::Jump => jump(),
        Kind::ValveStep => {
            format!("valve step from area {from_valve} to {to_valve} at {:.0} krpm", to.speed_rpm / 1e3)
        }
        Kind::T3Step => format!("turbine inlet {}", celsius(experiment.t3_k)),
        Kind::OilStep => format!("oil {}", celsius(experiment.oil_temperature_k)),
        Kind::Sensor => {
            format!("a sensor for {}, and a {}", experiment.sensor.as_deref().unwrap_or("-"), jump())
        }
        Kind::Soak => {
            "a soak before the next run, which determines the offsets of the temperature sensors".to_owned()
        }
    }
}

fn describe_experiment(experiment: &Suggestion) -> String {
    let Suggestion { from, to, .. } = experiment;
    match experiment.kind {
        Kind::Jump | Kind::ValveStep => format!(
            "`mapper plan CAMPAIGN --append {:.0}krpm@{} {:.0}krpm@{} --out PLAN` puts it after the points",
            from.speed_rpm / 1e3,
            from.valve,
            to.speed_rpm / 1e3,
            to.valve,
        ),
        Kind::Soak => {
            format!("a line of the campaign, before it is run again: {}", experiment.script.join(" "))
        }
        _ => format!("lines of a sequence, after the points: {}", experiment.script.join(" ")),
    }
}

impl Message for GapWarning {
    fn message(&self) -> String {
        match self {
            GapWarning::ChannelNotRecorded { channel } => format!(
                "{channel} ({}) is not recorded: effects that show only there cannot be found",
                channel.info().description
            ),
            GapWarning::InputNotRecorded { channel } => {
                format!("{channel} is not recorded: the campaign's value is used")
            }
            GapWarning::GapsInRecording { gaps, missing_s } => format!(
                "the recording has {gaps} gap(s), {missing_s:.1} s in total; blocks without samples are omitted"
            ),
            GapWarning::AssumedNoise { channel, noise_sigma } => format!(
                "no noise is declared for {channel}: that of a typical sensor is used, {noise_sigma} {}",
                channel.unit()
            ),
            GapWarning::UncertainTimes { scatter_s } => format!(
                "the times of the samples are off by {:.0} ms, as P3 shows where it jumps: readings that change have accordingly less weight",
                1e3 * scatter_s
            ),
            GapWarning::BaselineRecording { warning } => {
                format!("the reference recording: {}", warning.message())
            }
            GapWarning::Drift { reason, subtracted: true } => {
                format!(
                    "drift while the recording was made: {reason} It was subtracted from the readings before the diagnosis."
                )
            }
            GapWarning::Drift { reason, subtracted: false } => format!(
                "drift while the recording was made: {reason} The diagnosis assumes a rig that does not change, so no cause is named."
            ),
            GapWarning::DriftNotSubtracted { reason } => {
                format!(
                    "a drift was found and not subtracted, because the residual without it is only noise: {reason}"
                )
            }
            GapWarning::RecordingIncomplete { reason } => reason.clone(),
            GapWarning::Other { message, .. } if !message.is_empty() => message.clone(),
            other => other.code().to_owned(),
        }
    }
}

impl Message for OffsetAtRest {
    fn message(&self) -> String {
        let OffsetAtRest { channel, offset, declared_sigma } = self;
        format!(
            "{channel} reads {:.2} {unit} too {} at rest, where {declared_sigma:.2} {unit} are declared",
            offset.abs(),
            if *offset > 0.0 { "high" } else { "low" },
            unit = channel.unit(),
        )
    }
}

/// Classes of residuals in the map: upper bound in sigma, colour and name.
const CLASSES: [(f64, Colour, &str); 4] = [
    (1.3, palette::GREY, "noise"),
    (3.0, palette::SKY, "up to 3 sigma"),
    (10.0, palette::ORANGE, "up to 10 sigma"),
    (f64::INFINITY, palette::VERMILLION, "beyond 10 sigma"),
];

pub(crate) fn residual_maps(study: &Study, evidence: &Evidence) -> Vec<Figure> {
    let mut pictures = Vec::new();
    let after = evidence.with_cause.as_ref().map(|(cause, _, residual)| (format!("with {cause}"), residual));
    for (title, residual) in
        [("without the cause".to_owned(), &evidence.without_cause.1)].into_iter().chain(after)
    {
        let mut classes: [Vec<(f64, f64)>; CLASSES.len()] = Default::default();
        for step in 0..study.steps.len() {
            let Some(place) = place_on_map(study, step) else { continue };
            let groups = study.groups.iter().filter(|group| group.step == step);
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
pub(crate) fn heat_table(study: &Study, caption: &str, residual: &[f64]) -> Table {
    let heads = ["step".to_owned()].into_iter().chain(Study::OUTPUTS.iter().map(ToString::to_string));
    let mut table = Table::new(heads).caption(caption);
    for step in 0..study.steps.len() {
        let cell = |output: usize| {
            let group = study.groups.iter().find(|g| g.step == step && g.output == output);
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
pub(crate) fn traces(study: &Study, evidence: &Evidence) -> Vec<Figure> {
    let Some((cause, best, _)) = &evidence.with_cause else { return Vec::new() };
    let energy = |output: usize| {
        let groups = study.groups.iter().filter(|g| g.output == output);
        groups.flat_map(|g| &evidence.without_cause.1[g.rows.clone()]).map(|r| r * r).sum::<f64>()
    };
    let mut order: Vec<usize> = (0..Study::OUTPUTS.len()).collect();
    order.sort_by(|a, b| energy(*b).total_cmp(&energy(*a)));
    let picture = |output: usize| {
        let channel = Study::OUTPUTS[output];
        let (scale, unit) = display_scale(channel.unit());
        let points = |values: &[f64]| {
            let of_output = study.groups.iter().filter(|g| g.output == output);
            of_output
                .flat_map(|g| {
                    g.rows.clone().zip(&g.blocks).map(|(row, block)| {
                        let t_s = study.steps[g.step].blocks[*block].mean_s;
                        (t_s / 60.0, scale * (study.measured[row] - values[row]))
                    })
                })
                .collect::<Vec<(f64, f64)>>()
        };
        let panel = Panel::new(Axis::new("time, min"), Axis::new(format!("{channel}, {unit}")))
            .with(
                Line::new(points(&evidence.without_cause.0.values), palette::VERMILLION)
                    .label("without the cause"),
            )
            .with(Line::new(points(&best.values), palette::BLUE).label(format!("with {cause}")));
        Figure::new("").columns(1).panel_size_px(430.0, 180.0).panel(panel)
    };
    order.into_iter().take(4).map(picture).collect()
}
