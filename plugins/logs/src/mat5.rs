//! MATLAB data of level 5 (`save`, `save -v7`): vectors of numbers, also in structures. Vectors of equal length form a table. A matrix becomes
//! one column per column of it.

use crate::table_head::MAX_COLUMNS;
use crate::tables::column_log::{Chunk, ColumnTable, check_columns_file, column_log};
use mapper_recording::logs::limits::{MAX_UNPACKED_BYTES, max_memory_bytes};
use mapper_recording::logs::{Log, LogError, LogFile, LogFinding, LogFormat, LogOptions};
use mapper_table::{is_mat5, read_mat5};

pub(crate) const FORMAT: LogFormat = LogFormat { name: NAME, recognises: is_mat5, open, write: None };

const NAME: &str = "MATLAB";

type NamedColumn = (String, Vec<f64>);

fn open(file: &LogFile, options: &LogOptions) -> Result<Box<dyn Log>, LogError> {
    check_columns_file(file, NAME, options)?;
    let size = file.size_bytes()?;
    let bytes = file.head(usize::try_from(MAX_UNPACKED_BYTES).unwrap_or(usize::MAX))?;
    let damaged = |why| file.content_error(NAME, format!("it is damaged: {why}; save it again"));
    let content = read_mat5(&bytes, max_memory_bytes(size)).map_err(damaged)?;
    let mut left_out = content.left_out;
    let mut columns: Vec<NamedColumn> = Vec::new();
    for array in content.arrays {
        let count = if array.rows == 1 || array.columns == 1 { 1 } else { array.columns };
        if array.values.len() / count.max(1) < 2 {
            left_out += 1;
        } else if columns.len() + count > MAX_COLUMNS {
            return Err(damaged(format!("it has more than {MAX_COLUMNS} columns")));
        } else if count == 1 {
            columns.push((array.name, array.values));
        } else {
            let named = array.values.chunks(array.rows).enumerate();
            columns.extend(
                named.map(|(index, column)| (format!("{}_{}", array.name, index + 1), column.to_vec())),
            );
        }
    }
    let mut tables: Vec<Vec<NamedColumn>> = Vec::new();
    for column in columns {
        match tables.iter_mut().find(|table| table.iter().any(|(_, first)| first.len() == column.1.len())) {
            Some(table) => table.push(column),
            None => tables.push(vec![column]),
        }
    }
    let mut problems = Vec::new();
    if left_out > 0 {
        problems.push(LogFinding::left_out(left_out, "texts, cells, objects, complex or single numbers"));
    }
    let tables = tables.into_iter().map(|mut table| {
        remove_common_prefix(&mut table);
        let rows = table.first().map_or(0, |(_, values)| values.len());
        let (names, columns) = table.into_iter().map(|(name, values)| (name, Chunk::Numbers(values))).unzip();
        ColumnTable { title: format!("{rows} values"), head: vec![names], rows, columns, clock: None }
    });
    column_log(file, (NAME, "vectors"), tables.collect(), problems, options)
}

/// Shortens the names of one structure: `log.t`, `log.T2` become `t`, `T2`.
fn remove_common_prefix(table: &mut [NamedColumn]) {
    let prefix = |name: &str| name.rfind('.').map(|at| name[..=at].to_owned());
    let Some(first) = table.first().and_then(|(name, _)| prefix(name)) else { return };
    if table.iter().all(|(name, _)| prefix(name).as_deref() == Some(&first)) {
        table.iter_mut().for_each(|(name, _)| *name = name.split_off(first.len()));
    }
}
