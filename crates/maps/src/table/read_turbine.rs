//! Reads a turbine map from a table of points, in all layouts of compressor maps.

use crate::table::column::Machine;
use crate::table::description::DescribedColumns;
use crate::table::quantity;
use crate::table::quantity::Quantity;
use crate::table::read::{check_units_of_flow, leave_out_standstill, pressure_pa, read_notes, require};
use crate::table::rows_to_lines::{ETA_RANGE, MAX_PRESSURE_RATIO};
use crate::table::sheet::end_blocks::EndBlocks;
use crate::table::sheet::grid::Grid;
use crate::table::sheet::layout;
use crate::table::sheet::points::{Point, columns, efficiency_in_percent, points};
use crate::table::sheet::workbook::grid_of_workbook;
use mapper_core::unit_factors::{PA_PER_KPA, PERCENT};
use mapper_core::{
    ImportError, ImportRemark, ImportedTurbine, MapDescription, MeasuredTurbinePoint, ReferenceState,
    TurbineMap, TurbineMapPoint,
};
use mapper_physics::gas::air::Air;
use mapper_physics::laws::compression::apparent_efficiency;

/// The turbine map of a text.
pub fn read_turbine_text(text: &str, description: &MapDescription) -> Result<ImportedTurbine, ImportError> {
    read(&Grid::of_text(text)?, description)
}

/// The turbine map of a workbook.
pub fn read_turbine_workbook(
    bytes: &[u8],
    description: &MapDescription,
) -> Result<ImportedTurbine, ImportError> {
    read(&grid_of_workbook(bytes, description.sheet.as_deref())?, description)
}

/// Maximum speed parameter, rpm/K^0.5; larger values are corrected speeds. Bound: 200 krpm at 1000 K is 6300 rpm/K^0.5, and no map ends at 10 krpm.
const MAX_SPEED_PARAMETER: f64 = 10_000.0;
/// Maximum flow parameter, kg K^0.5/(s kPa). Bound: a nozzle of air passes 0.0404 through each 10 cm2; 10 would be a throat of 2500 cm2.
const MAX_FLOW_PARAMETER: f64 = 10.0;

fn read(grid: &Grid, description: &MapDescription) -> Result<ImportedTurbine, ImportError> {
    let described = DescribedColumns::of(description, Machine::Turbine)?;
    let (grid, layout) = layout::detect_layout(grid, &described)?;
    let grid = grid.as_ref();
    let notes = read_notes(grid, layout.first_row);
    let mut remarks = layout.remarks.clone();
    let all = || layout.groups.iter().flat_map(|group| &group.columns);
    check_units_of_flow(grid, &layout)?;
    if all().any(|column| is_flow(column.quantity) && !column.has_unit()) {
        remarks.push(ImportRemark::FlowUnitAssumed);
    }
    let blocks = EndBlocks::of(grid, &described, &layout);
    let mut points = points(grid, &described, &layout, &blocks, &mut remarks)?;
    points.retain(|point| !point.is_of_surge_line);
    leave_out_standstill(&mut points, speed_of, &mut remarks);
    let measured = match layout.is_measured() {
        true => {
            points.iter().map(|point| measured_point(point, description)).collect::<Result<Vec<_>, _>>()?
        }
        false => Vec::new(),
    };
    let fastest = points.iter().filter_map(speed_of).fold(0.0, f64::max);
    let has_speed_unit = all().any(|column| column.quantity == Quantity::Speed && column.has_unit());
    let speed_is_reduced = measured.is_empty() && !has_speed_unit && fastest < MAX_SPEED_PARAMETER;
    if speed_is_reduced && all().any(|column| column.quantity == Quantity::Speed) {
        remarks.push(ImportRemark::SpeedParameterAssumed);
    }
    let is_corrected = measured.is_empty()
        && (all().any(|column| is_flow(column.quantity))
            || !speed_is_reduced && all().any(|column| column.quantity == Quantity::Speed));
    let reference = match quantity::resolve_reference(notes.reference, description.reference) {
        Err(ImportError::NoReference) if !is_corrected => None,
        resolved => Some(resolved?),
    };
    if !measured.is_empty() {
        remarks.push(ImportRemark::Measured);
    }
    let in_percent = efficiency_in_percent(&layout, &points);
    if in_percent {
        remarks.push(ImportRemark::EfficiencyInPercent);
    }
    let columns = columns(&layout, &points, None);
    let state = reference.unwrap_or(ReferenceState::SAE);
    let rows: Result<Vec<TurbineMapPoint>, ImportError> = match measured.as_slice() {
        [] => points.iter().map(|point| row(point, state, speed_is_reduced, in_percent)).collect(),
        measured => measured.iter().map(|point| check(point.line, reduced_turbine_point(point))).collect(),
    };
    let mut rows = rows?;
    if rows.is_empty() {
        return Err(ImportError::Empty);
    }
    if rows.iter().all(|row| row.efficiency.is_none()) {
        remarks.push(ImportRemark::NoEfficiency);
    }
    sort(&mut rows);
    Ok(ImportedTurbine {
        map: TurbineMap { machine: notes.machine, points: rows, fitted: None },
        columns,
        remarks,
        measured,
    })
}

fn speed_of(point: &Point<'_>) -> Option<f64> {
    let found =
        [Quantity::Speed, Quantity::ReducedSpeed].into_iter().find_map(|quantity| point.cell(quantity));
    found.map(|(column, value)| column.as_stated(value)).or(point.speed)
}

fn row(
    point: &Point<'_>,
    reference: ReferenceState,
    speed_is_reduced: bool,
    in_percent: bool,
) -> Result<TurbineMapPoint, ImportError> {
    let value = |quantity: Quantity| point.cell(quantity).map(|(column, value)| column.as_stated(value));
    let needed = |value: Option<f64>, quantity: Quantity| require(point, quantity, value);
    let root = reference.t_ref_k.sqrt();
    let speed = needed(speed_of(point), Quantity::Speed)?;
    let is_parameter = speed_is_reduced || value(Quantity::ReducedSpeed).is_some();
    let flow = value(Quantity::TurbineFlow).or(value(Quantity::Flow));
    let corrected_flow = flow.map(|kg_s| kg_s * root / (reference.p_ref_pa / PA_PER_KPA));
    let efficiency =
        value(Quantity::Efficiency).map(|eta| if in_percent { 1.0 / PERCENT * eta } else { eta });
    let row = TurbineMapPoint {
        vane_position: value(Quantity::Vane).or(point.vane),
        speed_parameter_rpm_sqrt_k: if is_parameter { speed } else { speed / root },
        flow_parameter_kg_sqrt_k_s_kpa: needed(
            value(Quantity::ReducedFlow).or(corrected_flow),
            Quantity::ReducedFlow,
        )?,
        expansion_ratio: needed(value(Quantity::PressureRatio), Quantity::PressureRatio)?,
        efficiency,
    };
    check(point.at, row)
}

fn is_flow(quantity: Quantity) -> bool {
    matches!(quantity, Quantity::Flow | Quantity::TurbineFlow)
}

fn measured_point(
    point: &Point<'_>,
    description: &MapDescription,
) -> Result<MeasuredTurbinePoint, ImportError> {
    let value = |quantity: Quantity| point.cell(quantity).map(|(column, value)| column.as_stated(value));
    let of = |quantity: Quantity, value: Option<f64>| require(point, quantity, value);
    let pressure = |quantity: Quantity| of(quantity, pressure_pa(point, quantity, description)?);
    let measured = MeasuredTurbinePoint {
        line: point.at,
        vane_position: value(Quantity::Vane).or(point.vane),
        speed_rpm: of(Quantity::Speed, value(Quantity::Speed).or(point.speed))?,
        flow_kg_s: of(Quantity::TurbineFlow, value(Quantity::TurbineFlow).or(value(Quantity::Flow)))?,
        t3_k: of(Quantity::T3, value(Quantity::T3))?,
        p3_pa: pressure(Quantity::P3)?,
        p4_pa: pressure(Quantity::P4)?,
        t4_k: value(Quantity::T4),
    };
    // A root and a ratio need both above zero.
    for (quantity, value) in [("T3", measured.t3_k), ("P3", measured.p3_pa), ("P4", measured.p4_pa)] {
        if !(value.is_finite() && value > 0.0) {
            return Err(ImportError::Value { line: point.at, quantity, value, needed: "above 0" });
        }
    }
    Ok(measured)
}

/// Reduces a measured point by the state of the inlet. The efficiency follows from the temperatures, heat loss included.
pub fn reduced_turbine_point(point: &MeasuredTurbinePoint) -> TurbineMapPoint {
    let (root, expansion_ratio) = (point.t3_k.sqrt(), point.p3_pa / point.p4_pa);
    // An expansion is a compression from T3 by 1/ER; its efficiency is the inverse.
    let efficiency = |t4_k: f64| 1.0 / apparent_efficiency(1.0 / expansion_ratio, point.t3_k, t4_k, Air::DRY);
    TurbineMapPoint {
        vane_position: point.vane_position,
        speed_parameter_rpm_sqrt_k: point.speed_rpm / root,
        flow_parameter_kg_sqrt_k_s_kpa: point.flow_kg_s * root / (point.p3_pa / PA_PER_KPA),
        expansion_ratio,
        efficiency: point.t4_k.map(efficiency).filter(|eta| eta.is_finite()),
    }
}

fn check(line: usize, row: TurbineMapPoint) -> Result<TurbineMapPoint, ImportError> {
    let flow = row.flow_parameter_kg_sqrt_k_s_kpa;
    let eta = row.efficiency.unwrap_or(0.5);
    for (quantity, value, good, needed) in [
        (
            "speed over the root of temperature",
            row.speed_parameter_rpm_sqrt_k,
            row.speed_parameter_rpm_sqrt_k > 0.0 && row.speed_parameter_rpm_sqrt_k < MAX_SPEED_PARAMETER,
            "above 0, below 10 000 rpm/K^0.5",
        ),
        (
            "flow parameter",
            flow,
            flow > 0.0 && flow < MAX_FLOW_PARAMETER,
            "above 0, below 10 kg K^0.5/(s kPa)",
        ),
        (
            "expansion ratio",
            row.expansion_ratio,
            row.expansion_ratio > 1.0 && row.expansion_ratio < MAX_PRESSURE_RATIO,
            "above 1, below 50",
        ),
        ("efficiency", eta, ETA_RANGE.contains(&eta), "a fraction (0.72), not a percentage"),
    ] {
        if !(value.is_finite() && good) {
            return Err(ImportError::Value { line, quantity, value, needed });
        }
    }
    Ok(row)
}

/// Sorts by vane position, speed and expansion ratio.
fn sort(rows: &mut [TurbineMapPoint]) {
    let vane = |point: &TurbineMapPoint| point.vane_position.unwrap_or(f64::NEG_INFINITY);
    rows.sort_by(|a, b| {
        vane(a)
            .total_cmp(&vane(b))
            .then(a.speed_parameter_rpm_sqrt_k.total_cmp(&b.speed_parameter_rpm_sqrt_k))
            .then(a.expansion_ratio.total_cmp(&b.expansion_ratio))
    });
}
