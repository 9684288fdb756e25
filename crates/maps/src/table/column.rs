//! Quantity and unit of a table column, from its heading or the row of units below it.

use crate::table::quantity::{Quantity, end_in, is_turbine, quantity_of_name};
use mapper_core::ReferenceState;
use mapper_core::unit_factors::{G_PER_KG, PA_PER_KPA, PERCENT};
use mapper_physics::gas::air::GAS_CONSTANT_J_KGK;
use mapper_table::{
    ColumnName, Measured, Reference, Word, bare_unit, header_unit, is_dimensionless, is_reduced_unit,
    is_units_row_of_names, joined_units, split_unit, volume_flow_m3_s,
};
use mapper_yaml::units::{Kind, Unit};
use std::borrow::Cow;

/// Maximum number of letters of a heading that is kept. Bound: a line of a message.
pub(crate) const MAX_HEADING: usize = 60;

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Column {
    pub(crate) index: usize,
    pub(crate) quantity: Quantity,
    pub(crate) heading: String,
    /// Unit as written; empty if the heading has none.
    pub(crate) unit: String,
    pub(crate) is_gauge: bool,
    scale: Scale,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Scale {
    Unit(&'static Unit),
    Factor(f64),
}

impl Column {
    /// A column without a heading, in SI and rpm.
    pub(crate) fn bare(index: usize, quantity: Quantity) -> Column {
        Column {
            index,
            quantity,
            heading: String::new(),
            unit: String::new(),
            is_gauge: false,
            scale: Scale::Factor(1.0),
        }
    }

    /// The same quantity in another column.
    pub(crate) fn at(self, index: usize) -> Column {
        Column { index, ..self }
    }

    /// A column with the unit of its heading, if there is one.
    pub(crate) fn with_unit(
        index: usize,
        quantity: Quantity,
        heading: &str,
        unit: Option<&str>,
    ) -> Result<Column, ColumnError> {
        let heading: String = heading.chars().take(MAX_HEADING).collect();
        // `lb/s @ 545 R, 13.95 psia` has the reference state behind it.
        let unit = unit.map(|unit| unit.split('@').next().unwrap_or_default().trim());
        let Some(text) = unit.filter(|unit| !is_dimensionless(unit) && !is_ratio_kind(unit)) else {
            return Ok(Column { heading, ..Column::bare(index, quantity) });
        };
        let is_measured = matches!(quantity, Quantity::P1 | Quantity::P2 | Quantity::P3 | Quantity::P4);
        let gauge = header_unit(text).filter(|found| is_measured && found.reference == Reference::Gauge);
        let is_gauge = gauge.is_some();
        match gauge.map(|found| Scale::Unit(found.unit)).or_else(|| scale(quantity, text)) {
            Some(scale) => Ok(Column { index, quantity, heading, unit: text.to_owned(), is_gauge, scale }),
            None => Err(ColumnError::Unit {
                quantity,
                heading,
                unit: text.chars().take(40).collect(),
                kind: quantity.kind().name(),
                known: quantity.unit_list(),
            }),
        }
    }

    /// A pressure or temperature without a unit has that of the others, if all of those have the same.
    pub(crate) fn share_unit(&mut self, others: &[Column]) {
        let kind = self.quantity.kind();
        let has_kind = |other: &&Column| other.has_unit() && other.quantity.kind() == kind;
        let mut others = others.iter().filter(has_kind);
        let Some(first) = others.next().filter(|_| matches!(kind, Kind::Pressure | Kind::Temperature)) else {
            return;
        };
        if !self.has_unit() && others.all(|other| other.scale == first.scale) {
            (self.scale, self.unit) = (first.scale, first.unit.clone());
            self.is_gauge = first.is_gauge && self.quantity != Quantity::Ambient;
        }
    }

    /// A value in SI and rpm; reduced ones in rpm/K^0.5 and kg K^0.5/(s kPa).
    pub(crate) fn as_stated(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Unit(unit) => unit.to_inside(value),
            Scale::Factor(factor) => factor * value,
        }
    }

    /// A value in SI and rpm. Volume flows count at the density of the reference state, reduced quantities become corrected ones.
    pub(crate) fn to_corrected_si(&self, value: f64, reference: ReferenceState) -> f64 {
        let value = self.as_stated(value);
        let (t_ref_k, p_ref_pa) = (reference.t_ref_k, reference.p_ref_pa);
        match self.quantity {
            Quantity::ReducedSpeed => value * t_ref_k.sqrt(),
            Quantity::ReducedFlow => value * (p_ref_pa / PA_PER_KPA) / t_ref_k.sqrt(),
            Quantity::VolumeFlow => value * p_ref_pa / (GAS_CONSTANT_J_KGK * t_ref_k),
            _ => value,
        }
    }

    /// Whether a humidity is relative: in %, or without a unit.
    pub(crate) fn is_relative(&self) -> bool {
        !self.unit.to_lowercase().contains("kg")
    }

    pub(crate) fn is_static(&self) -> bool {
        ColumnName::read(&parts(&self.heading).0).has(Word::Static)
    }

    pub(crate) fn is_command(&self) -> bool {
        ColumnName::read(&parts(&self.heading).0).is_command()
    }

    pub(crate) fn is_corrected(&self) -> bool {
        ColumnName::read(&parts(&self.heading).0).has(Word::Corrected)
    }

    pub(crate) fn has_unit(&self) -> bool {
        !self.unit.is_empty()
    }
}

#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(crate) enum ColumnError {
    #[error(
        "the heading `{heading}` has the unit `{unit}`, which is not a unit of {kind}; write one of {known}"
    )]
    Unit { quantity: Quantity, heading: String, unit: String, kind: &'static str, known: String },
    #[error("the heading `{heading}` belongs to a turbine map")]
    Turbine { heading: String },
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Machine {
    #[default]
    Compressor,
    Turbine,
}

pub(crate) fn column(index: usize, heading: &str, machine: Machine) -> Result<Option<Column>, ColumnError> {
    let (name, unit) = parts(heading);
    let plain: String =
        name.to_lowercase().chars().filter(|c| c.is_alphanumeric() || "/√η^.".contains(*c)).collect();
    if machine == Machine::Compressor && is_turbine(&plain) {
        return Err(ColumnError::Turbine { heading: heading.chars().take(60).collect() });
    }
    // `Surge PR` is a point of the surge line.
    if end_in(&name).is_some() {
        return Ok(None);
    }
    // `flow_low` is an end of an interval.
    let words = name.to_lowercase();
    let mut words = words.split(|c: char| !c.is_alphanumeric()).rev();
    if matches!(words.next(), Some("low" | "high" | "lower" | "upper")) && words.next().is_some() {
        return Ok(None);
    }
    let by_unit = unit.as_deref().and_then(quantity_of_unit);
    let Some(quantity) = quantity_of_name(&name, &plain, by_unit, machine == Machine::Turbine) else {
        return Ok(None);
    };
    match Column::with_unit(index, quantity, heading, unit.as_deref()) {
        // A point may be without it.
        Err(_) if quantity.is_optional() => Ok(None),
        column => column.map(Some),
    }
}

/// Name and unit of a heading. Brackets that name the kind of a ratio are dropped.
pub(crate) fn parts(heading: &str) -> (String, Option<String>) {
    let heading = heading.trim();
    if !heading.contains(['[', '(']) && quantity_of_unit(heading).is_some() {
        return (String::new(), Some(heading.to_owned()));
    }
    // `P1 / kPa(g)`: the bracket belongs to the unit.
    let known = |unit: &str| {
        let kind = header_unit(unit).map(|found| found.kind);
        quantity_of_unit(unit).is_some() || matches!(kind, Some(Kind::Pressure | Kind::Temperature))
    };
    let split = split_unit(heading);
    if let (name, Some(unit)) = &split
        && unit.ends_with([')', ']'])
        && known(unit)
    {
        return (name.clone(), Some(unit.clone()));
    }
    if let Some((name, inside)) = last_bracket(heading)
        && !bracket_is_in_name(name, inside)
    {
        return (name.to_owned(), (!is_ratio_kind(inside)).then(|| inside.to_owned()));
    }
    // `MASSc-kg/s`, `Flow kg/s`, `m / kg/h`, `flow_kg_s`.
    if let (name, Some(unit)) = split
        && known(&unit)
        && !is_dimensionless(&unit)
    {
        return (name, Some(unit));
    }
    for separator in [" - ", "-", " ", "/"] {
        for (at, _) in heading.match_indices(separator) {
            let (name, unit) = (heading[..at].trim(), heading[at + separator.len()..].trim());
            if !name.is_empty() && unit.len() > 1 && known(unit) {
                return (name.to_owned(), Some(unit.to_owned()));
            }
        }
    }
    (heading.to_owned(), None)
}

/// Text before the final bracket of a heading, and the text inside it. Name and unit may contain brackets of their own.
fn last_bracket(heading: &str) -> Option<(&str, &str)> {
    let inside = heading.strip_suffix([']', ')'])?;
    let mut depth = 1;
    for (at, c) in inside.char_indices().rev() {
        match c {
            ']' | ')' => depth += 1,
            '[' | '(' => depth -= 1,
            _ => {}
        }
        if depth == 0 {
            return (at > 0).then(|| (inside[..at].trim(), inside[at + 1..].trim()));
        }
    }
    None
}

/// `sqrt(T)`: the bracket belongs to the name.
fn bracket_is_in_name(name: &str, inside: &str) -> bool {
    let root = name.to_lowercase();
    (root.ends_with("sqrt") || root.ends_with('√')) && inside.len() <= 4
}

/// Words of brackets that name the kind of a ratio, and no unit: `T-T`, `tot/stat`, `isentropic`.
const RATIO_KINDS: &str =
    "ts tt cc ss corr corrected red reduced is isentropic tot total stat static korr t s";

/// Whether a bracket contains words other than a unit, such as total or static.
fn is_ratio_kind(inside: &str) -> bool {
    let lower = inside.to_lowercase();
    let mut words = lower.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).peekable();
    let is_kind = words.peek().is_some() && words.all(|word| RATIO_KINDS.split(' ').any(|kind| kind == word));
    is_kind
        || is_dimensionless(inside)
        || ColumnName::read(inside).measured() == Some(Measured::PressureRatio)
}

pub(crate) fn is_unit_of(quantity: Quantity, text: &str) -> bool {
    scale(quantity, text).is_some()
}

/// A unit of mass flow, kg/s.
pub fn flow_unit_kg_s(text: &str) -> Option<f64> {
    Some(unit_of(Kind::MassFlow, text)?.to_inside(1.0))
}

fn quantity_of_unit(unit: &str) -> Option<Quantity> {
    let lower = unit.trim().to_lowercase();
    if volume_flow_m3_s(unit).is_some() {
        return Some(Quantity::VolumeFlow);
    }
    if lower == "%" {
        return Some(Quantity::Efficiency);
    }
    if is_reduced_unit(&lower) {
        return Some(if lower.contains("kg") || lower.contains("lb") || lower.starts_with('g') {
            Quantity::ReducedFlow
        } else {
            Quantity::ReducedSpeed
        });
    }
    match header_unit(unit)?.kind {
        Kind::Speed => Some(Quantity::Speed),
        Kind::MassFlow => Some(Quantity::Flow),
        _ => None,
    }
}

fn scale(quantity: Quantity, unit: &str) -> Option<Scale> {
    let unit = &unit.replace(['·', '⋅'], "*").replace(',', ".");
    let lower = unit.trim().to_lowercase();
    match quantity {
        Quantity::VolumeFlow => Some(Scale::Factor(volume_flow_m3_s(unit)??)),
        Quantity::ReducedSpeed if is_reduced_unit(&lower) => {
            // `1/min/√K` has a slash of its own.
            let root = ["sqrt", "√", "k^", "k0.5", "k**"].iter().filter_map(|root| lower.find(root)).min()?;
            let speed = lower.get(..root)?.trim_end_matches(['/', '*', '-', ' ', '(']);
            Some(Scale::Factor(unit_of(Kind::Speed, speed)?.to_inside(1.0)))
        }
        Quantity::ReducedFlow => {
            // `kg/s*K^0.5/kPa`, `kg-sqrt(K)/s-kPa`, `kg*sqrt(K)/(s*kPa)`: mass first, pressure last.
            let mass = unit.split(['*', '-', ' ']).next()?.trim_matches(['(', ')']);
            let mass = if mass.contains('/') { mass.to_owned() } else { format!("{mass}/s") };
            let pressure = unit.trim_end_matches([')', ' ']).rsplit(['/', '*', '-', ' ', '(']).next()?;
            let kg_s = unit_of(Kind::MassFlow, &mass)?.to_inside(1.0);
            Some(Scale::Factor(kg_s * (PA_PER_KPA / unit_of(Kind::Pressure, pressure)?.to_inside(1.0))))
        }
        // Positions are compared with each other only.
        Quantity::Vane if matches!(lower.as_str(), "deg" | "°" | "mm") => Some(Scale::Factor(1.0)),
        Quantity::Humidity if lower == "g/kg" => Some(Scale::Factor(1.0 / G_PER_KG)),
        Quantity::Humidity if lower == "kg/kg" => Some(Scale::Factor(1.0)),
        // Relative to the design speed.
        Quantity::Speed if lower == "%" => Some(Scale::Factor(1.0 / PERCENT)),
        _ => unit_of(quantity.kind(), unit).map(Scale::Unit),
    }
}

/// The unit of a kind in any spelling of headings. A map has absolute pressures.
fn unit_of(kind: Kind, text: &str) -> Option<&'static Unit> {
    kind.unit(text).or_else(|| {
        let found = header_unit(text)?;
        (found.kind == kind && found.reference != Reference::Gauge).then_some(found.unit)
    })
}

/// The headings with the letter of their machine in the place where names have it, if some have the compressor's (`P1C`, `PC1`, `TC_in`) and
/// some the turbine's: `P1T` and `PT1`, which are total values elsewhere, become `P_t1`. `bare_is_compressor`: `P1` is the compressor's.
pub(crate) fn with_machine_letters(headings: &[String], bare_is_compressor: bool) -> Vec<String> {
    let split = |heading: &String| {
        let (name, unit) = parts(heading);
        let letters: Vec<char> = name.to_lowercase().chars().filter(|c| c.is_alphanumeric()).collect();
        let rest = |at: usize| letters.get(at..).unwrap_or_default().iter().collect::<String>();
        let is_place = |rest: &str| matches!(rest, "1" | "2" | "01" | "02" | "in" | "out");
        let (quantity, (machine, place)) = match letters.as_slice() {
            [quantity, ..] if bare_is_compressor && is_place(&rest(1)) => (*quantity, ('c', rest(1))),
            [quantity, machine, ..] if is_place(&rest(2)) => (*quantity, (*machine, rest(2))),
            // `PT1C` is total too.
            [quantity, 't', place @ .., machine] | [quantity, place @ .., machine] => {
                (*quantity, (*machine, place.iter().collect()))
            }
            _ => return None,
        };
        let is_known =
            matches!(quantity, 'p' | 't') && matches!(machine, 'c' | 'v' | 't') && is_place(&place);
        let place = place.trim_start_matches('0').to_owned();
        is_known.then_some((quantity, machine == 't', place, unit))
    };
    let found: Vec<_> = headings.iter().map(split).collect();
    let has = |of_turbine: bool| found.iter().flatten().any(|(_, turbine, ..)| *turbine == of_turbine);
    if !(has(true) && has(false)) {
        return headings.to_vec();
    }
    let written = headings.iter().zip(&found).map(|(heading, found)| match found {
        Some((quantity, is_turbine, place, unit)) => {
            let unit = unit.as_ref().map_or(String::new(), |unit| format!(" [{unit}]"));
            format!("{quantity}_{}_{place}{unit}", if *is_turbine { "t" } else { "c" })
        }
        None => heading.clone(),
    });
    written.collect()
}

/// Headings with the units from a row of their own: `flow` and `g/s` become `flow [g/s]`. `None` if the row is not a row of units. A heading
/// with a unit keeps it. Each unit counts by itself: an unknown one concerns its own column alone.
pub(crate) fn merge_units_row(headings: &[String], row: &[String]) -> Option<Vec<String>> {
    let row = joined_units(row, headings.len()).map_or(Cow::Borrowed(row), Cow::Owned);
    if !is_units_row_of_names(&row) {
        return None;
    }
    let joined = headings.iter().enumerate().map(|(index, heading)| {
        let has_unit = parts(heading).1.is_some_and(|unit| mapper_table::is_unit(&unit));
        match row.get(index).map(|text| bare_unit(text)) {
            Some(unit) if !is_dimensionless(unit) && !has_unit => format!("{heading} [{unit}]"),
            _ => heading.clone(),
        }
    });
    Some(joined.collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn units_may_have_a_row_of_their_own() {
        let names = ["speed", "flow", "PR", "eta (is)"].map(str::to_owned);
        for (row, expected) in [
            (["[krpm]", "g/s", "-", "%"], ["speed [krpm]", "flow [g/s]", "PR", "eta (is) [%]"]),
            (["krpm", "slugs", "T-T", "%"], ["speed [krpm]", "flow [slugs]", "PR [T-T]", "eta (is) [%]"]),
            (["(rpm)", "(lb/s)", "bar/bar", ""], ["speed [rpm]", "flow [lb/s]", "PR", "eta (is)"]),
        ] {
            assert_eq!(merge_units_row(&names, &row.map(str::to_owned)).unwrap(), expected);
        }
        for none in [
            ["60", "38", "1.2", "70"],
            ["1", "1", "1.2", "%"],
            ["", "-", "", ""],
            ["Drehzahl", "Massenstrom", "rpm", ""],
        ] {
            assert_eq!(merge_units_row(&names, &none.map(str::to_owned)), None);
        }
    }

    proptest! {
        /// One known unit is enough, whatever the other columns have in the row.
        #[test]
        fn unknown_units_never_hide_a_known_one(
            others in proptest::collection::vec("[a-zA-Z°%/()²-]{0,3}", 0..12),
            place in 0usize..12,
        ) {
            let mut row = others;
            let place = place.min(row.len());
            row.insert(place, "lb/min".to_owned());
            let names: Vec<String> = (0..row.len()).map(|index| format!("column {index}")).collect();
            let joined = merge_units_row(&names, &row).unwrap();
            prop_assert_eq!(&joined[place], &format!("column {place} [lb/min]"));
        }
    }
}
