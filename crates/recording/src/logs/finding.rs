//! Findings about the columns of a log, and the plausibility of its values.

use mapper_core::{Channel, coded_enum, is_plausible_range};
use mapper_table::{kind_of, unit};
use mapper_yaml::units::{Kind, Unit};
use std::fmt;

coded_enum! {
/// A property of a log, by its stable code. It displays as one sentence with values. Rows count from 1.
LogFinding {
    "dialect" Dialect { separator: char, decimal: char, is_decimal_assumed: bool, encoding: String },
    /// The rows of the header; `units_in_names`: the names contain the units.
    "header" Header { names_row: Option<usize>, units_row: Option<usize>, units_in_names: bool, data_row: usize },
    "distant_units" DistantUnits { row: usize },
    "units_in_cells" UnitsInCells { columns: usize },
    "skipped_rows" SkippedRows { rows: usize },
    "repeated_names" RepeatedNames { names: usize },
    "long_form" LongForm { name: String, value: String, quantities: usize },
    "rate" Rate { rate_hz: f64 },
    "waveform" Waveform { interval_s: f64 },
    /// The clock of a group; `others`: clocks of the same pace.
    "clock" Clock { group: String, clock: String, others: Vec<String> },
    "clocks" Clocks { groups: usize },
    "epochs" DifferentEpochs,
    "ambiguous_date" AmbiguousDate { column: String },
    "hour_back" HourBack,
    "mdf_version" MdfVersion { version: String, program: String },
    "bus_frames" BusFrames,
    "without_values" WithoutValues { columns: Vec<String> },
    "left_out" LeftOut { columns: usize, reason: String },
    "skipped" Skipped { part: String, name: String, reason: String },
    "hidden_sheets" HiddenSheets { sheets: Vec<String>, is_read: bool },
    "several_hidden" SeveralHidden,
    "in_table" InTable { part: String, name: String, finding: Box<LogFinding> },
}
}

impl LogFinding {
    /// Columns that were left out, with the reason.
    pub fn left_out(columns: usize, reason: &str) -> LogFinding {
        LogFinding::LeftOut { columns, reason: reason.to_owned() }
    }

    /// A part of the file that was left out, with the reason.
    pub fn skipped(part: &str, name: &str, reason: impl fmt::Display) -> LogFinding {
        LogFinding::Skipped { part: part.to_owned(), name: name.to_owned(), reason: reason.to_string() }
    }
}

fn quoted(names: &[String], separator: &str) -> String {
    names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(separator)
}

impl fmt::Display for LogFinding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let row = |row: &Option<usize>| row.map_or("none".to_owned(), |row| row.to_string());
        match self {
            LogFinding::Dialect { separator, decimal, is_decimal_assumed, encoding } => {
                let separator = match separator {
                    '\t' => "tab".to_owned(),
                    ' ' => "blanks".to_owned(),
                    other => format!("`{other}`"),
                };
                let assumed = if *is_decimal_assumed { ", assumed" } else { "" };
                write!(
                    f,
                    "text: separator {separator}, decimal sign `{decimal}`{assumed}, letters in {encoding} (separator, decimal, encoding)"
                )
            }
            LogFinding::Header { names_row, units_row, units_in_names, data_row } => {
                let units = match units_row {
                    Some(row) => format!("in row {row}"),
                    None if *units_in_names => "in the names".to_owned(),
                    None => "none".to_owned(),
                };
                write!(
                    f,
                    "header: names in row {}, units {units}, data from row {data_row} (names_row, units_row, data_row)",
                    row(names_row)
                )
            }
            LogFinding::DistantUnits { row } => write!(f, "units of columns without one are in row {row}"),
            LogFinding::UnitsInCells { columns } => {
                write!(f, "{columns} columns have their unit after each number")
            }
            LogFinding::SkippedRows { rows } => write!(f, "{rows} rows before the header were skipped"),
            LogFinding::RepeatedNames { names } => {
                write!(f, "{names} names are repeated; the later ones are numbered: `name (2)`")
            }
            LogFinding::LongForm { name, value, quantities } => write!(
                f,
                "long form: `{name}` names the quantity of a row and `{value}` is its value; {quantities} quantities are in the first rows, and later ones are not read"
            ),
            LogFinding::Rate { rate_hz } => {
                write!(f, "clock: none, {rate_hz} samples a second as given (rate)")
            }
            LogFinding::Waveform { interval_s } => {
                write!(f, "clock: a waveform with a value every {interval_s} s (time, rate)")
            }
            other => other.write_clock_or_part(f),
        }
    }
}

impl LogFinding {
    fn write_clock_or_part(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            LogFinding::Clock { group, clock, others } => {
                f.write_str("clock")?;
                if !group.is_empty() {
                    write!(f, " of group `{group}`")?;
                }
                write!(f, ": {clock}")?;
                if !others.is_empty() {
                    write!(f, "; also present: {}", quoted(others, " and "))?;
                }
                f.write_str(" (time, time_unit)")
            }
            LogFinding::Clocks { groups } => {
                write!(f, "clocks: {groups} groups, each with its own (time, time_unit)")
            }
            LogFinding::DifferentEpochs => {
                f.write_str("the clocks count from different epochs: each group begins at 0 s")
            }
            LogFinding::AmbiguousDate { column } => {
                write!(f, "date: `{column}` is ambiguous; the month is assumed to be first (date_order)")
            }
            LogFinding::HourBack => f.write_str(
                "clock: a date goes back by an hour, as at the end of daylight saving; the rows after it are taken as an hour later \
                 (name a clock without daylight saving by `time` if that is wrong)",
            ),
            LogFinding::MdfVersion { version, program } => {
                write!(f, "version {version} of MDF, written by `{program}`")
            }
            LogFinding::BusFrames => f.write_str(
                "it contains frames of a bus (CAN, LIN, FlexRay, Ethernet) that are not decoded and have no signals: decode them with the database \
                 of the bus (DBC, ARXML) in the measuring program, or with asammdf (`MDF(FILE).extract_bus_logging({\"CAN\": [(DBC, 0)]}).save(NEW)`)",
            ),
            LogFinding::WithoutValues { columns } => write!(
                f,
                "{} without a value: formulas have values only after a spreadsheet program has calculated and saved them",
                quoted(columns, ", ")
            ),
            LogFinding::LeftOut { columns, reason } => write!(f, "{columns} columns were left out: {reason}"),
            LogFinding::Skipped { part, name, reason } => write!(f, "{part} `{name}` was skipped: {reason}"),
            LogFinding::HiddenSheets { sheets, is_read: true } => {
                write!(f, "hidden: {}; read because no visible sheet has a table", sheets.join(", "))
            }
            LogFinding::HiddenSheets { sheets, is_read: false } => {
                write!(f, "hidden, and read only if named by `sheet`: {}", sheets.join(", "))
            }
            LogFinding::SeveralHidden => {
                f.write_str("no visible sheet has a table, and several hidden ones have: name one")
            }
            LogFinding::InTable { part, name, finding } => write!(f, "{part} `{name}`: {finding}"),
            LogFinding::Other { message, .. } => f.write_str(message),
            other => f.write_str(other.code()),
        }
    }
}

/// Deepest gauge pressure, ratio to the ambient one. Bound: throttled inlets reach a half; below zero absolute nothing exists.
const MAX_SUCTION_RATIO: f64 = 0.7;

/// Share of the readings ignored at each end of the range. Bound: spikes and dropouts do not indicate a wrong unit.
pub(crate) const TRIMMED_SHARE: f64 = 0.02;

/// The standard atmosphere (ISO 2533), Pa. Source: the ambient pressure of a log that does not contain it.
pub(crate) const STANDARD_ATMOSPHERE_PA: f64 = 101_325.0;

/// Range of an ambient pressure, Pa. Bound: altitudes of up to 5 km, and the highest weather.
pub const AMBIENT_RANGE_PA: (f64, f64) = (5e4, 1.1e5);

/// Units that logs omit because their program or stand always uses them.
const USUAL_UNITS: [&str; 20] = [
    "K", "degC", "degF", "Pa", "kPa", "mbar", "bar", "psia", "inHg", "kgf/cm2", "rpm", "krpm", "kg/s", "g/s",
    "kg/h", "kg/min", "lb/min", "lb/s", "%", "1",
];

/// Units in which values from `low` to `high` would be plausible. `offset` is added to them: the ambient pressure in Pa for gauge
/// pressures, else 0.
pub fn fitting_units(channel: Channel, low: f64, high: f64, offset: f64) -> Vec<&'static Unit> {
    let kind = kind_of(channel);
    let usual = |unit: &&Unit| USUAL_UNITS.contains(&unit.symbol());
    let fitting = |unit: &&'static Unit| {
        is_plausible_range(channel, unit.to_inside(low) + offset, unit.to_inside(high) + offset)
    };
    let bare = unit(kind, "1").ok();
    kind.units().iter().chain(bare).filter(usual).filter(fitting).collect()
}

/// Whether pressures in this range (Pa) look like gauge readings: too low for absolute ones, and plausible after the ambient pressure
/// is added.
pub fn looks_like_gauge(channel: Channel, low_pa: f64, high_pa: f64) -> bool {
    /// An ambient pressure, Pa. Bound: only the size matters here.
    const AMBIENT_PA: f64 = 1e5;
    kind_of(channel) == Kind::Pressure
        && !is_plausible_range(channel, low_pa, high_pa)
        && is_plausible_range(channel, low_pa + AMBIENT_PA, high_pa + AMBIENT_PA)
        && low_pa > -MAX_SUCTION_RATIO * AMBIENT_PA
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_usual_mistakes_of_units_show() {
        // A car's compressor at 40 kg/h to 1100 kg/h taken for g/s and for kg/s.
        assert!(is_plausible_range(Channel::CompressorFlow, 0.011, 0.31));
        assert!(!is_plausible_range(Channel::CompressorFlow, 40.0, 1100.0));
        let symbols: Vec<_> = fitting_units(Channel::CompressorFlow, 40.0, 1100.0, 0.0)
            .iter()
            .map(|unit| unit.symbol())
            .collect();
        assert!(symbols.contains(&"kg/h") && !symbols.contains(&"kg/s"), "{symbols:?}");
        // degC taken for K, K for degC, rpm in thousands.
        assert!(
            !is_plausible_range(Channel::T1, 19.0, 25.0) && !is_plausible_range(Channel::T1, 565.0, 573.0)
        );
        assert!(
            !is_plausible_range(Channel::ShaftSpeed, 50.0, 150.0)
                && is_plausible_range(Channel::ShaftSpeed, 0.0, 1.5e5)
        );
        // A dead channel does not indicate a wrong unit.
        assert!(is_plausible_range(Channel::ShaftSpeed, 0.0, 0.0));
    }

    #[test]
    fn gauge_pressures_show_at_the_inlet() {
        assert!(looks_like_gauge(Channel::P1, -4e3, 400.0));
        assert!(!looks_like_gauge(Channel::P1, 9.7e4, 1.01e5));
        assert!(looks_like_gauge(Channel::P2, 9e3, 1.4e5));
    }
}
