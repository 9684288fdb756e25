//! Maps with relative speeds: programs for gas turbines scale a map to the design point of an engine, which a script of beta tables may state.

use crate::table::column::flow_unit_kg_s;
use crate::table::rows_to_lines::Row;
use mapper_core::{DesignPoint, ImportError, ImportRemark, MapDescription};

/// The design point of a map file, in the numbers of its tables. NPSS and pyCycle: NcMapDes, RlineMapDes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapDesign {
    pub speed: f64,
    /// Flow, pressure ratio and efficiency there; `None` if the tables do not have the point.
    pub values: Option<[f64; 3]>,
    pub rline: f64,
}

impl Default for MapDesign {
    /// Speed 1, as in tables of points.
    fn default() -> Self {
        MapDesign { speed: 1.0, values: None, rline: f64::NAN }
    }
}

/// Maximum relative speed. Bound: larger ones are in rpm.
const MAX_RELATIVE_SPEED: f64 = 10.0;

/// Scales rows with relative speeds to the stated design point, by the rule of NPSS and pyCycle: speed, flow and efficiency in proportion,
/// pressure ratio minus 1 in proportion. Returns whether the speeds are relative.
pub fn scale_to_design(
    rows: &mut [Row],
    map: MapDesign,
    design: DesignPoint,
    remarks: &mut Vec<ImportRemark>,
) -> Result<bool, ImportError> {
    let fastest = rows.iter().map(|row| row.speed_corrected_rpm).fold(0.0, f64::max);
    let is_relative = fastest < MAX_RELATIVE_SPEED && !rows.is_empty();
    let speed_factor = match design.speed_corrected_rpm {
        None if is_relative => return Err(ImportError::RelativeSpeed { fastest }),
        None => 1.0,
        Some(_) if !is_relative => return Err(ImportError::DesignSpeedUnused { fastest }),
        Some(rpm) => {
            remarks.push(ImportRemark::DesignSpeed { rpm: rpm / map.speed });
            rpm / map.speed
        }
    };
    let design_values = [design.flow_corrected_kg_s, design.pressure_ratio, design.eta];
    let mut factors = [1.0; 3];
    for (index, wanted) in design_values.into_iter().enumerate() {
        let Some(wanted) = wanted else { continue };
        let missing = ImportError::DesignPoint { speed: map.speed, rline: map.rline };
        let own = map.values.and_then(|values| values.get(index).copied()).ok_or(missing)?;
        // Pressure ratios scale from 1.
        let zero = if index == 1 { 1.0 } else { 0.0 };
        if let Some(factor) = factors.get_mut(index) {
            *factor = (wanted - zero) / (own - zero);
        }
    }
    let [flow, ratio, eta] = factors;
    for row in rows {
        row.speed_corrected_rpm *= speed_factor;
        row.flow_corrected_kg_s *= flow;
        if ratio != 1.0 {
            row.pressure_ratio = 1.0 + ratio * (row.pressure_ratio - 1.0);
        }
        row.eta = row.eta.map(|value| eta * value);
    }
    Ok(is_relative)
}

/// Occurrences of a name as a whole word, each with the text after its quotes and brackets.
fn occurrences<'a>(code: &'a str, name: &'a str) -> impl Iterator<Item = &'a str> {
    let is_name = |c: char| c.is_alphanumeric() || c == '_';
    code.match_indices(name).filter_map(move |(at, _)| {
        let rest = &code[at + name.len()..];
        let is_whole = !code[..at].ends_with(is_name) && !rest.starts_with(is_name);
        is_whole.then(|| rest.trim_start_matches(['\'', '"', ']', ' ', '\t']))
    })
}

/// The number after one of the names: `NcMapDes = 1.0`, `defaults["NcMap"] = 1.0`, `'NcMap': 1.0`.
fn number(code: &str, names: &[&str]) -> Option<f64> {
    let number = |text: &str| {
        let value = text.strip_prefix(['=', ':'])?.trim_start();
        let end = value.find(|c: char| !(c.is_ascii_digit() || "+-.eE".contains(c))).unwrap_or(value.len());
        value[..end].parse::<f64>().ok().filter(|value| value.is_finite())
    };
    names.iter().find_map(|name| occurrences(code, name).find_map(number))
}

/// The unit in quotes after one of the names: `'WcMap': 'lbm/s'`.
fn flow_unit_in(code: &str) -> Option<f64> {
    let unit = |text: &str| {
        let quoted = text.strip_prefix(['=', ':'])?.trim_start().strip_prefix(['\'', '"'])?;
        flow_unit_kg_s(&quoted.split(['\'', '"']).next()?.replace("lbm", "lb"))
    };
    ["WcMap", "WcArray", "Wc"].iter().find_map(|name| occurrences(code, name).find_map(unit))
}

pub(crate) fn design_of(code: &str) -> MapDesign {
    let default = MapDesign::default();
    MapDesign {
        speed: number(code, &["NcMapDes", "NcDes", "des_Nc", "NcMap"])
            .filter(|speed| *speed > 0.0)
            .unwrap_or(default.speed),
        rline: number(code, &["RlineMapDes", "RlineDes", "des_Rline", "RlineMap"]).unwrap_or(default.rline),
        values: None,
    }
}

pub(crate) fn flow_unit(code: &str, description: &MapDescription) -> Result<Option<f64>, ImportError> {
    let Some(column) = description.columns.iter().find(|column| column.quantity == "flow") else {
        return Ok(flow_unit_in(code));
    };
    let wrong = || ImportError::Description {
        key: column.quantity,
        text: column.text.chars().take(60).collect(),
        problem: "is not a unit of mass flow; write e.g. `flow: lb/s`".to_owned(),
    };
    flow_unit_kg_s(&column.text).map(Some).ok_or_else(wrong)
}

/// Interpolates a table over speed and an auxiliary coordinate, linear in both; `None` outside.
pub(crate) fn interpolate(speeds: &[f64], beta: &[f64], values: &[f64], design: MapDesign) -> Option<f64> {
    let (line, line_share) = locate(speeds, design.speed)?;
    let (column, column_share) = locate(beta, design.rline)?;
    let at = |line: usize, column: usize| values.get(line * beta.len() + column).copied();
    let on_line = |line: usize| {
        let (low, high) = (at(line, column)?, at(line, (column + 1).min(beta.len() - 1))?);
        Some(low + column_share * (high - low))
    };
    let (low, high) = (on_line(line)?, on_line((line + 1).min(speeds.len() - 1))?);
    Some(low + line_share * (high - low))
}

/// Index below a value, and the weight of the next one.
fn locate(rising: &[f64], wanted: f64) -> Option<(usize, f64)> {
    if let Some(index) = rising.iter().position(|value| *value == wanted) {
        return Some((index, 0.0));
    }
    let index = rising.windows(2).position(|pair| pair[0] < wanted && wanted < pair[1])?;
    Some((index, (wanted - rising[index]) / (rising[index + 1] - rising[index])))
}
