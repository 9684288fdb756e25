//! Values in the display units of a campaign.

use mapper_campaign::campaign::DisplayUnits;
use mapper_campaign::units::Kind;
use mapper_core::{Channel, OperatingPoint};
use mapper_recording::logs::units::kind_of;

/// Formatter of values in the display units.
#[derive(Debug, Clone)]
pub struct Display {
    units: DisplayUnits,
}

impl Display {
    /// The campaign's display units.
    pub fn new(units: &DisplayUnits) -> Self {
        Display { units: units.clone() }
    }

    /// The units.
    pub fn units(&self) -> &DisplayUnits {
        &self.units
    }

    /// A value converted from the internal to the display unit, for drawing.
    pub fn number(&self, kind: Kind, inside: f64) -> f64 {
        let symbol = match kind {
            Kind::Speed => &self.units.speed,
            Kind::Pressure => &self.units.pressure,
            Kind::MassFlow => &self.units.flow,
            Kind::Temperature => &self.units.temperature,
            _ => return inside,
        };
        Self::convert_to_unit(kind, symbol, inside)
    }

    /// A reading of a channel converted to the display unit, for drawing.
    pub fn reading(&self, channel: Channel, inside: f64) -> f64 {
        self.number(kind_of(channel), inside)
    }

    /// The display unit of a channel's readings; empty for a ratio.
    pub fn unit_of(&self, channel: Channel) -> &str {
        match kind_of(channel) {
            Kind::Speed => &self.units.speed,
            Kind::MassFlow => &self.units.flow,
            Kind::Pressure => &self.units.pressure,
            Kind::Temperature => &self.units.temperature,
            _ => "",
        }
    }

    /// A reading of a channel in its display unit, without the unit.
    pub fn shown_reading(&self, channel: Channel, inside: f64) -> String {
        match kind_of(channel) {
            Kind::Speed => self.speed(inside),
            Kind::MassFlow => self.flow(inside),
            Kind::Pressure => self.pressure(inside),
            Kind::Temperature => self.temperature(inside),
            _ => format!("{inside:.3}"),
        }
    }

    /// The display unit of differences between readings of a channel: K for temperatures.
    pub fn difference_unit(&self, channel: Channel) -> &str {
        if kind_of(channel) == Kind::Temperature { "K" } else { self.unit_of(channel) }
    }

    /// A difference between readings of a channel in that unit; `None` for none.
    pub fn difference(&self, channel: Channel, inside: f64) -> Option<f64> {
        let shown = match kind_of(channel) {
            Kind::Temperature => inside,
            kind => self.number(kind, inside) - self.number(kind, 0.0),
        };
        Some(shown).filter(|shown| shown.is_finite() && *shown != 0.0)
    }

    fn convert_to_unit(kind: Kind, symbol: &str, inside: f64) -> f64 {
        // A checked campaign names only existing units; anything else is shown in SI.
        kind.unit(symbol).map_or(inside, |unit| unit.from_inside(inside))
    }

    fn format_in_unit(kind: Kind, symbol: &str, value: f64, decimals: usize) -> String {
        format!("{:.decimals$}", Self::convert_to_unit(kind, symbol, value))
    }

    /// Column head: name, and the unit of speeds.
    pub fn speed_head(&self, name: &str) -> String {
        format!("{name} {}", self.units.speed)
    }

    /// A shaft speed.
    pub fn speed(&self, speed_rpm: f64) -> String {
        Self::format_in_unit(
            Kind::Speed,
            &self.units.speed,
            speed_rpm,
            if self.units.speed == "krpm" { 2 } else { 0 },
        )
    }

    /// The name of a speed line: its corrected speed in three figures.
    pub fn line_name(&self, speed_corrected_rpm: f64) -> String {
        let speed = Self::convert_to_unit(Kind::Speed, &self.units.speed, speed_corrected_rpm);
        let exponent = if speed == 0.0 { 0 } else { speed.abs().log10().floor() as i32 };
        let last = 10f64.powi(exponent - 2);
        let text = format!("{:.*}", (2 - exponent).max(0) as usize, (speed / last).round() * last);
        // Without zeros at the end.
        text.parse::<f64>().map_or(text, |speed| speed.to_string())
    }

    /// An operating point in words: speed with its unit, opening.
    pub fn place_in_words(&self, point: OperatingPoint) -> String {
        format!("{} {}, opening {}", self.speed(point.speed_rpm), self.units.speed, point.shown().1)
    }

    /// An operating point: speed and opening.
    pub fn place(&self, point: OperatingPoint) -> String {
        format!("{} @ {}", self.speed(point.speed_rpm), point.shown().1)
    }

    /// Column head: name, and the unit of pressures.
    pub fn pressure_head(&self, name: &str) -> String {
        format!("{name} {}", self.units.pressure)
    }

    /// A pressure.
    pub fn pressure(&self, pressure_pa: f64) -> String {
        let decimals = match self.units.pressure.as_str() {
            "Pa" => 0,
            "bar" => 4,
            _ => 2,
        };
        Self::format_in_unit(Kind::Pressure, &self.units.pressure, pressure_pa, decimals)
    }

    /// Column head: name, and the unit of flows.
    pub fn flow_head(&self, name: &str) -> String {
        format!("{name} {}", self.units.flow)
    }

    /// A mass flow.
    pub fn flow(&self, flow_kg_s: f64) -> String {
        Self::format_in_unit(
            Kind::MassFlow,
            &self.units.flow,
            flow_kg_s,
            if self.units.flow == "kg/s" { 5 } else { 2 },
        )
    }

    /// Column head: name, and the unit of temperatures.
    pub fn temperature_head(&self, name: &str) -> String {
        format!("{name} {}", self.units.temperature)
    }

    /// A temperature.
    pub fn temperature(&self, temperature_k: f64) -> String {
        Self::format_in_unit(Kind::Temperature, &self.units.temperature, temperature_k, 1)
    }
}
