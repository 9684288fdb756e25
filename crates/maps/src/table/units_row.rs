//! Merges a row of units into the headings of a table.

use mapper_table::{bare_unit, is_dimensionless, is_unit, is_units_row};

/// Headings with the units from a row of their own below them: `flow` and `g/s` become `flow [g/s]`. `None` if the row below is
/// not a row of units. A heading with a unit keeps it. Each unit counts by itself: an unknown one concerns its own column alone.
pub(super) fn merge_units_row(headings: &[String], below: &[String]) -> Option<Vec<String>> {
    let units: Vec<&str> = below.iter().map(|text| bare_unit(text)).collect();
    let some_known = units.iter().any(|unit| !is_dimensionless(unit) && is_unit(unit));
    let is_number = |unit: &&str| unit.starts_with(|c: char| c.is_ascii_digit()) && !is_unit(unit);
    if !some_known || !is_units_row(below) || units.iter().any(is_number) || units.len() > headings.len() {
        return None;
    }
    let joined = headings.iter().enumerate().map(|(index, heading)| match units.get(index) {
        Some(unit) if !is_dimensionless(unit) && !heading.contains(['[', '(']) => {
            format!("{heading} [{unit}]")
        }
        _ => heading.clone(),
    });
    Some(joined.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_may_have_a_row_of_their_own() {
        let names = ["speed", "flow", "PR", "eta (is)"].map(str::to_owned);
        let joined = merge_units_row(&names, &["[krpm]", "g/s", "-", "%"].map(str::to_owned)).unwrap();
        assert_eq!(joined, ["speed [krpm]", "flow [g/s]", "PR", "eta (is)"]);
        let joined = merge_units_row(&names, &["krpm", "slugs", "T-T", "%"].map(str::to_owned)).unwrap();
        assert_eq!(joined, ["speed [krpm]", "flow [slugs]", "PR [T-T]", "eta (is)"]);
        for none in [["60", "38", "1.2", "70"], ["1", "1", "1.2", "%"], ["", "-", "", ""]] {
            assert_eq!(merge_units_row(&names, &none.map(str::to_owned)), None);
        }
    }
}
