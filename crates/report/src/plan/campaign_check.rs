//! The check of a campaign, and the commissioning of its stand.

use crate::document::{Document, Table};
use crate::formatting::{Display, Message, duration, percent, significant_digits};
use crate::test_report::key_figures::assumed_keys;
use crate::test_report::zero_and_sensors::declared_sensors;
use mapper_campaign::units::Kind;
use mapper_campaign::{Campaign, ResolvedLine, ResolvedPoint};
use mapper_core::{
    Advice, CampaignChange, Channel, PlanRemark, UndeclaredForecast, VerdictForecast, half_width_95,
    valve_area_text, with_unit,
};
use mapper_observe::{Fitted, MeasuredValue};
use serde_json::{Value, json};
use std::path::Path;

/// A campaign without mistakes.
#[derive(Debug, Clone, Copy)]
pub struct CheckedCampaign<'a> {
    /// Its file.
    pub file: &'a Path,
    /// Its content.
    pub campaign: &'a Campaign,
    /// Number of steps, or its maximum.
    pub steps: usize,
    /// Whether the number of steps is known.
    pub is_planned: bool,
    /// Expected rig time, s.
    pub duration_s: f64,
    /// Number of warnings that were printed before.
    pub warnings: usize,
    /// Expected verdicts, if they can be forecast.
    pub verdicts: Option<VerdictForecast>,
    /// Changes that improve them.
    pub advice: &'a [Advice],
    /// The slowest crossing of the speeds to avoid.
    pub avoided: Option<&'a PlanRemark>,
    /// The resolved speed lines.
    pub lines: &'a [ResolvedLine],
}

impl crate::document::Describe for CheckedCampaign<'_> {
    fn document(&self) -> Document {
        let CheckedCampaign { campaign, steps, .. } = *self;
        let warnings = match self.warnings {
            0 => String::new(),
            1 => ", 1 warning".to_owned(),
            count => format!(", {count} warnings"),
        };
        let mut document = Document::default();
        document.text(format!(
            "{}: no mistakes{warnings}. {} points in {}{steps} steps on `{}` in {} of rig time{}.",
            self.file.display(),
            campaign.points.len(),
            if self.is_planned { "" } else { "at most " },
            campaign.backend.name,
            duration(self.duration_s),
            if campaign.sequence.is_some() { " by its script on the nominal machine" } else { "" },
        ));
        if let Some(forecast) = self.verdicts {
            add_forecast(&mut document, campaign, &forecast, self.advice);
        }
        document.text(self.avoided.map(Message::message).unwrap_or_default());
        document.list(declared_sensors(campaign));
        document.text(assumed_keys(campaign).unwrap_or_default());
        add_lines(&mut document, campaign, self.lines);
        document
    }
}

fn add_forecast(document: &mut Document, campaign: &Campaign, forecast: &VerdictForecast, advice: &[Advice]) {
    document.text(format!("Expected if the machine is as declared: {}", verdicts(forecast)));
    if let Some(UndeclaredForecast { good, eta_standard_error }) = forecast.undeclared {
        document.text(format!(
            "If alpha_A, probe and heating/cooling ratio are one standard deviation off: {good} of {} good, {} (95 %)",
            forecast.points,
            points_95(eta_standard_error)
        ));
    }
    let is_measured = |channel| campaign.sensors.contains_key(&channel);
    if campaign.report.humidity_ratio.is_none()
        && ![Channel::RelativeHumidity, Channel::DewPoint].into_iter().any(is_measured)
    {
        document.text("plus the unknown humidity: write `report: {humidity: 50 %}`, or record `RH`");
    }
    if forecast.near_limit {
        document.text(describe_near_limit(forecast));
    }
    if forecast.good_low < forecast.points && advice.is_empty() {
        document.text(
            "Neither a longer dwell nor a longer soak makes more of them good; add points, or set known parameters to `fixed` in \
             `identification.joint`.",
        );
    }
    document.list(advice.iter().map(|Advice { change, forecast: after }| {
        let additional_time = duration(after.duration_s - forecast.duration_s);
        format!("{} (+{additional_time}): {}", change_text(*change), verdicts(after))
    }));
}

/// The other outcome of a forecast near the limit: all points depend on it together, so a range from 0 would say less.
fn describe_near_limit(forecast: &VerdictForecast) -> String {
    let reason = "depends on how well the steps determine alpha_A, probe and heating/cooling ratio";
    match forecast.good {
        0 => format!(
            "Near a limit: all points are probably doubtful (`prior_dominated`), at best {} are good. It {reason}.",
            forecast.good_high
        ),
        _ => format!("Near a limit: all points may become doubtful (`prior_dominated`). It {reason}."),
    }
}

fn verdicts(forecast: &VerdictForecast) -> String {
    let VerdictForecast { points, good, good_low, good_high, near_limit, .. } = forecast;
    let has_range = good_low < good_high && !near_limit;
    let range = if has_range { format!(" ({good_low} to {good_high})") } else { String::new() };
    let error = forecast.eta_standard_error.filter(|_| *good > 0);
    let error = error.map_or_else(String::new, |sigma| format!(", efficiency {} (95 %)", points_95(sigma)));
    format!("{good} of {points} points good{range}{error}")
}

fn points_95(sigma: f64) -> String {
    format!("+/- {:.2} points", 100.0 * half_width_95(sigma))
}

fn change_text(change: CampaignChange) -> String {
    match change {
        CampaignChange::DwellS(dwell_s) => format!("`timing: {{dwell: {dwell_s:.0} s}}`"),
        CampaignChange::SoakS(soak_s) => format!("`zero: {{soak: {:.0} min}}`", soak_s / 60.0),
    }
}

fn add_lines(document: &mut Document, campaign: &Campaign, lines: &[ResolvedLine]) {
    let display = Display::new(&campaign.display);
    let mut rows = Table::new([
        display.head("corrected", Kind::Speed),
        display.head("physical", Kind::Speed),
        "points".to_owned(),
        display.head("corrected flow", Kind::MassFlow),
        "PR".to_owned(),
        "valve area".to_owned(),
        "surge margin %".to_owned(),
    ]);
    for line in lines {
        let [Some(first), Some(last)] = [line.points.first(), line.points.last()] else { continue };
        let range = |of: &dyn Fn(&ResolvedPoint) -> String| format!("{} to {}", of(first), of(last));
        rows.row([
            display.speed(line.speed_corrected_rpm),
            display.speed(line.speed_rpm),
            line.points.len().to_string(),
            range(&|point| display.flow(point.flow_corrected_kg_s)),
            range(&|point| format!("{:.3}", point.pressure_ratio)),
            range(&|point| valve_area_text(point.valve_opening_ratio)),
            percent(Some(last.surge_margin_ratio), 0),
        ]);
    }
    if !lines.is_empty() {
        document.table(rows);
        document.text(format!(
            "The lines on the nominal machine, from choke to surge, corrected to {}. `mapper plan` shows every point.",
            campaign.reference
        ));
    }
}

/// Significant digits of a value. Bound: intervals of commissionings are wider than a per cent.
const DIGITS: usize = 3;

/// The measured values, and whether the campaign agrees with them.
pub fn commissioning_document(values: &[MeasuredValue]) -> Document {
    let mut table =
        Table::new(["value", "declared", "measured (95 %)", "declaration"]).with_texts([0, 1, 2, 3]);
    for value in values {
        let actuator = match value.actuator {
            "turbine_inlet_pressure" => "P3",
            "turbine_inlet_temperature" => "T3",
            other => other,
        };
        table.row([
            format!("{actuator} {}", value.key),
            text(value, value.declared),
            measured(value),
            if value.agrees() { "agrees" } else { "differs" }.to_owned(),
        ]);
    }
    let mut document = Document::default();
    document.table(table);
    let different = values.iter().filter(|value| !value.agrees()).count();
    document.text(match different {
        0 => "The declaration agrees with the stand: nothing has to be changed.".to_owned(),
        1 => "1 value differs from the declaration.".to_owned(),
        count => format!("{count} values differ from the declaration."),
    });
    document
}

/// The same for a program: in the units of campaigns; a rate that does not limit the motion has no value.
pub fn commissioning_json(values: &[MeasuredValue]) -> Value {
    let entry = |value: &MeasuredValue| {
        let mut entry = json!(value);
        (entry["agrees"], entry["to_declare"]) = (json!(value.agrees()), json!(value.to_declare()));
        entry
    };
    values.iter().map(entry).collect()
}

/// Actuator, key and text of each value to declare.
pub fn values_to_declare(values: &[MeasuredValue]) -> Vec<(&'static str, &'static str, String)> {
    let entry = |value: &MeasuredValue| (value.actuator, value.key, text(value, value.to_declare()));
    values.iter().map(entry).collect()
}

fn text(value: &MeasuredValue, number: f64) -> String {
    with_unit(significant_digits(number, DIGITS), value.unit)
}

fn measured(value: &MeasuredValue) -> String {
    let Fitted { value: found, low, high } = value.measured;
    match high.is_finite() {
        true => format!("{} ({} to {})", text(value, found), text(value, low), text(value, high)),
        false => format!("at least {}", text(value, low)),
    }
}
