//! Names, units and the first row of data of a table, found from its first rows.

use mapper_recording::logs::{LogFinding, LogOptions};
use mapper_table::{
    DateOrder, bare_unit, header_unit, is_missing, is_units_row, is_units_row_of_names, joined_units,
    number_with_unit, parse_instant, read_number, split_unit, typical_length, with_unknown_units,
};
use std::collections::BTreeMap;

pub(crate) const MAX_COLUMNS: usize = 10_000;

#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct TableHead {
    pub(crate) columns: Vec<HeadColumn>,
    pub(crate) data_row: usize,
    /// Unit after each number of a column, if the cells have one.
    pub(crate) cell_units: BTreeMap<usize, String>,
    pub(crate) findings: Vec<LogFinding>,
}

#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct HeadColumn {
    pub(crate) name: String,
    pub(crate) header: String,
    pub(crate) unit: Option<String>,
    pub(crate) description: String,
}

pub(crate) fn analyse_head(
    rows: &[Vec<String>],
    decimal: u8,
    options: &LogOptions,
) -> Result<TableHead, String> {
    let length = typical_length(rows);
    let given_row = options.data_row.map(|row| row - 1);
    let data_row = given_row
        .or_else(|| first_data_row(rows, length, decimal))
        .ok_or("no rows of numbers were found; state the first one (`data_row`)")?;
    let rows = &without_comment_signs(rows, data_row, length);
    let header: Vec<usize> = header_rows(rows, data_row, length);
    let units_row = match options.units_row {
        Some(row) => row.checked_sub(1),
        None => {
            let may_be_units = |row: &usize| Some(*row + 1) != options.names_row;
            // Next to a row of names two known units are enough.
            let is_next_to_names = |row: &usize| {
                let known = rows[*row].iter().filter(|cell| header_unit(bare_unit(cell)).is_some()).count();
                header.len() > 1 && known > 1 && is_units_row_of_names(&rows[*row])
            };
            let all = || header.iter().copied().filter(may_be_units);
            all().find(|row| is_units_row(&rows[*row])).or_else(|| all().skip(1).find(is_next_to_names))
        }
    };
    let group_row = group_row(rows, &header, length);
    // Names have letters, unless no row has any.
    let has_names = header.iter().any(|row| Some(*row) != units_row && has_words(&rows[*row]));
    let others = || {
        header.iter().copied().filter(|row| Some(*row) != units_row && (!has_names || has_words(&rows[*row])))
    };
    let names_row = options.names_row.map(|row| row - 1).or_else(|| names_row(rows, others().collect()));
    let width = rows.get(data_row..).unwrap_or_default().iter().map(Vec::len).max().unwrap_or(0).max(length);
    if width > MAX_COLUMNS {
        return Err(format!("it has {width} columns; at most {MAX_COLUMNS} are read"));
    }
    let cell = |row: Option<usize>, column: usize| {
        row.and_then(|row| rows.get(row)).and_then(|row| row.get(column)).map_or("", String::as_str)
    };
    let labels: Vec<usize> =
        group_row.into_iter().chain(others().filter(|row| Some(*row) != names_row)).collect();
    let distant_units = if units_row.is_none() && options.units_row.is_none() {
        distant_units_row(rows, header.first().copied().unwrap_or(data_row), length)
    } else {
        None
    };
    let preamble = rows.get(..header.first().copied().unwrap_or(data_row)).unwrap_or_default();
    let mut cell_units: BTreeMap<usize, String> = BTreeMap::new();
    let list = if names_row.is_none() { channel_list(preamble, width) } else { ChannelList::default() };
    let header_of = |column: usize| match list.names.get(column) {
        Some(name) => name.clone(),
        None => one_line(cell(names_row, column)),
    };
    let headers: Vec<String> = (0..width).map(header_of).collect();
    let stated = if units_row.is_none() { with_unknown_units(&headers) } else { headers.clone() };
    let names: Vec<String> = stated.iter().map(|header| split_unit(header).0).collect();
    let mut columns: Vec<HeadColumn> = Vec::new();
    let mut seen: BTreeMap<String, usize> = BTreeMap::new();
    let mut repeated = 0;
    for (column, (header, stated)) in headers.into_iter().zip(&stated).enumerate() {
        let own_unit = bare_unit(cell(units_row, column));
        let (mut name, mut unit) = split_unit(stated);
        if units_row.is_some() {
            // `T2 (upper)` is a name if the units have their own row.
            (name, unit) =
                if own_unit.is_empty() && unit.is_some() { (name, unit) } else { (header.clone(), None) };
            unit = unit.or(Some(own_unit.to_owned()).filter(|unit| !unit.is_empty()));
        }
        if let Some(cell_unit) = unit_in_cells(rows.get(data_row..).unwrap_or_default(), column, decimal) {
            unit = unit.or(Some(cell_unit.clone()));
            cell_units.insert(column, cell_unit);
        }
        unit = unit.or_else(|| {
            Some(cell(distant_units, column).to_owned()).filter(|unit| header_unit(unit).is_some())
        });
        unit = unit.or_else(|| list.units.get(column).cloned().filter(|unit| !unit.is_empty()));
        if name.is_empty() {
            name = format!("column {}", column + 1);
        }
        // The group distinguishes columns with the same name.
        let is_repeated = names.iter().filter(|other| **other == name).count() > 1;
        // Merged cells may have two rows: the machine, and the place below it.
        let above = labels.iter().filter(|row| group_row == Some(**row) || Some(**row) < names_row);
        let mut from = 0;
        let mut group: Vec<&str> = Vec::new();
        for row in above {
            let (start, text) = label(rows, *row, column, is_repeated, from);
            group.extend((!text.is_empty() && !group.contains(&text)).then_some(text));
            from = start;
        }
        if !group.is_empty() && is_repeated {
            name = format!("{} {name}", group.join(" "));
        }
        let count = seen.entry(name.clone()).or_default();
        *count += 1;
        if *count > 1 {
            repeated += 1;
            name = format!("{name} ({count})");
        }
        let listed = listed_name(preamble, &header);
        let description: Vec<&str> = labels
            .iter()
            .map(|row| label(rows, *row, column, is_repeated, 0).1)
            .chain(listed)
            .filter(|text| !text.is_empty())
            .collect();
        columns.push(HeadColumn { header, name, unit, description: description.join(", ") });
    }
    // Separators at the ends of lines make columns without name and cells.
    let empty = |column: usize| {
        rows.get(data_row..)
            .unwrap_or_default()
            .iter()
            .all(|row| row.get(column).is_none_or(String::is_empty))
    };
    while columns.last().is_some_and(|column| column.header.is_empty()) && empty(columns.len() - 1) {
        columns.pop();
    }
    let found =
        HeadRows { names_row, units_row, distant_units, group_row, header: &header, data_row, repeated };
    let findings = findings(&found, &columns, cell_units.len());
    Ok(TableHead { columns, data_row, cell_units, findings })
}

struct HeadRows<'a> {
    names_row: Option<usize>,
    units_row: Option<usize>,
    /// Row of units that is not next to the names.
    distant_units: Option<usize>,
    group_row: Option<usize>,
    header: &'a [usize],
    data_row: usize,
    repeated: usize,
}

fn findings(found: &HeadRows<'_>, columns: &[HeadColumn], cell_units: usize) -> Vec<LogFinding> {
    let has_units = columns.iter().any(|column| column.unit.is_some());
    let mut findings = vec![LogFinding::Header {
        names_row: found.names_row.map(|row| row + 1),
        units_row: found.units_row.map(|row| row + 1),
        units_in_names: found.units_row.is_none() && has_units,
        data_row: found.data_row + 1,
    }];
    if let Some(row) = found.distant_units.filter(|_| has_units) {
        findings.push(LogFinding::DistantUnits { row: row + 1 });
    }
    if cell_units > 0 {
        findings.push(LogFinding::UnitsInCells { columns: cell_units });
    }
    let before = found.group_row.or(found.header.first().copied()).unwrap_or(found.data_row);
    if before > 0 {
        findings.push(LogFinding::SkippedRows { rows: before });
    }
    if found.repeated > 0 {
        findings.push(LogFinding::RepeatedNames { names: found.repeated });
    }
    findings
}

/// Names and units of the columns from a list above the table.
#[derive(Default)]
struct ChannelList {
    names: Vec<String>,
    units: Vec<String>,
}

/// The list of channels above a table without names: `Channel : Turbo Speed` or `Ch1 = Turbo Speed [rpm]` for each column, with or without
/// the clock before them.
fn channel_list(preamble: &[Vec<String>], width: usize) -> ChannelList {
    let mut values: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for row in preamble {
        let text =
            row.iter().filter(|cell| !cell.is_empty()).map(String::as_str).collect::<Vec<_>>().join(" ");
        let Some((key, value)) = text.split_once([':', '=']) else { continue };
        let is_mark = |letter: char| letter.is_ascii_digit() || "#;%/ _".contains(letter);
        let key = key.trim_matches(is_mark).to_lowercase();
        values.entry(key).or_default().push(one_line(value));
    }
    let is_of_columns = |found: &&Vec<String>| found.len() == width || found.len() + 1 == width;
    let with_clock = |found: &Vec<String>, clock: &str| {
        let missing = (found.len() < width).then(|| clock.to_owned());
        missing.into_iter().chain(found.iter().cloned()).collect::<Vec<String>>()
    };
    let names = |found: &Vec<String>| {
        let mut words: Vec<&String> =
            found.iter().filter(|name| name.contains(char::is_alphabetic)).collect();
        words.sort();
        words.dedup();
        words.len()
    };
    let is_units = |key: &str| key.contains("unit") || key.contains("einheit");
    let lists = values.iter().filter(|(key, _)| !is_units(key)).map(|(_, found)| found).filter(is_of_columns);
    let Some(best) = lists.max_by_key(|found| names(found)).filter(|found| 2 * names(found) > width) else {
        return ChannelList::default();
    };
    let units = values.iter().find(|(key, found)| is_units(key) && found.len() == best.len());
    ChannelList {
        names: with_clock(best, "Time"),
        units: units.map(|(_, found)| with_clock(found, "")).unwrap_or_default(),
    }
}

/// The long name in a list of channels above the table: the cell after the name.
fn listed_name<'a>(preamble: &'a [Vec<String>], name: &str) -> Option<&'a str> {
    let row =
        preamble.iter().find(|row| !name.is_empty() && row.first().is_some_and(|first| first == name))?;
    row.get(1).map(String::as_str).filter(|text| text.chars().any(char::is_alphabetic))
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn without_comment_signs(rows: &[Vec<String>], data_row: usize, length: usize) -> Vec<Vec<String>> {
    let mut rows = rows.to_vec();
    for row in rows.iter_mut().take(data_row) {
        if let Some(joined) = joined_units(row, length) {
            *row = joined;
        }
        let Some(first) = row.first() else { continue };
        let bare = first.trim_start_matches(['#', '%', '/']).trim_start().to_owned();
        if bare.len() == first.len() || header_unit(first).is_some() {
            continue;
        }
        if bare.is_empty() && row.len() > length {
            row.remove(0);
        } else if let (Some(first), false) = (row.first_mut(), bare.is_empty()) {
            *first = bare;
        }
    }
    rows
}

/// The row of groups above the header: words with empty cells between them, each above the first column of its group.
fn group_row(rows: &[Vec<String>], header: &[usize], length: usize) -> Option<usize> {
    let row = header.first()?.checked_sub(1)?;
    let cells = rows.get(row)?;
    let filled: Vec<usize> = (0..cells.len()).filter(|column| !cells[*column].is_empty()).collect();
    let apart = filled.windows(2).all(|pair| pair[1] > pair[0] + 1);
    // A row of the preamble has a name with its value next to it.
    let groups = filled.len() > 1 && apart;
    let words = filled.iter().all(|column| cells[*column].chars().any(char::is_alphabetic));
    (groups && words && cells.len() <= length && 2 * filled.len() < length).then_some(row)
}

fn distant_units_row(rows: &[Vec<String>], before: usize, length: usize) -> Option<usize> {
    let filled = |row: &[String]| row.iter().filter(|cell| !cell.is_empty()).count();
    (0..before.min(rows.len())).rev().find(|row| {
        let row = &rows[*row];
        row.len() + 2 >= length && 2 * filled(row) > length && is_units_row(row)
    })
}

fn unit_in_cells(rows: &[Vec<String>], column: usize, decimal: u8) -> Option<String> {
    let cells = rows.iter().filter_map(|row| row.get(column)).filter(|cell| !is_missing(cell.as_bytes()));
    let (mut unit, mut with, mut all) = (None, 0usize, 0usize);
    for cell in cells {
        all += 1;
        let Some((_, found)) = number_with_unit(cell, decimal) else { continue };
        with += 1;
        if *unit.get_or_insert(found) != found {
            return None;
        }
    }
    unit.filter(|_| 2 * with > all).map(str::to_owned)
}

/// The label of a column in a row, and where its group begins, not before `from`. A row of groups, which is sparse or above repeated names,
/// labels only the first column of a group.
fn label(rows: &[Vec<String>], row: usize, column: usize, is_repeated: bool, from: usize) -> (usize, &str) {
    let Some(cells) = rows.get(row) else { return (from, "") };
    let sparse = 2 * cells.iter().filter(|cell| !cell.is_empty()).count() < cells.len();
    let own = cells.get(column).map_or("", String::as_str);
    if !own.is_empty() || !(sparse || is_repeated) {
        return (if own.is_empty() { from } else { column }, own);
    }
    let before = cells.iter().enumerate().take(column).skip(from);
    before.rev().find(|(_, cell)| !cell.is_empty()).map_or((from, ""), |(at, cell)| (at, cell.as_str()))
}

/// The first full row with nearly the maximum number of distinct names: later rows have long names, and rows above have merged cells.
fn names_row(rows: &[Vec<String>], mut candidates: Vec<usize>) -> Option<usize> {
    let filled =
        |row: &usize| rows.get(*row).map_or(0, |row| row.iter().filter(|cell| !cell.is_empty()).count());
    let names = |row: &usize| distinct(rows.get(*row));
    let longest = candidates.iter().map(filled).max()?;
    candidates.retain(|row| 10 * filled(row) >= 8 * longest);
    let most = candidates.iter().map(names).max().filter(|most| *most > 0)?;
    candidates.into_iter().find(|row| 10 * names(row) >= 8 * most)
}

fn distinct(row: Option<&Vec<String>>) -> usize {
    let mut cells: Vec<&String> = row.into_iter().flatten().filter(|cell| !cell.is_empty()).collect();
    cells.sort();
    cells.dedup();
    cells.len()
}

fn header_rows(rows: &[Vec<String>], data_row: usize, length: usize) -> Vec<usize> {
    let like_a_header = |row: &usize| {
        let cells = &rows[*row];
        let filled = cells.iter().filter(|cell| !cell.is_empty()).count();
        // A row of the preamble has a name and a value.
        cells.len() + 2 >= length && (filled > 2 || filled + 1 >= length)
    };
    // A row such as a section title may be between the header and the data.
    let is_header = |row: &usize| like_a_header(row) && has_words(&rows[*row]);
    let end = (0..data_row.min(rows.len())).rev().find(is_header).map_or(0, |last| last + 1);
    let mut header: Vec<usize> = (0..end).rev().take_while(like_a_header).take(6).collect();
    header.reverse();
    header
}

fn has_words(row: &[String]) -> bool {
    row.iter().any(|cell| cell.chars().any(char::is_alphabetic))
}

fn first_data_row(rows: &[Vec<String>], length: usize, decimal: u8) -> Option<usize> {
    let mut data: Vec<bool> = rows.iter().map(|row| is_data(row, length, decimal)).collect();
    // Rows of a preamble may have numbers after a name, but the table's rows start with a number or a time.
    let has_values: Vec<bool> =
        (0..length).map(|column| is_value_column(rows, &data, column, decimal)).collect();
    for (row, is) in rows.iter().zip(&mut data) {
        let word = |(column, cell): (usize, &String)| {
            has_values.get(column) == Some(&true) && !is_missing(cell.as_bytes()) && !is_value(cell, decimal)
        };
        *is &= !row.iter().enumerate().any(word);
    }
    (0..rows.len()).find(|row| {
        let following = data.get(*row..(*row + 10).min(data.len())).unwrap_or_default();
        data[*row] && 10 * following.iter().filter(|is| **is).count() >= 8 * following.len()
    })
}

fn is_value_column(rows: &[Vec<String>], data: &[bool], column: usize, decimal: u8) -> bool {
    let cells = rows.iter().zip(data).filter(|(_, is)| **is).filter_map(|(row, _)| row.get(column));
    let (mut values, mut all) = (0usize, 0usize);
    for cell in cells.filter(|cell| !is_missing(cell.as_bytes())) {
        all += 1;
        values += usize::from(is_value(cell, decimal));
    }
    all >= 10 && 10 * values >= 9 * all
}

fn is_value(cell: &str, decimal: u8) -> bool {
    read_number(cell, decimal).is_some()
        || parse_instant(cell, DateOrder::DayFirst).is_some()
        || parse_instant(cell, DateOrder::MonthFirst).is_some()
}

fn is_data(row: &[String], length: usize, decimal: u8) -> bool {
    let filled = row.iter().filter(|cell| !is_missing(cell.as_bytes()));
    let (mut values, mut words) = (0, 0);
    for cell in filled {
        *(if is_value(cell, decimal) { &mut values } else { &mut words }) += 1;
    }
    row.len() + 2 >= length && values > 0 && values >= words
}
