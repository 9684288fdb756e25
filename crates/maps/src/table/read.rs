//! Reads a table of points as engineers have it: headings of several languages in any order, units in the heading or below it, a preamble,
//! a speed only in the first row of its line, one block per speed or side by side, measured points that are not corrected yet.

use crate::table::columns::column::Machine;
use crate::table::columns::described_columns::Given;
use crate::table::columns::quantity::Quantity;
use crate::table::efficiency_comment::efficiency_in_comment;
use crate::table::gas_turbine::beta_tables::{read_arrays, read_modelica, read_nested};
use crate::table::gas_turbine::design_point::{MapDesign, scale_to_design};
use crate::table::reference;
use crate::table::rows_to_lines::{Row, map_of_rows};
use crate::table::sheet::grid::{Grid, text_of};
use crate::table::sheet::layout::{self, Layout};
use crate::table::sheet::points::{Point, columns, efficiency_in_percent, points};
use mapper_core::{
    CompressorMap, EfficiencyDefinition, ImportError, ImportRemark, ImportedMap, MapDescription,
    ReferenceState, StaticTaps,
};
use mapper_physics::gas::air::Air;
use mapper_physics::gas::pressure_tap::static_to_total_pa;
use mapper_physics::laws::compression::apparent_efficiency;
use mapper_yaml::units::{Kind, header_unit};

/// The map of a text.
///
/// # Errors
/// [`ImportError`] with the line of the file.
pub fn read_text(text: &str, given: &MapDescription) -> Result<ImportedMap, ImportError> {
    read(&Grid::of_text(text)?, given)
}

/// The map of a text in any layout: tables of NPSS or Modelica, arrays of a script, or a table of points.
///
/// # Errors
/// [`ImportError`] with the line of the file.
pub fn read_any_text(text: &str, given: &MapDescription) -> Result<ImportedMap, ImportError> {
    if text.contains(NPSS_TABLE) {
        read_nested(text, given)
    } else if text.lines().next() == Some("#1") && text.contains("\ndouble ") {
        read_modelica(text, given)
    } else if has_arrays(text) {
        read_arrays(text, given)
    } else {
        read_text(text, given)
    }
}

/// The map of a file of text.
///
/// # Errors
/// As [`read_any_text`], and [`ImportError::NotText`].
pub fn read_any_bytes(bytes: &[u8], given: &MapDescription) -> Result<ImportedMap, ImportError> {
    read_any_text(&text_of(bytes)?, given)
}

/// How every table of an NPSS map begins.
const NPSS_TABLE: &str = "Table TB_";

/// Whether a script assigns arrays.
fn has_arrays(text: &str) -> bool {
    text.contains("np.array(") || text.lines().any(|line| line.replace(' ', "").contains("=["))
}

/// The map of a workbook: of its first sheet with a table of numbers.
///
/// # Errors
/// [`ImportError`] with the row of the sheet.
pub fn read_workbook(bytes: &[u8], given: &MapDescription) -> Result<ImportedMap, ImportError> {
    read(&Grid::of_workbook(bytes, given.sheet.as_deref())?, given)
}

/// Information from the rows outside the table.
#[derive(Default)]
pub(super) struct Notes {
    pub(super) reference: Option<ReferenceState>,
    pub(super) machine: String,
    efficiency: Option<EfficiencyDefinition>,
}

fn read(grid: &Grid, description: &MapDescription) -> Result<ImportedMap, ImportError> {
    let given = Given::of(description, Machine::Compressor)?;
    let Some(layout) = layout::layout(grid, &given)? else { return Err(ImportError::Empty) };
    let notes = notes(grid, layout.first_row);
    let mut remarks = layout.remarks.clone();
    let mut reference = reference::settle(notes.reference, description.reference);
    if layout.needs_no_reference() && matches!(reference, Err(ImportError::NoReference)) {
        // Reduced quantities become corrected ones of any state; this one is the usual.
        reference = Ok(ReferenceState::SAE);
        remarks.push(ImportRemark::ReducedQuantities { reference: ReferenceState::SAE });
    }
    let reference = reference?;
    let points = points(grid, &given, &layout, &mut remarks)?;
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
    let mut rows = Vec::with_capacity(points.len());
    for point in &points {
        rows.push(row(point, &layout, reference, in_percent, taps)?);
    }
    scale_to_design(&mut rows, MapDesign::default(), description.design, &mut remarks)?;
    rows.iter().try_for_each(Row::check)?;
    if rows.iter().all(|row| row.eta.is_none()) {
        remarks.push(ImportRemark::NoEfficiency);
    }
    let map = map_of_rows(notes.machine, &rows, Some(reference), None)?;
    let efficiency =
        if layout.is_measured() { Some(EfficiencyDefinition::Enthalpy) } else { notes.efficiency };
    Ok(ImportedMap { map: CompressorMap { efficiency, ..map }, columns, remarks })
}

/// The four numbers of a point.
fn row(
    point: &Point<'_>,
    layout: &Layout,
    reference: ReferenceState,
    in_percent: bool,
    taps: StaticTaps,
) -> Result<Row, ImportError> {
    let any =
        |quantities: &[Quantity]| quantities.iter().find_map(|quantity| point.value(*quantity, reference));
    let needed = |value: Option<f64>, quantity: Quantity| {
        value.ok_or_else(|| ImportError::NotANumber {
            line: point.at,
            quantity: quantity.name().to_owned(),
            text: String::new(),
        })
    };
    let own_speed = any(&[Quantity::Speed, Quantity::ReducedSpeed]);
    let speed_rpm = needed(own_speed.or(point.speed), Quantity::Speed)?;
    let flow_kg_s =
        needed(any(&[Quantity::Flow, Quantity::VolumeFlow, Quantity::ReducedFlow]), Quantity::Flow)?;
    let mut row = Row {
        at: point.at,
        speed_corrected_rpm: speed_rpm,
        flow_corrected_kg_s: flow_kg_s,
        pressure_ratio: f64::NAN,
        eta: any(&[Quantity::Efficiency]).map(|eta| if in_percent { 0.01 * eta } else { eta }),
    };
    if layout.is_measured() {
        let t1_k = needed(any(&[Quantity::T1]), Quantity::T1)?;
        let t2_k = any(&[Quantity::T2]);
        let mut p1_pa = needed(any(&[Quantity::P1]), Quantity::P1)?;
        let mut p2_pa = needed(any(&[Quantity::P2]), Quantity::P2)?;
        if let Some(diameter_m) = taps.inlet_diameter_m {
            p1_pa = static_to_total_pa(p1_pa, flow_kg_s, t1_k, diameter_m);
        }
        if let Some(diameter_m) = taps.outlet_diameter_m {
            p2_pa = static_to_total_pa(p2_pa, flow_kg_s, needed(t2_k, Quantity::T2)?, diameter_m);
        }
        row.pressure_ratio = p2_pa / p1_pa;
        row.speed_corrected_rpm = reference.corrected_speed_rpm(speed_rpm, t1_k);
        row.flow_corrected_kg_s = reference.corrected_flow_kg_s(flow_kg_s, t1_k, p1_pa);
        let t2_k = t2_k.filter(|t2_k| *t2_k > t1_k && p2_pa > p1_pa);
        let apparent = t2_k.map(|t2_k| apparent_efficiency(row.pressure_ratio, t1_k, t2_k, Air::DRY));
        row.eta = row.eta.or(apparent);
    } else {
        row.pressure_ratio = needed(any(&[Quantity::PressureRatio]), Quantity::PressureRatio)?;
    }
    Ok(row)
}

/// Looks through the rows outside the table.
pub(super) fn notes(grid: &Grid, first_row: usize) -> Notes {
    let mut notes = Notes::default();
    for (index, row) in grid.rows.iter().enumerate() {
        if index >= first_row && !row.is_comment {
            continue;
        }
        let text = row.text();
        notes.reference =
            notes.reference.or_else(|| reference::in_comment(&text)).or_else(|| reference_in(grid, &text));
        notes.efficiency = notes.efficiency.or_else(|| efficiency_in_comment(&text));
        if let Some((_, name)) =
            text.split_once("compressor map of ").or_else(|| text.split_once("turbine map of "))
        {
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
