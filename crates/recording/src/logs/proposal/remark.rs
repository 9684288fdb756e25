//! Reasons for the certainty of a proposed channel, and results of the checks between channels.

use mapper_core::{Channel, coded_enum};
use std::fmt;

/// Size from which a number has no decimals. Source: three to five digits are shown.
const FIVE_DIGITS: f64 = 1e4;
/// Size from which a number has one decimal. Source: as above.
const THREE_DIGITS: f64 = 100.0;
/// Size below which a number is shown with its exponent. Source: as above.
const SMALL: f64 = 1e-3;

coded_enum! {
/// A remark on a proposal, by its stable code. It displays as one sentence with values.
ProposalRemark {
    "rivals" Rivals { columns: Vec<String> },
    "ambiguous_name" AmbiguousName,
    "tag_numbers" TagNumbers { columns: Vec<String> },
    /// The tag number gives no place, but only one order of the loops is a compressor (and turbine).
    "tag_station" TagStation { number: u32 },
    "computed" Computed,
    "implausible_range" ImplausibleRange { min: f64, max: f64, unit: String, plausible_units: Vec<String> },
    "impossible_readings" ImpossibleReadings { value: f64, unit: String },
    /// The range fits one unit alone; `columns`: number of columns of the kind that share it.
    "one_unit_fits" OneUnitFits { unit: String, columns: usize },
    "no_unit_fits" NoUnitFits { min: f64, max: f64 },
    "several_units_fit" SeveralUnitsFit { units: Vec<String> },
    /// Of degC and degF, in this unit alone the inlet has the temperature of a test cell.
    "inlet_temperature" InletTemperature { unit: String },
    "fits_machine" FitsMachine { unit: String, surge_kg_s: f64, choke_kg_s: f64, speed_rpm: f64 },
    "fits_wheel" FitsWheel { unit: String, diameter_m: f64 },
    "unknown_unit" UnknownUnit { channel: Channel, column: String, unit: String },
    "volume_flow" VolumeFlow { channel: Channel, column: String, unit: String },
    "standard_flow" StandardFlow { channel: Channel, column: String, unit: String, known_units: Vec<String> },
    "taken_as_gauge" TakenAsGauge { min_pa: f64 },
    "gauge_like_inlet" GaugeLikeInlet,
    "above" Above { higher: Channel, lower: Channel, share: f64 },
    "seldom_above" SeldomAbove { higher: Channel, lower: Channel, share: f64 },
    "other_stations" OtherStations,
    "gas_turbine_stations" GasTurbineStations,
    "engine_valve" EngineValve,
    "engine_speed" EngineSpeed { max_rpm: f64 },
    "correlation" Correlation { r: f64, is_expected: bool },
    "gas_temperature" GasTemperature { max_k: f64, ideal_k: f64 },
    "housing_or_gas" HousingOrGas { gas: Channel },
}
}

impl fmt::Display for ProposalRemark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        use ProposalRemark as Remark;
        match self {
            Remark::Rivals { columns } => write!(f, "it could also be {}", columns.join(" or ")),
            Remark::AmbiguousName => f.write_str("the name is ambiguous"),
            Remark::TagNumbers { columns } => write!(
                f,
                "{}: tag numbers give no place; look it up in the piping diagram of the stand and write the columns into a channel map",
                columns.join(", ")
            ),
            Remark::TagStation { number } => write!(
                f,
                "tag numbers give no place; of all loops with a temperature and a pressure, only {number} has the readings of this station"
            ),
            Remark::Computed => f.write_str("its name indicates a computed value"),
            Remark::ImplausibleRange { min, max, unit, plausible_units } => {
                write!(f, "{} to {} {unit} is not plausible", short(*min), short(*max))?;
                match plausible_units.as_slice() {
                    [] => Ok(()),
                    units => write!(f, "; {} would be plausible", units.join(" or ")),
                }
            }
            Remark::ImpossibleReadings { value, unit } => write!(
                f,
                "some readings are {} {unit}, which is impossible: if they mark missing readings, set `missing: {value}`",
                short(*value)
            ),
            Remark::OneUnitFits { unit, columns: 1 } => {
                write!(f, "the log gives no unit; only {unit} is plausible")
            }
            Remark::OneUnitFits { unit, columns } => {
                write!(
                    f,
                    "the log gives no unit; only in {unit} all {columns} columns of this kind are plausible"
                )
            }
            Remark::NoUnitFits { min, max } => {
                write!(f, "the log gives no unit, and the range {} to {} fits none", short(*min), short(*max))
            }
            Remark::SeveralUnitsFit { units } => {
                write!(f, "the log gives no unit; its range fits {}", units.join(" or "))
            }
            Remark::InletTemperature { unit } => {
                write!(
                    f,
                    "the log gives no unit; taken as {unit}, in which the inlet is as warm as a test cell"
                )
            }
            Remark::FitsMachine { unit, surge_kg_s, choke_kg_s, speed_rpm } => write!(
                f,
                "the log gives no unit; {unit} fits the machine ({surge_kg_s:.3} to {choke_kg_s:.3} kg/s at {speed_rpm:.0} rpm)"
            ),
            Remark::FitsWheel { unit, diameter_m } => write!(
                f,
                "the log gives no unit; {unit} fits speed and pressure ratio (a wheel of about {:.0} mm)",
                1e3 * diameter_m
            ),
            Remark::UnknownUnit { channel, column, unit } => {
                write!(f, "{channel} may be `{column}`, but the unit `{unit}` is unknown: write a known one")
            }
            Remark::VolumeFlow { channel, column, unit } => write!(
                f,
                "{channel} may be `{column}`, but `{unit}` is a volume flow: multiply it by the density at the flow meter first"
            ),
            Remark::StandardFlow { channel, column, unit, known_units } => write!(
                f,
                "{channel} may be `{column}`, but `{unit}` is a flow at a standard temperature, which differs between manufacturers: \
                 write the unit as one of {}",
                known_units.join(", ")
            ),
            other => other.write_check(f),
        }
    }
}

impl ProposalRemark {
    /// The sentence of a check of the readings.
    fn write_check(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        use ProposalRemark as Remark;
        match self {
            Remark::TakenAsGauge { min_pa } => {
                write!(f, "down to {:.1} kPa: too low for an absolute pressure, taken as gauge", min_pa / 1e3)
            }
            Remark::GaugeLikeInlet => {
                f.write_str("the log does not give its reference; taken as gauge like P1")
            }
            Remark::Above { higher, lower, share } => write!(
                f,
                "{higher} is above {lower} in {:.0} % of the time that the shaft turns, as expected",
                100.0 * share
            ),
            Remark::SeldomAbove { higher, lower, share } => write!(
                f,
                "{higher} is above {lower} in only {:.0} % of the time that the shaft turns",
                100.0 * share
            ),
            Remark::OtherStations => f.write_str(
                "its stations may be numbered as in a gas turbine: 2 before and 3 after the compressor, 4 before and 5 after the turbine",
            ),
            Remark::GasTurbineStations => f.write_str(
                "stations are numbered 2 to 5 as in a gas turbine: with other numbers T3 would be below T4",
            ),
            Remark::EngineValve => {
                f.write_str("the log is of an engine: this may be its throttle or bypass")
            }
            Remark::EngineSpeed { max_rpm } => {
                write!(f, "maximum {max_rpm:.0} rpm: this may be the engine speed")
            }
            Remark::Correlation { r, is_expected } => {
                let verb = if *is_expected { "correlates" } else { "does not correlate" };
                write!(f, "flow {verb} with speed (r = {r:.2})")
            }
            Remark::GasTemperature { max_k, ideal_k } => write!(
                f,
                "up to {max_k:.0} K, above the {ideal_k:.0} K of an ideal compression: taken as the gas, not as the housing"
            ),
            Remark::HousingOrGas { gas } => write!(
                f,
                "it may be the gas temperature after the {}, for which the log has no other column",
                if *gas == Channel::T2 { "compressor" } else { "turbine" }
            ),
            Remark::Other { message, .. } if !message.is_empty() => f.write_str(message),
            other => f.write_str(other.code()),
        }
    }
}

/// A number with three to five significant digits, for messages.
pub(crate) fn short(value: f64) -> String {
    match value.abs() {
        _ if !value.is_finite() => "-".to_owned(),
        0.0 => "0".to_owned(),
        size if size >= FIVE_DIGITS => format!("{value:.0}"),
        size if size >= THREE_DIGITS => format!("{value:.1}"),
        size if size >= 1.0 => format!("{value:.2}"),
        size if size >= SMALL => format!("{value:.4}"),
        _ => format!("{value:.2e}"),
    }
}
