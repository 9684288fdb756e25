//! Points of a sheet, from lists and from matrices.

use crate::table::column::{Column, Machine, column};
use crate::table::description::DescribedColumns;
use crate::table::quantity::{Quantity, end_in};
use crate::table::rows_to_lines::check_point_count;
use crate::table::sheet::end_blocks::{EndBlocks, RowUse};
use crate::table::sheet::grid::{Grid, GridRow};
use crate::table::sheet::headings::without_speed;
use crate::table::sheet::layout::{self, Layout};
use mapper_core::unit_factors::PERCENT;
use mapper_core::{ImportError, ImportRemark, ImportedColumn, LineEnd, ReferenceState};
use mapper_numerics::statistics::range;
use mapper_table::is_missing_mark;
use std::collections::HashMap;
use std::ops::Range;

/// Minimum median of efficiencies in per cent. Bound: fractions are at most 1, and usable points have at least 1 %.
pub(crate) const MIN_PERCENTAGE: f64 = 1.5;

pub(crate) struct Point<'a> {
    /// Line of the file, from 1.
    pub(crate) at: usize,
    columns: &'a [Column],
    pub(crate) speed: Option<f64>,
    pub(crate) vane: Option<f64>,
    values: Vec<Option<f64>>,
    /// End of the speed line, if a cell of the row names it.
    pub(crate) end: Option<LineEnd>,
    /// Whether it is a point of the surge line, from a block of its own.
    pub(crate) is_of_surge_line: bool,
}

impl Point<'_> {
    pub(crate) fn cell(&self, quantity: Quantity) -> Option<(&Column, f64)> {
        let position = self.columns.iter().position(|column| column.quantity == quantity)?;
        Some((self.columns.get(position)?, self.values.get(position).copied().flatten()?))
    }

    /// A value in SI and rpm, corrected to a reference state.
    pub(crate) fn value(&self, quantity: Quantity, reference: ReferenceState) -> Option<f64> {
        let (column, value) = self.cell(quantity)?;
        Some(column.to_corrected_si(value, reference))
    }
}

/// Marks of the format `fitted` for a node beyond the measured points, and for one that does not compress.
const NO_POINTS: [&str; 2] = ["extrapolated", "unusable"];

pub(crate) fn points<'a>(
    grid: &Grid,
    described: &DescribedColumns,
    layout: &'a Layout,
    blocks: &'a EndBlocks,
    remarks: &mut Vec<ImportRemark>,
) -> Result<Vec<Point<'a>>, ImportError> {
    let mut points = Vec::new();
    let (mut has_carried_speed, mut extrapolated) = (false, 0);
    // The title of the first block may be above the headings, which may have a row of units.
    let above = grid.rows.iter().take(layout.first_row).rev().take(3);
    let mut vane = above.filter_map(|row| layout::vane_of_title(grid, described, row)).next();
    for group in &layout.groups {
        let (mut speed, mut last_speed) = (group.speed_rpm, None);
        for (index, row) in grid.rows.iter().enumerate() {
            let row_use = blocks.use_of(index);
            if let RowUse::SurgeLine(columns) = row_use {
                points.extend(surge_point(grid, row, columns));
                continue;
            }
            if index < layout.first_row || row.is_comment || row_use == RowUse::Unused {
                continue;
            }
            let cell = |index: usize| row.cells.get(index).map_or("", String::as_str);
            let is_empty = group.own_columns().iter().all(|column| is_missing_mark(cell(column.index)));
            let is_title =
                layout.groups.len() == 1 && row.cells.iter().filter(|cell| !cell.is_empty()).count() == 1;
            if is_empty && !is_title {
                continue;
            }
            if let Some(position) = layout::vane_of_title(grid, described, row) {
                vane = Some(position);
                continue;
            }
            // A single number far from the table is not a point.
            if is_empty && group.speed_column().is_some() {
                continue;
            }
            if let Some(title_rpm) = layout::speed_of_title(grid, described, row, group) {
                speed = Some(title_rpm);
                continue;
            }
            // Each block may repeat the row of units.
            let above = layout.first_row.checked_sub(1).and_then(|above| grid.rows.get(above));
            if layout::is_heading(described, row) || above.is_some_and(|above| above.cells == row.cells) {
                continue;
            }
            if row.cells.iter().any(|cell| NO_POINTS.contains(&cell.as_str())) {
                extrapolated += 1;
                continue;
            }
            // A mean or the author's name below the table is not a point.
            let has_point = group.columns.iter().any(|column| {
                column.quantity != Quantity::Efficiency
                    && !column.quantity.is_optional()
                    && grid.number(cell(column.index)).is_some()
            });
            if !has_point
                && group.bare_cells == 0
                && row.cells.iter().any(|cell| cell.contains(char::is_alphabetic))
            {
                continue;
            }
            check_point_count(points.len(), row.at)?;
            let mut values = values(grid, row, group)?;
            if let Some(place) = group.speed_column().and_then(|position| values.get_mut(position)) {
                match place {
                    Some(own) => last_speed = Some(*own),
                    None => {
                        has_carried_speed = true;
                        *place = last_speed;
                    }
                }
            }
            let end = row.cells.iter().find_map(|cell| end_in(cell));
            let columns = group.columns.as_slice();
            points.push(Point { at: row.at, columns, speed, vane, values, end, is_of_surge_line: false });
        }
    }
    remarks.extend(blocks.remarks());
    if extrapolated > 0 {
        remarks.push(ImportRemark::ExtrapolatedNodes { count: extrapolated });
    }
    if has_carried_speed {
        remarks.push(ImportRemark::SpeedOfRowAbove);
    }
    Ok(points)
}

/// The point of a row below the title of the surge line; `None` for a row without numbers.
fn surge_point<'a>(grid: &Grid, row: &GridRow, columns: &'a [Column]) -> Option<Point<'a>> {
    let number = |column: &Column| row.cells.get(column.index).and_then(|cell| grid.number(cell));
    let values: Vec<Option<f64>> = columns.iter().map(number).collect();
    let is_point = !row.is_comment && values.iter().any(Option::is_some);
    let (at, end) = (row.at, Some(LineEnd::Surge));
    is_point.then_some(Point { at, columns, speed: None, vane: None, values, end, is_of_surge_line: true })
}

/// The numbers of a row by column.
fn values(grid: &Grid, row: &GridRow, group: &layout::Group) -> Result<Vec<Option<f64>>, ImportError> {
    let mut values = Vec::with_capacity(group.columns.len());
    for column in &group.columns {
        let text = row.cells.get(column.index).map_or("", String::as_str);
        let value = grid.number(text);
        if value.is_none() && !is_missing_mark(text) && !column.quantity.is_optional() {
            return Err(ImportError::NotANumber {
                line: row.at,
                quantity: column.quantity.name().to_owned(),
                text: text.chars().take(40).collect(),
            });
        }
        values.push(value);
    }
    let filled = row.cells.iter().filter(|cell| !cell.is_empty()).count();
    // Without headings all columns are required, and between blanks no cell can be empty: a shorter row is a mistake.
    let needed = group.columns.iter().map(|column| column.index + 1).max().unwrap_or(0);
    let is_short =
        group.bare_cells > 0 && filled != group.bare_cells || grid.is_blank_separated && filled < needed;
    if is_short {
        let text = row.text().chars().take(60).collect();
        return Err(ImportError::RowForm { line: row.at, text, form: ROW_FORM });
    }
    Ok(values)
}

const ROW_FORM: &str = "a row of corrected rpm, corrected kg/s, pressure ratio and efficiency";

/// Whether efficiencies without a unit are percentages: their median is far above 1.
pub(crate) fn efficiency_in_percent(layout: &Layout, points: &[Point<'_>]) -> bool {
    let named = layout.groups.iter().flat_map(|group| &group.columns);
    if named.clone().any(|column| {
        column.quantity == Quantity::Efficiency && (column.has_unit() || column.heading.is_empty())
    }) {
        return false;
    }
    let mut etas: Vec<f64> =
        points.iter().filter_map(|point| point.value(Quantity::Efficiency, ReferenceState::SAE)).collect();
    etas.sort_by(f64::total_cmp);
    etas.get(etas.len() / 2).is_some_and(|median| *median > MIN_PERCENTAGE)
        && etas.last().is_some_and(|last| *last <= PERCENT)
}

/// The columns with the range of their values; without a reference state reduced values are not converted.
pub(crate) fn columns(
    layout: &Layout,
    points: &[Point<'_>],
    reference: Option<ReferenceState>,
) -> Vec<ImportedColumn> {
    let mut columns: Vec<ImportedColumn> = Vec::new();
    for column in layout.groups.first().iter().flat_map(|group| &group.columns) {
        let value = |point: &Point<'_>| {
            let (column, value) = point.cell(column.quantity)?;
            Some(reference.map_or_else(
                || column.as_stated(value),
                |reference| column.to_corrected_si(value, reference),
            ))
        };
        let values = points.iter().filter(|point| !point.is_of_surge_line).filter_map(value);
        let (low, high) = range(values);
        columns.push(ImportedColumn {
            heading: column.heading.clone(),
            number: column.index + 1,
            quantity: column.quantity.name(),
            key: column.quantity.key(),
            unit: column.unit.clone(),
            low,
            high,
        });
    }
    columns
}

/// Quantities that a matrix may hold.
const MATRIX_QUANTITIES: [Quantity; 3] = [Quantity::PressureRatio, Quantity::Efficiency, Quantity::Flow];

/// Speeds of turbochargers, rpm. Bound: they distinguish the axis of speed from that of flow.
const SPEEDS_RPM: Range<f64> = 5e3..1e6;

/// Rows between the title of a matrix and its values. Bound: names of the axes, units.
const MAX_HEAD_ROWS: usize = 4;

pub(crate) fn quantity_of_title(cell: &str) -> Option<Column> {
    let found = column(0, cell, Machine::Compressor).ok().flatten();
    found.filter(|found| MATRIX_QUANTITIES.contains(&found.quantity))
}

struct Matrix {
    title: Column,
    at: usize,
    rows: Range<usize>,
    /// The axis of the speed and the other one, as written.
    speeds: Vec<f64>,
    others: Vec<f64>,
    cells: HashMap<[u64; 2], String>,
    speed_unit: String,
    flow_unit: String,
}

pub(crate) fn points_of_matrices(grid: &Grid) -> Option<Grid> {
    let mut matrices: Vec<Matrix> = Vec::new();
    for (index, row) in grid.rows.iter().enumerate() {
        if row.is_comment || row.cells.iter().any(|cell| grid.number(cell).is_some()) {
            continue;
        }
        let filled = row.cells.iter().enumerate().filter(|(_, cell)| !cell.is_empty());
        let titles: Vec<(usize, Option<Column>)> =
            filled.map(|(place, cell)| (place, quantity_of_title(cell))).collect();
        for (number, (start, title)) in titles.iter().enumerate() {
            let Some(title) = title else { continue };
            let end = titles.get(number + 1).map_or(usize::MAX, |(next, _)| *next);
            matrices.extend(matrix(grid, index, *start..end, title));
        }
    }
    let matrix_of = |quantity| matrices.iter().find(|matrix| matrix.title.quantity == quantity);
    let (ratios, etas, flows) =
        (matrix_of(Quantity::PressureRatio)?, matrix_of(Quantity::Efficiency), matrix_of(Quantity::Flow));
    let value = |matrix: Option<&Matrix>, speed: f64, other: f64| {
        let cell = matrix.and_then(|matrix| matrix.cells.get(&[speed.to_bits(), other.to_bits()]));
        cell.cloned().unwrap_or_default()
    };
    let heading = |name: &str, unit: &str| {
        if unit.is_empty() { name.to_owned() } else { format!("{name} [{unit}]") }
    };
    let flow_unit = flows.map_or(ratios.flow_unit.as_str(), |flows| flows.title.unit.as_str());
    let names = vec![
        heading("speed", &ratios.speed_unit),
        heading("flow", flow_unit),
        "pressure ratio".to_owned(),
        heading("efficiency", etas.map_or("", |etas| etas.title.unit.as_str())),
    ];
    // Rows outside the matrices may have the reference state.
    let is_outside =
        |index: &usize| matrices.iter().all(|matrix| !(matrix.at..matrix.rows.end).contains(index));
    let outside = (0..grid.rows.len()).filter(is_outside).filter_map(|index| grid.rows.get(index));
    let mut rows: Vec<GridRow> = outside.map(|row| GridRow { is_comment: true, ..row.clone() }).collect();
    let at = grid.rows.get(ratios.at).map_or(1, |row| row.at);
    rows.push(GridRow { at, cells: names, is_comment: false });
    let decimal = |value: f64| {
        let text = value.to_string();
        if grid.has_decimal_comma { text.replace('.', ",") } else { text }
    };
    for speed in &ratios.speeds {
        for other in &ratios.others {
            let ratio = value(Some(ratios), *speed, *other);
            let flow = if flows.is_some() { value(flows, *speed, *other) } else { decimal(*other) };
            if !is_missing_mark(&ratio) && !is_missing_mark(&flow) {
                let cells = vec![decimal(*speed), flow, ratio, value(etas, *speed, *other)];
                rows.push(GridRow { at, cells, is_comment: false });
            }
        }
    }
    let has_points = rows.iter().filter(|row| !row.is_comment).count() > 2;
    has_points.then(|| grid.with_rows(rows))
}

fn matrix(grid: &Grid, index: usize, columns: Range<usize>, title: &Column) -> Option<Matrix> {
    let cell = |row: &GridRow, place: usize| row.cells.get(place).cloned().unwrap_or_default();
    let width = |row: &GridRow| row.cells.len().min(columns.end);
    let head = (index + 1..grid.rows.len().min(index + 1 + MAX_HEAD_ROWS)).find(|at| {
        let row = &grid.rows[*at];
        let axis =
            (columns.start + 1..width(row)).filter(|place| axis_value(grid, &cell(row, *place)).is_some());
        !row.is_comment && axis.count() >= 2 && grid.number(&cell(row, columns.start)).is_none()
    })?;
    let head_row = &grid.rows[head];
    let axis: Vec<(usize, f64)> = (columns.start + 1..width(head_row))
        .filter_map(|place| Some((place, axis_value(grid, &cell(head_row, place))?)))
        .collect();
    let is_value = |row: &GridRow| !row.is_comment && axis_value(grid, &cell(row, columns.start)).is_some();
    let count = grid.rows.get(head + 1..)?.iter().take_while(|row| is_value(row)).count();
    let rows = head + 1..head + 1 + count;
    let side: Vec<(usize, f64)> = rows
        .clone()
        .filter_map(|at| Some((at, axis_value(grid, &cell(&grid.rows[at], columns.start))?)))
        .collect();
    // Names of the axes: `speed [rpm] \ flow [kg/s]` in the corner, or in the rows above.
    let names = |at: usize, place: usize| -> Vec<Column> {
        let text = cell(&grid.rows[at], place).replace(" / ", "|");
        let parts = text.split(['\\', '|', '\n', '↓', '→']);
        parts.filter_map(|part| column(0, part.trim(), Machine::Compressor).ok().flatten()).collect()
    };
    let corner = names(head, columns.start);
    let places = |at: usize| (columns.start..width(&grid.rows[at])).map(move |place| (at, place));
    let above: Vec<Column> =
        (index + 1..head).flat_map(places).flat_map(|(at, place)| names(at, place)).collect();
    let unit = |quantity: Quantity| {
        corner.iter().chain(&above).find(|label| label.quantity.is_same_quantity(quantity))
    };
    let (speed, flow) = (unit(Quantity::Speed), unit(Quantity::Flow));
    let is_speed = |values: &[(usize, f64)]| {
        values
            .iter()
            .all(|(_, value)| SPEEDS_RPM.contains(&speed.map_or(*value, |unit| unit.as_stated(*value))))
    };
    let values = |values: &[(usize, f64)]| values.iter().map(|(_, value)| *value).collect::<Vec<f64>>();
    let is_across = match (is_speed(&axis), is_speed(&side)) {
        (true, false) => true,
        (false, true) => false,
        // In krpm and g/s both may be speeds: the corner names the side first.
        (true, true) => corner.first()?.quantity.is_same_quantity(Quantity::Flow),
        (false, false) => return None,
    };
    let mut cells = HashMap::new();
    for (row, down) in &side {
        for (place, across) in &axis {
            let text = cell(&grid.rows[*row], *place);
            let (speed, other) = if is_across { (*across, *down) } else { (*down, *across) };
            cells.insert([speed.to_bits(), other.to_bits()], text);
        }
    }
    let (speeds, others) = if is_across { (&axis, &side) } else { (&side, &axis) };
    let text = |label: Option<&Column>| label.map(|label| label.unit.clone()).unwrap_or_default();
    let (speeds, others) = (values(speeds), values(others));
    Some(Matrix {
        title: title.clone(),
        at: index,
        rows,
        speeds,
        others,
        cells,
        speed_unit: text(speed),
        flow_unit: text(flow),
    })
}

/// The number of a cell of an axis, which may have a unit of speed.
fn axis_value(grid: &Grid, cell: &str) -> Option<f64> {
    grid.number(cell)
        .or_else(|| without_speed(grid, cell).filter(|(rest, _)| rest.is_empty()).map(|(_, rpm)| rpm))
}
