//! Values in the display units of a campaign.

use mapper_campaign::campaign::DisplayUnits;
use mapper_campaign::units::Kind;
use mapper_core::{Channel, OperatingPoint};
use mapper_recording::logs::kind_of;

/// Formatter of values in the display units.
#[derive(Debug, Clone, Default)]
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

    /// The display unit of a kind; empty for a kind that is shown as it is.
    fn unit(&self, kind: Kind) -> &str {
        match kind {
            Kind::Speed => &self.units.speed,
            Kind::Pressure => &self.units.pressure,
            Kind::MassFlow => &self.units.flow,
            Kind::Temperature => &self.units.temperature,
            _ => "",
        }
    }

    /// A value converted from the internal to the display unit, for drawing.
    pub fn number(&self, kind: Kind, inside: f64) -> f64 {
        match self.unit(kind) {
            "" => inside,
            // A checked campaign names only existing units; anything else is shown in SI.
            symbol => kind.unit(symbol).map_or(inside, |unit| unit.from_inside(inside)),
        }
    }

    /// A value in its display unit, without the unit.
    fn shown(&self, kind: Kind, inside: f64) -> String {
        let decimals = match (kind, self.unit(kind)) {
            (Kind::Speed, "krpm") => 2,
            (Kind::Speed, _) | (Kind::Pressure, "Pa") => 0,
            (Kind::MassFlow, "kg/s") => 5,
            (Kind::Pressure, "bar") => 4,
            (Kind::MassFlow | Kind::Pressure, _) => 2,
            (Kind::Temperature, _) => 1,
            _ => 3,
        };
        format!("{:.decimals$}", self.number(kind, inside))
    }

    /// A reading of a channel converted to the display unit, for drawing.
    pub fn reading(&self, channel: Channel, inside: f64) -> f64 {
        self.number(kind_of(channel), inside)
    }

    /// The display unit of a channel's readings; empty for a ratio.
    pub fn unit_of(&self, channel: Channel) -> &str {
        self.unit(kind_of(channel))
    }

    /// A reading of a channel in its display unit, without the unit.
    pub fn shown_reading(&self, channel: Channel, inside: f64) -> String {
        self.shown(kind_of(channel), inside)
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

    /// Column head: name, and the unit of speeds.
    pub fn speed_head(&self, name: &str) -> String {
        format!("{name} {}", self.units.speed)
    }

    /// A shaft speed.
    pub fn speed(&self, speed_rpm: f64) -> String {
        self.shown(Kind::Speed, speed_rpm)
    }

    /// The name of a speed line: its corrected speed in three figures.
    pub fn line_name(&self, speed_corrected_rpm: f64) -> String {
        let speed = self.number(Kind::Speed, speed_corrected_rpm);
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
        self.shown(Kind::Pressure, pressure_pa)
    }

    /// Column head: name, and the unit of flows.
    pub fn flow_head(&self, name: &str) -> String {
        format!("{name} {}", self.units.flow)
    }

    /// A mass flow.
    pub fn flow(&self, flow_kg_s: f64) -> String {
        self.shown(Kind::MassFlow, flow_kg_s)
    }

    /// Column head: name, and the unit of temperatures.
    pub fn temperature_head(&self, name: &str) -> String {
        format!("{name} {}", self.units.temperature)
    }

    /// A temperature.
    pub fn temperature(&self, temperature_k: f64) -> String {
        self.shown(Kind::Temperature, temperature_k)
    }
}
