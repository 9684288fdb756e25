//! The table of all measured and commanded quantities of a rig: symbol, unit, place, description.

use serde::{Deserialize, Serialize};

/// A measured or commanded quantity of the rig.
///
/// Serialised by its symbol (`"T2"`), the name used in the paper, in messages and in channel maps.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum Channel {
    /// Shaft speed.
    #[serde(rename = "N")]
    ShaftSpeed,
    /// Compressor mass flow.
    #[serde(rename = "m_c")]
    CompressorFlow,
    /// Compressor inlet pressure (station 1).
    P1,
    /// Compressor inlet total temperature (station 1).
    T1,
    /// Compressor outlet pressure (station 2).
    P2,
    /// Compressor outlet total temperature, as read by the probe (station 2).
    T2,
    /// Compressor housing temperature.
    Tc,
    /// Turbine mass flow.
    #[serde(rename = "m_t")]
    TurbineFlow,
    /// Turbine inlet pressure (station 3).
    P3,
    /// Turbine inlet total temperature (station 3).
    T3,
    /// Turbine outlet pressure (station 4).
    P4,
    /// Turbine outlet total temperature (station 4).
    T4,
    /// Turbine housing temperature.
    Tt,
    /// Oil inlet temperature.
    #[serde(rename = "T_oil")]
    TOil,
    /// Ambient temperature around the housings.
    #[serde(rename = "T_amb")]
    TAmb,
    /// Commanded turbine inlet pressure.
    #[serde(rename = "P3_command")]
    P3Command,
    /// Commanded turbine inlet temperature.
    #[serde(rename = "T3_command")]
    T3Command,
    /// Commanded back-pressure valve opening, relative to the nominal area.
    #[serde(rename = "valve_command")]
    ValveCommand,
    /// Commanded oil inlet temperature.
    #[serde(rename = "T_oil_command")]
    TOilCommand,
    /// Oil outlet temperature.
    #[serde(rename = "T_oil_out")]
    TOilOut,
    /// Oil mass flow.
    #[serde(rename = "m_oil")]
    OilFlow,
    /// Cooling water inlet temperature.
    #[serde(rename = "T_water")]
    TWater,
    /// Cooling water outlet temperature.
    #[serde(rename = "T_water_out")]
    TWaterOut,
    /// Cooling water mass flow.
    #[serde(rename = "m_water")]
    WaterFlow,
    /// Relative humidity of the air that the compressor takes in.
    #[serde(rename = "RH")]
    RelativeHumidity,
    /// Dew point of that air.
    #[serde(rename = "T_dew")]
    DewPoint,
}

/// The device a channel belongs to; one message per group and sample is recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Group {
    /// Shaft and compressor side.
    Compressor,
    /// Turbine side, oil and cooling water included.
    Turbine,
    /// The test cell.
    Ambient,
    /// Commands to the rig.
    Command,
}

impl Group {
    /// All groups, in the order they are recorded.
    pub const ALL: [Group; 4] = [Group::Compressor, Group::Turbine, Group::Ambient, Group::Command];

    /// The MCAP topic of the group.
    pub fn topic(self) -> &'static str {
        match self {
            Group::Compressor => "/rig/compressor",
            Group::Turbine => "/rig/turbine",
            Group::Ambient => "/rig/ambient",
            Group::Command => "/rig/command",
        }
    }
}

/// Physical dimension of a channel; determines the units that a user may write for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Dimension {
    /// rpm.
    RotationalSpeed,
    /// kg/s.
    MassFlow,
    /// Pa, absolute.
    Pressure,
    /// K.
    Temperature,
    /// 1.
    Ratio,
}

impl Dimension {
    /// The internal unit.
    pub fn unit(self) -> &'static str {
        match self {
            Dimension::RotationalSpeed => "rpm",
            Dimension::MassFlow => "kg/s",
            Dimension::Pressure => "Pa",
            Dimension::Temperature => "K",
            Dimension::Ratio => "1",
        }
    }
}

/// One row of the channel table.
#[derive(Debug, Clone, Copy)]
pub struct ChannelInfo {
    /// The channel described.
    pub channel: Channel,
    /// Symbol of the field, e.g. `T2`.
    pub symbol: &'static str,
    /// Device group.
    pub group: Group,
    /// Field name in recordings, unit suffix included, unique within the group.
    pub field: &'static str,
    /// Physical dimension.
    pub dimension: Dimension,
    /// Description of one line.
    pub description: &'static str,
}

/// Every channel, in recording order.
#[rustfmt::skip]
pub const CHANNELS: [ChannelInfo; 26] = {
    use Channel as C;
    use Dimension::{MassFlow, Pressure, Ratio, RotationalSpeed, Temperature};
    const fn row(channel: Channel, symbol: &'static str, group: Group, field: &'static str, dimension: Dimension, description: &'static str) -> ChannelInfo {
        ChannelInfo { channel, symbol, group, field, dimension, description }
    }
    [
        row(C::ShaftSpeed,     "N",             Group::Compressor, "speed_rpm",                   RotationalSpeed, "shaft speed"),
        row(C::CompressorFlow, "m_c",           Group::Compressor, "flow_kg_s",                   MassFlow,        "compressor mass flow"),
        row(C::P1,             "P1",            Group::Compressor, "inlet_pressure_pa",           Pressure,        "compressor inlet pressure, as tapped"),
        row(C::T1,             "T1",            Group::Compressor, "inlet_temperature_k",         Temperature,     "compressor inlet total temperature"),
        row(C::P2,             "P2",            Group::Compressor, "outlet_pressure_pa",          Pressure,        "compressor outlet pressure, as tapped"),
        row(C::T2,             "T2",            Group::Compressor, "outlet_temperature_k",        Temperature,     "compressor outlet total temperature, as the probe reads it"),
        row(C::Tc,             "Tc",            Group::Compressor, "housing_temperature_k",       Temperature,     "compressor housing temperature"),
        row(C::TurbineFlow,    "m_t",           Group::Turbine,    "flow_kg_s",                   MassFlow,        "turbine mass flow"),
        row(C::P3,             "P3",            Group::Turbine,    "inlet_pressure_pa",           Pressure,        "turbine inlet pressure, as tapped"),
        row(C::T3,             "T3",            Group::Turbine,    "inlet_temperature_k",         Temperature,     "turbine inlet total temperature"),
        row(C::P4,             "P4",            Group::Turbine,    "outlet_pressure_pa",          Pressure,        "turbine outlet pressure, as tapped"),
        row(C::T4,             "T4",            Group::Turbine,    "outlet_temperature_k",        Temperature,     "turbine outlet total temperature"),
        row(C::Tt,             "Tt",            Group::Turbine,    "housing_temperature_k",       Temperature,     "turbine housing temperature"),
        row(C::TOil,           "T_oil",         Group::Turbine,    "oil_temperature_k",           Temperature,     "oil inlet temperature"),
        row(C::TAmb,           "T_amb",         Group::Ambient,    "temperature_k",               Temperature,     "ambient temperature"),
        row(C::P3Command,      "P3_command",    Group::Command,    "turbine_inlet_pressure_pa",   Pressure,        "commanded turbine inlet pressure"),
        row(C::T3Command,      "T3_command",    Group::Command,    "turbine_inlet_temperature_k", Temperature,     "commanded turbine inlet temperature"),
        row(C::ValveCommand,   "valve_command", Group::Command,    "valve_opening",               Ratio,           "commanded back-pressure valve opening, relative to the nominal area"),
        row(C::TOilCommand,    "T_oil_command", Group::Command,    "oil_temperature_k",           Temperature,     "commanded oil inlet temperature"),
        row(C::TOilOut,        "T_oil_out",     Group::Turbine,    "oil_outlet_temperature_k",    Temperature,     "oil outlet temperature"),
        row(C::OilFlow,        "m_oil",         Group::Turbine,    "oil_flow_kg_s",               MassFlow,        "oil mass flow"),
        row(C::TWater,         "T_water",       Group::Turbine,    "water_temperature_k",         Temperature,     "cooling water inlet temperature"),
        row(C::TWaterOut,      "T_water_out",   Group::Turbine,    "water_outlet_temperature_k",  Temperature,     "cooling water outlet temperature"),
        row(C::WaterFlow,      "m_water",       Group::Turbine,    "water_flow_kg_s",             MassFlow,        "cooling water mass flow"),
        row(C::RelativeHumidity, "RH",          Group::Ambient,    "relative_humidity",           Ratio,           "relative humidity of the inlet air"),
        row(C::DewPoint,       "T_dew",         Group::Ambient,    "dew_point_k",                 Temperature,     "dew point of the inlet air"),
    ]
};

/// Number of modelled channels, which are the first ones. The others are only measured.
pub const MODELLED_CHANNELS: usize = 19;

impl Channel {
    /// The channel's row in [`CHANNELS`].
    pub fn info(self) -> &'static ChannelInfo {
        // The table is in declaration order; a test checks it.
        &CHANNELS[self as usize]
    }

    /// Symbol, e.g. `T2`.
    pub fn symbol(self) -> &'static str {
        self.info().symbol
    }

    /// SI unit (rpm for speed), e.g. `K`.
    pub fn unit(self) -> &'static str {
        self.info().dimension.unit()
    }
}

impl std::fmt::Display for Channel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.symbol())
    }
}

/// A symbol without a channel.
#[derive(Debug, Clone, thiserror::Error, PartialEq, Eq)]
#[error("no channel is called `{symbol}`; the channels are {}", list_symbols())]
pub struct UnknownChannel {
    /// The given text.
    pub symbol: String,
}

fn list_symbols() -> String {
    CHANNELS.map(|row| row.symbol).join(", ")
}

impl std::str::FromStr for Channel {
    type Err = UnknownChannel;

    fn from_str(symbol: &str) -> Result<Self, Self::Err> {
        CHANNELS
            .iter()
            .find(|row| row.symbol == symbol)
            .map(|row| row.channel)
            .ok_or_else(|| UnknownChannel { symbol: symbol.to_owned() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_in_declaration_order_and_its_symbols_parse_back() {
        for (index, row) in CHANNELS.iter().enumerate() {
            assert_eq!(row.channel as usize, index);
            assert_eq!(row.symbol.parse::<Channel>().unwrap(), row.channel);
            assert_eq!(serde_json::to_string(&row.channel).unwrap(), format!("\"{}\"", row.symbol));
        }
    }

    #[test]
    fn fields_are_unique_within_a_group() {
        for a in &CHANNELS {
            for b in &CHANNELS {
                assert!(a.channel == b.channel || a.group != b.group || a.field != b.field);
            }
        }
    }
}
