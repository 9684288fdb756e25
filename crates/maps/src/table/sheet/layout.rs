//! Detects the layout of a table: its headings, and whether speed lines are below each other or side by side.

use crate::table::column::{Column, ColumnError, Machine, column, with_machine_letters};
use crate::table::description::DescribedColumns;
use crate::table::quantity::{Quantity, is_end_title};
use crate::table::sheet::grid::{Grid, GridRow};
use crate::table::sheet::headings::{Headings, speed_in, without_speed};
use mapper_core::unit_factors::PERCENT;
use mapper_core::{ImportError, ImportRemark};
use mapper_table::is_missing_mark;
use std::borrow::Cow;

/// Columns of one block: all of a table, or those of one speed line if lines are side by side.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Group {
    pub(crate) columns: Vec<Column>,
    /// How many columns at the end it shares with the other groups.
    pub(crate) shared: usize,
    pub(crate) speed_rpm: Option<f64>,
    /// Number of cells of every row if the table has no headings; else 0.
    pub(crate) bare_cells: usize,
}

impl Group {
    /// The columns that it does not share.
    pub(crate) fn own_columns(&self) -> &[Column] {
        self.columns.split_at(self.columns.len() - self.shared).0
    }

    pub(crate) fn speed_column(&self) -> Option<usize> {
        self.columns
            .iter()
            .position(|column| matches!(column.quantity, Quantity::Speed | Quantity::ReducedSpeed))
    }

    fn has(&self, quantities: &[Quantity]) -> bool {
        self.columns.iter().any(|column| quantities.contains(&column.quantity))
    }

    fn has_flow(&self) -> bool {
        self.has(&[Quantity::Flow, Quantity::VolumeFlow, Quantity::ReducedFlow, Quantity::TurbineFlow])
    }

    fn is_measured(&self) -> bool {
        !self.has(&[Quantity::PressureRatio]) && (self.has_compressor() || self.has_turbine())
    }

    fn has_all(&self, quantities: &[Quantity]) -> bool {
        quantities.iter().all(|quantity| self.has(&[*quantity]))
    }

    fn has_compressor(&self) -> bool {
        self.has_all(&[Quantity::P1, Quantity::P2, Quantity::T1])
    }

    fn has_turbine(&self) -> bool {
        self.has_all(&[Quantity::P3, Quantity::P4, Quantity::T3])
    }

    pub(crate) fn is_complete(&self) -> bool {
        self.has_flow() && (self.has(&[Quantity::PressureRatio]) || self.is_measured())
    }
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Layout {
    pub(crate) groups: Vec<Group>,
    pub(crate) first_row: usize,
    pub(crate) remarks: Vec<ImportRemark>,
}

impl Layout {
    fn below(headings: &Headings, groups: Vec<Group>) -> Layout {
        let used: Vec<usize> =
            groups.iter().flat_map(|group| &group.columns).map(|column| column.index).collect();
        let remarks = headings.remarks(&used).collect();
        Layout { groups, first_row: headings.first_row, remarks }
    }

    /// Whether the points are measured values that are not corrected.
    pub(crate) fn is_measured(&self) -> bool {
        self.groups.iter().any(Group::is_measured)
    }

    pub(crate) fn is_turbine_alone(&self) -> bool {
        let is_turbine = |group: &Group| {
            if group.is_measured() {
                !group.has_compressor()
            } else {
                !group.has(&[Quantity::Flow, Quantity::VolumeFlow, Quantity::ReducedFlow])
            }
        };
        self.groups.iter().any(is_turbine)
    }

    /// Whether speed and flow are reduced quantities, which need no reference state.
    pub(crate) fn needs_no_reference(&self) -> bool {
        self.groups
            .iter()
            .all(|group| group.has(&[Quantity::ReducedSpeed]) && group.has(&[Quantity::ReducedFlow]))
    }
}

/// Detects the layout of a table; the cells are transposed if the headings are in the first column.
pub(crate) fn detect_layout<'a>(
    grid: &'a Grid,
    described: &DescribedColumns,
) -> Result<(Cow<'a, Grid>, Layout), ImportError> {
    let found = layout(grid, described);
    if let Ok(Some(layout)) = found {
        return Ok((Cow::Borrowed(grid), layout));
    }
    if let Some(transposed) = grid.transposed()
        && let Ok(Some(layout)) = layout(&transposed, described)
        && layout.groups.iter().all(|group| group.bare_cells == 0)
    {
        return Ok((Cow::Owned(transposed), layout));
    }
    Err(found.err().unwrap_or(ImportError::Empty))
}

fn layout(grid: &Grid, described: &DescribedColumns) -> Result<Option<Layout>, ImportError> {
    if let Some(layout) = layout_by_column_numbers(grid, described)? {
        return Ok(Some(layout));
    }
    // The row with the most columns that is not a complete heading: number of columns and index.
    let mut incomplete: Option<(usize, usize)> = None;
    for (index, row) in grid.rows.iter().enumerate() {
        if described.machine == Machine::Compressor && is_turbine_title(row) {
            return Err(ImportError::Turbine { line: row.at, text: row.text().chars().take(60).collect() });
        }
        // A table below the title of the surge line is not the map.
        let above = index.checked_sub(1).and_then(|above| grid.rows.get(above));
        if above.is_some_and(|above| {
            !above.is_comment && is_end_title(&above.text()) && !is_heading(described, above)
        }) {
            continue;
        }
        let headings = Headings::of(grid, index, row);
        if let Some(groups) = side_by_side(grid, described, index, &headings.cells)
            .or_else(|| by_speed(grid, described, index, &headings.cells))
        {
            return Ok(Some(Layout::below(&headings, groups)));
        }
        let known = match columns(described, &headings.names) {
            Ok(known) => known,
            // Only a row of headings can have a wrong unit.
            Err(error) if is_reported(described, row, &error) => return Err(column_error(row, error)),
            Err(_) => continue,
        };
        let group = Group { columns: known, ..Group::default() };
        if group.is_complete() && (!row.is_comment || group.columns.len() >= 3) {
            return with_heading(grid, described, index, headings, group).map(Some);
        }
        if group.columns.len() >= 2 && incomplete.is_none_or(|(count, _)| group.columns.len() > count) {
            incomplete = Some((group.columns.len(), index));
        }
    }
    let heading = incomplete.and_then(|(_, index)| grid.rows.get(index));
    if let Some(layout) = heading_in_usual_order(grid, described, incomplete) {
        return Ok(Some(layout));
    }
    if let Some(row) = heading.filter(|row| !row.is_comment) {
        return Err(ImportError::NoColumn {
            line: row.at,
            missing: missing_quantity(described, row),
            found: row.cells.join(", ").chars().take(120).collect(),
        });
    }
    layout_without_headings(grid, described)
}

/// A heading above rows of four numbers that names only the first columns of the usual order.
fn heading_in_usual_order(
    grid: &Grid,
    described: &DescribedColumns,
    incomplete: Option<(usize, usize)>,
) -> Option<Layout> {
    let mut layout = layout_without_headings(grid, described).ok().flatten()?;
    let (_, index) = incomplete?;
    let group = layout.groups.first_mut()?;
    let cells = &grid.rows.get(index)?.cells;
    let named = columns(described, cells).ok()?;
    // A name that is not known is that of another quantity.
    let is_all = cells.iter().filter(|cell| cell.contains(char::is_alphabetic)).count() == named.len();
    let in_order = is_all
        && named
            .iter()
            .zip(&group.columns)
            .all(|(named, usual)| named.index == usual.index && named.quantity == usual.quantity);
    if !in_order || index >= layout.first_row {
        return None;
    }
    for (place, named) in group.columns.iter_mut().zip(named) {
        *place = named;
    }
    Some(layout)
}

/// Whether to report a mistake in a row: a comment may contain any words, and two of them by chance.
fn is_reported(described: &DescribedColumns, row: &GridRow, error: &ColumnError) -> bool {
    match (row.is_comment, error) {
        (false, ColumnError::Turbine { .. }) => true,
        (true, ColumnError::Unit { .. }) => named_cells(described, row) > 2,
        _ => is_heading(described, row),
    }
}

fn column_error(row: &GridRow, error: ColumnError) -> ImportError {
    match error {
        ColumnError::Turbine { heading } => ImportError::Turbine { line: row.at, text: heading },
        error @ ColumnError::Unit { .. } => ImportError::Row { line: row.at, source: Box::new(error) },
    }
}

/// Whether a title names a turbine and no compressor.
fn is_turbine_title(row: &GridRow) -> bool {
    let text = row.text().to_lowercase();
    let numbers = row.cells.iter().filter(|cell| cell.parse::<f64>().is_ok()).count();
    // A title may hold a reference state.
    let is_title = numbers == 0 || text.trim_start().starts_with("turbine map");
    is_title
        && (text.contains("turbine") || text.contains("turbina"))
        && text.contains("map")
        && !text.contains("compressor")
}

/// The columns with recognised headings. Of two with the same quantity a map needs the total or corrected one, a table of measured points
/// the total or measured one; else the first counts.
pub(crate) fn columns(described: &DescribedColumns, cells: &[String]) -> Result<Vec<Column>, ColumnError> {
    let spellings = with_machine_letters(cells, described.bare_is_compressor);
    let (mut all, mut wrong): (Vec<Column>, Vec<ColumnError>) = (Vec::new(), Vec::new());
    for (index, cell) in
        cells.iter().enumerate().filter(|(_, cell)| cell.contains(char::is_alphabetic) || cell.contains('%'))
    {
        let spelling = spellings.get(index).unwrap_or(cell);
        match described.column_read_as(index, cell, spelling) {
            Ok(column) => all.extend(column),
            Err(error @ ColumnError::Turbine { .. }) => return Err(error),
            Err(error) => wrong.push(error),
        }
    }
    // A second column of a quantity is not needed, so its unit may be unknown.
    let is_missing = |error: &ColumnError| matches!(error, ColumnError::Unit { quantity, .. } if !all.iter().any(|column| column.quantity == *quantity));
    if let Some(error) = wrong.into_iter().find(is_missing) {
        return Err(error);
    }
    let has = |quantity: Quantity| all.iter().any(|column| column.quantity == quantity);
    let is_map = has(Quantity::PressureRatio);
    // Readings are corrected here, so that a corrected flow among them would be corrected twice.
    let is_measured = !is_map && (has(Quantity::P2) || has(Quantity::P3));
    all.retain(|column| {
        !(is_measured
            && column.is_corrected()
            && matches!(column.quantity, Quantity::Speed | Quantity::Flow | Quantity::TurbineFlow))
    });
    let rank = |column: &Column| (column.is_command(), column.is_static(), column.is_corrected() != is_map);
    let mut columns: Vec<Column> = Vec::new();
    for column in all {
        match columns.iter_mut().find(|known| known.quantity == column.quantity) {
            Some(known) if rank(&column) < rank(known) => *known = column,
            Some(_) => {}
            None => columns.push(column),
        }
    }
    let stated = columns.clone();
    columns.iter_mut().for_each(|column| column.share_unit(&stated));
    Ok(columns)
}

pub(crate) fn is_heading(described: &DescribedColumns, row: &GridRow) -> bool {
    named_cells(described, row) > 1
}

/// How many cells of a row without numbers name quantities.
fn named_cells(described: &DescribedColumns, row: &GridRow) -> usize {
    let named = |cell: &&String| {
        cell.contains(char::is_alphabetic) && !matches!(column(0, cell, described.machine), Ok(None))
    };
    // `Speed line 60,000 rpm` is a title.
    let is_number =
        |cell: &String| cell.contains(|c: char| c.is_ascii_digit()) && !cell.contains(char::is_alphabetic);
    let has_number = row.cells.iter().any(is_number);
    if has_number { 0 } else { row.cells.iter().filter(named).count() }
}

fn missing_quantity(described: &DescribedColumns, row: &GridRow) -> &'static str {
    let known = columns(described, &row.cells).unwrap_or_default();
    let group = Group { columns: known, ..Group::default() };
    if group.has_flow() { "pressure ratio (or P1, P2 and T1)" } else { "flow" }
}

/// The layout below a heading: its units may be in a row of their own; without a speed column each block has its speed in a title.
fn with_heading(
    grid: &Grid,
    described: &DescribedColumns,
    index: usize,
    headings: Headings,
    mut group: Group,
) -> Result<Layout, ImportError> {
    let units_row = grid.rows.get(headings.first_row.saturating_sub(1));
    if let Some(below) = units_row.filter(|_| headings.cells != headings.names) {
        group.columns = columns(described, &headings.cells).map_err(|error| column_error(below, error))?;
    }
    let title_above = index
        .checked_sub(1)
        .and_then(|above| grid.rows.get(above))
        .and_then(|above| speed_of_title(grid, described, above, &group));
    if group.speed_column().is_none() {
        let mut below = grid.rows.iter().skip(headings.first_row);
        let has_title = below.any(|row| speed_of_title(grid, described, row, &group).is_some());
        if title_above.is_none() && !has_title {
            return Err(ImportError::NoColumn {
                line: grid.rows.get(index).map_or(1, |row| row.at),
                missing: "corrected speed",
                found: headings.names.join(", ").chars().take(120).collect(),
            });
        }
        group.speed_rpm = title_above;
    }
    Ok(Layout::below(&headings, vec![group]))
}

/// Lines side by side: pairs of flow and pressure ratio (X and Y in files of digitisers), each with its speed above.
fn side_by_side(
    grid: &Grid,
    described: &DescribedColumns,
    index: usize,
    headings: &[String],
) -> Option<Vec<Group>> {
    let is_letter = |cell: &String| matches!(cell.to_lowercase().as_str(), "x" | "y");
    let filled: Vec<(usize, &String)> =
        headings.iter().enumerate().filter(|(_, cell)| !cell.is_empty()).collect();
    let by_letter = filled.len() >= 2 && filled.iter().all(|(_, cell)| is_letter(cell));
    let quantity = |index: usize, cell: &String| {
        let letter = match cell.to_lowercase().as_str() {
            "x" if by_letter => Some(Quantity::Flow),
            "y" if by_letter => Some(Quantity::PressureRatio),
            _ => None,
        };
        let column = described.column(index, cell).ok().flatten();
        let by_letter = || described.with_unit(Column::bare(index, letter?)).ok();
        column.or_else(by_letter)
    };
    let mut groups: Vec<Group> = Vec::new();
    for (index, cell) in &filled {
        let Some(column) = quantity(*index, cell) else { continue };
        match groups.last_mut().filter(|group| !group.has(&[column.quantity])) {
            Some(group) => group.columns.push(column),
            None => groups.push(Group { columns: vec![column], ..Group::default() }),
        }
    }
    if groups.len() < 2
        || !groups.iter().all(Group::is_complete)
        || groups.iter().any(|group| group.speed_column().is_some())
    {
        return None;
    }
    let above = grid.rows.get(index.checked_sub(1)?)?;
    for group in &mut groups {
        let columns = group.columns.iter().map(|column| column.index);
        let mut cells = columns.filter_map(|index| above.cells.get(index)).filter(|cell| !cell.is_empty());
        group.speed_rpm = cells.find_map(|cell| speed_in(grid, cell));
    }
    groups.iter().all(|group| group.speed_rpm.is_some()).then_some(groups)
}

/// One group of columns for each speed, which the headings or the row above them hold; columns without a speed belong to all.
fn by_speed(
    grid: &Grid,
    described: &DescribedColumns,
    index: usize,
    headings: &[String],
) -> Option<Vec<Group>> {
    let above = index.checked_sub(1).and_then(|above| grid.rows.get(above));
    let (mut shared, mut groups, mut title_speed) = (Vec::new(), Vec::<Group>::new(), None);
    for (place, heading) in headings.iter().enumerate() {
        let title = above.and_then(|row| row.cells.get(place)).filter(|cell| !cell.is_empty());
        title_speed = title.map_or(title_speed, |cell| speed_in(grid, cell));
        let (name, speed_rpm) = match without_speed(grid, heading) {
            Some((name, own)) => (name, Some(own)),
            None => (heading.clone(), title_speed),
        };
        match (described.column(place, &name).ok()?, speed_rpm) {
            (None, _) => {}
            (Some(column), None) => shared.push(column),
            (Some(column), Some(speed_rpm)) => {
                match groups.iter_mut().find(|group| group.speed_rpm == Some(speed_rpm)) {
                    Some(group) => group.columns.push(column),
                    None => {
                        let speed_rpm = Some(speed_rpm);
                        groups.push(Group { columns: vec![column], speed_rpm, ..Group::default() });
                    }
                }
            }
        }
    }
    for group in &mut groups {
        let shared_columns =
            shared.iter().filter(|column| !group.has(&[column.quantity])).cloned().collect::<Vec<_>>();
        group.shared = shared_columns.len();
        group.columns.extend(shared_columns);
    }
    let is_line = |group: &Group| group.is_complete() && group.speed_column().is_none();
    (groups.len() > 1 && groups.iter().all(is_line)).then_some(groups)
}

/// The speed in the title of a block, rpm: `N = 60000 rpm`, `60 krpm`, or a number alone.
pub(crate) fn speed_of_title(
    grid: &Grid,
    described: &DescribedColumns,
    row: &GridRow,
    group: &Group,
) -> Option<f64> {
    if group.speed_column().is_some()
        || is_heading(described, row)
        || vane_of_title(grid, described, row).is_some()
    {
        return None;
    }
    let filled: Vec<&String> = row.cells.iter().filter(|cell| !is_missing_mark(cell)).collect();
    let numbers = filled.iter().filter(|cell| grid.number(cell).is_some()).count();
    (numbers <= 1 && filled.len() <= 4).then(|| speed_in(grid, &row.text())).flatten()
}

/// The vane position in the title of a block of a turbine map: `VGT position 40 %`.
pub(crate) fn vane_of_title(grid: &Grid, described: &DescribedColumns, row: &GridRow) -> Option<f64> {
    if described.machine == Machine::Compressor || is_heading(described, row) {
        return None;
    }
    let text = row.text().replace('%', " %");
    let is_vane = |word: &str| matches!(described.column(0, word), Ok(Some(column)) if column.quantity == Quantity::Vane);
    let words: Vec<&str> = text
        .split(|c: char| c.is_whitespace() || matches!(c, '=' | ':' | '[' | ']' | '(' | ')'))
        .filter(|word| !word.is_empty())
        .collect();
    let numbers: Vec<f64> = words.iter().filter_map(|word| grid.number(word)).collect();
    let [number] = numbers.as_slice() else { return None };
    let factor = if words.contains(&"%") { 1.0 / PERCENT } else { 1.0 };
    (words.len() <= 5 && words.iter().any(|word| is_vane(word))).then_some(factor * number)
}

fn layout_by_column_numbers(
    grid: &Grid,
    described: &DescribedColumns,
) -> Result<Option<Layout>, ImportError> {
    let columns =
        described.numbered().map_err(|error| ImportError::Row { line: 1, source: Box::new(error) })?;
    let group = Group { columns, ..Group::default() };
    if !group.is_complete() || group.speed_column().is_none() {
        return Ok(None);
    }
    let is_point = |row: &GridRow| {
        let number =
            |column: &Column| row.cells.get(column.index).and_then(|cell| grid.number(cell)).is_some();
        !row.is_comment && group.columns.iter().all(number)
    };
    let first_row = grid.rows.iter().position(is_point);
    Ok(first_row.map(|first_row| Layout { groups: vec![group], first_row, remarks: Vec::new() }))
}

/// Maximum number of cells. Bound: SAE text may have a temperature or a vane position after the efficiency; a wider row is another table.
const MAX_BARE_CELLS: usize = 6;

/// The layout without headings: corrected rpm, corrected kg/s, pressure ratio, and the efficiency if there is a fourth column.
fn layout_without_headings(grid: &Grid, described: &DescribedColumns) -> Result<Option<Layout>, ImportError> {
    let numbers = |row: &GridRow| row.cells.iter().filter(|cell| grid.number(cell).is_some()).count();
    let first = grid
        .rows
        .iter()
        .position(|row| !row.is_comment && numbers(row) >= 3 && numbers(row) == row.cells.len());
    let Some(first_row) = first else {
        return match grid.rows.iter().find(|row| !row.is_comment) {
            None => Ok(None),
            Some(row) => Err(ImportError::RowForm {
                line: row.at,
                text: row.text().chars().take(60).collect(),
                form: "a row of numbers or of headings: speed, flow, pressure ratio, efficiency",
            }),
        };
    };
    let order = [Quantity::Speed, Quantity::Flow, Quantity::PressureRatio, Quantity::Efficiency];
    let row = grid.rows.get(first_row).map_or(&[][..], |row| row.cells.as_slice());
    if row.len() < order.len() || row.len() > MAX_BARE_CELLS {
        let at = grid.rows.get(first_row).map_or(1, |row| row.at);
        return Err(ImportError::RowForm {
            line: at,
            text: row.join(" ").chars().take(60).collect(),
            form: "four numbers: corrected rpm, corrected kg/s, pressure ratio, efficiency; name the columns in a heading",
        });
    }
    let columns = order.into_iter().enumerate();
    let columns = columns.map(|(index, quantity)| described.with_unit(Column::bare(index, quantity)));
    let columns: Result<_, _> = columns.collect();
    let columns = columns.map_err(|error| ImportError::Row { line: 1, source: Box::new(error) })?;
    let group = Group { columns, bare_cells: row.len(), ..Group::default() };
    let mut remarks = vec![ImportRemark::NoHeading];
    if row.len() > order.len() {
        remarks.push(ImportRemark::FurtherColumns { count: row.len() - order.len() });
    }
    Ok(Some(Layout { groups: vec![group], first_row, remarks }))
}
