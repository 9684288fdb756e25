//! Tables for a terminal, numbers to the right, units in the head.

use comfy_table::{CellAlignment, Table, presets};
use mapper_campaign::campaign::DisplayUnits;
use mapper_campaign::units::Kind;

/// A table with these column heads; all columns but the first are numbers.
pub fn with_heads(heads: &[String]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_header(heads);
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// A number, or a dash where there is none: a silent number helps nobody.
pub fn number(value: Option<f64>, decimals: usize) -> String {
    value
        .filter(|value| value.is_finite())
        .map_or_else(|| "-".to_owned(), |value| format!("{value:.decimals$}"))
}

/// Values as the campaign wants them shown.
#[derive(Debug, Clone)]
pub struct Display {
    units: DisplayUnits,
}

impl Display {
    /// The campaign's display units.
    pub fn new(units: &DisplayUnits) -> Self {
        Display { units: units.clone() }
    }

    fn shown(kind: Kind, symbol: &str, value: f64, decimals: usize) -> String {
        // A checked campaign names only units that exist; anything else is shown in SI.
        let shown = kind.unit(symbol).map_or(value, |unit| unit.from_inside(value));
        format!("{shown:.decimals$}")
    }

    /// Column head: what, and the unit of speeds.
    pub fn speed_head(&self, what: &str) -> String {
        format!("{what} {}", self.units.speed)
    }

    /// A shaft speed.
    pub fn speed(&self, speed_rpm: f64) -> String {
        Self::shown(Kind::Speed, &self.units.speed, speed_rpm, if self.units.speed == "krpm" { 2 } else { 0 })
    }

    /// Column head: what, and the unit of pressures.
    pub fn pressure_head(&self, what: &str) -> String {
        format!("{what} {}", self.units.pressure)
    }

    /// A pressure.
    pub fn pressure(&self, pressure_pa: f64) -> String {
        let decimals = match self.units.pressure.as_str() {
            "Pa" => 0,
            "bar" => 4,
            _ => 2,
        };
        Self::shown(Kind::Pressure, &self.units.pressure, pressure_pa, decimals)
    }

    /// Column head: what, and the unit of flows.
    pub fn flow_head(&self, what: &str) -> String {
        format!("{what} {}", self.units.flow)
    }

    /// A mass flow.
    pub fn flow(&self, flow_kg_s: f64) -> String {
        Self::shown(
            Kind::MassFlow,
            &self.units.flow,
            flow_kg_s,
            if self.units.flow == "kg/s" { 5 } else { 2 },
        )
    }

    /// Column head: what, and the unit of temperatures.
    pub fn temperature_head(&self, what: &str) -> String {
        format!("{what} {}", self.units.temperature)
    }

    /// A temperature.
    pub fn temperature(&self, temperature_k: f64) -> String {
        Self::shown(Kind::Temperature, &self.units.temperature, temperature_k, 1)
    }
}

/// When something is done, after the start of the run: `+h:mm`.
pub fn eta(after_s: f64) -> String {
    let minutes = (after_s.max(0.0) / 60.0).round() as u64;
    format!("+{}:{:02}", minutes / 60, minutes % 60)
}

/// A duration as hours and minutes, or minutes and seconds.
pub fn duration(duration_s: f64) -> String {
    let seconds = duration_s.max(0.0).round() as u64;
    if seconds >= 3600 {
        format!("{} h {:02} min", seconds / 3600, seconds % 3600 / 60)
    } else {
        format!("{} min {:02} s", seconds / 60, seconds % 60)
    }
}
