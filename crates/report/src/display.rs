//! Values in the units that a campaign wants shown.

use mapper_campaign::campaign::DisplayUnits;
use mapper_campaign::units::Kind;
use mapper_core::{Channel, OperatingPoint};
use mapper_logs::units::kind_of;

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

    /// The units.
    pub fn units(&self) -> &DisplayUnits {
        &self.units
    }

    /// A value of the unit used inside in the unit that is shown, for drawing.
    pub fn number(&self, kind: Kind, inside: f64) -> f64 {
        let symbol = match kind {
            Kind::Speed => &self.units.speed,
            Kind::Pressure => &self.units.pressure,
            Kind::MassFlow => &self.units.flow,
            Kind::Temperature => &self.units.temperature,
            _ => return inside,
        };
        Self::in_unit(kind, symbol, inside)
    }

    /// A reading of a channel in the unit that is shown, for drawing.
    pub fn reading(&self, channel: Channel, inside: f64) -> f64 {
        self.number(kind_of(channel), inside)
    }

    /// The unit in which readings of a channel are shown; empty for a ratio.
    pub fn unit_of(&self, channel: Channel) -> &str {
        match kind_of(channel) {
            Kind::Speed => &self.units.speed,
            Kind::MassFlow => &self.units.flow,
            Kind::Pressure => &self.units.pressure,
            Kind::Temperature => &self.units.temperature,
            _ => "",
        }
    }

    fn in_unit(kind: Kind, symbol: &str, inside: f64) -> f64 {
        // A checked campaign names only units that exist; anything else is shown in SI.
        kind.unit(symbol).map_or(inside, |unit| unit.from_inside(inside))
    }

    fn shown(kind: Kind, symbol: &str, value: f64, decimals: usize) -> String {
        format!("{:.decimals$}", Self::in_unit(kind, symbol, value))
    }

    /// Column head: what, and the unit of speeds.
    pub fn speed_head(&self, what: &str) -> String {
        format!("{what} {}", self.units.speed)
    }

    /// A shaft speed.
    pub fn speed(&self, speed_rpm: f64) -> String {
        Self::shown(Kind::Speed, &self.units.speed, speed_rpm, if self.units.speed == "krpm" { 2 } else { 0 })
    }

    /// An operating point: speed and opening.
    pub fn place(&self, point: OperatingPoint) -> String {
        format!("{} @ {}", self.speed(point.speed_rpm), point.shown().1)
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
