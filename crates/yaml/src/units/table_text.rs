//! How the text of a table is cut: its separator, its decimal sign, and a row of units below its names.

use super::header_unit;

/// Separators of a table's columns and what goes with them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TableText {
    /// Between the columns.
    pub separator: char,
}

impl TableText {
    /// By the first line with content: `;` or tab if it has three of them, as a table of four columns has; otherwise a comma.
    pub fn of(line: &str) -> TableText {
        let separator = [';', '\t'].into_iter().find(|c| line.matches(*c).count() >= 3).unwrap_or(',');
        TableText { separator }
    }

    /// The fields of a line.
    pub fn fields<'a>(&self, line: &'a str) -> Vec<&'a str> {
        line.split(self.separator).map(str::trim).collect()
    }

    /// A number; with a decimal comma too, if commas do not separate columns.
    pub fn number(&self, text: &str) -> Option<f64> {
        let text = text.trim();
        text.parse().ok().or_else(|| {
            let decimal_comma =
                self.separator != ',' && text.matches(',').count() == 1 && !text.contains('.');
            decimal_comma.then(|| text.replacen(',', ".", 1).parse().ok()).flatten()
        })
    }
}

/// Headings with the units from a row of their own below them: `flow` and `g/s` become `flow [g/s]`. `None` if the row below is
/// no row of units. A heading that names its unit itself keeps it.
pub fn with_units_row(headings: &[&str], below: &[&str]) -> Option<Vec<String>> {
    let bare = |text: &str| text.trim().trim_matches(['[', ']', '(', ')']).trim().to_owned();
    let says_nothing = |text: &str| ["", "-", "1"].contains(&text);
    let units: Vec<String> = below.iter().map(|text| bare(text)).collect();
    let all_known = units.iter().all(|unit| says_nothing(unit) || header_unit(unit).is_some());
    let some_known = units.iter().any(|unit| !says_nothing(unit));
    if !(all_known && some_known) || units.len() > headings.len() {
        return None;
    }
    let joined = headings.iter().enumerate().map(|(index, heading)| match units.get(index) {
        Some(unit) if !says_nothing(unit) && !heading.contains(['[', '(']) => format!("{heading} [{unit}]"),
        _ => (*heading).to_owned(),
    });
    Some(joined.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commas_are_decimal_where_they_do_not_separate() {
        let german = TableText::of("n;m;pi;eta");
        assert_eq!(german.fields("50000; 0,035 ;1,175;0,7"), ["50000", "0,035", "1,175", "0,7"]);
        assert_eq!((german.number("0,035"), german.number("0.035")), (Some(0.035), Some(0.035)));
        assert_eq!((german.number("1,000,000"), german.number("1.000,5")), (None, None));
        let english = TableText::of("50000,0.035,1.175,0.7");
        assert_eq!((english.separator, english.number("0,035")), (',', None));
        assert_eq!(TableText::of("a\tb\tc\td").separator, '\t');
        // A semicolon in a remark separates nothing.
        assert_eq!(TableText::of("n,m,pi,eta,see; there").separator, ',');
    }

    #[test]
    fn units_may_have_a_row_of_their_own() {
        let names = ["speed", "flow", "PR", "eta (is)"];
        let joined = with_units_row(&names, &["[krpm]", "g/s", "-", "%"]).unwrap();
        assert_eq!(joined, ["speed [krpm]", "flow [g/s]", "PR", "eta (is)"]);
        for none in [["60", "38", "1.2", "70"], ["krpm", "slugs", "-", "%"], ["", "-", "", ""]] {
            assert_eq!(with_units_row(&names, &none), None);
        }
    }
}
