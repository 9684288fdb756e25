//! Merges a row of units into the headings of a table.

use crate::table::columns::column::parts;
use mapper_table::{bare_unit, is_dimensionless, is_unit, is_units_row_of_names};

/// Headings with the units from a row of their own: `flow` and `g/s` become `flow [g/s]`. `None` if the row is not a row of units. A heading
/// with a unit keeps it. Each unit counts by itself: an unknown one concerns its own column alone.
pub(super) fn merge_units_row(headings: &[String], row: &[String]) -> Option<Vec<String>> {
    if !is_units_row_of_names(row) {
        return None;
    }
    let joined = headings.iter().enumerate().map(|(index, heading)| {
        let has_unit = parts(heading).1.is_some_and(|unit| is_unit(&unit));
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
