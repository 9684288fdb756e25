//! Columns and rows of MDF files, common to both versions.

use mapper_recording::logs::{Column, Layout, LogError, LogFile, Row, RowSink};
use std::collections::BTreeSet;

const MAX_CHANNELS: usize = 10_000;

/// Maximum length of a comment, characters.
const MAX_DESCRIPTION: usize = 200;

/// Refuses a file with too many channels.
pub(crate) fn check_channel_count(file: &LogFile, name: &'static str, count: usize) -> Result<(), LogError> {
    if count > MAX_CHANNELS {
        return Err(
            file.content_error(name, format!("it has {count} channels; at most {MAX_CHANNELS} are read"))
        );
    }
    Ok(())
}

/// The column of a channel. A name that the group already has is numbered.
pub(crate) fn column(
    names: &mut BTreeSet<String>,
    [header, unit, description]: [&str; 3],
    group: usize,
) -> Column {
    let mut name = header.to_owned();
    let mut number = 1usize;
    while !names.insert(name.clone()) {
        number += 1;
        name = format!("{header} ({number})");
    }
    Column {
        name,
        header: header.to_owned(),
        unit: Some(unit.trim().to_owned()).filter(|unit| !unit.is_empty()),
        description: description.chars().take(MAX_DESCRIPTION).collect(),
        group,
    }
}

/// The wanted channels of a group; `channels` has one for each column of the layout.
pub(crate) fn wanted_channels<'a, T>(
    layout: &Layout,
    wanted: &[usize],
    channels: &'a [T],
    group: usize,
) -> Vec<&'a T> {
    layout.members(group, wanted).into_iter().filter_map(|column| channels.get(column)).collect()
}

/// Forwards rows of columns that begin together; values in `missing` mark missing readings.
pub(crate) fn forward_rows(
    group: usize,
    times_s: impl Iterator<Item = f64>,
    columns: &[Vec<f64>],
    missing: &[f64],
    sink: &mut RowSink<'_>,
) -> Result<(), LogError> {
    let mut values: Vec<f64> = Vec::new();
    for (row, t_s) in times_s.enumerate() {
        values.clear();
        values.extend(columns.iter().map(|column| {
            let value = column.get(row).copied().unwrap_or(f64::NAN);
            if missing.contains(&value) { f64::NAN } else { value }
        }));
        sink(Row { group, t_s, values: &values })?;
    }
    Ok(())
}
