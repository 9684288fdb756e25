//! Units and order of the columns from the heading above the rows.

use mapper_core::MAP_COLUMNS;
use mapper_yaml::units::{FoundColumn, HeadingError, Kind, WantedColumn, find_columns};

/// Physical quantities of the four columns.
const KINDS: [Kind; 4] = [Kind::Speed, Kind::MassFlow, Kind::Fraction, Kind::Fraction];

/// Positions of the four quantities in a row, and their units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Columns([FoundColumn; 4]);

impl Default for Columns {
    /// The format's own: corrected rpm, corrected kg/s, pressure ratio, efficiency.
    fn default() -> Self {
        Columns(std::array::from_fn(|index| FoundColumn { index, unit: None }))
    }
}

impl Columns {
    /// The quantities of a row, in internal units.
    pub(super) fn inside(&self, numbers: [f64; 4]) -> [f64; 4] {
        self.0.map(|column| numbers.get(column.index).map_or(f64::NAN, |value| column.inside(*value)))
    }

    /// Reads a heading: the units of the named columns, and the order if all four are named.
    /// A title without column names changes nothing. A comment counts only if it names all four.
    pub(super) fn read(&mut self, line: &str, is_comment: bool) -> Result<(), HeadingError> {
        let fields = fields(line);
        let headings: Vec<&str> = fields.iter().map(String::as_str).collect();
        let mut found: [Option<FoundColumn>; 4] = [None; 4];
        let mut wrong = None;
        for (index, place) in found.iter_mut().enumerate() {
            let (quantity, names) = MAP_COLUMNS[index];
            match find_columns(&headings, [WantedColumn { quantity, names, kind: KINDS[index] }]) {
                Ok([column]) => *place = Some(column),
                Err(HeadingError::Missing { .. }) => {}
                Err(error) => wrong = wrong.or(Some(error)),
            }
        }
        let known = found.iter().flatten().count() + usize::from(wrong.is_some());
        if is_comment && known < found.len() {
            return Ok(());
        }
        if let Some(error) = wrong {
            return Err(error);
        }
        let ordered = headings.len() == found.len() && known == found.len();
        for (place, column) in self.0.iter_mut().zip(found) {
            let Some(column) = column else { continue };
            place.unit = column.unit;
            if ordered {
                place.index = column.index;
            }
        }
        Ok(())
    }
}

/// Headings between blanks, commas and semicolons; a unit after a blank belongs to the name before it.
fn fields(line: &str) -> Vec<String> {
    let mut fields: Vec<String> = Vec::new();
    for word in
        line.split(|c: char| c.is_whitespace() || matches!(c, ',' | ';')).filter(|word| !word.is_empty())
    {
        match fields.last_mut().filter(|_| word.starts_with(['[', '('])) {
            Some(name) => name.push_str(word),
            None => fields.push(word.to_owned()),
        }
    }
    fields
}
