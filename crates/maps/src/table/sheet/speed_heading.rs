//! Speeds in titles and headings: `N = 60000 rpm`, `PR@60000`, `60 krpm | flow [kg/s]`.

use crate::table::sheet::grid::Grid;
use mapper_core::unit_factors::RPM_PER_KRPM;
use mapper_table::header_unit;
use mapper_yaml::units::{Kind, Unit};
use std::ops::RangeInclusive;

/// Range of a number without a unit that is a speed, rpm. Bound: smaller numbers are diameters in mm, temperatures or pressures in mbar, larger
/// ones dates.
const BARE_RPM: RangeInclusive<f64> = 5e3..=1e6;

fn is_separator(c: char) -> bool {
    c.is_whitespace() || matches!(c, '=' | ':' | '[' | ']' | '(' | ')')
}

fn speed_unit(text: &str) -> Option<&'static Unit> {
    header_unit(text).filter(|found| found.kind == Kind::Speed).map(|found| found.unit)
}

/// The one number of a text with its unit of speed; rpm if it names none.
pub(crate) fn speed_in(grid: &Grid, text: &str) -> Option<f64> {
    let words = || text.split(is_separator).filter(|word| !word.is_empty());
    let mut speeds = words().filter_map(|word| {
        let digits = word.find(|c: char| c.is_alphabetic()).unwrap_or(word.len());
        grid.number(&word[..digits]).map(|value| (value, &word[digits..]))
    });
    let (value, unit) = speeds.next()?;
    if speeds.next().is_some() {
        return None;
    }
    let unit = speed_unit(unit).or_else(|| words().find_map(speed_unit));
    Some(unit.map_or(value, |unit| unit.to_inside(value))).filter(|rpm| *rpm > 0.0)
}

/// A heading without the speed in it, and the speed in rpm.
pub(crate) fn without_speed(grid: &Grid, heading: &str) -> Option<(String, f64)> {
    let is_number_char = |c: char| c.is_ascii_digit() || matches!(c, '.' | ',');
    let mut from = 0;
    while let Some(start) = heading[from..].find(|c: char| c.is_ascii_digit()).map(|at| from + at) {
        let length = heading[start..].find(|c: char| !is_number_char(c)).unwrap_or(heading.len() - start);
        from = start + length;
        let number = heading[start..from].trim_end_matches(['.', ',']);
        let after = heading[from..].trim_start_matches([' ', '_', '[', '(']);
        let end = after.find(|c: char| c.is_whitespace() || "|_:;)]".contains(c)).unwrap_or(after.len());
        let (unit, rest) = after.split_at(end);
        let is_bracket = heading[from..].trim_start().starts_with(['[', '(']);
        let Some(value) = grid.number(number) else { continue };
        let (speed_rpm, rest) = match speed_unit(unit) {
            Some(unit) => (unit.to_inside(value), rest),
            None if unit == "k" => (RPM_PER_KRPM * value, rest),
            // A number with another unit, for example of a pressure, is not a speed.
            None if !BARE_RPM.contains(&value) || header_unit(unit).is_some() && !is_bracket => continue,
            None => (value, &heading[from..]),
        };
        let mut before = &heading[..start];
        loop {
            let cut = before.trim_end_matches(|c: char| {
                is_separator(c) && !matches!(c, ']' | ')') || "@|_-,".contains(c)
            });
            let word = cut.rfind(|c: char| is_separator(c) || "@|_-".contains(c)).map_or(0, |at| at + 1);
            match cut.get(word..).map(str::to_lowercase).as_deref() {
                Some("n" | "nc" | "at" | "bei" | "speed" | "drehzahl" | "line") => before = &cut[..word],
                _ => {
                    before = cut;
                    break;
                }
            }
        }
        let rest = rest.trim_start_matches(|c: char| c.is_whitespace() || "|_:-)],".contains(c));
        return Some((format!("{before} {rest}").trim().to_owned(), speed_rpm)).filter(|_| speed_rpm > 0.0);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_heading_may_hold_the_speed_of_its_line() {
        let grid = Grid::of_text("1,2,3\n").unwrap();
        for (heading, name, rpm) in [
            ("PR@60000", "PR", 6e4),
            ("eta @ 60 krpm [%]", "eta [%]", 6e4),
            ("60000 rpm | flow [kg/s]", "flow [kg/s]", 6e4),
            ("flow_60000 [kg/s]", "flow [kg/s]", 6e4),
            ("m (n=60000 1/min) [g/s]", "m [g/s]", 6e4),
            ("PR_120k", "PR", 12e4),
            ("60krpm", "", 6e4),
            ("60000", "", 6e4),
            ("N60000 PR", "PR", 6e4),
        ] {
            let (found, found_rpm) = without_speed(&grid, heading).unwrap_or_else(|| panic!("{heading}"));
            assert_eq!((found.as_str(), found_rpm), (name, rpm), "{heading}");
        }
        for heading in ["P2/P1", "flow at 101325 Pa", "T1 298.15 K", "eta 0.8", "p 98100Pa"] {
            assert_eq!(without_speed(&grid, heading), None, "{heading}");
        }
    }
}
