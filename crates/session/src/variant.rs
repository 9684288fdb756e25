//! Variants of a machine, which a nightly campaign runs in turn instead of the nominal machine.

use mapper_campaign::Campaign;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

const SERIAL_NUMBER_COLUMN: &str = "serial_number";
/// Maximum size of a table of machines, bytes.
const MAX_TABLE_BYTES: usize = 10_000_000;
/// Maximum number of settings of one machine.
const MAX_COLUMNS: usize = 64;
/// First seed of drawn machines, far above those of campaigns. A machine keeps its own seed for any number of drawn machines.
const FIRST_DRAWN_SEED: u64 = 1_000_000;

/// One machine, as differences between the simulated machine and the campaign's declarations.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Variant {
    /// Its serial number, the key of its results.
    pub serial_number: String,
    /// Backend settings by path, e.g. `deviations.compressor_efficiency`: `-2 %`.
    pub settings: BTreeMap<String, String>,
}

/// Why the machines cannot be read.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum VariantError {
    #[error("failed to read the machines in {}: {}", .0.display(), .1)]
    Read(PathBuf, #[source] std::io::Error),
    #[error("{}: {}", .0.display(), .1)]
    Form(PathBuf, #[source] csv::Error),
    /// `problem`: with its correction.
    #[error("{}: {problem}", .path.display())]
    Table { path: PathBuf, problem: String },
    /// `there`: the value at that path.
    #[error(
        "machine {serial_number}: the campaign has no settings at `{key}`, but `{there}`; leave the column out, or change the campaign"
    )]
    Occupied { serial_number: String, key: String, there: String },
}

impl Variant {
    /// Reads a table: a header with `serial_number` and paths of settings below the campaign's backend, then one machine per row. Columns are
    /// separated by comma or semicolon; an empty cell keeps the campaign's value. Lines that begin with `#` are comments.
    ///
    /// # Errors
    /// `VariantError` with the line.
    pub fn read(path: &Path) -> Result<Vec<Variant>, VariantError> {
        let unread = |source| VariantError::Read(path.to_owned(), source);
        let bytes = mapper_yaml::read_limited(path, MAX_TABLE_BYTES).map_err(unread)?;
        let text = String::from_utf8(bytes).map_err(|error| unread(std::io::Error::other(error)))?;
        Self::from_text(&text, path)
    }

    fn from_text(text: &str, path: &Path) -> Result<Vec<Variant>, VariantError> {
        let wrong = |problem: String| VariantError::Table { path: path.to_owned(), problem };
        let (at, header) =
            (1..).zip(text.lines()).find(|(_, line)| !line.starts_with('#')).unwrap_or((1, ""));
        let delimiter = if header.contains(';') { ';' } else { ',' };
        let wrong_at = |line: u64, column: usize, problem: &str| {
            wrong(format!("{problem}\n{}", mark_cell(text, line, column, delimiter)))
        };
        // A row with too few or too many cells is marked after its last cell.
        let form = |error: csv::Error| match error.kind() {
            csv::ErrorKind::UnequalLengths { pos: Some(at), expected_len, len } => wrong_at(
                at.line(),
                usize::try_from(*expected_len.min(len)).unwrap_or(usize::MAX),
                &format!("line {}: {len} cells below a header of {expected_len}", at.line()),
            ),
            _ => VariantError::Form(path.to_owned(), error),
        };
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(delimiter as u8)
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .from_reader(text.trim_start_matches('\u{feff}').as_bytes());
        let columns: Vec<String> = reader.headers().map_err(form)?.iter().map(str::to_owned).collect();
        let Some(name) = columns.iter().position(|column| column == SERIAL_NUMBER_COLUMN) else {
            return Err(wrong_at(
                at,
                0,
                &format!("no column is called `{SERIAL_NUMBER_COLUMN}`; name each machine in one"),
            ));
        };
        if columns.len() > MAX_COLUMNS {
            return Err(wrong(format!("{} columns; at most {MAX_COLUMNS} are allowed", columns.len())));
        }
        if let Some(twice) = columns.iter().enumerate().find(|(i, column)| columns[..*i].contains(column)) {
            return Err(wrong_at(at, twice.0, &format!("the column `{}` appears twice", twice.1)));
        }
        let (mut machines, mut names) = (Vec::new(), BTreeSet::new());
        for row in reader.records() {
            let row = row.map_err(form)?;
            let line = row.position().map_or(0, csv::Position::line);
            let serial_number = row.get(name).unwrap_or_default().to_owned();
            if serial_number.is_empty() {
                return Err(wrong_at(
                    line,
                    name,
                    &format!("line {line}: the machine has no `{SERIAL_NUMBER_COLUMN}`"),
                ));
            }
            if !names.insert(serial_number.clone()) {
                let twice = format!("line {line}: the machine {serial_number} appears twice");
                return Err(wrong_at(line, name, &twice));
            }
            let settings = columns.iter().zip(&row).enumerate();
            let settings = settings
                .filter(|(place, (_, cell))| *place != name && !cell.is_empty())
                .map(|(_, (column, cell))| (column.clone(), cell.to_owned()))
                .collect();
            machines.push(Variant { serial_number, settings });
        }
        if machines.is_empty() {
            return Err(wrong("the table has no machines below its header".to_owned()));
        }
        Ok(machines)
    }

    /// Machines drawn from the campaign's declared tolerances. Repeated calls return the same machines.
    pub fn draw(campaign: &Campaign, count: usize) -> Vec<Variant> {
        let kind = campaign.machine.serial_number.as_deref().unwrap_or(&campaign.machine.name);
        (0..count)
            .map(|index| Variant {
                serial_number: format!("{kind}-drawn-{:04}", index + 1),
                settings: BTreeMap::from([
                    ("tolerances".to_owned(), "drawn".to_owned()),
                    ("tolerances_seed".to_owned(), (FIRST_DRAWN_SEED + index as u64).to_string()),
                ]),
            })
            .collect()
    }

    /// Puts the machine into a campaign.
    ///
    /// # Errors
    /// `VariantError::Occupied`. The backend itself checks for unknown settings.
    pub fn apply_to(&self, campaign: &mut Campaign) -> Result<(), VariantError> {
        campaign.machine.serial_number = Some(self.serial_number.clone());
        for (key, text) in &self.settings {
            let mut at = &mut campaign.backend.settings;
            for part in key.split('.') {
                if at.is_null() {
                    *at = Value::Object(Map::new());
                }
                let there = at.to_string();
                let Some(map) = at.as_object_mut() else {
                    let (serial_number, key) = (self.serial_number.clone(), key.clone());
                    return Err(VariantError::Occupied { serial_number, key, there });
                };
                at = map.entry(part).or_insert(Value::Null);
            }
            *at = parse_cell(text);
        }
        Ok(())
    }
}

/// A line of the table with a caret below the start of a cell, or after the last cell.
fn mark_cell(text: &str, line: u64, column: usize, delimiter: char) -> String {
    let number = line.to_string();
    let index = usize::try_from(line.saturating_sub(1)).unwrap_or(usize::MAX);
    let line = text.lines().nth(index).unwrap_or_default();
    let before: usize = line.split(delimiter).take(column).map(|cell| cell.chars().count() + 1).sum();
    let before = before.min(line.chars().count());
    format!("{number} | {line}\n{:width$} | {:before$}^", "", "", width = number.len())
}

/// A cell as YAML would read it: a number, or text.
fn parse_cell(text: &str) -> Value {
    if let Ok(whole) = text.parse::<u64>() {
        return json!(whole);
    }
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() => json!(number),
        _ => json!(text),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<Variant>, String> {
        Variant::from_text(text, Path::new("machines.csv")).map_err(|error| error.to_string())
    }

    #[test]
    fn separators_comments_and_empty_cells_are_read() {
        let comma = read("# production of May\nserial_number,deviations.convection\nA,+5 %\nB,\n").unwrap();
        let semicolon = read("serial_number; deviations.convection\nA; +5 %\nB;\n").unwrap();
        assert_eq!(comma, semicolon);
        assert_eq!(comma[0].settings["deviations.convection"], "+5 %");
        assert!(comma[1].settings.is_empty());
    }

    #[test]
    fn mistakes_are_reported_with_their_line() {
        for (text, expected) in [
            ("name,x\nA,1\n", "no column is called `serial_number`"),
            (
                "# of May\nserial_number,x,x\nA,1,2\n",
                "the column `x` appears twice\n2 | serial_number,x,x\n  |                 ^",
            ),
            ("x;serial_number\n1;A\n2;A\n", "line 3: the machine A appears twice\n3 | 2;A\n  |   ^"),
            ("serial_number,x\nA,1\n,2\n", "line 3: the machine has no `serial_number`\n3 | ,2\n  | ^"),
            ("serial_number,x\nA,1,2\n", "line 2: 3 cells below a header of 2\n2 | A,1,2\n  |     ^"),
            ("serial_number,x,y\nA,1\n", "line 2: 2 cells below a header of 3\n2 | A,1\n  |    ^"),
            ("serial_number,x\n", "the table has no machines below its header"),
            ("", "no column is called `serial_number`"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.contains(expected), "{text:?}: {error}");
        }
    }

    #[test]
    fn settings_replace_only_their_own_keys() {
        let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../campaigns/grid18.yaml"));
        let mut campaign = mapper_campaign::load(path).unwrap();
        campaign.backend.settings = json!({"noise": "none", "deviations": {"valve_area": "1 %"}});
        let settings =
            [("deviations.convection", "+5 %"), ("machine.alpha_area", "0.1"), ("tolerances_seed", "7")];
        let settings = settings.map(|(key, text)| (key.to_owned(), text.to_owned())).into();
        let machine = Variant { serial_number: "X-1".to_owned(), settings };
        machine.apply_to(&mut campaign).unwrap();
        assert_eq!(
            campaign.backend.settings,
            json!({
                "noise": "none", "deviations": {"valve_area": "1 %", "convection": "+5 %"},
                "machine": {"alpha_area": 0.1}, "tolerances_seed": 7
            })
        );
        assert_eq!(campaign.machine.serial_number.as_deref(), Some("X-1"));
        let settings = [("noise.of.t2".to_owned(), "1".to_owned())].into();
        let error =
            Variant { serial_number: "X-2".to_owned(), settings }.apply_to(&mut campaign).unwrap_err();
        assert!(error.to_string().contains("noise.of.t2"), "{error}");
    }
}
