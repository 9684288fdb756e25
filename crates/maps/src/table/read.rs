//! Reads a table of map points: headings of several languages in any order, units in or below the heading, a preamble, a speed only in the
//! first row of its line, one block per speed or side by side, measured points that are not corrected yet.

use crate::table::beta_tables::{read_arrays, read_gsp, read_modelica, read_nested};
use crate::table::column::{Column, Machine, column};
use crate::table::description::DescribedColumns;
use crate::table::design_point::{MapDesign, scale_to_design};
use crate::table::quantity;
use crate::table::quantity::{Quantity, efficiency_in_comment, is_end_title};
use crate::table::rows_to_lines::{Row, add_surge_speeds, map_of_rows, shift_remark, surge_marks};
use crate::table::sheet::end_blocks::EndBlocks;
use crate::table::sheet::grid::{Grid, text_of};
use crate::table::sheet::headings::without_speed;
use crate::table::sheet::layout::{self, Layout};
use crate::table::sheet::points::{Point, columns, efficiency_in_percent, points, points_of_matrices};
use crate::table::sheet::workbook::grid_of_workbook;
use mapper_core::unit_factors::PERCENT;
use mapper_core::{
    EfficiencyDefinition, ImportError, ImportRemark, ImportedMap, MapDescription, MeasuredPoint,
    NoCompression, ReferenceState, StaticTaps, TurbineReadings, Warning,
};
use mapper_physics::gas::air::{Air, humidity_kg_kg};
use mapper_physics::gas::mixture::Gas;
use mapper_physics::gas::pressure_tap::static_to_total_pa;
use mapper_physics::laws::compression::apparent_efficiency;
use mapper_table::header_unit;
use mapper_yaml::units::Kind;

/// The map of a text.
pub fn read_text(text: &str, description: &MapDescription) -> Result<ImportedMap, ImportError> {
    read(&Grid::of_text(text)?, description)
}

/// The map of a text in any layout: tables of NPSS or Modelica, arrays of a script, or a table of points.
pub fn read_any_text(text: &str, description: &MapDescription) -> Result<ImportedMap, ImportError> {
    if text.contains(NPSS_TABLE) {
        read_nested(text, description)
    } else if text.lines().next() == Some("#1") && text.contains("\ndouble ") {
        read_modelica(text, description)
    } else if text.lines().take(GSP_HEAD).any(|line| line.trim_start().starts_with("Reynolds:")) {
        read_gsp(text, description)
    } else if text.contains("np.array(") || text.lines().any(|line| line.replace(' ', "").contains("=[")) {
        read_arrays(text, description)
    } else {
        read_text(text, description)
    }
}

/// The map of a file of text.
pub fn read_any_bytes(bytes: &[u8], description: &MapDescription) -> Result<ImportedMap, ImportError> {
    read_any_text(&text_of(bytes)?, description)
}

/// Start of every table of an NPSS map.
const NPSS_TABLE: &str = "Table TB_";

/// Lines above the tables of GSP and GasTurb. Bound: the title, which begins with 99, and the effect of the Reynolds number.
const GSP_HEAD: usize = 10;

/// The map of a workbook: of its first sheet with a table of numbers.
pub fn read_workbook(bytes: &[u8], description: &MapDescription) -> Result<ImportedMap, ImportError> {
    read(&grid_of_workbook(bytes, description.sheet.as_deref())?, description)
}

#[derive(Default)]
pub(super) struct Notes {
    pub(super) reference: Option<ReferenceState>,
    pub(super) machine: String,
    efficiency: Option<EfficiencyDefinition>,
}

fn read(grid: &Grid, description: &MapDescription) -> Result<ImportedMap, ImportError> {
    let mut described = DescribedColumns::of(description, Machine::Compressor)?;
    match read_columns(grid, description, &described) {
        // Next to `P1T`, which may be a total pressure, `P1` is the compressor's if `P1T` cannot be.
        Err(error @ ImportError::NotACompressor { .. }) => {
            described.bare_is_compressor = true;
            read_columns(grid, description, &described).map_err(|_| error)
        }
        found => found,
    }
}

fn read_columns(
    grid: &Grid,
    description: &MapDescription,
    described: &DescribedColumns,
) -> Result<ImportedMap, ImportError> {
    let points_grid = points_of_matrices(grid);
    let grid = points_grid.as_ref().unwrap_or(grid);
    let (grid, layout) = layout::detect_layout(grid, described)?;
    let grid = grid.as_ref();
    if layout.is_turbine_alone() {
        let heading = layout.first_row.checked_sub(1).and_then(|row| grid.rows.get(row));
        let text = heading.map(|row| row.text().chars().take(60).collect()).unwrap_or_default();
        return Err(ImportError::Turbine { line: heading.map_or(1, |row| row.at), text });
    }
    check_units_of_flow(grid, &layout)?;
    let notes = read_notes(grid, layout.first_row);
    let mut remarks = layout.remarks.clone();
    let mut reference = quantity::resolve_reference(notes.reference, description.reference);
    // Reduced quantities and readings can be corrected to any state.
    if (layout.needs_no_reference() || layout.is_measured())
        && matches!(reference, Err(ImportError::NoReference))
    {
        reference = Ok(ReferenceState::SAE);
        if !layout.is_measured() {
            remarks.push(ImportRemark::ReducedQuantities { reference: ReferenceState::SAE });
        }
    }
    let reference = reference?;
    let blocks = EndBlocks::of(grid, described, &layout);
    let mut points = points(grid, described, &layout, &blocks, &mut remarks)?;
    leave_out_standstill(&mut points, |point| speed_of(point, reference), &mut remarks);
    let columns = columns(&layout, &points, Some(reference));
    let in_percent = efficiency_in_percent(&layout, &points);
    if in_percent {
        remarks.push(ImportRemark::EfficiencyInPercent);
    }
    let taps = description.static_taps;
    if layout.is_measured() {
        remarks.push(ImportRemark::Measured);
    } else if taps != StaticTaps::default() {
        return Err(ImportError::Description {
            key: "inlet_pipe, outlet_pipe",
            text: "given".to_owned(),
            problem: "but the table has no P1 and P2; leave them out".to_owned(),
        });
    }
    let (mut rows, mut surge, mut measured) = (Vec::new(), Vec::new(), Vec::new());
    for point in &points {
        let mut row = row(point, &layout, reference, in_percent)?;
        if layout.is_measured() {
            let readings = measured_point(point, &row, reference, description)?;
            correct(&mut row, &readings, reference);
            measured.extend((!point.is_of_surge_line).then_some(readings));
        }
        if point.is_of_surge_line { &mut surge } else { &mut rows }.push(row);
    }
    check_unit_of_temperature(&measured)?;
    check_is_compressor(&measured)?;
    check_unit_of_efficiency(&layout, &rows)?;
    remarks.extend(add_surge_speeds(&rows, &mut surge));
    // One scale for points and surge line.
    let point_count = rows.len();
    rows.append(&mut surge);
    scale_to_design(&mut rows, MapDesign::default(), description.design, &mut remarks)?;
    rows.iter().try_for_each(Row::check)?;
    let surge = rows.split_off(point_count);
    if rows.iter().all(|row| row.eta.is_none()) {
        remarks.push(ImportRemark::NoEfficiency);
    }
    let mut map = map_of_rows(notes.machine, &rows, Some(reference), None)?;
    map.surge = surge_marks(&map, &surge);
    for point in map.lines.iter_mut().flat_map(|line| &mut line.points).map(|point| &mut point.identified) {
        // A rise below zero has no efficiency.
        let readings = measured.get(point.step).filter(|_| point.eta.is_none());
        point.warnings.extend(readings.map(no_efficiency));
    }
    remarks.extend(shift_remark(&map));
    map.efficiency =
        if layout.is_measured() { Some(EfficiencyDefinition::Enthalpy) } else { notes.efficiency };
    Ok(ImportedMap { map, columns, remarks, measured })
}

/// Refuses a volume flow or flow parameter without a unit: their usual units differ by more than maps do, so the size does not reveal them.
pub(super) fn check_units_of_flow(grid: &Grid, layout: &Layout) -> Result<(), ImportError> {
    let mut columns = layout.groups.iter().flat_map(|group| &group.columns);
    let is_open = |column: &&Column| {
        // SAE's MFP is in kg K^0.5/(s kPa).
        let has_open_unit = match column.quantity {
            Quantity::ReducedFlow => !column.heading.eq_ignore_ascii_case("mfp"),
            quantity => quantity == Quantity::VolumeFlow,
        };
        has_open_unit && !column.has_unit()
    };
    let Some(column) = columns.find(is_open) else { return Ok(()) };
    let line = layout.first_row.checked_sub(1).and_then(|row| grid.rows.get(row)).map_or(1, |row| row.at);
    let (key, example) = match column.quantity {
        Quantity::ReducedFlow => (Quantity::ReducedFlow.key(), "kg/s*K^0.5/kPa"),
        // `Q` is often a mass flow.
        _ if column.heading.chars().count() == 1 => (Quantity::Flow.key(), "kg/s"),
        _ => (Quantity::VolumeFlow.key(), "m3/h"),
    };
    Err(ImportError::NoUnit { line, heading: column.heading.clone(), key, example })
}

fn no_efficiency(point: &MeasuredPoint) -> Warning {
    Warning::NoCompression(point.t2_k.map_or(NoCompression::NoT2, |t2_k| NoCompression::NoRise {
        rise_k: t2_k - point.t1_k,
        pressure_ratio: point.p2_pa / point.p1_pa,
    }))
}

/// Maximum inlet temperature of a compressor, K. Bound: air that a stage before it has compressed to twice the pressure without a cooler.
const MAX_INLET_K: f64 = 400.0;

/// Minimum inlet temperature of a compressor, K. Bound: the coldest air on earth has 180 K; a number of degC or degF is below it.
const MIN_INLET_K: f64 = 180.0;

/// Refuses a table whose inlet is colder than any air: its temperatures have another unit.
fn check_unit_of_temperature(measured: &[MeasuredPoint]) -> Result<(), ImportError> {
    let is_cold: fn(&&MeasuredPoint) -> bool = |point| point.t1_k < MIN_INLET_K;
    let count = measured.iter().filter(is_cold).count();
    match measured.iter().find(is_cold).filter(|_| 2 * count > measured.len()) {
        None => Ok(()),
        Some(point) => Err(ImportError::Value {
            line: point.line,
            quantity: "T1 in K",
            value: point.t1_k,
            needed: "that of air; if the column is in degC or degF, write that into its heading",
        }),
    }
}

/// Refuses a table whose compressor expands or draws in exhaust gas: its columns are another machine's.
fn check_is_compressor(measured: &[MeasuredPoint]) -> Result<(), ImportError> {
    let expands: fn(&&MeasuredPoint) -> bool = |point| point.p2_pa < point.p1_pa;
    let is_hot: fn(&&MeasuredPoint) -> bool = |point| point.t1_k > MAX_INLET_K;
    for (is_wrong, problem) in [(expands, "P2 is below P1"), (is_hot, "T1 is that of exhaust gas")] {
        let points = measured.iter().filter(is_wrong).count();
        let first = measured.iter().find(is_wrong).filter(|_| 2 * points > measured.len());
        if let Some(first) = first {
            return Err(ImportError::NotACompressor {
                line: first.line,
                points,
                of: measured.len(),
                problem,
            });
        }
    }
    Ok(())
}

/// Maximum speed at standstill as a ratio of the fastest. Bound: the slowest lines of maps have a tenth of it.
const STANDSTILL_RATIO: f64 = 0.01;

pub(super) fn leave_out_standstill(
    points: &mut Vec<Point<'_>>,
    speed: impl Fn(&Point<'_>) -> Option<f64>,
    remarks: &mut Vec<ImportRemark>,
) {
    let fastest = points.iter().filter_map(&speed).fold(0.0, f64::max);
    let mut rows = Vec::new();
    points.retain(|point| {
        let is_at_rest = speed(point).is_some_and(|speed| speed < STANDSTILL_RATIO * fastest);
        rows.extend(is_at_rest.then_some(point.at));
        !is_at_rest
    });
    if !rows.is_empty() {
        remarks.push(ImportRemark::Standstill { rows });
    }
}

/// The speed of a point, rpm, as its column or its block has it.
fn speed_of(point: &Point<'_>, reference: ReferenceState) -> Option<f64> {
    let mut own = [Quantity::Speed, Quantity::ReducedSpeed].into_iter();
    own.find_map(|quantity| point.value(quantity, reference)).or(point.speed)
}

/// Maximum efficiency of fractions below a heading in %. Bound: 1 is the maximum of a fraction, and usable points have more than 1.5 %.
const MAX_FRACTION_IN_PERCENT: f64 = 0.015;

/// Refuses fractions below a heading in %.
fn check_unit_of_efficiency(layout: &Layout, rows: &[Row]) -> Result<(), ImportError> {
    let mut columns = layout.groups.iter().flat_map(|group| &group.columns);
    let is_in_percent = columns.any(|column| column.quantity == Quantity::Efficiency && column.has_unit());
    let etas = || rows.iter().filter_map(|row| Some((row.at, row.eta?))).filter(|_| is_in_percent);
    match etas().next().filter(|_| etas().all(|(_, eta)| (0.0..MAX_FRACTION_IN_PERCENT).contains(&eta))) {
        None => Ok(()),
        Some((line, value)) => Err(ImportError::Value {
            line,
            quantity: "efficiency",
            value,
            needed: "a percentage (72) as its unit says; if the column has fractions, leave the unit out",
        }),
    }
}

pub(super) fn require(point: &Point<'_>, quantity: Quantity, value: Option<f64>) -> Result<f64, ImportError> {
    value.ok_or_else(|| ImportError::NotANumber {
        line: point.at,
        quantity: quantity.name().to_owned(),
        text: String::new(),
    })
}

/// The row of a point. Speed and flow of a measured point are not corrected yet, and its pressure ratio is unknown.
fn row(
    point: &Point<'_>,
    layout: &Layout,
    reference: ReferenceState,
    in_percent: bool,
) -> Result<Row, ImportError> {
    let any =
        |quantities: &[Quantity]| quantities.iter().find_map(|quantity| point.value(*quantity, reference));
    let flow = any(&[Quantity::Flow, Quantity::VolumeFlow, Quantity::ReducedFlow]);
    // A surge line may be without speeds.
    let speed = speed_of(point, reference).or(point.is_of_surge_line.then_some(f64::NAN));
    Ok(Row {
        at: point.at,
        speed_corrected_rpm: require(point, Quantity::Speed, speed)?,
        flow_corrected_kg_s: require(point, Quantity::Flow, flow)?,
        pressure_ratio: if layout.is_measured() {
            f64::NAN
        } else {
            require(point, Quantity::PressureRatio, any(&[Quantity::PressureRatio]))?
        },
        eta: any(&[Quantity::Efficiency]).map(|eta| if in_percent { 1.0 / PERCENT * eta } else { eta }),
    })
}

/// The measured values of a point, static pressures converted to total ones.
fn measured_point(
    point: &Point<'_>,
    row: &Row,
    reference: ReferenceState,
    description: &MapDescription,
) -> Result<MeasuredPoint, ImportError> {
    let value = |quantity: Quantity| point.value(quantity, reference);
    let flow_kg_s = row.flow_corrected_kg_s;
    let t1_k = require(point, Quantity::T1, value(Quantity::T1))?;
    let t2_k = value(Quantity::T2);
    let taps = description.static_taps;
    let pressure = |quantity: Quantity| require(point, quantity, pressure_pa(point, quantity, description)?);
    let (mut p1_pa, mut p2_pa) = (pressure(Quantity::P1)?, pressure(Quantity::P2)?);
    if let Some(diameter_m) = taps.inlet_diameter_m {
        p1_pa = static_to_total_pa(p1_pa, flow_kg_s, t1_k, diameter_m);
    }
    if let Some(diameter_m) = taps.outlet_diameter_m {
        p2_pa = static_to_total_pa(p2_pa, flow_kg_s, require(point, Quantity::T2, t2_k)?, diameter_m);
    }
    let humidity = point.cell(Quantity::Humidity).map(|(column, written)| match column.is_relative() {
        true if column.unit.is_empty() => humidity_kg_kg(1.0 / PERCENT * written, t1_k, p1_pa),
        true => humidity_kg_kg(column.as_stated(written), t1_k, p1_pa),
        false => column.as_stated(written),
    });
    if let Some(humidity) = humidity.filter(|humidity| !(0.0..=MAX_HUMIDITY_KG_KG).contains(humidity)) {
        return Err(ImportError::Value {
            line: point.at,
            quantity: "humidity",
            value: humidity,
            needed: "from 0 to 0.1 kg/kg; write its unit, %, g/kg or kg/kg, into the heading",
        });
    }
    Ok(MeasuredPoint {
        line: point.at,
        speed_rpm: row.speed_corrected_rpm,
        flow_kg_s,
        t1_k,
        t2_k,
        p1_pa,
        p2_pa,
        tc_k: value(Quantity::Tc),
        humidity_kg_kg: humidity,
        turbine: TurbineReadings {
            t3_k: value(Quantity::T3),
            p3_pa: pressure_pa(point, Quantity::P3, description)?,
            p4_pa: pressure_pa(point, Quantity::P4, description)?,
            oil_k: value(Quantity::Oil),
        },
        end: point.end,
    })
}

pub(super) fn pressure_pa(
    point: &Point<'_>,
    quantity: Quantity,
    description: &MapDescription,
) -> Result<Option<f64>, ImportError> {
    let Some((column, value)) = point.cell(quantity) else { return Ok(None) };
    if !column.is_gauge {
        return Ok(Some(column.as_stated(value)));
    }
    let ambient = point.cell(Quantity::Ambient).map(|(column, value)| column.as_stated(value));
    match ambient.or(description.ambient_pa) {
        Some(ambient_pa) => Ok(Some(column.as_stated(value) + ambient_pa)),
        None => {
            let missing = "ambient pressure, which is added to a gauge pressure (or give the `barometer`)";
            Err(ImportError::NoColumn { line: point.at, missing, found: column.heading.clone() })
        }
    }
}

/// Maximum humidity. Bound: saturated air of 50 degC at 100 kPa has 0.088 kg/kg.
const MAX_HUMIDITY_KG_KG: f64 = 0.1;

/// Corrects a measured point; its efficiency is the apparent one if the table has none.
fn correct(row: &mut Row, point: &MeasuredPoint, reference: ReferenceState) {
    let air = Air::new(Gas::air(), point.humidity_kg_kg.unwrap_or(0.0)).between(point.p1_pa, point.p2_pa);
    row.pressure_ratio = point.p2_pa / point.p1_pa;
    row.speed_corrected_rpm = reference.corrected_speed_rpm(point.speed_rpm, point.t1_k);
    row.flow_corrected_kg_s =
        reference.corrected_flow_kg_s(point.flow_kg_s * air.dry_flow_ratio(), point.t1_k, point.p1_pa);
    let t2_k = point.t2_k.filter(|t2_k| *t2_k > point.t1_k && point.p2_pa > point.p1_pa);
    row.eta = row.eta.or(t2_k.map(|t2_k| apparent_efficiency(row.pressure_ratio, point.t1_k, t2_k, air)));
}

pub(super) fn read_notes(grid: &Grid, first_row: usize) -> Notes {
    let mut notes = Notes::default();
    for (index, row) in grid.rows.iter().enumerate() {
        if index >= first_row && !row.is_comment {
            continue;
        }
        let text = row.text();
        notes.reference = notes
            .reference
            .or_else(|| quantity::reference_in_comment(&text))
            .or_else(|| parse_reference_line(grid, &text));
        notes.efficiency = notes.efficiency.or_else(|| efficiency_in_comment(&text));
        if let Some((_, name)) =
            text.split_once("compressor map of ").or_else(|| text.split_once("turbine map of "))
        {
            notes.machine = name.trim().chars().take(200).collect();
        }
    }
    if notes.machine.is_empty() {
        notes.machine = title(grid, first_row).unwrap_or_default();
    }
    notes
}

/// The title of a text: words alone in its first line.
fn title(grid: &Grid, first_row: usize) -> Option<String> {
    let row = grid.rows.first().filter(|row| first_row > 0 && !row.is_comment)?;
    let text = row.text();
    let name = text.split(CORRECTED_TO).next().unwrap_or_default().trim();
    let is_alone = row.cells.len() == 1 || grid.is_blank_separated;
    let is_number = |cell: &String| grid.number(cell).is_some();
    let names_column = |cell: &String| !matches!(column(0, cell, Machine::Compressor), Ok(None));
    let is_title = is_alone
        && name.contains(char::is_alphabetic)
        && !is_end_title(name)
        && without_speed(grid, name).is_none()
        && name != UNNAMED_MACHINE
        && (name.len() < text.len() || !row.cells.iter().any(|cell| is_number(cell) || names_column(cell)));
    is_title.then(|| name.chars().take(200).collect())
}

/// What stands between machine and reference state in a title.
pub const CORRECTED_TO: &str = ", corrected to ";
/// The name of a machine without one.
pub const UNNAMED_MACHINE: &str = "unnamed machine";

/// "Reference Pressure 100 kPa, Reference Temperature 298 K": a pressure and a temperature in a line that names their purpose.
fn parse_reference_line(grid: &Grid, text: &str) -> Option<ReferenceState> {
    let lower = text.to_lowercase();
    let words =
        ["ref", "corrected to", "@", "conditions", "standard cond", "bezug", "korrigiert auf", "normzustand"];
    if !words.iter().any(|word| lower.contains(word)) {
        return None;
    }
    let is_mark = |c: char| c.is_whitespace() || matches!(c, '=' | ':' | ';' | '/' | '[' | ']' | '(' | ')');
    let words: Vec<&str> =
        text.split(is_mark).map(|word| word.trim_matches(',')).filter(|word| !word.is_empty()).collect();
    let of = |kind: Kind| {
        words.iter().enumerate().find_map(|(index, word)| {
            // `298K`, `298 K`.
            let end = word.find(|c: char| c.is_alphabetic() || c == '°').unwrap_or(word.len());
            let unit = if end < word.len() { word.get(end..) } else { words.get(index + 1).copied() };
            // In the heading of a column `R` is not a unit of temperature.
            let unit = unit.map(|unit| if matches!(unit, "R" | "°R") { "degR" } else { unit })?;
            let unit = header_unit(unit).filter(|unit| unit.kind == kind)?;
            Some(unit.unit.to_inside(grid.number(word.get(..end)?)?))
        })
    };
    let state = ReferenceState { t_ref_k: of(Kind::Temperature)?, p_ref_pa: of(Kind::Pressure)? };
    state.is_plausible().then_some(state)
}
