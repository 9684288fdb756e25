//! Determines separator and decimal sign of a text by trial.

use crate::notation::instant::parse_instant;
use crate::notation::number::{is_missing, read_number};
use mapper_recording::logs::DateOrder;

/// Candidate separators, in order of preference for equal scores.
pub(crate) const SEPARATORS: [u8; 5] = [b'\t', b';', b',', b'|', b' '];

/// Score of rows as a table: cells with numbers or times in a typical row, times the share of rows of that length.
pub(crate) fn score(rows: &[Vec<String>], separator: u8) -> f64 {
    let length = typical_length(rows);
    if length == 0 || rows.is_empty() {
        return 0.0;
    }
    let fitting: Vec<&Vec<String>> = rows.iter().filter(|row| row.len() == length).collect();
    let useful = |row: &Vec<String>| row.iter().filter(|cell| is_value(cell, separator)).count() as f64;
    let mut counts: Vec<f64> = fitting.iter().map(|row| useful(row)).collect();
    counts.sort_by(f64::total_cmp);
    let typical = counts.get(counts.len() / 2).copied().unwrap_or(0.0);
    let share = fitting.len() as f64 / rows.len() as f64;
    typical * (typical / length as f64) * share * share
}

/// The most frequent number of cells in a row.
pub(crate) fn typical_length(rows: &[Vec<String>]) -> usize {
    let mut lengths: Vec<usize> = rows.iter().map(Vec::len).collect();
    lengths.sort_unstable();
    lengths.chunk_by(|a, b| a == b).max_by_key(|same| (same.len(), same[0])).map_or(0, |same| same[0])
}

fn is_value(cell: &str, separator: u8) -> bool {
    let bytes = cell.as_bytes();
    read_number(cell, b'.').is_some()
        || separator != b',' && read_number(cell, b',').is_some()
        || is_missing(bytes) && !cell.is_empty()
        || parse_instant(cell, DateOrder::DayFirst).is_some()
        || parse_instant(cell, DateOrder::MonthFirst).is_some()
}

/// The decimal sign of the cells; the second value is whether any cell contains it.
pub(crate) fn decimal(rows: &[Vec<String>]) -> (u8, bool) {
    let (mut points, mut commas) = (0usize, 0usize);
    for cell in rows.iter().flatten() {
        let (point, comma) = (cell.rfind('.'), cell.rfind(','));
        match (point, comma) {
            (Some(point), Some(comma)) if comma > point => {
                commas += 100 * usize::from(read_number(cell, b',').is_some())
            }
            (Some(_), Some(_)) => points += 100 * usize::from(read_number(cell, b'.').is_some()),
            (Some(_), None) => points += usize::from(read_number(cell, b'.').is_some()),
            (None, Some(_)) => commas += usize::from(read_number(cell, b',').is_some()),
            (None, None) => {}
        }
    }
    if commas <= points { (b'.', points > 0) } else { (b',', true) }
}
