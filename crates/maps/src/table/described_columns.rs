//! The columns that a map description names.

use crate::table::column::{Column, ColumnError, MAX_HEADING, Machine, column, is_unit_of, parts};
use crate::table::quantity::Quantity;
use mapper_core::{ImportError, MapDescription};

/// A statement about one column.
#[derive(Debug, Clone, PartialEq)]
struct Statement {
    quantity: Quantity,
    place: ColumnPlace,
    unit: Option<String>,
}

#[derive(Debug, Clone, PartialEq)]
enum ColumnPlace {
    /// Column with this heading, with or without its unit.
    Heading { whole: String, name: String },
    /// Position, from 0.
    Number(usize),
    /// Any column that the reader recognises.
    Anywhere,
}

/// The columns of a map description.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct DescribedColumns {
    statements: Vec<Statement>,
    /// The machine of the map.
    pub(crate) machine: Machine,
}

impl DescribedColumns {
    /// # Errors
    /// [`ImportError::Description`] for an invalid column number, or a unit of another quantity.
    pub(crate) fn of(
        description: &MapDescription,
        machine: Machine,
    ) -> Result<DescribedColumns, ImportError> {
        let mut statements = Vec::new();
        for column in &description.columns {
            let wrong = |problem: String| ImportError::Description {
                key: column.quantity,
                text: column.text.chars().take(60).collect(),
                problem,
            };
            let Some(quantity) = Quantity::of_key(column.quantity) else { continue };
            let text = column.text.trim();
            let (place, unit) = if is_unit_of(quantity, text) {
                (ColumnPlace::Anywhere, Some(text.to_owned()))
            } else if let Some(numbered) = text.strip_prefix('#') {
                let end = numbered.find(|c: char| !c.is_ascii_digit()).unwrap_or(numbered.len());
                let number: Option<usize> = numbered[..end].parse().ok().filter(|number| *number > 0);
                let number = number.ok_or_else(|| {
                    wrong("is not the number of a column; write e.g. `#2 [kg/s]`".to_owned())
                })?;
                let unit = numbered[end..].trim().trim_matches(['[', ']', '(', ')']).to_owned();
                (ColumnPlace::Number(number - 1), (!unit.is_empty()).then_some(unit))
            } else {
                let (name, unit) = parts(text);
                (ColumnPlace::Heading { whole: plain(text), name: plain(&name) }, unit)
            };
            if let Some(unit) = unit.as_ref().filter(|unit| !is_unit_of(quantity, unit)) {
                return Err(wrong(format!(
                    "has the unit `{unit}`, which is not a unit of {}; write one of {}",
                    quantity.name(),
                    quantity.unit_list()
                )));
            }
            statements.push(Statement { quantity, place, unit });
        }
        Ok(DescribedColumns { statements, machine })
    }

    /// The column of a heading: as described, or as its name suggests.
    pub(crate) fn column(&self, index: usize, heading: &str) -> Result<Option<Column>, ColumnError> {
        self.column_read_as(index, heading, heading)
    }

    /// As [`DescribedColumns::column`], if the other headings give this one the meaning of another spelling.
    pub(crate) fn column_read_as(
        &self,
        index: usize,
        heading: &str,
        spelling: &str,
    ) -> Result<Option<Column>, ColumnError> {
        let heading_plain = plain(heading);
        let described = self.statements.iter().find(|statement| match &statement.place {
            ColumnPlace::Heading { whole, name } => {
                heading_plain == *whole || heading_plain == *name || plain(&parts(heading).0) == *whole
            }
            ColumnPlace::Number(number) => *number == index,
            ColumnPlace::Anywhere => false,
        });
        if let Some(statement) = described {
            let unit = statement.unit.clone().or_else(|| parts(heading).1);
            return Column::with_unit(index, statement.quantity, heading, unit.as_deref()).map(Some);
        }
        let found =
            column(index, spelling, self.machine)?.filter(|found| !self.has_place_for(found.quantity));
        let written = |mut found: Column| {
            found.heading = heading.chars().take(MAX_HEADING).collect();
            self.with_unit(found)
        };
        found.map(written).transpose()
    }

    /// A column without a unit has the described one.
    pub(crate) fn with_unit(&self, column: Column) -> Result<Column, ColumnError> {
        let stated = self.statements.iter().find(|statement| {
            statement.place == ColumnPlace::Anywhere && statement.quantity.is_same_quantity(column.quantity)
        });
        match stated {
            Some(Statement { quantity, unit: Some(unit), .. }) if !column.has_unit() => {
                Column::with_unit(column.index, *quantity, &column.heading, Some(unit.as_str()))
            }
            _ => Ok(column),
        }
    }

    fn has_place_for(&self, quantity: Quantity) -> bool {
        self.statements.iter().any(|statement| {
            statement.place != ColumnPlace::Anywhere && statement.quantity.is_same_quantity(quantity)
        })
    }

    /// The columns that are described by their numbers.
    pub(crate) fn numbered(&self) -> Result<Vec<Column>, ColumnError> {
        let numbered = self.statements.iter().filter_map(|statement| match statement.place {
            ColumnPlace::Number(index) => Some((index, statement)),
            _ => None,
        });
        numbered
            .map(|(index, statement)| {
                Column::with_unit(index, statement.quantity, "", statement.unit.as_deref())
            })
            .collect()
    }
}

/// The heading in lower case without blanks, so that copies by hand match.
fn plain(heading: &str) -> String {
    heading.to_lowercase().split_whitespace().collect()
}
