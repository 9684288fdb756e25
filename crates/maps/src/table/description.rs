//! The description of a table of points, and the columns that it describes.

use crate::table::column::{Column, ColumnError, MAX_HEADING, Machine, column, is_unit_of, parts};
use crate::table::quantity::{Quantity, parse_reference};
use mapper_core::{
    DescribedColumn, ImportError, ImportRemark, ImportedColumn, ImportedMap, ImportedTurbine, MapDescription,
    ReferenceState,
};
use mapper_yaml::keys::{self, Key, KeyError, store};
use mapper_yaml::units::{Kind, parse};
use mapper_yaml::{Document, FindingKind, Findings, Schema, Source, steps};
use serde_json::{Map, Value, json};
use std::fmt::Write;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// Maximum size of a map description, bytes. Bound: memory; one of all keys has two kilobytes.
const MAX_BYTES: usize = 1 << 16;

static DOCUMENT: Document = Document { name: "map description", example: "docs/reference/files.md" };
static SCHEMA: LazyLock<Schema> = LazyLock::new(|| Schema::new(schema()));

/// A column, which takes its heading, number or unit.
macro_rules! column {
    ($name:literal, $example:literal) => {
        Key {
            name: $name,
            description: "Column by its heading (`X [lb/min]`) or number (`#2 [kg/s]`), or the unit alone.",
            example: $example,
            set: |given, text| set_column(given, $name, text),
        }
    };
}

const KEYS: [Key<MapDescription>; 30] = [
    Key {
        name: "reference",
        description: "Reference state of the corrected quantities: SAE, Garrett, BorgWarner, or temperature and pressure.",
        example: "298 K, 100 kPa",
        set: |given, text| store(&mut given.reference, parse_reference(text).ok()),
    },
    Key {
        name: "sheet",
        description: "Sheet of a workbook; the first visible one with numbers if none is named.",
        example: "Map",
        set: |given, text| store(&mut given.sheet, Some(text.to_owned())),
    },
    Key {
        name: "design_speed",
        description: "Corrected speed of the design point, for files with relative speeds.",
        example: "150000 rpm",
        set: |given, text| store(&mut given.design.speed_corrected_rpm, positive(Kind::Speed, text)),
    },
    Key {
        name: "design_flow",
        description: "Corrected flow of the design point; the flows of the file are scaled to it.",
        example: "0.2 kg/s",
        set: |given, text| store(&mut given.design.flow_corrected_kg_s, positive(Kind::MassFlow, text)),
    },
    Key {
        name: "design_pressure_ratio",
        description: "Pressure ratio of the design point.",
        example: "2.4",
        set: |given, text| {
            let ratio = text.parse().ok().filter(|ratio: &f64| *ratio > 1.0 && ratio.is_finite());
            store(&mut given.design.pressure_ratio, ratio)
        },
    },
    Key {
        name: "design_efficiency",
        description: "Efficiency of the design point.",
        example: "74 %",
        set: |given, text| {
            let eta = positive(Kind::Fraction, text).or_else(|| text.parse().ok());
            store(&mut given.design.eta, eta.filter(|eta| *eta > 0.0 && *eta <= 1.0))
        },
    },
    Key {
        name: "inlet_pipe",
        description: "Inner diameter of the pipe at P1, if P1 is a static pressure.",
        example: "45 mm",
        set: |given, text| store(&mut given.static_taps.inlet_diameter_m, positive(Kind::Length, text)),
    },
    Key {
        name: "outlet_pipe",
        description: "Inner diameter of the pipe at P2, if P2 is a static pressure.",
        example: "38 mm",
        set: |given, text| store(&mut given.static_taps.outlet_diameter_m, positive(Kind::Length, text)),
    },
    Key {
        name: "barometer",
        description: "Ambient pressure, if P1 or P2 are gauge pressures and no column has it.",
        example: "98.6 kPa",
        set: |given, text| store(&mut given.ambient_pa, positive(Kind::Pressure, text)),
    },
    column!("speed", "N [krpm]"),
    column!("reduced_speed", "N/sqrt(T) [rpm/K^0.5]"),
    column!("flow", "lb/min"),
    column!("volume_flow", "V [m3/h]"),
    column!("reduced_flow", "kg/s*K^0.5/kPa"),
    column!("pressure_ratio", "Y"),
    column!("efficiency", "#4 [%]"),
    column!("vane", "VGT [%]"),
    column!("p1", "P1 [kPa]"),
    column!("p2", "P2 [kPa]"),
    column!("t1", "T1 [degC]"),
    column!("t2", "T2 [degC]"),
    column!("tc", "Tc [degC]"),
    column!("humidity", "RH [%]"),
    column!("ambient_pressure", "p_amb [mbar]"),
    column!("p3", "P3 [kPa]"),
    column!("p4", "P4 [kPa]"),
    column!("t3", "T3 [degC]"),
    column!("t4", "T4 [degC]"),
    column!("turbine_flow", "m_t [kg/s]"),
    column!("oil_temperature", "T_oil [degC]"),
];

fn positive(kind: Kind, text: &str) -> Option<f64> {
    parse(kind, text).ok().filter(|value| *value > 0.0)
}

fn set_column(description: &mut MapDescription, quantity: &'static str, text: &str) -> Option<()> {
    if text.is_empty() {
        return None;
    }
    description.columns.retain(|column| column.quantity != quantity);
    description.columns.push(DescribedColumn { quantity, text: text.to_owned() });
    Some(())
}

/// Adds a statement to a description.
pub fn set_key(description: &mut MapDescription, key: &str, value: &str) -> Result<(), KeyError> {
    keys::set_key(&KEYS, description, key, value.trim())
}

/// Why a map description cannot be read.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum DescriptionError {
    #[error("failed to read the map description {}: {}", .0.display(), .1)]
    Read(PathBuf, #[source] io::Error),
    #[error("{0}")]
    Mistakes(Box<Findings>),
}

/// Reads the file of a map description.
pub fn read_description(path: &Path) -> Result<MapDescription, DescriptionError> {
    let mistakes = |findings| DescriptionError::Mistakes(Box::new(findings));
    let text = mapper_yaml::open(&DOCUMENT, path, MAX_BYTES)
        .map_err(|source| DescriptionError::Read(path.to_owned(), source))?
        .map_err(mistakes)?;
    description_from_yaml(&text, path).map_err(mistakes)
}

/// Reads a map description; `origin` names it in messages.
pub fn description_from_yaml(text: &str, origin: &Path) -> Result<MapDescription, Findings> {
    let (tree, mut notes) = mapper_yaml::read(Source::new(&DOCUMENT, origin, text))?;
    SCHEMA.check(&tree, &mut notes);
    let mut description = MapDescription::default();
    if notes.is_empty() {
        for key in tree.keys(&[]) {
            let steps = steps![key];
            let number = || tree.get(&steps).and_then(Value::as_f64).map(|number| number.to_string());
            let text = tree.text(&steps).map(str::to_owned).or_else(number).unwrap_or_default();
            let Err(error) = set_key(&mut description, key, &text) else { continue };
            let remedy = KEYS.iter().find(|row| row.name == key).map_or("", |row| row.description);
            notes.push(tree.finding(FindingKind::WrongValue, &steps, error.to_string(), remedy));
        }
    }
    if notes.is_empty() { Ok(description) } else { Err(tree.findings(notes)) }
}

fn schema() -> Value {
    let property = |key: &Key<MapDescription>| {
        let value =
            json!({"type": ["string", "number"], "description": key.description, "examples": [key.example]});
        (key.name.to_owned(), value)
    };
    let properties: Map<String, Value> = KEYS.iter().map(property).collect();
    json!({"type": "object", "minProperties": 1, "properties": properties, "additionalProperties": false})
}

/// Map description of an imported map: all detected and assumed properties, for the user to correct.
pub fn description_text(file_name: &str, found: &ImportedMap, given: &MapDescription) -> String {
    text_of_description(file_name, Some(found.map.reference), &found.columns, &found.remarks, given)
}

/// As [`description_text`], for a turbine map.
pub fn turbine_description_text(file_name: &str, found: &ImportedTurbine, given: &MapDescription) -> String {
    text_of_description(file_name, given.reference, &found.columns, &found.remarks, given)
}

fn text_of_description(
    file_name: &str,
    reference: Option<ReferenceState>,
    columns: &[ImportedColumn],
    remarks: &[ImportRemark],
    given: &MapDescription,
) -> String {
    let mut text = format!(
        "# Map description of {file_name}. Give it to a command as its description, or in a campaign as\n\
         # `map: {{file: {file_name}, description: FILE, reference: ...}}`. Keys and units: docs/reference/files.md.\n"
    );
    let mut line = |key: &str, value: &str| {
        let _ = writeln!(text, "{key}: {}", Value::from(value));
    };
    if let Some(state) = reference {
        line("reference", &format!("{} K, {} Pa", state.t_ref_k, state.p_ref_pa));
    }
    if let Some(sheet) = &given.sheet {
        line("sheet", sheet);
    }
    let design = given.design;
    for (key, value, unit) in [
        ("design_speed", design.speed_corrected_rpm, " rpm"),
        ("design_flow", design.flow_corrected_kg_s, " kg/s"),
        ("design_pressure_ratio", design.pressure_ratio, ""),
        ("design_efficiency", design.eta, ""),
        ("inlet_pipe", given.static_taps.inlet_diameter_m, " m"),
        ("outlet_pipe", given.static_taps.outlet_diameter_m, " m"),
    ] {
        if let Some(value) = value {
            line(key, &format!("{value}{unit}"));
        }
    }
    let in_percent = remarks.contains(&ImportRemark::EfficiencyInPercent);
    let has_speed = columns.iter().any(|column| column.key.ends_with("speed"));
    for column in columns {
        let unit = match column.unit.as_str() {
            "" if column.key == "efficiency" && in_percent => "%",
            // A turbine speed whose size indicated a reduced speed stays without a unit.
            "" if remarks.contains(&ImportRemark::SpeedParameterAssumed) && column.key == "speed" => "",
            "" => default_unit(column.key),
            unit => unit,
        };
        let has_unit = column.heading.contains(unit) && !column.unit.is_empty();
        // For lines side by side, `columns` has the first line only.
        if column.heading.is_empty() && !has_speed {
            if !unit.is_empty() {
                line(column.key, unit);
            }
            continue;
        }
        let place =
            if column.heading.is_empty() { format!("#{}", column.number) } else { column.heading.clone() };
        let unit = if has_unit || unit.is_empty() { String::new() } else { format!(" [{unit}]") };
        line(column.key, &format!("{place}{unit}"));
    }
    for column in given.columns.iter().filter(|_| columns.is_empty()) {
        line(column.quantity, &column.text);
    }
    text
}

/// The unit of a column without one.
fn default_unit(key: &str) -> &'static str {
    match key {
        "speed" => "rpm",
        "flow" => "kg/s",
        _ => "",
    }
}

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
    /// Whether places without the letter of a machine (`P1`) are the compressor's next to those of the turbine (`P1T`).
    pub(crate) bare_is_compressor: bool,
}

impl DescribedColumns {
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
        Ok(DescribedColumns { statements, machine, bare_is_compressor: false })
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_example_is_a_value_of_its_key_and_nonsense_is_none() {
        for key in KEYS {
            set_key(&mut MapDescription::default(), key.name, key.example).unwrap();
        }
        for (key, value) in
            [("design_speed", "150000"), ("design_efficiency", "1.4"), ("flow", " "), ("x", "1")]
        {
            assert!(set_key(&mut MapDescription::default(), key, value).is_err(), "{key}: {value}");
        }
    }

    #[test]
    fn a_file_has_the_same_keys_and_its_mistakes_have_places() {
        let text = "reference: SAE\ndesign_speed: 150 krpm\nflow: \"X [lb/min]\"\n";
        let read = description_from_yaml(text, Path::new("x.yaml")).unwrap();
        assert_eq!(read.design.speed_corrected_rpm, Some(150e3));
        assert_eq!(read.columns, [DescribedColumn { quantity: "flow", text: "X [lb/min]".to_owned() }]);
        for wrong in ["design_speed: fast\n", "flows: kg/s\n", "- flow\n", ""] {
            assert!(description_from_yaml(wrong, Path::new("x.yaml")).unwrap_err().count() > 0, "{wrong}");
        }
    }
}
