//! The headings of a table's columns: names and units.

use super::{BARE_RATIO, Kind, Reference, Unit, header_unit, split_unit};

/// The text in brackets behind a name without being a unit: kinds of ratios and of efficiencies.
const NO_UNITS: &[&str] = &["", "-", "1", "ts", "tt", "t-s", "t-t", "corr", "corrected"];

/// A column that is looked for.
#[derive(Debug, Clone, Copy)]
pub struct WantedColumn<'a> {
    /// What it holds, in words.
    pub quantity: &'static str,
    /// Names that it may have, in lower case without blanks and underscores; the first that is found counts.
    pub names: &'a [&'a str],
    /// What it measures.
    pub kind: Kind,
}

/// Place of a column, and its unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FoundColumn {
    /// Position, from 0.
    pub index: usize,
    /// Unit that the heading names; `None` if it names none.
    pub unit: Option<&'static Unit>,
}

impl FoundColumn {
    /// A value of the column in the unit used inside; unchanged if the heading names no unit.
    pub fn inside(&self, value: f64) -> f64 {
        self.unit.map_or(value, |unit| unit.to_inside(value))
    }
}

/// Why a table's columns cannot be identified.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum HeadingError {
    /// No heading has one of the names.
    #[error("no column holds the {quantity} (one of {names}); found: {found}")]
    Missing {
        /// What is looked for.
        quantity: &'static str,
        /// Names that it may have.
        names: String,
        /// Headings that are there, shortened.
        found: String,
    },
    /// An unknown unit.
    #[error("the heading `{heading}` has the unit `{unit}`, which is none of a {kind}; write one of {known}")]
    Unit {
        /// The heading.
        heading: String,
        /// What stands for its unit.
        unit: String,
        /// What is measured.
        kind: &'static str,
        /// Units that are known.
        known: String,
    },
}

/// Finds columns by the names in their headings, with the units that stand there: `N [krpm]`, `flow (g/s)`, `m_dot / kg/h`,
/// `speed_krpm`.
///
/// # Errors
/// [`HeadingError`] if one is missing, or has a unit that is not known.
pub fn find_columns<const N: usize>(
    headings: &[&str],
    wanted: [WantedColumn<'_>; N],
) -> Result<[FoundColumn; N], HeadingError> {
    let mut found = [FoundColumn { index: 0, unit: None }; N];
    for (place, column) in found.iter_mut().zip(&wanted) {
        let read: Vec<(String, Option<String>)> =
            headings.iter().map(|heading| split(heading, column.kind)).collect();
        let named = column.names.iter().find_map(|name| read.iter().position(|(plain, _)| plain == name));
        // Some write the unit alone. A share has none by which it could be distinguished from another.
        let by_unit = || {
            let is_unit = |heading: &&str| known(column.kind, heading.trim()).is_some();
            headings.iter().position(is_unit).filter(|_| column.kind != Kind::Fraction)
        };
        let index = named.or_else(by_unit);
        let Some(index) = index else {
            return Err(HeadingError::Missing {
                quantity: column.quantity,
                names: column.names.join(", "),
                found: headings.join(", ").chars().take(120).collect(),
            });
        };
        let unit = match &read[index].1 {
            None => None,
            Some(text) => Some(known(column.kind, text).ok_or_else(|| HeadingError::Unit {
                heading: headings[index].chars().take(60).collect(),
                unit: text.chars().take(40).collect(),
                kind: column.kind.name(),
                known: column.kind.unit_list(),
            })?),
        };
        *place = FoundColumn { index, unit };
    }
    Ok(found)
}

/// A heading's name, plain, and the text of its unit.
fn split(heading: &str, kind: Kind) -> (String, Option<String>) {
    let heading = heading.trim();
    if known(kind, heading).is_some() {
        return (plain(heading), Some(heading.to_owned()));
    }
    // In brackets even a text that is not a unit counts as the unit: it can be refused by name.
    if let Some((name, rest)) = heading.split_once(['[', '(']) {
        let unit = rest.trim_end_matches([']', ')', ' ']).trim();
        let is_unit = !NO_UNITS.contains(&unit.to_ascii_lowercase().as_str());
        return (plain(name), is_unit.then(|| unit.to_owned()));
    }
    // `pressure_ratio` names no unit, although a ratio could be one.
    let meant = |unit: &str| known(kind, unit).is_some_and(|unit| unit.symbol() != BARE_RATIO.symbol());
    match split_unit(heading) {
        (name, Some(unit)) if meant(&unit) => (plain(&name), Some(unit)),
        _ => (plain(heading), None),
    }
}

/// The unit of a kind under any spelling that tables and logs use. A table holds absolute pressures.
fn known(kind: Kind, text: &str) -> Option<&'static Unit> {
    let named =
        || header_unit(text).filter(|found| found.kind == kind && found.reference != Reference::Gauge);
    kind.unit(text).or_else(|| Some(named()?.unit))
}

/// In lower case without blanks and underscores.
fn plain(name: &str) -> String {
    name.trim().to_lowercase().replace([' ', '_'], "")
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SPEED: WantedColumn<'_> =
        WantedColumn { quantity: "speed", names: &["n", "speed"], kind: Kind::Speed };
    const FLOW: WantedColumn<'_> =
        WantedColumn { quantity: "flow", names: &["mdot", "flow"], kind: Kind::MassFlow };

    #[test]
    fn units_stand_in_brackets_behind_a_slash_or_at_the_end() {
        for (headings, rpm, kg_s) in [
            (["N [krpm]", "flow (g/s)"], 1e3, 1e-3),
            (["speed", "m_dot / kg/h"], 1.0, 1.0 / 3600.0),
            (["speed_rpm", "Flow_kg_s"], 1.0, 1.0),
            (["n in it, flow", "x"], f64::NAN, f64::NAN),
            (["Speed [1/min]", "flow[lb/min]"], 1.0, 0.453_592_37 / 60.0),
            (["n/rpm", "flow krpm"], f64::NAN, f64::NAN),
            (["krpm", "kg/min"], 1e3, 1.0 / 60.0),
            (["n [U/min]", "m_dot kg/hr"], 1.0, 1.0 / 3600.0),
        ] {
            match find_columns(&headings, [SPEED, FLOW]) {
                Ok([speed, flow]) => {
                    // The factors are exact; the difference is rounding.
                    assert!((speed.inside(1.0) / rpm - 1.0).abs() < 1e-15, "{headings:?}");
                    assert!((flow.inside(1.0) / kg_s - 1.0).abs() < 1e-15, "{headings:?}");
                }
                Err(error) => assert!(rpm.is_nan(), "{headings:?}: {error}"),
            }
        }
    }

    #[test]
    fn an_unknown_unit_is_refused_with_those_that_are_known() {
        let error = find_columns(&["N [furlongs]", "flow"], [SPEED, FLOW]).unwrap_err();
        assert!(matches!(&error, HeadingError::Unit { unit, .. } if unit == "furlongs"));
        assert!(error.to_string().contains("krpm"), "{error}");
        assert!(matches!(find_columns(&[], [SPEED]), Err(HeadingError::Missing { .. })));
    }

    proptest! {
        #[test]
        fn any_headings_are_columns_or_an_error(headings in proptest::collection::vec(".{0,20}", 0..6)) {
            let headings: Vec<&str> = headings.iter().map(String::as_str).collect();
            if let Ok([speed, flow]) = find_columns(&headings, [SPEED, FLOW]) {
                prop_assert!(speed.index < headings.len() && flow.index < headings.len());
            }
        }
    }
}
