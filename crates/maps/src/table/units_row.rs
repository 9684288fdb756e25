//! Merges a row of units into the headings of a table.

use crate::table::columns::column::{is_dimensionless, is_known_unit};

/// Headings with the units from a row of their own below them: `flow` and `g/s` become `flow [g/s]`. `None` if the row below is
/// not a row of units. A heading with a unit keeps it.
pub(super) fn merge_units_row(headings: &[String], below: &[String]) -> Option<Vec<String>> {
    let bare = |text: &str| text.trim().trim_matches(['[', ']', '(', ')']).trim().to_owned();
    let units: Vec<String> = below.iter().map(|text| bare(text)).collect();
    let all_known = units.iter().all(|unit| is_dimensionless(unit) || is_known_unit(unit));
    let some_known = units.iter().any(|unit| !is_dimensionless(unit));
    if !(all_known && some_known) || units.len() > headings.len() {
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
        for none in [["60", "38", "1.2", "70"], ["krpm", "slugs", "-", "%"], ["", "-", "", ""]] {
            assert_eq!(merge_units_row(&names, &none.map(str::to_owned)), None);
        }
    }
}
