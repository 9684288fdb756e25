//! Units in the headers of logs and tables.

use crate::column_name::ColumnName;
use crate::name_parts::Measured;
use mapper_core::{Channel, Dimension};
use mapper_yaml::units::{BARE_RATIO, CUBIC_FOOT_M3, Kind, Unit, UnitError, parse_with};
use serde::Serialize;

/// Reference of a pressure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reference {
    /// The header does not state it.
    Unstated,
    /// Vacuum.
    Absolute,
    /// The ambient pressure.
    Gauge,
}

/// A recognised unit of a header.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeaderUnit {
    /// Kind of quantity.
    pub kind: Kind,
    /// The unit.
    pub unit: &'static Unit,
    /// Reference of a pressure.
    pub reference: Reference,
}

/// Spellings in logs, in addition to those of the table of units; lower case without blanks.
#[rustfmt::skip]
const SPELLINGS: &[(Kind, &str, &[&str])] = &[
    (Kind::Temperature, "degC", &["degc", "°c", "c", "gradc", "grdc", "grad", "celsius", "gradcelsius", "degreesc", "degreec", "ºc",
        "deg.c", "*c", "℃", "°с", "graus", "grados", "gradosc"]),
    (Kind::Temperature, "K", &["k", "kelvin", "degk", "°k"]),
    (Kind::Temperature, "degF", &["degf", "°f", "f", "fahrenheit", "deg.f", "℉"]),
    (Kind::Temperature, "degR", &["degr", "°r", "rankine", "deg.r"]),
    (Kind::Speed, "rpm", &["rpm", "1/min", "min-1", "min^-1", "min⁻¹", "u/min", "upm", "rev/min", "r/min", "umin", "/min", "1/m",
        "tr/min", "trmin", "giri/min", "t/min", "r.p.m.", "об/мин", "obr/min", "ot/min", "omw/min", "转/分", "转/分钟"]),
    (Kind::Speed, "krpm", &["krpm", "1000rpm", "x1000rpm", "×1000rpm", "rpmx1000", "rpm/1000", "10^3rpm", "10³rpm", "1e3rpm",
        "1000/min", "k1/min", "ku/min", "kupm"]),
    (Kind::Speed, "Hz", &["hz", "1/s", "rev/s", "u/s", "rps"]),
    (Kind::Speed, "rad/s", &["rad/s"]),
    (Kind::MassFlow, "kg/s", &["kg/s", "kgs", "kgs-1", "kg/sec", "кг/с", "千克/秒"]),
    (Kind::MassFlow, "g/s", &["g/s", "gs-1", "g/sec", "г/с"]),
    (Kind::MassFlow, "kg/h", &["kg/h", "kg/hr", "kghr", "kgh", "kgh-1", "kg/std", "кг/ч"]),
    (Kind::MassFlow, "kg/min", &["kg/min", "kgmin"]),
    (Kind::MassFlow, "lb/min", &["lb/min", "lbmin", "lbm/min", "lbs/min", "ppm_lb"]),
    (Kind::MassFlow, "lb/s", &["lb/s", "lbm/s", "lbs/s", "pps", "lbps"]),
    (Kind::MassFlow, "lb/h", &["lb/h", "lb/hr", "lbm/hr", "lbm/h", "lbs/hr", "lbs/h", "pph"]),
    (Kind::MassFlow, "mg/s", &["mg/s"]),
    (Kind::MassFlow, "t/h", &["t/h", "t/hr"]),
    (Kind::MassFlow, "Nm3/h", &["nm3/h", "nm³/h", "nm^3/h"]),
    (Kind::MassFlow, "Sm3/h", &["sm3/h", "sm³/h", "sm^3/h"]),
    (Kind::Fraction, "%", &["%", "percent", "prozent", "pct"]),
    (Kind::Fraction, "1", &["1", "-", "--", "ratio"]),
    (Kind::Duration, "s", &["s", "sec", "secs", "second", "seconds", "sek", "sekunden", "с", "сек", "秒"]),
    (Kind::Duration, "ms", &["ms", "msec", "millisec", "milliseconds"]),
    (Kind::Duration, "min", &["min", "minutes", "minuten"]),
    (Kind::Duration, "h", &["h", "hr", "hours", "std", "stunden"]),
];

/// Units of pressure without a reference.
#[rustfmt::skip]
const PRESSURES: &[(&str, &str)] = &[
    ("mbar", "mbar"), ("kpa", "kPa"), ("hpa", "hPa"), ("mpa", "MPa"), ("bar", "bar"), ("atm", "atm"), ("at", "kgf/cm2"),
    ("psi", "psia"), ("lbf/in2", "psia"), ("lbf/in^2", "psia"), ("kgf/cm2", "kgf/cm2"), ("kgf/cm^2", "kgf/cm2"),
    ("kgf/cm²", "kgf/cm2"), ("kg/cm2", "kgf/cm2"), ("kg/cm²", "kgf/cm2"), ("mmhg", "mmHg"), ("torr", "Torr"), ("inhg", "inHg"),
    ("\"hg", "inHg"), ("mmws", "mmH2O"), ("mmwc", "mmH2O"), ("mmh2o", "mmH2O"), ("mmh₂o", "mmH2O"), ("mmce", "mmH2O"),
    ("inh2o", "inH2O"), ("inh₂o", "inH2O"), ("inwc", "inH2O"), ("\"h2o", "inH2O"), ("pa", "Pa"), ("кпа", "kPa"), ("мпа", "MPa"),
    ("бар", "bar"), ("па", "Pa"),
];

/// Units of volume flow, lower case without blanks, and their value in m3/s; `None` for a volume at standard conditions, which the
/// unit does not define. Source: definitions of the units.
const VOLUME_FLOWS: &[(Option<f64>, &[&str])] = &[
    (
        None,
        &[
            "scfm", "sft3/min", "std.cfm", "stdcfm", "slpm", "sl/min", "nl/min", "nlpm", "slm", "nm3/min",
            "nm³/min", "sm3/min", "sm³/min",
        ],
    ),
    (Some(1.0), &["m3/s", "m³/s", "m^3/s", "cbm/s"]),
    (Some(1.0 / 60.0), &["m3/min", "m³/min", "m^3/min"]),
    (Some(1.0 / 3600.0), &["m3/h", "m³/h", "m^3/h", "m3/hr"]),
    (Some(1e-3), &["l/s"]),
    (Some(1e-3 / 60.0), &["l/min", "lpm"]),
    (Some(1e-3 / 3600.0), &["l/h"]),
    (Some(CUBIC_FOOT_M3 / 60.0), &["cfm", "acfm", "icfm", "ft3/min", "ft^3/min", "ft³/min"]),
    (Some(CUBIC_FOOT_M3), &["cfs", "ft3/s", "ft^3/s", "ft³/s"]),
];

/// The value of a unit of volume flow in m3/s; `Some(None)` for a volume at standard conditions, which the unit does not define; `None` for
/// other units.
pub fn volume_flow_m3_s(text: &str) -> Option<Option<f64>> {
    let plain: String = text.chars().filter(|c| !c.is_whitespace() && !"[]()".contains(*c)).collect();
    let lower = plain.to_lowercase();
    VOLUME_FLOWS.iter().find(|(_, spellings)| spellings.contains(&lower.as_str())).map(|(m3_s, _)| *m3_s)
}

const GAUGE: &[&str] =
    &["g", "(g)", "_g", "rel", "_rel", "(rel)", "r", "ü", "(ü)", "gauge", "ue", "-g", "relativ"];
const ABSOLUTE: &[&str] = &["a", "(a)", "_a", "abs", "_abs", "(abs)", "absolute", "absolut", "-a", "abs."];

/// Recognises the unit in a header; `None` if the text is not a unit.
pub fn header_unit(text: &str) -> Option<HeaderUnit> {
    let plain: String = text.chars().filter(|c| !c.is_whitespace() && !['[', ']'].contains(c)).collect();
    let lower = plain.to_lowercase();
    if lower.is_empty() || lower.len() > 24 {
        return None;
    }
    let known =
        |kind, symbol, reference| Some(HeaderUnit { kind, unit: by_symbol(kind, symbol)?, reference });
    // `lbm_min` is `lbm/min` in the name of a variable.
    let quotient = lower.replacen('_', "/", 1);
    for (kind, symbol, spellings) in SPELLINGS {
        if spellings.contains(&lower.as_str()) || spellings.contains(&quotient.as_str()) {
            return known(*kind, symbol, Reference::Unstated);
        }
    }
    for (spelling, symbol) in PRESSURES {
        let reference = match lower.strip_prefix(spelling) {
            Some("") => Reference::Unstated,
            Some(rest) if GAUGE.contains(&rest) => Reference::Gauge,
            Some(rest) if ABSOLUTE.contains(&rest) => Reference::Absolute,
            _ => continue,
        };
        return known(Kind::Pressure, symbol, reference);
    }
    None
}

/// Whether a text is a unit of a column, reduced quantities and humidity included.
pub fn is_unit(text: &str) -> bool {
    header_unit(text).is_some()
        || volume_flow_m3_s(text).is_some()
        || is_reduced_unit(text)
        || matches!(text.trim().to_lowercase().as_str(), "g/kg" | "kg/kg")
}

/// Whether a unit has the root of a temperature, as those of reduced speed and flow do.
pub fn is_reduced_unit(text: &str) -> bool {
    let lower = text.to_lowercase().replace(',', ".");
    let roots = ["k^0.5", "k^.5", "k^1/2", "sqrt(k", "sqrtk", "√k", "k0.5", "k**0.5"];
    roots.iter().any(|root| lower.contains(root))
}

/// Whether a text stands for the unit of a ratio.
pub fn is_dimensionless(unit: &str) -> bool {
    // `bar/bar`, `kPa/kPa`.
    let is_quotient = unit.split_once('/').is_some_and(|(above, below)| above == below && is_unit(above));
    is_quotient
        || matches!(
            unit.to_lowercase().as_str(),
            "" | "-" | "--" | "1" | "ratio" | "fraction" | "frac" | "dimensionless" | "dec" | "nd" | "none"
        )
}

/// A cell of a row of units without the brackets around it: `[kPa]`, `(bar(a))`, `in kPa`.
pub fn bare_unit(cell: &str) -> &str {
    let cell = cell.trim();
    let cell = cell.strip_prefix("in ").unwrap_or(cell);
    let pairs = [('[', ']'), ('(', ')'), ('{', '}'), ('<', '>')];
    let inside = pairs.iter().find_map(|(open, close)| cell.strip_prefix(*open)?.strip_suffix(*close));
    inside.map_or(cell, str::trim)
}

/// Whether the cells of a row are units: one at least, and not fewer than other texts.
pub fn is_units_row(row: &[String]) -> bool {
    let filled = row.iter().filter(|cell| !cell.is_empty()).count();
    let units = row.iter().filter(|cell| is_unit(bare_unit(cell))).count();
    units > 0 && 2 * units >= filled
}

/// Whether a row without numbers next to names of columns has their units: more units than names of quantities. Texts in the form of a unit
/// count too, so that an unknown one is reported; all others concern their own columns alone.
pub fn is_units_row_of_names(row: &[String]) -> bool {
    let cells = || row.iter().map(|cell| bare_unit(cell)).filter(|cell| !is_dimensionless(cell));
    let names_quantity = |cell: &str| ColumnName::read(cell).measured().is_some();
    // `P1` and `Speed` are names; `W`, `V` and `t` may be units.
    let is_name = |cell: &&str| {
        let has_form = cell.chars().count() > 3 || cell.ends_with(|c: char| c.is_ascii_digit());
        has_form && !is_unit(cell) && !cell.contains('/') && names_quantity(cell)
    };
    let is_number = |cell: &str| cell.starts_with(|c: char| c.is_ascii_digit()) && !is_unit(cell);
    let has_form = |cell: &&str| {
        let is_quotient = cell.contains('/') && !cell.contains(char::is_whitespace) && !names_quantity(cell);
        is_quotient && !cell.eq_ignore_ascii_case("n/a") && cells().count() > 1
    };
    let units = cells().filter(|cell| is_unit(cell) || has_form(cell)).count();
    units > cells().filter(is_name).count() && !cells().any(is_number)
}

/// The unit with this symbol; ratios also have the unit `1`.
fn by_symbol(kind: Kind, symbol: &str) -> Option<&'static Unit> {
    kind.unit(symbol).or((symbol == BARE_RATIO.symbol()).then_some(&BARE_RATIO))
}

/// Splits a header into its name and its unit, if it has both: `T2 [degC]`, `T2 (degC)`, `p2 / kPa`, `p2 in kPa`, `T2_degC`.
pub fn split_unit(header: &str) -> (String, Option<String>) {
    let header = header.trim();
    for (open, close, any) in [('[', ']', true), ('(', ')', false), ('{', '}', false), ('<', '>', false)] {
        let Some(inside) = header.strip_suffix(close) else { continue };
        // The opening bracket that belongs to the last closing one: `P2 (kPa(g))`.
        let mut depth = 1;
        let opens = |(_, letter): &(usize, char)| {
            depth += i32::from(*letter == close) - i32::from(*letter == open);
            depth == 0
        };
        let Some((at, _)) = inside.char_indices().rev().find(opens) else { continue };
        let (name, unit) = (&inside[..at], inside[at + open.len_utf8()..].trim());
        // `bar (g)` and `[bar(g)]` contain brackets.
        if !name.trim().is_empty()
            && !unit.is_empty()
            && (any || header_unit(unit).is_some() || volume_flow_m3_s(unit).is_some())
        {
            return (name.trim().trim_end_matches(['/', ',']).trim().to_owned(), Some(unit.to_owned()));
        }
    }
    // Take the longest unit: `m kg/h` ends in `h` as well.
    let mut best: Option<(&str, &str)> = None;
    for between in [" / ", " in ", "/", ", ", "_", " "] {
        for (at, _) in header.match_indices(between) {
            let (name, unit) = (header[..at].trim(), header[at + between.len()..].trim());
            // A single letter after a blank or an underscore is more often a station than a unit: `T_C`, `p_a`.
            let doubtful = [" ", "_"].contains(&between) && unit.len() < 2;
            let longer = best.is_none_or(|(_, known)| known.len() < unit.len());
            let stated = !name.is_empty() && !doubtful && unit != "-" && !unit.ends_with("--");
            if stated && longer && header_unit(unit).is_some() {
                best = Some((name, unit));
            }
        }
    }
    if let Some((name, unit)) = best {
        return (name.to_owned(), Some(unit.to_owned()));
    }
    (header.to_owned(), None)
}

/// How a heading may separate its unit from its name: text before the unit and after it.
const FORMS: [(&str, &str); 6] = [("(", ")"), (" / ", ""), (", ", ""), (" in ", ""), ("_", ""), (" ", "")];

/// Maximum number of letters of an unknown unit. Bound: `kg*m/(s*kPa)`; longer texts are remarks.
const MAX_UNIT_LETTERS: usize = 12;

/// The headings of one table, with units of no known spelling in square brackets: in `Flow slug/s` a quotient, and else what stands where
/// many of the headings have their units, as in `Speed_rpm` and `T2_C`. An unknown unit is then named instead of being part of the name.
pub fn with_unknown_units(headings: &[String]) -> Vec<String> {
    let filled = headings.iter().filter(|heading| !heading.is_empty()).count();
    let has_form = |heading: &String, (open, close): (&str, &str)| {
        let (_, unit) = split_unit(heading);
        let before = unit.as_deref().and_then(|unit| heading.strip_suffix(close)?.strip_suffix(unit));
        before.is_some_and(|before| before.ends_with(open))
    };
    let usual = FORMS.into_iter().find(|form| {
        let count = headings.iter().filter(|heading| has_form(heading, *form)).count();
        form.0 != " " && count > 1 && 3 * count > filled
    });
    let named = |heading: &String| {
        if heading.ends_with(']') || is_unit(heading) {
            return heading.clone();
        }
        let known = split_unit(heading).1;
        let found = FORMS.into_iter().find_map(|form| {
            let body = heading.strip_suffix(form.1)?;
            let at = body.rfind(form.0)?;
            let (name, unit) = (body[..at].trim(), body[at + form.0.len()..].trim());
            let is_found = match &known {
                // `dwt/ms` ends in a unit of time.
                Some(known) => {
                    let is_time = header_unit(known).is_some_and(|unit| unit.kind == Kind::Duration);
                    let is_quantity = ColumnName::read(name).measured().is_some();
                    is_time && is_quantity && unit.len() > known.len() && is_unknown_quotient(unit)
                }
                None => is_unknown_quotient(unit) || usual == Some(form) && stands_for_unit(name, unit),
            };
            (is_found && name.contains(char::is_alphabetic)).then(|| format!("{name} [{unit}]"))
        });
        found.unwrap_or_else(|| heading.clone())
    };
    headings.iter().map(named).collect()
}

/// Whether a text has the form of a unit and no known words: `slug/s`, but not `P2/P1` or `in/out`.
fn is_unknown_quotient(text: &str) -> bool {
    let is_part = |part: &str| {
        part.starts_with(|c: char| c.is_alphabetic() || "°%1".contains(c))
            && part.chars().all(|c| c.is_alphanumeric() || "^·*²³°%".contains(c))
    };
    let Some((above, below)) = text.split_once('/') else { return false };
    is_part(above)
        && is_part(below)
        && text.chars().count() <= MAX_UNIT_LETTERS
        && !is_dimensionless(text)
        && !(ColumnName::read(above).is_known() && ColumnName::read(below).is_known())
}

/// Whether a word is a unit where the other headings have theirs. A letter is one only of a temperature, and not of the name `T_C`.
fn stands_for_unit(name: &str, word: &str) -> bool {
    let letters = word.chars().count();
    if letters == 1 {
        let read = ColumnName::read(name);
        let is_temperature = header_unit(word).is_some_and(|unit| unit.kind == Kind::Temperature);
        return is_temperature && read.measured() == Some(Measured::Temperature) && read.part_count() > 1;
    }
    letters <= MAX_UNIT_LETTERS
        && word.contains(char::is_alphabetic)
        && !word.contains(|c: char| c.is_whitespace() || "()".contains(c))
        && !is_dimensionless(word)
        && (word.starts_with('°') || !ColumnName::read(word).is_known())
}

/// A row between blanks with the parts of each unit joined, if it then has as many cells as there are columns: `deg C`, `bar abs`.
pub fn joined_units(row: &[String], columns: usize) -> Option<Vec<String>> {
    let mut joined: Vec<String> = Vec::new();
    for cell in row {
        let whole = joined.last().map(|before| format!("{before} {cell}"));
        match (joined.last_mut(), whole) {
            (Some(before), Some(whole))
                if header_unit(&whole).is_some() && !(is_unit(before) && is_unit(cell)) =>
            {
                *before = whole;
            }
            _ => joined.push(cell.clone()),
        }
    }
    (row.len() > columns && joined.len() == columns).then_some(joined)
}

/// The kind of quantity that a channel measures.
pub fn kind_of(channel: Channel) -> Kind {
    match channel.info().dimension {
        Dimension::RotationalSpeed => Kind::Speed,
        Dimension::MassFlow => Kind::MassFlow,
        Dimension::Pressure => Kind::Pressure,
        Dimension::Temperature => Kind::Temperature,
        Dimension::Ratio => Kind::Fraction,
    }
}

/// The kind of noise and offsets of a reading.
pub fn difference(kind: Kind) -> Kind {
    match kind {
        Kind::Temperature => Kind::TemperatureDifference,
        Kind::Pressure => Kind::PressureDifference,
        other => other,
    }
}

/// The unit with a spelling of this or another program.
pub fn unit(kind: Kind, spelling: &str) -> Result<&'static Unit, UnitError> {
    let spelling = spelling.trim();
    find(kind, spelling).ok_or_else(|| UnitError::WrongUnit { unit: spelling.to_owned(), kind })
}

/// Parses a number with its unit, such as `29e-3 m^2`, to SI and rpm. A ratio needs no unit.
pub fn parse_quantity(kind: Kind, text: &str) -> Result<f64, UnitError> {
    parse_with(kind, text, |spelling| match spelling {
        "" => (kind == Kind::Fraction).then_some(&BARE_RATIO),
        spelling => find(kind, spelling),
    })
}

/// The remedy for an error: the units that are valid.
pub fn remedy(kind: Kind, error: &UnitError) -> String {
    let bare = if kind == Kind::Fraction { "; a ratio may be written with `1`" } else { "" };
    format!("{}{bare}", error.remedy(kind))
}

fn find(kind: Kind, spelling: &str) -> Option<&'static Unit> {
    kind.unit(spelling).or_else(|| match (kind, spelling) {
        (Kind::Fraction, "1" | "-") => Some(&BARE_RATIO),
        (Kind::Temperature, "C" | "celsius") => kind.unit("degC"),
        (Kind::Temperature, "F") => kind.unit("degF"),
        // Unambiguous for a channel: channels contain absolute pressures.
        (Kind::Pressure, "psi") => kind.unit("psia"),
        // Unambiguous for an interval too: only the scale counts, and degF and degR have the same.
        (Kind::TemperatureDifference, "degC" | "°C") => kind.unit("K"),
        (Kind::TemperatureDifference, "degF" | "°F") => Kind::Temperature.unit("degR"),
        _ => None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::CHANNELS;

    #[test]
    fn units_as_test_stands_write_them() {
        for (text, kind, symbol, reference) in [
            ("°C", Kind::Temperature, "degC", Reference::Unstated),
            ("[Grad C]", Kind::Temperature, "degC", Reference::Unstated),
            ("kPaG", Kind::Pressure, "kPa", Reference::Gauge),
            ("kPaA", Kind::Pressure, "kPa", Reference::Absolute),
            ("bar(g)", Kind::Pressure, "bar", Reference::Gauge),
            ("mbar rel", Kind::Pressure, "mbar", Reference::Gauge),
            ("bar abs", Kind::Pressure, "bar", Reference::Absolute),
            ("kghr", Kind::MassFlow, "kg/h", Reference::Unstated),
            ("U/min", Kind::Speed, "rpm", Reference::Unstated),
            ("tr/min", Kind::Speed, "rpm", Reference::Unstated),
            ("℃", Kind::Temperature, "degC", Reference::Unstated),
            ("inHg", Kind::Pressure, "inHg", Reference::Unstated),
            ("in H2O", Kind::Pressure, "inH2O", Reference::Unstated),
            ("mmWS", Kind::Pressure, "mmH2O", Reference::Unstated),
            ("kgf/cm2", Kind::Pressure, "kgf/cm2", Reference::Unstated),
            ("kg/cm2 abs", Kind::Pressure, "kgf/cm2", Reference::Absolute),
            ("lbf/in2 g", Kind::Pressure, "psia", Reference::Gauge),
            ("Torr", Kind::Pressure, "Torr", Reference::Unstated),
            ("pps", Kind::MassFlow, "lb/s", Reference::Unstated),
            ("lb/hr", Kind::MassFlow, "lb/h", Reference::Unstated),
            ("t/h", Kind::MassFlow, "t/h", Reference::Unstated),
            ("mg/s", Kind::MassFlow, "mg/s", Reference::Unstated),
            ("degR", Kind::Temperature, "degR", Reference::Unstated),
        ] {
            let found = header_unit(text).unwrap();
            assert_eq!(
                (found.kind, found.unit.symbol(), found.reference),
                (kind, symbol_of(kind, symbol), reference),
                "{text}"
            );
        }
        assert_eq!(header_unit("Nm"), None);
        assert_eq!(volume_flow_m3_s("SCFM"), Some(None));
        assert_eq!(volume_flow_m3_s("m3/h"), Some(Some(1.0 / 3600.0)));
        assert_eq!(header_unit("SCFM"), None);
    }

    fn symbol_of(kind: Kind, symbol: &str) -> &'static str {
        by_symbol(kind, symbol).unwrap().symbol()
    }

    #[test]
    fn a_header_is_cut_where_its_unit_begins() {
        for (header, name, unit) in [
            ("T2 [degC]", "T2", Some("degC")),
            ("p2 / kPa", "p2", Some("kPa")),
            ("m_L / kg/h", "m_L", Some("kg/h")),
            ("Druck (bar)", "Druck", Some("bar")),
            ("p2 [bar(g)]", "p2", Some("bar(g)")),
            ("Drehzahl ATL in 1/min", "Drehzahl ATL", Some("1/min")),
            ("outlet_temp_degC", "outlet_temp", Some("degC")),
            ("Flow_kg_s", "Flow", Some("kg_s")),
            ("m_L kg/h", "m_L", Some("kg/h")),
            ("Drehzahl 1/min", "Drehzahl", Some("1/min")),
            ("T_C", "T_C", None),
            ("T2", "T2", None),
            ("Valve (upper)", "Valve (upper)", None),
            ("q [Nm]", "q", Some("Nm")),
        ] {
            assert_eq!(split_unit(header), (name.to_owned(), unit.map(str::to_owned)), "{header}");
        }
    }

    #[test]
    fn an_unknown_unit_is_not_part_of_the_name() {
        for (headings, expected) in [
            (
                vec!["Flow dwt/ms", "P2/P1", "Druck (kip/ft2)", "side in/out", "status n/a", "T2 degC"],
                vec!["Flow [dwt/ms]", "P2/P1", "Druck [kip/ft2]", "side in/out", "status n/a", "T2 degC"],
            ),
            (
                vec!["Speed_rpm", "p1_kPa", "p2_kPa", "m_kg/s", "T2_C", "T_C", "T1_tot", "m_stones"],
                vec!["Speed_rpm", "p1_kPa", "p2_kPa", "m_kg/s", "T2 [C]", "T_C", "T1_tot", "m [stones]"],
            ),
            (
                vec!["Speed, rpm", "p1, kPa", "Druck, Verdichter", "T1, degRe"],
                vec!["Speed, rpm", "p1, kPa", "Druck, Verdichter", "T1 [degRe]"],
            ),
            (vec!["Speed", "T2_C", "T2 degRe", "p (upper)"], vec!["Speed", "T2_C", "T2 degRe", "p (upper)"]),
        ] {
            let headings: Vec<String> = headings.into_iter().map(str::to_owned).collect();
            assert_eq!(with_unknown_units(&headings), expected);
        }
    }

    #[test]
    fn the_words_of_a_unit_belong_together_if_the_row_then_fits() {
        let row = ["s", "deg", "C", "bar", "abs", "kg/s"].map(str::to_owned);
        assert_eq!(joined_units(&row, 4).unwrap(), ["s", "deg C", "bar abs", "kg/s"]);
        assert_eq!(joined_units(&row, 5), None);
        assert_eq!(joined_units(&["deg C", "bar"].map(str::to_owned), 2), None);
    }

    #[test]
    fn foreign_spellings_mean_what_their_programs_mean() {
        // Definitions of the units; NIST SP 811 for psi (tolerance: its seven digits).
        for (kind, text, inside) in [
            (Kind::Temperature, "25 C", 298.15),
            (Kind::Temperature, "25celsius", 298.15),
            (Kind::Temperature, "212 F", 373.15),
            (Kind::TemperatureDifference, "0.25 degC", 0.25),
            (Kind::TemperatureDifference, "1.8 °F", 1.0),
            (Kind::Pressure, "14.695948775 psi", 101_325.0),
            (Kind::PressureDifference, "0.01 psi", 68.947_57),
            (Kind::Speed, "110e3 rev/min", 110e3),
            (Kind::Speed, "1000 rev/s", 60e3),
            (Kind::MassFlow, "36 kg/hr", 0.01),
            (Kind::MassFlow, "1 lb/s", 0.453_592_37),
            (Kind::Fraction, "0.7", 0.7),
            (Kind::Fraction, "0.7 1", 0.7),
            (Kind::Fraction, "50 %", 0.5),
        ] {
            let got = parse_quantity(kind, text).unwrap();
            assert!((got - inside).abs() <= 5e-8 * inside, "{text}: {got}");
        }
    }

    #[test]
    fn the_native_unit_of_every_channel_leaves_every_bit_as_it_is() {
        for row in CHANNELS {
            let native = unit(kind_of(row.channel), row.dimension.unit()).unwrap();
            for value in [-0.0, 0.1, 98_100.123_456_789] {
                assert_eq!(native.to_inside(value).to_bits(), f64::to_bits(value), "{}", row.symbol);
            }
        }
    }

    #[test]
    fn text_that_is_not_a_quantity_is_refused() {
        for (kind, text) in [
            (Kind::Fraction, ""),
            (Kind::Pressure, "abc"),
            (Kind::Pressure, "5"),
            (Kind::Pressure, "5 K"),
            (Kind::Pressure, "5 barg"),
            (Kind::Temperature, "inf K"),
            (Kind::Temperature, "1e999 K"),
            (Kind::Fraction, "nan"),
            (Kind::Fraction, "1e999"),
        ] {
            assert!(parse_quantity(kind, text).is_err(), "{text}");
        }
        assert!(unit(Kind::Fraction, "").is_err());
    }
}
