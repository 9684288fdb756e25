//! Tables of identified points, one description of each column for all outputs; agreement of two methods, and errors common to all points.

use crate::document::{Cell, Document, Table, verdict_word};
use crate::formatting::{Display, number, percent};
use Column as C;
use mapper_campaign::units::Kind;
use mapper_core::{
    Channel, CompressorMap, IdentifiedPoint, Recording, SpeedLine, StepKind, StepMarker, Verdict, Warning,
    half_width_95, step_number, valve_area_text,
};
use mapper_identify::DynamicEfficiency;
use mapper_numerics::statistics::{mean, median};
use mapper_recording::score::ScoredPoint;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Column {
    Step,
    Speed,
    SpeedCorrected,
    Opening,
    Flow,
    FlowMargin,
    PressureRatio,
    PressureRatioMargin,
    Eta,
    EtaMargin,
    EtaAllowance,
    H,
    HMargin,
    T2Change,
    T1,
    P1,
    Read(Channel),
    Verdict,
    TrueEta,
    TrueH,
}

/// The columns of a test report.
const REPORT: [Column; 20] = [
    C::Step,
    C::Speed,
    C::SpeedCorrected,
    C::Opening,
    C::Flow,
    C::FlowMargin,
    C::PressureRatio,
    C::PressureRatioMargin,
    C::Eta,
    C::EtaMargin,
    C::EtaAllowance,
    C::H,
    C::HMargin,
    C::T2Change,
    C::T1,
    C::P1,
    C::Read(Channel::T2),
    C::Read(Channel::P2),
    C::Read(Channel::T3),
    C::Verdict,
];
/// The columns of a wide table on a terminal.
const WIDE: [Column; 11] = [
    C::Step,
    C::Speed,
    C::Opening,
    C::Flow,
    C::PressureRatio,
    C::Eta,
    C::EtaMargin,
    C::H,
    C::HMargin,
    C::T2Change,
    C::Verdict,
];
/// The columns that fit next to the name of a speed line.
const NARROW: [Column; 8] =
    [C::Step, C::Opening, C::Flow, C::PressureRatio, C::Eta, C::EtaMargin, C::H, C::HMargin];

impl Column {
    fn head(self, display: &Display) -> String {
        match self {
            C::Step => "step".to_owned(),
            C::Speed => display.head("N", Kind::Speed),
            C::SpeedCorrected => display.head("N corr.", Kind::Speed),
            C::Opening => "valve area".to_owned(),
            C::Flow => display.head("flow corr.", Kind::MassFlow),
            C::FlowMargin | C::PressureRatioMargin | C::EtaMargin | C::HMargin => "+/-".to_owned(),
            C::PressureRatio => "PR".to_owned(),
            C::Eta => "eta %".to_owned(),
            C::EtaAllowance => "else".to_owned(),
            C::H => "h W/(m2 K)".to_owned(),
            C::T2Change => "dT2 K".to_owned(),
            C::T1 => display.head("T1", Kind::Temperature),
            C::P1 => display.head("P1", Kind::Pressure),
            C::Read(channel) => format!("{channel} {}", display.unit_of(channel)),
            C::Verdict => "verdict".to_owned(),
            C::TrueEta => "true eta %".to_owned(),
            C::TrueH => "true h".to_owned(),
        }
    }

    fn cell(self, scored: &ScoredPoint, recording: Option<&Recording>, display: &Display) -> Cell {
        let ScoredPoint { point, truth } = scored;
        let flow = |kg_s: f64| display.flow(kg_s);
        let ratio = |ratio: f64| format!("{ratio:.4}");
        let in_percent = |ratio: f64| percent(Some(ratio), 2);
        let whole = |value: f64| number(Some(value), 0);
        // A half width of 0 means that no sensor is declared, not that it is perfect.
        let declared = |half: f64| Some(half).filter(|half| *half > 0.0);
        match self {
            C::Step => Cell::number(step_name(point), point.step as f64),
            C::Speed => Cell::optional(Some(point.speed_rpm), |rpm| display.speed(rpm)),
            C::SpeedCorrected => Cell::optional(Some(point.speed_corrected_rpm), |rpm| display.speed(rpm)),
            C::Opening => Cell::optional(Some(point.valve_opening_ratio), valve_area_text),
            C::Flow => Cell::optional(Some(point.flow_corrected_kg_s), flow),
            C::FlowMargin => {
                let half_ratio = half_width_95(point.common.flow_corrected_standard_error_ratio);
                Cell::optional(declared(half_ratio * point.flow_corrected_kg_s), flow)
            }
            C::PressureRatio => Cell::optional(Some(point.pressure_ratio), ratio),
            C::PressureRatioMargin => {
                Cell::optional(declared(half_width_95(point.common.pressure_ratio_standard_error)), ratio)
            }
            C::Eta => Cell::optional(point.eta, in_percent),
            C::EtaMargin => Cell::margins(point.eta_margins_95().map(|both| both.scaled(100.0)), 2),
            C::EtaAllowance => Cell::optional(point.eta_allowance, in_percent),
            C::H => Cell::optional(point.h_w_m2k, whole),
            C::HMargin => Cell::margins(point.h_margins_95_w_m2k(), 0),
            C::T2Change => Cell::optional(point.dt2_k, |k| number(Some(k), 1)),
            C::T1 => Cell::optional(Some(point.t1_k), |k| display.temperature(k)),
            C::P1 => Cell::optional(Some(point.p1_pa), |pa| display.pressure(pa)),
            C::Read(channel) => {
                let marker = recording.and_then(|all| all.steps.iter().find(|step| step.index == point.step));
                let read = recording.zip(marker).and_then(|(all, marker)| at_end(all, marker, channel));
                Cell::optional(read, |value| display.shown_reading(channel, value))
            }
            C::Verdict => Cell::verdict(point.verdict),
            C::TrueEta => Cell::optional(truth.map(|truth| truth.eta), in_percent),
            C::TrueH => Cell::optional(truth.map(|truth| truth.h_w_m2k), whole),
        }
    }
}

fn points_table<'a>(
    columns: &[Column],
    points: impl Iterator<Item = &'a ScoredPoint>,
    recording: Option<&Recording>,
    display: &Display,
) -> Table {
    let mut table = Table::new(columns.iter().map(|column| column.head(display)));
    for scored in points {
        let cells = columns.iter().map(|column| column.cell(scored, recording, display)).collect();
        table.row_of_step(Some(scored.point.step), cells);
    }
    table
}

/// The points of each speed line from surge to choke with all their columns, followed by the points outside the map.
pub(crate) fn point_tables(
    map: Option<&CompressorMap>,
    points: &[ScoredPoint],
    recording: &Recording,
    display: &Display,
) -> Vec<Table> {
    let mut tables = Vec::new();
    let mut on_a_line: Vec<usize> = Vec::new();
    for line in map.map_or(&[][..], |map| map.lines.as_slice()) {
        let own_points = points_of_line(points, |step| line.points.iter().any(|p| p.identified.step == step));
        on_a_line.extend(own_points.iter().map(|scored| scored.point.step));
        let caption =
            format!("{} {} corrected", display.line_name(line.speed_corrected_rpm), display.units.speed);
        tables.push(points_table(&REPORT, own_points.into_iter(), Some(recording), display).caption(caption));
    }
    let caption = if tables.is_empty() { "Points" } else { "Repeats, and points that are not on the map" };
    let others = points.iter().filter(|scored| !on_a_line.contains(&scored.point.step));
    tables.push(points_table(&REPORT, others, Some(recording), display).caption(caption));
    tables
}

fn points_of_line(points: &[ScoredPoint], is_on_it: impl Fn(usize) -> bool) -> Vec<&ScoredPoint> {
    let mut own_points: Vec<&ScoredPoint> =
        points.iter().filter(|scored| is_on_it(scored.point.step)).collect();
    own_points.sort_by(|a, b| a.point.flow_corrected_kg_s.total_cmp(&b.point.flow_corrected_kg_s));
    own_points
}

pub(crate) fn wide_table(points: &[ScoredPoint], display: &Display, truth: bool) -> Table {
    let true_columns: &[Column] = if with_truth(points, truth) { &[C::TrueEta, C::TrueH] } else { &[] };
    points_table(&[&WIDE, true_columns].concat(), points.iter(), None, display)
}

fn with_truth(points: &[ScoredPoint], truth: bool) -> bool {
    truth && points.iter().any(|scored| scored.truth.is_some())
}

/// The points by speed line from surge to choke, then those outside the map; without repeats. With true efficiencies if `truth` and known.
pub(crate) fn points_by_line(
    points: &[ScoredPoint],
    map: Option<&CompressorMap>,
    display: &Display,
    truth: bool,
) -> Document {
    let units = &display.units;
    let with_truth = with_truth(points, truth);
    let mut heads: Vec<&str> =
        vec![&units.speed, "step", "valve area", &units.flow, "PR", "eta %", "+/-", "h", "+/-"];
    heads.extend(with_truth.then_some("true %"));
    heads.push("");
    let mut table = Table::new(heads);
    let mut add = |name: String, scored: &ScoredPoint| {
        let mut row = vec![name.into()];
        row.extend(NARROW.iter().map(|column| match column {
            C::Step => step_number(scored.point.step).to_string().into(),
            column => column.cell(scored, None, display),
        }));
        row.extend(with_truth.then(|| C::TrueEta.cell(scored, None, display)));
        // A good point needs no remark.
        row.push(match scored.point.verdict {
            Verdict::Good => "".into(),
            verdict => Cell::verdict(verdict),
        });
        table.row_of_step(Some(scored.point.step), row);
    };
    let mut on_a_line = Vec::new();
    for (speed_rpm, steps) in speed_lines(points, map) {
        for (index, scored) in points_of_line(points, |step| steps.contains(&step)).into_iter().enumerate() {
            add(if index == 0 { display.line_name(speed_rpm) } else { String::new() }, scored);
            on_a_line.push(scored.point.step);
        }
    }
    // A point with a repeat visit is on the map once, by the more certain visit.
    let is_on_a_line = |scored: &ScoredPoint| {
        let mut visits = points.iter().filter(|other| on_a_line.contains(&other.point.step));
        let is_same = |other: &ScoredPoint| {
            scored.point.target.zip(other.point.target).is_some_and(|(a, b)| a.is_same_place(&b))
        };
        on_a_line.contains(&scored.point.step) || visits.any(is_same)
    };
    // Without lines, each point has its measured speed.
    let mut name = (!on_a_line.is_empty()).then(|| "no line".to_owned());
    for scored in points.iter().filter(|scored| scored.point.kind.measures() && !is_on_a_line(scored)) {
        let name = if on_a_line.is_empty() {
            display.speed(scored.point.speed_corrected_rpm)
        } else {
            name.take().unwrap_or_default()
        };
        add(name, scored);
    }
    let mut document = Document::default();
    document.text(format!(
        "Points by corrected speed in {} and area of the back-pressure valve in per cent of its nominal area, corrected flow in {}, h in W/(m2 K).",
        units.speed, units.flow
    ));
    if let Some(map) = map {
        let definition = map.efficiency.map(|definition| format!("; eta: {}", definition.description()));
        let gas = map.gas.as_ref().map(|gas| format!("; gas: {gas}"));
        let [definition, gas] = [definition, gas].map(Option::unwrap_or_default);
        document.text(format!("Corrected to {}{definition}{gas}.", map.reference));
    }
    document.table(table);
    document
}

/// Corrected speed of each line, rpm, and the steps on it: those of the map, or else steps with one target speed.
fn speed_lines(points: &[ScoredPoint], map: Option<&CompressorMap>) -> Vec<(f64, Vec<usize>)> {
    if let Some(map) = map {
        let steps = |line: &SpeedLine| line.points.iter().map(|point| point.identified.step).collect();
        return map.lines.iter().map(|line| (line.speed_corrected_rpm, steps(line))).collect();
    }
    let measured = points.iter().map(|scored| &scored.point).filter(|point| point.kind.measures());
    let mut targeted: Vec<(f64, &IdentifiedPoint)> =
        measured.filter_map(|point| Some((point.target?.speed_rpm, point))).collect();
    targeted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let groups = targeted.chunk_by(|a, b| a.0 == b.0);
    let line = |group: &[(f64, &IdentifiedPoint)]| {
        let speed_rpm = mean(group.iter().map(|(_, point)| point.speed_corrected_rpm)).unwrap_or(f64::NAN);
        (speed_rpm, group.iter().map(|(_, point)| point.step).collect())
    };
    groups.map(line).collect()
}

pub(crate) fn verdict_sentence<'a>(points: impl Iterator<Item = &'a IdentifiedPoint>) -> String {
    let verdicts: Vec<Verdict> = points.map(|point| point.verdict).collect();
    let count = |verdict| verdicts.iter().filter(|other| **other == verdict).count();
    match (verdicts.len(), count(Verdict::Good)) {
        (0, _) => "No point was identified.".to_owned(),
        (1, 1) => "The point is good.".to_owned(),
        (all, good) if all == good => format!("The points of all {all} steps are good."),
        (all, good) => format!(
            "The points of {good} of {all} steps are good, {} {}, {} {}.",
            count(Verdict::Doubtful),
            verdict_word(Verdict::Doubtful),
            count(Verdict::Unusable),
            verdict_word(Verdict::Unusable)
        ),
    }
}

/// Which efficiency it is, and the median share of it that may be something else, in a sentence; `None` without an efficiency.
pub(crate) fn allowance_sentence<'a>(points: impl Iterator<Item = &'a IdentifiedPoint>) -> Option<String> {
    let points: Vec<&IdentifiedPoint> = points.filter(|point| point.eta_allowance.is_some()).collect();
    let middle = median(points.iter().filter_map(|point| point.eta_allowance)).filter(|half| *half > 0.0)?;
    let which = if points.iter().all(|point| point.warnings.contains(&Warning::Apparent)) {
        "The efficiency is the apparent one: heat exchanged with the housing counts as work, and no interval contains it"
    } else {
        "The efficiency is the wheel's as the method defines it"
    };
    Some(format!(
        "{which}; +/- {} points of it, which no interval contains, may be recirculation, recovery of the T2 probe or heat behind the wheel.",
        percent(Some(middle), 1)
    ))
}

pub(crate) fn step_name(point: &IdentifiedPoint) -> String {
    match point.kind {
        StepKind::Point => step_number(point.step).to_string(),
        StepKind::Repeat => format!("{} repeat", step_number(point.step)),
        StepKind::Return => format!("{} return", step_number(point.step)),
        StepKind::Approach => format!("{} surge", step_number(point.step)),
    }
}

/// The last seconds of a step, over which readings are averaged.
pub const END_S: f64 = 2.0;

/// The mean of a channel over the last seconds of a step, in the channel's unit; `None` without readings.
pub fn at_end(recording: &Recording, marker: &StepMarker, channel: Channel) -> Option<f64> {
    let start_s = (marker.end_s - END_S).max(marker.start_s);
    let values = recording.series.get(&channel)?.slice(start_s, marker.end_s).1;
    mean(values).filter(|mean| mean.is_finite())
}

pub fn disagreement_text(
    points: &[ScoredPoint],
    dynamic: &[DynamicEfficiency],
    display: &Display,
) -> Option<String> {
    let pairs = dynamic.iter().filter_map(|other| {
        let point = points.iter().map(|scored| &scored.point).find(|point| point.step == other.step)?;
        Some((point, other, distance(point, other)?))
    });
    let pairs: Vec<_> = pairs.collect();
    let disagreeing: Vec<_> = pairs.iter().filter(|(point, other, _)| are_disjoint(point, other)).collect();
    let (point, other, distance) = disagreeing.iter().max_by(|a, b| a.2.total_cmp(&b.2))?;
    Some(format!(
        "Methods disagree: at {} of {} points the efficiency by `dynamic` lies outside both 95 % intervals of the one by `joint`, by up \
         to {:.1} points (step {}, {} {}, valve area {}: {:.1} % against {:.1} %). `dynamic` takes alpha_A and the probe as declared and h \
         as constant in each step; `joint` finds them from all steps.\n",
        disagreeing.len(),
        pairs.len(),
        100.0 * distance,
        step_number(point.step),
        display.speed(point.speed_rpm),
        display.units.speed,
        valve_area_text(point.valve_opening_ratio),
        100.0 * other.eta,
        100.0 * point.eta.unwrap_or(f64::NAN),
    ))
}

fn distance(point: &IdentifiedPoint, other: &DynamicEfficiency) -> Option<f64> {
    Some((point.eta? - other.eta).abs())
}

fn are_disjoint(point: &IdentifiedPoint, other: &DynamicEfficiency) -> bool {
    let (Some(low), Some(high)) = (point.eta_low, point.eta_high) else { return false };
    other.eta_high < low || high < other.eta_low
}

/// One sentence each for the slowest speed and the others: offsets matter less at speed. `None` without a common part.
pub fn shared_errors_text<'a>(
    points: impl Iterator<Item = &'a IdentifiedPoint>,
    display: &Display,
) -> Option<String> {
    let usable: Vec<&IdentifiedPoint> = points
        .filter(|point| point.verdict != Verdict::Unusable && point.eta_low.is_some())
        .filter(|point| !point.common.eta_changes.is_empty())
        .collect();
    let speed = |point: &IdentifiedPoint| point.target.map_or(point.speed_rpm, |target| target.speed_rpm);
    let slowest_rpm = usable.iter().map(|point| speed(point)).reduce(f64::min)?;
    // The speed along a line varies by a few per cent at most.
    let (slow, fast): (Vec<&IdentifiedPoint>, Vec<&IdentifiedPoint>) =
        usable.iter().copied().partition(|point| speed(point) <= 1.05 * slowest_rpm);
    let describe = |points: &[&IdentifiedPoint]| {
        let half = |value: fn(&IdentifiedPoint) -> Option<f64>| {
            median(points.iter().filter_map(|point| value(point))).map(|x| 100.0 * x)
        };
        let total = half(|point| Some(0.5 * (point.eta_high? - point.eta_low?)))?;
        let common = half(|point| Some(half_width_95(point.common.eta_standard_error())))?;
        Some(format!("+/- {common:.2} of the +/- {total:.2} points"))
    };
    let first = format!("{} at {} {}", describe(&slow)?, display.speed(slowest_rpm), display.units.speed);
    let parts = match describe(&fast) {
        Some(others) => format!("{first}, {others} at higher speeds"),
        None => first,
    };
    Some(format!(
        "The efficiencies of all points share one error (sensor offsets and gains, parameters of the method): {parts} (95 %). It moves the whole \
         map together; the remainder, in quadrature, is independent for each point. The map's files have both parts."
    ))
}
