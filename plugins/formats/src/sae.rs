//! SAE text, compressor (J1826, J922): `#` comments, then corrected rpm, corrected kg/s, pressure ratio, efficiency in a
//! row, from choke to surge within a line.
//!
//! Manufacturers' files may begin with a title, a row of two wheel diameters and column names. These are skipped,
//! except for the units in the names.

mod columns;

use crate::heading::{efficiency_in_comment, heading};
use crate::lines::{Row, map_of_rows, room_for_one_more};
use crate::reference;
use columns::Columns;
use mapper_core::{CompressorMap, ExportError, ImportError, MapFormat, ReferenceState};
use mapper_yaml::units::HeadingError;
use std::fmt::Write;

pub(crate) const FORMAT: MapFormat = MapFormat {
    name: "sae",
    extension: "txt",
    further_extensions: &["map", "sae", "dat"],
    description: "SAE text: corrected rpm, corrected kg/s, pressure ratio, efficiency, from choke to surge",
    write: Some(write),
    draw: None,
    read: Some(read),
};

/// The form of a row.
const ROW_FORM: &str = "four numbers: corrected rpm, corrected kg/s, pressure ratio, efficiency";

fn write(map: &CompressorMap) -> Result<Vec<u8>, ExportError> {
    let mut text = heading(map, "#");
    let all = || map.lines.iter().flat_map(|line| &line.points);
    let without = all().filter(|point| point.eta.is_none()).count();
    if without > 0 {
        let _ = writeln!(
            text,
            "# {without} points without efficiency are left out: the format has no place for them"
        );
    }
    text.push_str("# N(rpm) mdot(kg/s) PR Eff\n");
    for line in &map.lines {
        // Points are stored by rising flow; the format goes from choke to surge.
        for point in line.points.iter().rev() {
            let Some(eta) = point.eta else { continue };
            // Shortest text that reads back to the same number.
            let _ = writeln!(
                text,
                "{} {} {} {eta}",
                line.speed_corrected_rpm, point.flow_corrected_kg_s, point.pressure_ratio
            );
        }
    }
    Ok(text.into_bytes())
}

fn read(text: &str, given: Option<ReferenceState>) -> Result<CompressorMap, ImportError> {
    let (mut rows, mut found, mut machine) = (Vec::new(), None, String::new());
    let mut efficiency = None;
    let mut columns = Columns::default();
    let mut heading_allowed = true;
    for (index, line) in text.lines().enumerate() {
        let at = index + 1;
        let (content, comment) = match line.split_once('#') {
            Some((content, comment)) => (content.trim(), Some(comment)),
            None => (line.trim(), None),
        };
        let units = |source: HeadingError| ImportError::Row { line: at, source: source.into() };
        if let Some(comment) = comment {
            if heading_allowed {
                columns.read(comment, true).map_err(units)?;
            }
            found = found.or_else(|| reference::in_comment(comment));
            efficiency = efficiency.or_else(|| efficiency_in_comment(comment));
            if let Some((_, name)) = comment.split_once("compressor map of ") {
                machine = name.trim().chars().take(200).collect();
            }
        }
        if content.is_empty() {
            continue;
        }
        match four_numbers(content) {
            Some(numbers) => {
                let [speed_corrected_rpm, flow_corrected_kg_s, pressure_ratio, eta] = columns.inside(numbers);
                room_for_one_more(rows.len(), at)?;
                let row =
                    Row { at, speed_corrected_rpm, flow_corrected_kg_s, pressure_ratio, eta: Some(eta) };
                row.check()?;
                rows.push(row);
                heading_allowed = false;
            }
            None if heading_allowed && is_heading(content) => columns.read(content, false).map_err(units)?,
            None => {
                let shown: String = content.chars().take(60).collect();
                return Err(ImportError::RowForm { line: at, text: shown, form: ROW_FORM });
            }
        }
    }
    let map = map_of_rows(machine, &rows, found, given)?;
    Ok(CompressorMap { efficiency, ..map })
}

/// Text, or two numbers as the wheel's diameters; three numbers or five are a broken row.
fn is_heading(content: &str) -> bool {
    let numbers = content.split_whitespace().filter(|field| field.parse::<f64>().is_ok()).count();
    numbers < content.split_whitespace().count() || numbers == 2
}

fn four_numbers(content: &str) -> Option<[f64; 4]> {
    let mut fields =
        content.split(|c: char| c.is_whitespace() || matches!(c, ',' | ';')).filter(|f| !f.is_empty());
    let mut numbers = [0.0; 4];
    for number in &mut numbers {
        *number = fields.next()?.parse().ok()?;
    }
    fields.next().is_none().then_some(numbers)
}
