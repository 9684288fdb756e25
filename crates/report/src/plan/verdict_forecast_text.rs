//! The forecast of verdicts as lines for a terminal.

use crate::formatting::duration::duration;
use crate::formatting::table::COLUMNS;
use crate::formatting::wrapped::wrapped;
use mapper_campaign::Campaign;
use mapper_core::{Advice, CampaignChange, Channel, UndeclaredForecast, VerdictForecast, half_width_95};

/// The expected verdicts in a line, and below it a line for each change that improves them; empty without a forecast.
pub fn verdict_forecast_text(
    campaign: &Campaign,
    forecast: Option<VerdictForecast>,
    advice: &[Advice],
) -> String {
    let Some(forecast) = forecast else { return String::new() };
    let declared = format!("Expected if the machine is as declared: {}", verdicts(&forecast));
    let mut text = wrapped(&declared, COLUMNS, 2);
    if let Some(UndeclaredForecast { good, eta_standard_error }) = forecast.undeclared {
        let error = points_95(eta_standard_error);
        let rare = format!(
            "If alpha_A, probe and heating/cooling ratio are one standard deviation off: {good} of {} good, {error} (95 %)",
            forecast.points
        );
        text += &wrapped(&rare, COLUMNS, 2);
    }
    let is_measured = |channel| campaign.sensors.contains_key(&channel);
    if campaign.report.humidity_ratio.is_none()
        && ![Channel::RelativeHumidity, Channel::DewPoint].into_iter().any(is_measured)
    {
        text += "  plus the unknown humidity: write `report: {humidity: 50 %}`, or record `RH`\n";
    }
    if forecast.near_limit {
        text += &near_limit_text(&forecast);
    }
    if forecast.good_low < forecast.points && advice.is_empty() {
        text += "Neither a longer dwell nor a longer soak makes more of them good; add points, or set known\n\
                 parameters to `fixed` in `identification.joint`.\n";
    }
    for Advice { change, forecast: after } in advice {
        let additional_time = duration(after.duration_s - forecast.duration_s);
        let line = format!("  {} (+{additional_time}): {}", change_text(*change), verdicts(after));
        text += &wrapped(&line, COLUMNS, 4);
    }
    text
}

/// The other outcome of a forecast near the limit: all points depend on it together, so a range from 0 would say less.
fn near_limit_text(forecast: &VerdictForecast) -> String {
    let steps = "these steps determine alpha_A, probe and heating/cooling ratio a little";
    let text = match forecast.good {
        0 => format!(
            "Near a limit: if {steps} better than forecast, up to {} points are good; otherwise all are doubtful (`prior_dominated`).",
            forecast.good_high
        ),
        _ => format!(
            "Near a limit: if {steps} worse than forecast, all points are doubtful (`prior_dominated`)."
        ),
    };
    wrapped(&text, COLUMNS, 2)
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
