//! The isothermal zero, several sensors of a channel, and measured surge-side ends.

use crate::document::{Describe, Document, Table};
use crate::formatting::{Display, number, percent};
use mapper_campaign::Campaign;
use mapper_core::{Channel, SoftSurge, SurgeFoundBy, SurgeMark, SurgeNotFound, half_width_95};
use mapper_identify::ZeroOutcome;
use mapper_observe::FusedChannel;
use mapper_recording::score::ScoredMark;
use serde::Serialize;

pub(crate) fn zero_sentence(zero: &ZeroOutcome) -> Option<String> {
    match zero {
        ZeroOutcome::NotRequested => None,
        ZeroOutcome::Refused(reason) => {
            Some(format!("No isothermal zero: {reason}. The declared offsets stand."))
        }
        ZeroOutcome::Found(zero) => Some(format!(
            "At rest, from {:.0} to {:.0} s, all sensors of a kind should read the same; the differences are subtracted. Half \
             widths of 95 % intervals.",
            zero.start_s, zero.end_s
        )),
    }
}

pub(crate) fn zero_section(zero: &ZeroOutcome, display: &Display) -> Document {
    let mut document = Document::default();
    document.text(zero_sentence(zero).unwrap_or_default());
    let ZeroOutcome::Found(zero) = zero else { return document };
    let row = |(channel, offset): (&Channel, &f64)| {
        let shown = |value: f64| display.difference(*channel, value).unwrap_or(0.0);
        let half = shown(half_width_95(zero.left_sigma.get(channel).copied().unwrap_or(f64::NAN)));
        // Two significant digits of the half width.
        let decimals = if half > 0.0 && half.is_finite() {
            (1.0 - half.log10().floor()).clamp(0.0, 6.0) as usize
        } else {
            2
        };
        let unit = display.difference_unit(*channel).to_owned();
        [channel.to_string(), format!("{:+.decimals$}", shown(*offset)), format!("{half:.decimals$}"), unit]
    };
    let heads = ["sensor", "subtracted", "known within +/-", "unit"];
    document.table(Table::new(heads).with_texts([3]).rows(zero.offsets.iter().map(row)));
    // The gas of the turbine stays warm longer than a soak lasts.
    let hot_side = [Channel::T3, Channel::T4, Channel::Tt];
    let kept = zero.left_out.iter().filter(|left| !hot_side.contains(&left.channel));
    let kept = kept.map(|left| format!("{} keeps its declared offset: {}", left.channel, left.reason));
    document.list(kept);
    document
}

impl Describe for ZeroOutcome {
    fn document(&self) -> Document {
        let mut document = Document::default();
        document.section("Isothermal zero", zero_section(self, &Display::default()));
        document
    }
}

/// A line for each channel that has several sensors: their combination, and the omitted sensors with reasons.
impl Describe for [FusedChannel] {
    fn document(&self) -> Document {
        let mut body = Document::default();
        if !self.is_empty() {
            body.text("Fused by their declared uncertainty (one standard deviation).");
            body.list(self.iter().map(ToString::to_string));
        }
        let mut document = Document::default();
        document.section("Channels with several sensors", body);
        document
    }
}

pub(crate) fn declared_sensors(campaign: &Campaign) -> Vec<String> {
    let several = campaign.sensors.iter().filter_map(|(channel, sensor)| {
        let fused = FusedChannel {
            channel: *channel,
            sensors: sensor.redundant.as_ref()?.elements.len(),
            left_out: Vec::new(),
            contradiction: None,
            declared: sensor.declared,
            probe_diameter_m: sensor.probe_diameter_m,
        };
        Some(fused.to_string())
    });
    several.collect()
}

/// Result of the search for surge.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct SurgeReport {
    /// The marks in order of speed, with the truth if the recording contains it.
    pub marks: Vec<ScoredMark>,
    /// Lines on which no mark was found.
    pub remarks: Vec<SurgeNotFound>,
    /// How often the compressor went into surge.
    pub surges: usize,
}

/// Marks of a search for surge, lines without a mark, and the number of surge events; `truth`: with the deviations of the marks from it.
pub(crate) fn surge_section(surge: &SurgeReport, display: &Display, truth: bool) -> Document {
    let truth = truth && surge.marks.iter().any(|scored| scored.truth_flow_corrected_kg_s.is_some());
    let units = &display.units;
    let mut heads: Vec<&str> =
        vec![&units.speed, &units.flow, "+/- %", "PR", "+/-", "nearest %", "openings", "found by"];
    let soft = surge.marks.iter().find_map(|scored| scored.mark.soft);
    heads.extend(soft.map(|_| "soft"));
    heads.extend(truth.then_some("error %"));
    let mut document = Document::default();
    document.text(
        "Surge-side ends of the lines: corrected speed and flow, half widths of 95 % intervals, distance of the nearest point above in \
         flow, number of openings tried.",
    );
    if let Some(soft) = soft {
        document.text(format!("soft: corrected flow at soft surge, {}.", soft_criterion(&soft)));
    }
    if truth {
        document.text("error: difference from the simulator's truth.");
    }
    document.table(Table::new(heads).with_texts([7]).rows(surge_rows(&surge.marks, display, truth)));
    surge_remarks(surge).into_iter().for_each(|remark| document.text(remark));
    document
}

/// The criterion of soft surge.
pub(crate) fn soft_criterion(soft: &SoftSurge) -> String {
    format!(
        "where the coefficient of variation of {} reaches {:.3} %, {:.1} times that far from surge (SAE J1826: the onset of fluctuations)",
        soft.channel,
        100.0 * soft.variation_ratio,
        soft.variation_ratio / soft.quiet_ratio
    )
}

fn surge_remarks(surge: &SurgeReport) -> Vec<String> {
    std::iter::once(times(surge.surges))
        .chain(surge.remarks.iter().map(|SurgeNotFound { target_speed_rpm, openings, enough }| match enough {
            true => format!(
                "Not found at {target_speed_rpm:.0} rpm: the variation of pressures and flow did not grow over {openings} openings."
            ),
            false => format!(
                "Not found at {target_speed_rpm:.0} rpm: {openings} openings are too few to locate surge."
            ),
        }))
        .collect()
}

fn surge_rows(marks: &[ScoredMark], display: &Display, truth: bool) -> Vec<Vec<String>> {
    let has_soft = marks.iter().any(|scored| scored.mark.soft.is_some());
    let row = |ScoredMark { mark, truth_flow_corrected_kg_s }: &ScoredMark| {
        let flow_kg_s = mark.flow_corrected_kg_s;
        let mut row = vec![
            display.speed(mark.speed_corrected_rpm),
            display.flow(flow_kg_s),
            percent(Some(half_width_95(mark.flow_total_standard_error_kg_s()) / flow_kg_s), 1),
            number(Some(mark.pressure_ratio), 3),
            number(Some(half_width_95(mark.pressure_ratio_standard_error)), 3),
            percent(Some(mark.closest_flow_corrected_kg_s / flow_kg_s - 1.0), 1),
            mark.steps.to_string(),
            evidence_name(mark).to_owned(),
        ];
        if has_soft {
            row.push(mark.soft.map_or_else(|| "-".to_owned(), |soft| display.flow(soft.flow_corrected_kg_s)));
        }
        if truth {
            row.push(percent(truth_flow_corrected_kg_s.map(|true_kg_s| flow_kg_s / true_kg_s - 1.0), 2));
        }
        row
    };
    marks.iter().map(row).collect()
}

fn times(surges: usize) -> String {
    match surges {
        0 => "The compressor did not go into surge during the approach.".to_owned(),
        1 => "The compressor went into surge once during the approach; the valve opened immediately."
            .to_owned(),
        more => format!(
            "The compressor went into surge {more} times during the approach; the valve opened immediately."
        ),
    }
}

fn evidence_name(mark: &SurgeMark) -> &'static str {
    match mark.found_by {
        SurgeFoundBy::Precursor => "variation",
        SurgeFoundBy::Surge => "surge",
        SurgeFoundBy::File => "file",
    }
}
