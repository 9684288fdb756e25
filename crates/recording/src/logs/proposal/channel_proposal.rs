//! The proposed channel of a column, with remarks.

use crate::logs::Layout;
use mapper_core::{Channel, coded_enum};
use serde::Serialize;
use serde_json::Value;
use std::fmt;
use std::fmt::Write;

/// Flow at surge and at choke of a machine at a shaft speed in rpm, kg/s.
pub type NominalFlows<'a> = &'a dyn Fn(f64) -> (f64, f64);

/// Certainty of an entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Certainty {
    /// Contradicted or ambiguous: written as a comment.
    Unsure,
    /// Some property was guessed.
    Likely,
    /// Name, unit and range agree.
    Sure,
}

/// A channel with its proposed column.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ProposedChannel {
    /// The channel.
    pub channel: Channel,
    /// Index of the column in the layout.
    pub column: usize,
    /// Columns of further sensors at the same place.
    pub others: Vec<usize>,
    /// Unit as written in a channel map; `None` if unknown.
    pub unit: Option<&'static str>,
    /// Whether it is a gauge pressure.
    pub gauge: bool,
    /// Certainty.
    pub certainty: Certainty,
    /// Reasons for the certainty, and assumptions.
    #[serde(serialize_with = "mapper_core::json_messages::serialize")]
    pub remarks: Vec<ProposalRemark>,
}

impl ProposedChannel {
    /// Its remarks on one line.
    pub fn remarks_text(&self) -> String {
        self.remarks.iter().map(ToString::to_string).collect::<Vec<_>>().join("; ")
    }
}

/// Reference of the gauge pressures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub enum Ambient {
    /// A column.
    Column {
        /// Index of the column in the layout.
        column: usize,
        /// Its unit.
        unit: &'static str,
    },
    /// The standard atmosphere, since no column has the ambient pressure; the user replaces it by the barometer's reading.
    Assumed,
}

/// The proposed channel map of a log.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Proposal {
    /// Channels in the order of the channel table.
    pub channels: Vec<ProposedChannel>,
    /// Reference of gauge pressures; `None` if the log has no gauge pressure.
    pub ambient: Option<Ambient>,
    /// Results of the checks between channels.
    #[serde(serialize_with = "mapper_core::json_messages::serialize")]
    pub remarks: Vec<ProposalRemark>,
}

impl Proposal {
    /// The entry of a channel.
    pub fn entry(&self, channel: Channel) -> Option<&ProposedChannel> {
        self.channels.iter().find(|proposed| proposed.channel == channel)
    }

    /// The entry of a column.
    pub fn channel_of_column(&self, column: usize) -> Option<&ProposedChannel> {
        self.channels.iter().find(|proposed| proposed.column == column || proposed.others.contains(&column))
    }
}

/// The text of a channel map: certain and likely channels as entries, unsure ones as comments. `options` are the keys and values with
/// which the log was read.
pub fn channel_map_text(
    name: &str,
    layout: &Layout,
    proposal: &Proposal,
    options: &[(String, String)],
) -> String {
    let mut text = format!(
        "# Proposed channel map of {}. Entries with a remark are guesses:\n\
         # look at them. Lines that are comments are doubtful and count only without the `#`.\nchannels:\n",
        remark(name)
    );
    let kept = |proposed: &&ProposedChannel| proposed.certainty > Certainty::Unsure;
    if !proposal.channels.iter().any(|proposed| kept(&proposed)) {
        text.push_str(
            "  # no channel was recognised; write e.g.\n  # T2: {field: \"name of the column\", unit: degC}\n",
        );
    }
    for proposed in &proposal.channels {
        let mut line = format!("{}: {}", proposed.channel.symbol(), source(layout, proposed));
        if !proposed.remarks.is_empty() {
            let _ = write!(line, "  # {}", remark(&proposed.remarks_text()));
        }
        let _ = writeln!(text, "  {}{line}", if kept(&proposed) { "" } else { "# " });
    }
    match &proposal.ambient {
        None => {}
        Some(Ambient::Column { column, unit }) => {
            let _ = writeln!(
                text,
                "\n# Added to gauge pressures.\nambient_pressure: {{{}, unit: {unit}}}",
                place(layout, *column)
            );
        }
        Some(Ambient::Assumed) => {
            text.push_str(
                "\n# Added to gauge pressures. The log does not contain it: write the barometer's reading, e.g. 99.2 kPa, or\n\
                 # {altitude: 300 m}. `unknown` is 101.3 kPa with an uncertainty of 3 kPa.\n\
                 ambient_pressure: unknown\n",
            );
        }
    }
    if !options.is_empty() {
        text.push_str("\n# Options for reading the log.\nlog:\n");
        for (key, value) in options {
            let _ = writeln!(text, "  {key}: {}", quoted(value));
        }
    }
    text
}

fn source(layout: &Layout, proposed: &ProposedChannel) -> String {
    let mut text = if proposed.others.is_empty() {
        format!("{{{}", place(layout, proposed.column))
    } else {
        let columns = std::iter::once(&proposed.column).chain(&proposed.others);
        let names =
            columns.filter_map(|column| layout.columns.get(*column)).map(|column| scalar(&column.name));
        format!("{{{}field: [{}]", topic(layout, proposed.column), names.collect::<Vec<_>>().join(", "))
    };
    if let Some(unit) = proposed.unit {
        let _ = write!(text, ", unit: {}", scalar(unit));
    }
    if proposed.gauge {
        text.push_str(", gauge: true");
    }
    text.push('}');
    text
}

/// Topic (if the log has several groups) and field.
fn place(layout: &Layout, column: usize) -> String {
    let name = layout.columns.get(column).map_or("", |column| column.name.as_str());
    format!("{}field: {}", topic(layout, column), scalar(name))
}

fn topic(layout: &Layout, column: usize) -> String {
    let group = layout.columns.get(column).and_then(|column| layout.groups.get(column.group));
    match group {
        Some(group) if !group.name.is_empty() => format!("topic: {}, ", scalar(&group.name)),
        _ => String::new(),
    }
}

/// The text as a YAML scalar, in quotes unless it is a plain word.
fn scalar(text: &str) -> String {
    const WORDS: [&str; 9] = ["y", "n", "yes", "no", "on", "off", "true", "false", "null"];
    let mut letters = text.chars();
    let normalise = letters.next().is_some_and(|first| first.is_ascii_alphabetic())
        && letters.all(|letter| letter.is_ascii_alphanumeric() || ['_', '/', '.', '^'].contains(&letter))
        && !WORDS.contains(&text.to_lowercase().as_str());
    if normalise { text.to_owned() } else { quoted(text) }
}

/// The text in JSON's quotes, which YAML reads too; YAML needs more characters escaped.
fn quoted(text: &str) -> String {
    let json = Value::from(text).to_string();
    let escaped = |c| if is_plain(c) { c.to_string() } else { format!("\\u{:04x}", u32::from(c)) };
    json.chars().map(escaped).collect()
}

fn remark(text: &str) -> String {
    text.chars().map(|c| if is_plain(c) { c } else { ' ' }).collect()
}

/// Whether every YAML reader accepts a character unescaped within a line.
fn is_plain(c: char) -> bool {
    !c.is_control() && !matches!(c, '\u{2028}' | '\u{2029}' | '\u{feff}' | '\u{fffe}' | '\u{ffff}')
}

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
                write!(f, "the log gives no unit; of the usual ones, only {unit} is plausible")
            }
            Remark::OneUnitFits { unit, columns } => {
                write!(
                    f,
                    "the log gives no unit; of the usual ones, only in {unit} all {columns} columns of this kind are plausible"
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
