//! Reads a table of points as engineers have it: headings of several languages in any order, units in the heading or below it, a preamble,
//! a speed only in the first row of its line, one block per speed or side by side, measured points that are not corrected yet.

mod grid;
mod layout;
mod quantity;

use crate::lines::{Row, map_of_rows, room_for_one_more};
use crate::{heading, reference};
use grid::{Grid, GridRow, is_missing};
use layout::Layout;
use mapper_core::{
    CompressorMap, EfficiencyDefinition, ImportError, ImportRemark, ImportedColumn, ImportedMap,
    ReferenceState,
};
use mapper_physics::air::Air;
use mapper_physics::compression::apparent_efficiency;
use mapper_yaml::units::{Kind, header_unit};
use quantity::Quantity;

pub(crate) use grid::text_of;

/// The map of a text.
pub(crate) fn read_text(text: &str, given: Option<ReferenceState>) -> Result<ImportedMap, ImportError> {
    read(&Grid::of_text(text)?, given)
}

/// The map of a workbook: of its first sheet with a table of numbers.
pub(crate) fn read_workbook(bytes: &[u8], given: Option<ReferenceState>) -> Result<ImportedMap, ImportError> {
    read(&Grid::of_workbook(bytes)?, given)
}

/// Information from the rows outside the table.
#[derive(Default)]
struct Notes {
    reference: Option<ReferenceState>,
    machine: String,
    efficiency: Option<EfficiencyDefinition>,
}

fn read(grid: &Grid, given: Option<ReferenceState>) -> Result<ImportedMap, ImportError> {
    let Some(layout) = layout::layout(grid)? else { return Err(ImportError::Empty) };
    let notes = notes(grid, layout.first_row);
    let mut remarks = layout.remarks.clone();
    let mut reference = reference::settle(notes.reference, given);
    if layout.needs_no_reference() && matches!(reference, Err(ImportError::NoReference)) {
        // Reduced quantities become corrected ones of any state; this one is the usual.
        reference = Ok(ReferenceState::SAE);
        remarks.push(ImportRemark::ReducedQuantities { reference: ReferenceState::SAE });
    }
    let reference = reference?;
    let points = points(grid, &layout, &mut remarks)?;
    let columns = columns(&layout, &points, reference);
    let in_percent = efficiency_in_percent(&layout, &points);
    if in_percent {
        remarks.push(ImportRemark::EfficiencyInPercent);
    }
    if layout.is_measured() {
        remarks.push(ImportRemark::Measured);
    }
    let mut rows = Vec::with_capacity(points.len());
    for point in &points {
        let row = point.row(&layout, reference, in_percent)?;
        row.check()?;
        rows.push(row);
    }
    if rows.iter().all(|row| row.eta.is_none()) {
        remarks.push(ImportRemark::NoEfficiency);
    }
    let map = map_of_rows(notes.machine, &rows, Some(reference), None)?;
    let efficiency =
        if layout.is_measured() { Some(EfficiencyDefinition::Enthalpy) } else { notes.efficiency };
    Ok(ImportedMap { map: CompressorMap { efficiency, ..map }, columns, remarks })
}

/// The values of a point by column, as written.
struct Point<'a> {
    at: usize,
    group: &'a layout::Group,
    /// Speed from outside the row: of its block, or of a row above; in the unit of the speed column.
    speed: Option<f64>,
    values: Vec<Option<f64>>,
}

impl Point<'_> {
    fn value(&self, quantity: Quantity, reference: ReferenceState) -> Option<f64> {
        let position = self.group.columns.iter().position(|column| column.quantity == quantity)?;
        let column = self.group.columns.get(position)?;
        Some(column.inside(self.values.get(position).copied().flatten()?, reference))
    }

    fn row(&self, layout: &Layout, reference: ReferenceState, in_percent: bool) -> Result<Row, ImportError> {
        let any =
            |quantities: &[Quantity]| quantities.iter().find_map(|quantity| self.value(*quantity, reference));
        let needed = |value: Option<f64>, quantity: Quantity| {
            value.ok_or_else(|| ImportError::NotANumber {
                line: self.at,
                quantity: quantity.name().to_owned(),
                text: String::new(),
            })
        };
        let own_speed = any(&[Quantity::Speed, Quantity::ReducedSpeed]);
        let speed_rpm = needed(own_speed.or(self.speed), Quantity::Speed)?;
        let flow_kg_s =
            needed(any(&[Quantity::Flow, Quantity::VolumeFlow, Quantity::ReducedFlow]), Quantity::Flow)?;
        let mut row = Row {
            at: self.at,
            speed_corrected_rpm: speed_rpm,
            flow_corrected_kg_s: flow_kg_s,
            pressure_ratio: f64::NAN,
            eta: any(&[Quantity::Efficiency]).map(|eta| if in_percent { 0.01 * eta } else { eta }),
        };
        if layout.is_measured() {
            let (p1_pa, p2_pa) =
                (needed(any(&[Quantity::P1]), Quantity::P1)?, needed(any(&[Quantity::P2]), Quantity::P2)?);
            let t1_k = needed(any(&[Quantity::T1]), Quantity::T1)?;
            row.pressure_ratio = p2_pa / p1_pa;
            row.speed_corrected_rpm = reference.corrected_speed_rpm(speed_rpm, t1_k);
            row.flow_corrected_kg_s = reference.corrected_flow_kg_s(flow_kg_s, t1_k, p1_pa);
            let t2_k = any(&[Quantity::T2]).filter(|t2_k| *t2_k > t1_k && p2_pa > p1_pa);
            let apparent = t2_k.map(|t2_k| apparent_efficiency(row.pressure_ratio, t1_k, t2_k, Air::DRY));
            row.eta = row.eta.or(apparent);
        } else {
            row.pressure_ratio = needed(any(&[Quantity::PressureRatio]), Quantity::PressureRatio)?;
        }
        Ok(row)
    }
}

/// How the format `fitted` marks a node beyond the measured points.
const EXTRAPOLATED: &str = "extrapolated";

fn points<'a>(
    grid: &Grid,
    layout: &'a Layout,
    remarks: &mut Vec<ImportRemark>,
) -> Result<Vec<Point<'a>>, ImportError> {
    let mut points = Vec::new();
    let (mut carried, mut extrapolated) = (false, 0);
    for group in &layout.groups {
        let mut speed = group.speed_rpm;
        for row in grid.rows.iter().skip(layout.first_row).filter(|row| !row.is_comment) {
            let cell = |index: usize| row.cells.get(index).map_or("", String::as_str);
            if group.columns.iter().all(|column| is_missing(cell(column.index)))
                && row.cells.iter().filter(|cell| !cell.is_empty()).count() != 1
            {
                continue;
            }
            if let Some(title_rpm) = layout::speed_of_title(grid, row, group) {
                speed = Some(title_rpm);
                continue;
            }
            if layout::is_heading(row) {
                continue;
            }
            if row.cells.iter().any(|cell| cell == EXTRAPOLATED) {
                extrapolated += 1;
                continue;
            }
            room_for_one_more(points.len(), row.at)?;
            let values = values(grid, row, group)?;
            let own = group.speed_column().and_then(|position| values.get(position).copied().flatten());
            if group.speed_column().is_some() {
                match own {
                    Some(own) => {
                        speed = group
                            .speed_column()
                            .and_then(|at| Some(group.columns.get(at)?.inside(own, ReferenceState::SAE)))
                    }
                    None => carried = true,
                }
            }
            points.push(Point { at: row.at, group, speed, values });
        }
    }
    if extrapolated > 0 {
        remarks.push(ImportRemark::ExtrapolatedNodes { count: extrapolated });
    }
    if carried {
        remarks.push(ImportRemark::SpeedOfRowAbove);
    }
    Ok(points)
}

/// The numbers of a row by column.
fn values(grid: &Grid, row: &GridRow, group: &layout::Group) -> Result<Vec<Option<f64>>, ImportError> {
    let mut values = Vec::with_capacity(group.columns.len());
    for column in &group.columns {
        let text = row.cells.get(column.index).map_or("", String::as_str);
        let value = grid.number(text);
        if value.is_none() && !is_missing(text) {
            return Err(ImportError::NotANumber {
                line: row.at,
                quantity: column.quantity.name().to_owned(),
                text: text.chars().take(40).collect(),
            });
        }
        values.push(value);
    }
    let filled = row.cells.iter().filter(|cell| !cell.is_empty()).count();
    // A row without headings has no column to spare, and one between blanks no empty cell: what is cut short is a mistake.
    let needed = group.columns.iter().map(|column| column.index + 1).max().unwrap_or(0);
    if group.is_bare && filled != group.columns.len() || grid.by_blanks && filled < needed {
        let text = row.text().chars().take(60).collect();
        return Err(ImportError::RowForm { line: row.at, text, form: ROW_FORM });
    }
    Ok(values)
}

/// The form of a row without headings.
const ROW_FORM: &str = "a row of corrected rpm, corrected kg/s, pressure ratio and efficiency";

/// Whether efficiencies without a unit are percentages: their median is far above 1.
fn efficiency_in_percent(layout: &Layout, points: &[Point<'_>]) -> bool {
    let named = layout.groups.iter().flat_map(|group| &group.columns);
    if named.clone().any(|column| {
        column.quantity == Quantity::Efficiency && (column.has_unit() || column.heading.is_empty())
    }) {
        return false;
    }
    let mut etas: Vec<f64> =
        points.iter().filter_map(|point| point.value(Quantity::Efficiency, ReferenceState::SAE)).collect();
    etas.sort_by(f64::total_cmp);
    // No efficiency is above 1, and none of a usable point below 1 %.
    etas.get(etas.len() / 2).is_some_and(|median| *median > 1.5)
        && etas.last().is_some_and(|last| *last <= 100.0)
}

/// The columns with the range of their values.
fn columns(layout: &Layout, points: &[Point<'_>], reference: ReferenceState) -> Vec<ImportedColumn> {
    let mut columns: Vec<ImportedColumn> = Vec::new();
    for column in layout.groups.first().iter().flat_map(|group| &group.columns) {
        let values = points.iter().filter_map(|point| point.value(column.quantity, reference));
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |r, v| (r.0.min(v), r.1.max(v)));
        columns.push(ImportedColumn {
            heading: column.heading.clone(),
            quantity: column.quantity.name(),
            unit: column.unit.clone(),
            low,
            high,
        });
    }
    columns
}

fn notes(grid: &Grid, first_row: usize) -> Notes {
    let mut notes = Notes::default();
    for (index, row) in grid.rows.iter().enumerate() {
        if index >= first_row && !row.is_comment {
            continue;
        }
        let text = row.text();
        notes.reference =
            notes.reference.or_else(|| reference::in_comment(&text)).or_else(|| reference_in(grid, &text));
        notes.efficiency = notes.efficiency.or_else(|| heading::efficiency_in_comment(&text));
        if let Some((_, name)) = text.split_once("compressor map of ") {
            notes.machine = name.trim().chars().take(200).collect();
        }
    }
    notes
}

/// "Reference Pressure 100 kPa, Reference Temperature 298 K": a pressure and a temperature in a line that names their purpose.
fn reference_in(grid: &Grid, text: &str) -> Option<ReferenceState> {
    let lower = text.to_lowercase();
    if !["ref", "corrected to", "standard cond", "bezug"].iter().any(|word| lower.contains(word)) {
        return None;
    }
    let words: Vec<&str> = text
        .split(|c: char| c.is_whitespace() || matches!(c, '=' | ':' | ',' | ';'))
        .filter(|word| !word.is_empty())
        .collect();
    let of = |kind: Kind| {
        words.windows(2).find_map(|pair| {
            let [number, unit] = pair else { return None };
            let unit = header_unit(unit.trim_matches(['(', ')', '[', ']']))?;
            (unit.kind == kind).then_some(unit.unit.to_inside(grid.number(number)?))
        })
    };
    let state = ReferenceState { t_ref_k: of(Kind::Temperature)?, p_ref_pa: of(Kind::Pressure)? };
    state.is_plausible().then_some(state)
}
