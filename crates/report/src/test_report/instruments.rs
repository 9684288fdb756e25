//! The instruments: declared uncertainty, uncertainty after a zero, calibration register.

use crate::formatting::display::Display;
use mapper_campaign::Campaign;
use mapper_core::{Channel, DeclaredUncertainty, half_width_95};
use std::collections::BTreeMap;

/// Columns of [`instrument_rows`].
pub const INSTRUMENT_HEADS: [&str; 9] = [
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

/// Meaning of the columns.
pub const INSTRUMENT_WORDS: &str = "Half widths of 95 % intervals, as declared: noise of one sample, offset left after calibration, gain; \
                                    temperatures in K. As used: the offset that the isothermal zero leaves, where there was one. \
                                    `-`: it is not declared.";

/// A row for each sensor of the campaign. `used`: the uncertainties of the identification.
pub fn instrument_rows(
    campaign: &Campaign,
    used: &BTreeMap<Channel, DeclaredUncertainty>,
    display: &Display,
) -> Vec<[String; 9]> {
    let row = |(channel, sensor): (&Channel, &mapper_campaign::campaign::SensorDeclaration)| {
        let half = |sigma: f64| {
            display.difference(*channel, half_width_95(sigma)).map_or_else(dash_cell, two_figures)
        };
        let declared = &sensor.declared;
        let used = used.get(channel).map_or_else(dash_cell, |used| half(used.offset_sigma));
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

/// Columns of [`register_rows`].
pub const REGISTER_HEADS: [&str; 7] =
    ["sensor", "certificate", "laboratory", "calibrated", "due", "range", "U (k = 2)"];

/// A row for each sensor whose calibration states more than its day. `tested_at`: start of the test, from its day on.
pub fn register_rows(campaign: &Campaign, tested_at: Option<&str>, display: &Display) -> Vec<[String; 7]> {
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

#[cfg(test)]
mod tests {
    use super::two_figures;

    #[test]
    fn an_uncertainty_has_two_figures() {
        let shown = [0.000294, 0.0588, 0.49, 1.96, 58.8, 0.0].map(two_figures);
        assert_eq!(shown, ["0.00029", "0.059", "0.49", "2.0", "59", "-"]);
    }
}
