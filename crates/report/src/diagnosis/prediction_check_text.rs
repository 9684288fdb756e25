//! Evaluation of a pre-registered prediction, as a page for a terminal.

use crate::formatting::number::four_figures;
use mapper_diagnose::gap::ForecastCheck;

/// The page.
pub fn forecast_check_text(held: &ForecastCheck, seal: &str) -> String {
    let mut text = format!(
        "forecast {seal}\n{} values, nothing fitted: residual {:.2} times the noise, {:.1} % within the 95 % band\n\n",
        held.values,
        held.ratio,
        100.0 * held.inside
    );
    for (channel, row) in &held.channels {
        let (scale, unit) = if row.unit == "Pa" { (1e-3, "kPa") } else { (1.0, row.unit.as_str()) };
        text += &format!(
            "  {channel:4} {:>10} {unit:5} {:>5.2} times the noise, {:>5.1} % within\n",
            four_figures(scale * row.rms),
            row.ratio,
            100.0 * row.inside
        );
    }
    text
}
