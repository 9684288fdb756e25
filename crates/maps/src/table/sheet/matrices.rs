//! Matrices over speed and flow, one of each quantity: below each other, side by side, or on a sheet each. Flows that vary along a line may
//! have a matrix of their own; the other axis then counts the points.

use crate::table::column::{Column, Machine, column};
use crate::table::quantity::Quantity;
use crate::table::sheet::grid::{Grid, GridRow};
use crate::table::sheet::headings::without_speed;
use mapper_table::is_missing_mark;
use std::collections::HashMap;
use std::ops::Range;

/// Quantities that a matrix may hold.
const MATRIX_QUANTITIES: [Quantity; 3] = [Quantity::PressureRatio, Quantity::Efficiency, Quantity::Flow];

/// Speeds of turbochargers, rpm. Bound: they distinguish the axis of speed from that of flow.
const SPEEDS_RPM: Range<f64> = 5e3..1e6;

/// Rows between the title of a matrix and its values. Bound: names of the axes, units.
const MAX_HEAD_ROWS: usize = 4;

/// The quantity that a title names.
pub(crate) fn quantity_of_title(cell: &str) -> Option<Column> {
    let found = column(0, cell, Machine::Compressor).ok().flatten();
    found.filter(|found| MATRIX_QUANTITIES.contains(&found.quantity))
}

/// A matrix with the row and column of each value.
struct Matrix {
    title: Column,
    /// Row of the title.
    at: usize,
    rows: Range<usize>,
    /// The axis of the speed and the other one, as written.
    speeds: Vec<f64>,
    others: Vec<f64>,
    /// Value by speed and other axis.
    cells: HashMap<[u64; 2], String>,
    speed_unit: String,
    flow_unit: String,
}

/// The table of points of a grid of matrices; `None` if it has none of pressure ratios.
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

/// The matrix below a title in columns of a grid.
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
