//! Maps of turbines: tables of points with exact digits, the fitted table with its intervals, and tables for simulation programs.

use crate::sae::{WIDTH, field};
use crate::simulation_table::digits;
use mapper_core::{
    ExportError, FittedTurbine, FittedTurbineLine, FittedTurbineNode, ImportError, ImportedTurbine,
    MapDescription, TurbineFormat, TurbineMap, one_line,
};
use mapper_maps::table::{read_turbine_text, read_turbine_workbook, text_of};
use serde::Serialize;
use std::fmt::Write;

pub(crate) const CSV: TurbineFormat = TurbineFormat { write: Some(write_csv), read: Some(read_text) };
pub(crate) const TEXT: TurbineFormat = TurbineFormat { write: Some(write_sae), read: Some(read_text) };
pub(crate) const WORKBOOK: TurbineFormat = TurbineFormat { write: None, read: Some(read_turbine_workbook) };
pub(crate) const JSON: TurbineFormat = TurbineFormat { write: Some(write_json), read: Some(read_json) };
pub(crate) const FITTED: TurbineFormat = TurbineFormat { write: Some(write_fitted), read: None };
pub(crate) const SIMSCAPE: TurbineFormat = TurbineFormat { write: Some(write_simscape), read: None };
pub(crate) const MODELICA: TurbineFormat = TurbineFormat { write: Some(write_modelica), read: None };

/// Value of `kind` in the JSON of a turbine map.
pub(crate) const KIND: &str = "turbine";

/// Name and units in comment lines that begin with `mark`.
fn heading(map: &TurbineMap, mark: &str) -> String {
    let machine = if map.machine.is_empty() { "unnamed machine".to_owned() } else { one_line(&map.machine) };
    format!(
        "{mark} turbine map of {machine}\n\
         {mark} reduced by the inlet: rpm over the root of K; kg/s times the root of K over kPa; efficiencies as shares\n"
    )
}

fn read_text(bytes: &[u8], given: &MapDescription) -> Result<ImportedTurbine, ImportError> {
    read_turbine_text(&text_of(bytes)?, given)
}

fn write_csv(map: &TurbineMap) -> Result<Vec<u8>, ExportError> {
    let has_vanes = map.points.iter().any(|point| point.vane_position.is_some());
    let mut text = heading(map, "#");
    if has_vanes {
        text.push_str("vane position,");
    }
    text.push_str("N/sqrt(T3) [rpm/K^0.5],m*sqrt(T3)/p3 [kg/s*K^0.5/kPa],expansion ratio,efficiency\n");
    for point in &map.points {
        if has_vanes {
            text += &(digits(point.vane_position) + ",");
        }
        let _ = writeln!(
            text,
            "{},{},{},{}",
            point.speed_parameter_rpm_sqrt_k,
            point.flow_parameter_kg_sqrt_k_s_kpa,
            point.expansion_ratio,
            digits(point.efficiency)
        );
    }
    Ok(text.into_bytes())
}

/// SAE text in the columns of the compressor's; vanes add a fifth one. A point without efficiency has `-`.
fn write_sae(map: &TurbineMap) -> Result<Vec<u8>, ExportError> {
    let has_vanes = map.points.iter().any(|point| point.vane_position.is_some());
    let title = heading(map, "");
    let mut text = title.lines().next().unwrap_or_default().trim_start().to_owned();
    let vanes = if has_vanes { " VGT" } else { "" };
    let _ = writeln!(text, "\n{}{}", field(0.0), field(0.0));
    let _ = writeln!(text, "SP(rpm/sqrt(K)) mfp(kg-sqrt(K)/s-kPa) ER Eff{vanes}");
    let number = |value: Option<f64>| value.map_or(format!("{:>WIDTH$}", "-"), field);
    for point in &map.points {
        let numbers =
            [point.speed_parameter_rpm_sqrt_k, point.flow_parameter_kg_sqrt_k_s_kpa, point.expansion_ratio];
        text.extend(numbers.map(field));
        text += &number(point.efficiency);
        text.extend(has_vanes.then(|| number(point.vane_position)));
        text.push('\n');
    }
    Ok(text.into_bytes())
}

#[derive(Serialize)]
struct MapDocument<'a> {
    kind: &'static str,
    #[serde(flatten)]
    map: &'a TurbineMap,
}

fn write_json(map: &TurbineMap) -> Result<Vec<u8>, ExportError> {
    let mut bytes =
        serde_json::to_vec_pretty(&MapDocument { kind: KIND, map }).map_err(ExportError::failed("json"))?;
    bytes.push(b'\n');
    Ok(bytes)
}

fn read_json(bytes: &[u8], _: &MapDescription) -> Result<ImportedTurbine, ImportError> {
    let map: TurbineMap = serde_json::from_slice(bytes)?;
    let is_number = |value: f64| value.is_finite() && value > 0.0;
    for (index, point) in map.points.iter().enumerate() {
        for (quantity, value) in [
            ("speed parameter", point.speed_parameter_rpm_sqrt_k),
            ("flow parameter", point.flow_parameter_kg_sqrt_k_s_kpa),
            ("expansion ratio - 1", point.expansion_ratio - 1.0),
        ] {
            if !is_number(value) {
                let place = format!("point {} of the map", index + 1);
                return Err(ImportError::Field { place, quantity, value, needed: "a number above 0" });
            }
        }
    }
    if map.points.is_empty() { Err(ImportError::Empty) } else { Ok(map.into()) }
}

fn fitted<'a>(map: &'a TurbineMap, format: &'static str) -> Result<&'a FittedTurbine, ExportError> {
    map.fitted.as_ref().ok_or(ExportError::NeedsFit { format })
}

/// The nodes with 95 % intervals of a measurement there.
fn write_fitted(map: &TurbineMap) -> Result<Vec<u8>, ExportError> {
    let fitted = fitted(map, "fitted")?;
    let mut text = heading(map, "#");
    text.push_str(
        "# *_low and *_high: 95 % interval of a measurement there; beyond the measured expansion ratios of a line `extrapolated`\n\
         vane position,N/sqrt(T3) [rpm/K^0.5],m*sqrt(T3)/p3 [kg/s*K^0.5/kPa],expansion ratio,efficiency,\
         flow_low,flow_high,efficiency_low,efficiency_high,support\n",
    );
    for line in &fitted.lines {
        for node in &line.nodes {
            let _ = writeln!(
                text,
                "{},{},{},{},{},{},{},{},{},{}",
                digits(line.vane_position),
                line.speed_parameter_rpm_sqrt_k,
                node.flow_parameter_kg_sqrt_k_s_kpa,
                node.expansion_ratio,
                digits(node.efficiency),
                node.flow_low,
                node.flow_high,
                digits(node.efficiency_low),
                digits(node.efficiency_high),
                if node.extrapolated { "extrapolated" } else { "measured" }
            );
        }
    }
    Ok(text.into_bytes())
}

fn by_vane(fitted: &FittedTurbine) -> impl Iterator<Item = &[FittedTurbineLine]> {
    fitted.lines.chunk_by(|a, b| a.vane_position == b.vane_position)
}

type Value = fn(&FittedTurbineNode) -> Option<f64>;
/// The tables over speed and expansion ratio.
const TABLES: [(&str, Value); 2] = [
    ("flow_parameter", |node| Some(node.flow_parameter_kg_sqrt_k_s_kpa)),
    ("efficiency", |node| node.efficiency),
];

fn row(line: &FittedTurbineLine, value: Value) -> Option<String> {
    let values: Option<Vec<String>> = line.nodes.iter().map(|node| Some(value(node)?.to_string())).collect();
    Some(values?.join(" "))
}

/// Name of a table at a vane position: the first, the second of several.
fn table_name(name: &str, index: usize, count: usize) -> String {
    if count > 1 { format!("{name}_vane_{}", index + 1) } else { name.to_owned() }
}

/// MATLAB arrays over speed (rows) and expansion ratio (columns).
fn write_simscape(map: &TurbineMap) -> Result<Vec<u8>, ExportError> {
    let fitted = fitted(map, "simscape")?;
    let mut text = heading(map, "%");
    let count = by_vane(fitted).count();
    for (index, lines) in by_vane(fitted).enumerate() {
        let Some(first) = lines.first() else { continue };
        if let Some(position) = first.vane_position {
            let _ = writeln!(text, "{} = {position};", table_name("vane_position", index, count));
        }
        let speeds: Vec<String> =
            lines.iter().map(|line| line.speed_parameter_rpm_sqrt_k.to_string()).collect();
        let _ = writeln!(text, "{} = [{}];", table_name("speed_parameter", index, count), speeds.join(" "));
        let ratios: Vec<String> = first.nodes.iter().map(|node| node.expansion_ratio.to_string()).collect();
        let _ = writeln!(text, "{} = [{}];", table_name("expansion_ratio", index, count), ratios.join(" "));
        for (name, value) in TABLES {
            let rows: Option<Vec<String>> = lines.iter().map(|line| row(line, value)).collect();
            if let Some(rows) = rows {
                let _ = writeln!(text, "{} = [\n  {}\n];", table_name(name, index, count), rows.join("\n  "));
            }
        }
    }
    Ok(text.into_bytes())
}

/// `Modelica.Blocks.Tables.CombiTable2Ds`: u1 speed parameter, u2 expansion ratio.
fn write_modelica(map: &TurbineMap) -> Result<Vec<u8>, ExportError> {
    let fitted = fitted(map, "modelica")?;
    // The version must be the very first line.
    let mut text = format!("#1\n{}# u1: speed parameter; u2: expansion ratio\n", heading(map, "#"));
    let count = by_vane(fitted).count();
    for (index, lines) in by_vane(fitted).enumerate() {
        let Some(first) = lines.first() else { continue };
        if let Some(position) = first.vane_position {
            let _ = writeln!(text, "# vane position {position}");
        }
        let ratios: Vec<String> = first.nodes.iter().map(|node| node.expansion_ratio.to_string()).collect();
        for (name, value) in TABLES {
            let rows: Option<Vec<String>> = lines.iter().map(|line| row(line, value)).collect();
            let Some(rows) = rows else { continue };
            let size = (rows.len() + 1, ratios.len() + 1);
            let _ = writeln!(text, "double {}({},{})", table_name(name, index, count), size.0, size.1);
            let _ = writeln!(text, "0 {}", ratios.join(" "));
            for (line, row) in lines.iter().zip(rows) {
                let _ = writeln!(text, "{} {row}", line.speed_parameter_rpm_sqrt_k);
            }
        }
    }
    Ok(text.into_bytes())
}
