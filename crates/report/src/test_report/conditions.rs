//! Declared conditions of rig and cell compared with the readings, the instruments, the energy balance of the points, and criteria of acceptance.

use crate::document::{Document, Table};
use crate::formatting::Display;
use crate::point_results::points::{END_S, at_end};
use mapper_campaign::Campaign;
use mapper_core::{Channel, DeclaredUncertainty, Recording, StepMarker, half_width_95, step_number};
use mapper_identify::IsothermalZero;
use mapper_numerics::statistics::mean;
use mapper_observe::acceptance::{CriterionResult, judge_acceptance};
use mapper_observe::energy_balance::{EnergyBalance, Gases, Power, energy_balance};
use mapper_recording::score::ScoredPoint;
use std::collections::BTreeMap;

/// A row for each condition with readings: name, declared value, and mean, minimum and maximum of its readings at the ends of the steps.
pub(crate) fn condition_table(
    campaign: Option<&Campaign>,
    recording: &Recording,
    display: &Display,
) -> Table {
    let boundary = campaign.map(|campaign| &campaign.boundary);
    // A condition that follows the compressor's outlet has no single value.
    let follows = campaign.map(|campaign| campaign.follow_outlet).unwrap_or_default();
    let conditions = [
        (Channel::T1, "inlet temperature T1, total", boundary.map(|b| b.t1_k)),
        (Channel::P1, "inlet pressure P1", boundary.map(|b| b.p1_pa)),
        (
            Channel::T3,
            "turbine inlet temperature T3, total",
            boundary.map(|b| b.t3_k).filter(|_| !follows.turbine_inlet),
        ),
        (Channel::P4, "turbine outlet pressure P4", boundary.map(|b| b.p4_pa)),
        (Channel::TOil, "oil temperature", boundary.map(|b| b.oil_temperature_k).filter(|_| !follows.oil)),
        (Channel::TAmb, "ambient temperature", boundary.map(|b| b.ambient_temperature_k)),
    ];
    let rows = conditions.into_iter().filter_map(|(channel, name, declared)| {
        let read: Vec<f64> =
            recording.steps.iter().filter_map(|step| at_end(recording, step, channel)).collect();
        let average = mean(&read)?;
        let lowest = read.iter().copied().fold(f64::INFINITY, f64::min);
        let highest = read.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let format = |value: f64| display.shown_reading(channel, value);
        Some([
            name.to_owned(),
            declared.map_or_else(|| "-".to_owned(), format),
            format(average),
            format(lowest),
            format(highest),
            display.unit_of(channel).to_owned(),
        ])
    });
    Table::new(["condition", "declared", "mean", "min", "max", "unit"])
        .caption("Conditions read at the ends of the steps")
        .with_texts([5])
        .rows(rows)
}

/// A row for each quantity that the rig was told to set: the reading that would show a command without effect, or that there is none. No rig measures
/// the flow area of its valve, and what a controller reports of its position is not independent of the command.
pub(crate) fn witness_table(recording: &Recording, display: &Display) -> Table {
    let commands = [
        (Channel::P3Command, "turbine inlet pressure P3", Some(Channel::P3)),
        (Channel::T3Command, "turbine inlet temperature T3", Some(Channel::T3)),
        (Channel::ValveCommand, "valve opening", None),
        (Channel::TOilCommand, "oil temperature", Some(Channel::TOil)),
    ];
    let rows = commands.into_iter().filter_map(|(command, name, witness)| {
        let steps = || recording.steps.iter();
        steps().find_map(|step| at_end(recording, step, command))?;
        let differences = witness.into_iter().flat_map(|witness| {
            steps().filter_map(move |step| {
                Some(at_end(recording, step, witness)? - at_end(recording, step, command)?)
            })
        });
        let largest = differences.max_by(|a, b| a.abs().total_cmp(&b.abs()));
        let (read_by, difference) = match witness.zip(largest) {
            Some((witness, largest)) => (
                witness.to_string(),
                display.difference(witness, largest).map_or_else(|| "0".to_owned(), two_figures),
            ),
            None => ("none: a command without effect would not show".to_owned(), dash_cell()),
        };
        Some([name.to_owned(), read_by, difference, display.difference_unit(command).to_owned()])
    });
    Table::new(["command", "read by", "largest difference", "unit"])
        .caption("Commands and their readings at the ends of the steps")
        .with_texts([1, 3])
        .rows(rows)
}

/// Meaning of the columns.
const INSTRUMENT_WORDS: &str = "Half widths of 95 % intervals, as declared: noise of one sample, offset left after calibration, gain; \
                                    temperatures in K. As used: the offset at rest, which the isothermal zero determines where \
                                    there was one, and the gain over the distance from there. \
                                    `-`: it is not declared.";

/// The instruments and their calibration register. `used`: the uncertainties of the identification; `tested_at`: start of the test.
pub(crate) fn instruments_section(
    campaign: &Campaign,
    used: &BTreeMap<Channel, DeclaredUncertainty>,
    zero: Option<&IsothermalZero>,
    tested_at: Option<&str>,
    display: &Display,
) -> Document {
    let mut document = Document::default();
    document.text(INSTRUMENT_WORDS);
    let heads = [
        "sensor",
        "reads",
        "unit",
        "noise +/-",
        "offset +/-",
        "as used +/-",
        "gain +/- %",
        "tap or probe",
        "last calibration",
    ];
    let instruments = Table::new(heads).caption("Instruments").with_texts([1, 2, 5, 7, 8]);
    document.table(instruments.rows(instrument_rows(campaign, used, zero, display)));
    let heads = ["sensor", "certificate", "laboratory", "calibrated", "due", "range", "U (k = 2)"];
    let register = Table::new(heads).caption("Calibration register").all_texts();
    document.table(register.rows(register_rows(campaign, tested_at, display)));
    document
}

fn instrument_rows(
    campaign: &Campaign,
    used: &BTreeMap<Channel, DeclaredUncertainty>,
    zero: Option<&IsothermalZero>,
    display: &Display,
) -> Vec<[String; 9]> {
    let row = |(channel, sensor): (&Channel, &mapper_campaign::campaign::SensorDeclaration)| {
        let half = |sigma: f64| {
            display.difference(*channel, half_width_95(sigma)).map_or_else(dash_cell, two_figures)
        };
        let declared = &sensor.declared;
        let used = used.get(channel).map_or_else(dash_cell, |used| {
            as_used(*channel, used, half(used.offset_sigma), rest_reading(zero, *channel), display)
        });
        let place = match (sensor.static_tap_pipe_diameter_m, sensor.probe_diameter_m) {
            (Some(pipe_m), _) => format!("static tap, pipe {:.1} mm", 1e3 * pipe_m),
            (None, tip_m) if tip_m > 0.0 => format!("probe {:.1} mm", 1e3 * tip_m),
            (None, _) if matches!(channel, Channel::P1 | Channel::P2) => "total".to_owned(),
            _ => dash_cell(),
        };
        let several = sensor.redundant.as_ref().map(|_| " (several)").unwrap_or_default();
        let dates = sensor.calibrations.iter().flatten().map(|calibration| calibration.date);
        [
            channel.to_string(),
            format!("{}{several}", channel.info().description),
            display.difference_unit(*channel).to_owned(),
            half(declared.noise_sigma),
            half(declared.offset_sigma),
            used,
            match half_width_95(declared.gain_sigma_ratio) {
                gain if gain > 0.0 => two_figures(100.0 * gain),
                _ => dash_cell(),
            },
            place,
            dates.max().map_or_else(|| "not stated".to_owned(), |date| date.to_string()),
        ]
    };
    campaign.sensors.iter().map(row).collect()
}

fn rest_reading(zero: Option<&IsothermalZero>, channel: Channel) -> Option<f64> {
    let zero = zero?;
    zero.offsets.get(&channel)?;
    zero.common.iter().find(|common| common.channels.contains(&channel)).map(|common| common.reading)
}

/// The error at a reading: `offset`, and the gain over the distance from the reading at rest (with a zero) or from the calibration.
fn as_used(
    channel: Channel,
    used: &DeclaredUncertainty,
    offset: String,
    rest: Option<f64>,
    display: &Display,
) -> String {
    let gain = half_width_95(used.gain_sigma_ratio);
    if gain <= 0.0 {
        return offset;
    }
    // The reading whose gain error is zero: only a difference of it and any other reading is needed.
    let from = rest.unwrap_or(-channel.gain_distance(0.0));
    let distance = if from == 0.0 {
        "reading".to_owned()
    } else {
        format!("distance from {} {}", display.shown_reading(channel, from), display.unit_of(channel))
    };
    let gain = format!("{} % of {distance}", two_figures(100.0 * gain));
    if offset == dash_cell() { gain } else { format!("{offset} + {gain}") }
}

/// A row for each sensor whose calibration states more than its day. `tested_at`: start of the test, from its day on.
fn register_rows(campaign: &Campaign, tested_at: Option<&str>, display: &Display) -> Vec<[String; 7]> {
    let mut rows = Vec::new();
    for (&channel, declaration) in &campaign.sensors {
        for (_, sensor, calibration) in declaration.calibrated(channel) {
            let Some(calibration) = calibration.filter(|certificate| certificate.is_certified()) else {
                continue;
            };
            let text = |value: &Option<String>| value.clone().unwrap_or_else(dash_cell);
            let reading = |value: f64| display.shown_reading(channel, value);
            rows.push([
                sensor,
                text(&calibration.certificate),
                text(&calibration.laboratory),
                calibration.date.to_string(),
                calibration.due.map_or_else(dash_cell, |due| {
                    let due = due.to_string();
                    let is_past = tested_at.is_some_and(|at| at.get(..due.len()) > Some(due.as_str()));
                    if is_past { format!("{due}, expired") } else { due }
                }),
                calibration.range.map_or_else(dash_cell, |(min, max)| {
                    format!("{} to {} {}", reading(min), reading(max), display.unit_of(channel))
                }),
                calibration
                    .uncertainty
                    .and_then(|expanded| display.difference(channel, expanded))
                    .map_or_else(dash_cell, |expanded| {
                        format!("{} {}", two_figures(expanded), display.difference_unit(channel))
                    }),
            ]);
        }
    }
    rows
}

fn dash_cell() -> String {
    "-".to_owned()
}

/// Two significant figures without an exponent, enough for an uncertainty.
fn two_figures(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return dash_cell();
    }
    let decimals = (1.0 - value.abs().log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{value:.decimals$}")
}

/// Meaning of the columns.
const BALANCE_WORDS: &str = "Means of the last 2 s of each step, half widths of 95 % intervals from the declared sensors. Compressor: rise of \
                                 the enthalpy of its air. Turbine: drop of the enthalpy of its gas. Losses: turbine minus the \
                                 others; until the housings are settled, heat that they store is part of them, and so are oil and water where they \
                                 are not measured.";

pub struct JudgedPoints<'a> {
    pub campaign: Option<&'a Campaign>,
    pub recording: &'a Recording,
    pub gases: Gases,
    pub points: &'a [ScoredPoint],
    pub used: &'a BTreeMap<Channel, DeclaredUncertainty>,
}

fn balances<'a>(report: &JudgedPoints<'a>) -> Vec<(&'a StepMarker, EnergyBalance)> {
    let steps = report
        .points
        .iter()
        .filter_map(|scored| report.recording.steps.iter().find(|step| step.index == scored.point.step));
    let balance = |step: &'a StepMarker| {
        let span_s = ((step.end_s - END_S).max(step.start_s), step.end_s);
        (step, energy_balance(report.recording, span_s, &report.gases, report.used))
    };
    steps.map(balance).collect()
}

fn balance_rows(report: &JudgedPoints<'_>) -> Vec<[String; 6]> {
    let balances = balances(report);
    if balances.iter().all(|(_, balance)| balance.turbine.is_none()) {
        return Vec::new();
    }
    let shown = |power: Option<Power>| match power {
        Some(power) => format!("{:.0} +/- {:.0}", power.w, half_width_95(power.sigma_w)),
        None => "-".to_owned(),
    };
    let row = |(step, balance): (&StepMarker, EnergyBalance)| {
        let EnergyBalance { compressor, turbine, oil, water, losses } = balance;
        let [compressor, turbine, oil, water, losses] = [compressor, turbine, oil, water, losses].map(shown);
        [step_number(step.index).to_string(), compressor, turbine, oil, water, losses]
    };
    balances.into_iter().map(row).collect()
}

fn acceptance_rows(report: &JudgedPoints<'_>) -> Vec<[String; 5]> {
    let criteria = report.campaign.and_then(|campaign| campaign.acceptance.as_ref());
    let Some(criteria) = criteria else { return Vec::new() };
    let row = |judged: CriterionResult| {
        let failed: Vec<String> = judged.failed().map(|step| step_number(step).to_string()).collect();
        let result = match (judged.largest_ratio(), failed.len()) {
            (None, _) => "not measured".to_owned(),
            (Some(_), 0) => "pass".to_owned(),
            (Some(_), failed) => format!("fail at {failed} of {}", judged.steps.len()),
        };
        let percent = |ratio: f64| format!("{:.2}", 100.0 * ratio);
        [
            judged.channel.map_or_else(
                || "heat balance: losses over turbine".to_owned(),
                |channel| format!("fluctuation of {channel}"),
            ),
            percent(judged.limit_ratio),
            judged.largest_ratio().map_or_else(|| "-".to_owned(), percent),
            result,
            failed.join(", "),
        ]
    };
    judge_acceptance(criteria, report.recording, &balances(report)).into_iter().map(row).collect()
}

fn acceptance_words(report: &JudgedPoints<'_>) -> Option<String> {
    let criteria = report.campaign?.acceptance.as_ref()?;
    Some(format!(
        "{} ({}). Judged over the last {} s of each step; a fluctuation is the highest minus the lowest reading over the mean.",
        criteria.name, criteria.source, criteria.window_s
    ))
}

pub(crate) fn acceptance_section(report: &JudgedPoints<'_>) -> Document {
    let mut document = Document::default();
    let heads = ["criterion", "limit, %", "largest, %", "result", "steps that fail"];
    document.text(acceptance_words(report).unwrap_or_default());
    document.table(Table::new(heads).with_texts([3, 4]).rows(acceptance_rows(report)));
    document
}

pub(crate) fn balance_section(report: &JudgedPoints<'_>) -> Document {
    let mut document = Document::default();
    let rows = balance_rows(report);
    if !rows.is_empty() {
        let heads = ["step", "compressor, W", "turbine, W", "oil, W", "water, W", "losses, W"];
        document.text(BALANCE_WORDS);
        document.table(Table::new(heads).rows(rows));
    }
    document
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::{Series, StepKind};

    /// P3 arrives 5 kPa below its command; the oil has no reading, nor has any valve.
    #[test]
    fn every_command_has_a_reading_or_none() {
        let series = |value: f64| {
            let t_s: Vec<f64> = (0..100).map(f64::from).collect();
            Series { values: vec![value; t_s.len()], t_s }
        };
        let step = StepMarker {
            index: 0,
            kind: StepKind::Point,
            start_s: 0.0,
            end_s: 99.0,
            from: None,
            to: None,
            p3_pa: 2e5,
            valve_opening_ratio: 1.4,
        };
        let recording = Recording {
            series: BTreeMap::from([
                (Channel::P3Command, series(2e5)),
                (Channel::P3, series(1.95e5)),
                (Channel::ValveCommand, series(1.4)),
                (Channel::TOilCommand, series(350.0)),
            ]),
            steps: vec![step],
            ..Recording::default()
        };
        let table = witness_table(&recording, &Display::default());
        let text = crate::markdown_table(&table);
        let cells: Vec<Vec<&str>> = text
            .lines()
            .skip(2)
            .map(|line| line.trim_matches('|').split('|').map(str::trim).collect())
            .collect();
        assert_eq!(cells.len(), 3, "no T3 was commanded");
        assert_eq!((cells[0][1], cells[0][2], cells[0][3]), ("P3", "-5.0", "kPa"));
        assert!(cells[1..].iter().all(|row| row[2] == "-"), "{cells:?}");
    }

    /// After a zero at 25 degC with 0.05 % (0.1 % at 95 %), T2 at 130 degC is known to 0.1 % of 105 K, not to the offset at rest alone.
    #[test]
    fn the_error_as_used_names_offset_and_gain() {
        let used = DeclaredUncertainty { noise_sigma: 0.1, offset_sigma: 0.011, gain_sigma_ratio: 5e-4 };
        let display = Display::default();
        let shown = as_used(Channel::T2, &used, "0.022".to_owned(), Some(298.15), &display);
        assert!(shown.contains("0.022 + 0.098 %"), "{shown}");
        let unzeroed = as_used(Channel::P2, &used, "0.20".to_owned(), None, &display);
        assert!(unzeroed.ends_with("% of reading"), "{unzeroed}");
        let exact = DeclaredUncertainty { gain_sigma_ratio: 0.0, ..used };
        assert_eq!(as_used(Channel::T2, &exact, "0.022".to_owned(), None, &display), "0.022");
    }

    #[test]
    fn an_uncertainty_has_two_figures() {
        let shown = [0.000294, 0.0588, 0.49, 1.96, 58.8, 0.0].map(two_figures);
        assert_eq!(shown, ["0.00029", "0.059", "0.49", "2.0", "59", "-"]);
    }
}
