//! Maps with relative speeds: programs for gas turbines scale a map to the design point of an engine.

use crate::table::rows_to_lines::Row;
use mapper_core::{DesignPoint, ImportError, ImportRemark};

/// The design point of a map file, in the numbers of its tables. NPSS and pyCycle: NcMapDes, RlineMapDes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MapDesign {
    pub speed: f64,
    /// Flow, pressure ratio and efficiency there; `None` if the tables do not have the point.
    pub values: Option<[f64; 3]>,
    /// Auxiliary coordinate.
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
///
/// # Errors
/// [`ImportError::RelativeSpeed`] without a design speed, [`ImportError::DesignSpeedUnused`] with one that the file does not need,
/// [`ImportError::DesignPoint`] if the tables do not have the design point.
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
