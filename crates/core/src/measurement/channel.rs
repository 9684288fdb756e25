//! The one table of measured quantities, and the declared uncertainty of a sensor.

use serde::{Deserialize, Serialize};

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

/// Declares [`Channel`] and [`CHANNELS`].
macro_rules! channels {
    ($($channel:ident, $symbol:literal, $group:ident, $field:literal, $dimension:ident, $description:literal;)+) => {
        /// A measured or commanded quantity of the rig.
        ///
        /// Serialised by its symbol (`"T2"`), the name used in the paper, in messages and in channel maps.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        pub enum Channel {
            $(#[doc = $description] #[serde(rename = $symbol)] $channel,)+
        }

        /// Every channel, in recording order.
        pub const CHANNELS: [ChannelInfo; [$($symbol),+].len()] = [$(ChannelInfo {
            channel: Channel::$channel,
            symbol: $symbol,
            group: Group::$group,
            field: $field,
            dimension: Dimension::$dimension,
            description: $description,
        }),+];
    };
}

#[rustfmt::skip]
channels! {
    ShaftSpeed,       "N",             Compressor, "speed_rpm",                   RotationalSpeed, "shaft speed";
    CompressorFlow,   "m_c",           Compressor, "flow_kg_s",                   MassFlow,        "compressor mass flow";
    P1,               "P1",            Compressor, "inlet_pressure_pa",           Pressure,        "compressor inlet pressure, as tapped";
    T1,               "T1",            Compressor, "inlet_temperature_k",         Temperature,     "compressor inlet total temperature";
    P2,               "P2",            Compressor, "outlet_pressure_pa",          Pressure,        "compressor outlet pressure, as tapped";
    T2,               "T2",            Compressor, "outlet_temperature_k",        Temperature,     "compressor outlet total temperature, as the probe reads it";
    Tc,               "Tc",            Compressor, "housing_temperature_k",       Temperature,     "compressor housing temperature";
    TurbineFlow,      "m_t",           Turbine,    "flow_kg_s",                   MassFlow,        "turbine mass flow";
    P3,               "P3",            Turbine,    "inlet_pressure_pa",           Pressure,        "turbine inlet pressure, as tapped";
    T3,               "T3",            Turbine,    "inlet_temperature_k",         Temperature,     "turbine inlet total temperature";
    P4,               "P4",            Turbine,    "outlet_pressure_pa",          Pressure,        "turbine outlet pressure, as tapped";
    T4,               "T4",            Turbine,    "outlet_temperature_k",        Temperature,     "turbine outlet total temperature";
    Tt,               "Tt",            Turbine,    "housing_temperature_k",       Temperature,     "turbine housing temperature";
    TOil,             "T_oil",         Turbine,    "oil_temperature_k",           Temperature,     "oil inlet temperature";
    TAmb,             "T_amb",         Ambient,    "temperature_k",               Temperature,     "ambient temperature";
    P3Command,        "P3_command",    Command,    "turbine_inlet_pressure_pa",   Pressure,        "commanded turbine inlet pressure";
    T3Command,        "T3_command",    Command,    "turbine_inlet_temperature_k", Temperature,     "commanded turbine inlet temperature";
    ValveCommand,     "valve_command", Command,    "valve_opening",               Ratio,           "commanded back-pressure valve opening, relative to the nominal area";
    TOilCommand,      "T_oil_command", Command,    "oil_temperature_k",           Temperature,     "commanded oil inlet temperature";
    TOilOut,          "T_oil_out",     Turbine,    "oil_outlet_temperature_k",    Temperature,     "oil outlet temperature";
    OilFlow,          "m_oil",         Turbine,    "oil_flow_kg_s",               MassFlow,        "oil mass flow";
    TWater,           "T_water",       Turbine,    "water_temperature_k",         Temperature,     "cooling water inlet temperature";
    TWaterOut,        "T_water_out",   Turbine,    "water_outlet_temperature_k",  Temperature,     "cooling water outlet temperature";
    WaterFlow,        "m_water",       Turbine,    "water_flow_kg_s",             MassFlow,        "cooling water mass flow";
    RelativeHumidity, "RH",            Ambient,    "relative_humidity",           Ratio,           "relative humidity of the inlet air";
    DewPoint,         "T_dew",         Ambient,    "dew_point_k",                 Temperature,     "dew point of the inlet air";
    P1Variation,      "P1_cov",        Compressor, "inlet_pressure_variation",    Ratio,           "coefficient of variation of P1 over a second of fast samples";
    P2Variation,      "P2_cov",        Compressor, "outlet_pressure_variation",   Ratio,           "coefficient of variation of P2 over a second of fast samples";
}

/// Number of modelled channels, which are the first ones. The others are only measured. Source: the table above.
pub const MODELLED_CHANNELS: usize = 19;

impl Channel {
    /// The channel of the coefficient of variation of its fast samples; `None` for channels that are not sampled fast.
    pub fn variation(self) -> Option<Channel> {
        match self {
            Channel::P1 => Some(Channel::P1Variation),
            Channel::P2 => Some(Channel::P2Variation),
            _ => None,
        }
    }

    /// The channel's row in [`CHANNELS`].
    pub fn info(self) -> &'static ChannelInfo {
        &CHANNELS[self as usize]
    }

    /// Symbol, e.g. `T2`.
    pub fn symbol(self) -> &'static str {
        self.info().symbol
    }

    /// Distance of a reading from the value at which a gain error vanishes, in the channel's unit: [`CALIBRATED_AT_K`] for thermometers, 0 for
    /// all others.
    pub fn gain_distance(self, reading: f64) -> f64 {
        match self.info().dimension {
            Dimension::Temperature => reading - CALIBRATED_AT_K,
            Dimension::RotationalSpeed | Dimension::MassFlow | Dimension::Pressure | Dimension::Ratio => {
                reading
            }
        }
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

/// Sample interval of the program's own recordings, to which declared noise refers, s. Source: a definition.
pub const SAMPLE_INTERVAL_S: f64 = 0.1;

/// Temperature at which a thermometer's gain error is zero, K. Source: ISO 1, reference temperature 20 degC.
pub const CALIBRATED_AT_K: f64 = 293.15;

/// One-sigma uncertainty of a channel, in its SI unit.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DeclaredUncertainty {
    /// Noise of one sample.
    pub noise_sigma: f64,
    /// Fixed offset.
    pub offset_sigma: f64,
    /// Fixed gain error, ratio to the value; of a thermometer, to its distance from [`CALIBRATED_AT_K`].
    pub gain_sigma_ratio: f64,
}

impl DeclaredUncertainty {
    /// Fixed error of a reading of `channel`, offset and gain together, one standard deviation in the channel's unit.
    pub fn fixed_sigma(&self, channel: Channel, reading: f64) -> f64 {
        self.offset_sigma.hypot(self.gain_sigma_ratio * channel.gain_distance(reading))
    }
}

/// Colour of the sensor noise: white noise and first-order noise, with standard deviations `sqrt(1 - c^2)` and `c` of the total.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseColour {
    /// Share c of the first-order noise in the standard deviation, 0..1.
    pub first_order_share_ratio: f64,
    /// Time constant, s, > 0.
    pub time_constant_s: f64,
}

impl Default for NoiseColour {
    fn default() -> Self {
        NoiseColour {
            // Judgement: a third of the variance of a conditioned thermocouple is slow.
            first_order_share_ratio: 0.6,
            // Bound: the gas of a pipe is replaced within it.
            time_constant_s: 2.0,
        }
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
