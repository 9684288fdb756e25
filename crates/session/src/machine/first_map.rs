//! The nominal map of a first campaign: the machine's own, or that of a similar compressor.

use crate::errors::first_map_error::FirstMapError;
use crate::machine::first_request::FirstCampaignRequest;
use crate::{Registry, SessionError};
use mapper_campaign::{MapMisfit, USUAL_WHEEL_DIAMETERS_M, find_map_misfit, nominal_table};
use mapper_chart::efficiency_mesh::{InterpolatedLine, SUBDIVISIONS, interpolated_lines};
use mapper_core::{ReferenceState, one_line};
use mapper_physics::compressor_map::characteristic::CompressorCharacteristic;
use mapper_physics::compressor_map::closed_form_map::{ClosedFormMap, TURBO_A_WHEEL_M};
use mapper_report::significant_digits;
use std::path::Path;

/// Lowest and highest corrected speed of campaigns/turbo_a.yaml, rpm: tip speeds of 136 and 422 m/s.
const TURBO_A_SPEEDS_RPM: (f64, f64) = (50e3, 155e3);
/// Speed lines of a grid that is not taken from a map.
const GRID_LINES: usize = 8;
/// A map with this many lines is measured on all of them. Fewer lines have too few steps to determine alpha_A and the probe: the forecast for
/// 24 steps on four lines is doubtful. More lines take longer than a night.
const MAP_LINE_COUNTS: std::ops::RangeInclusive<usize> = 7..=10;
/// Every so many interpolated lines become lines of the table: three between two measured ones. Linear interpolation then deviates from the
/// cubic by a sixteenth as much as without.
const LINE_STRIDE: usize = SUBDIVISIONS / 4;
/// Points of a line in the table of a similar compressor. They are densest near surge, where the flow changes most with pressure.
const POINTS_PER_LINE: usize = 13;

/// Evenly spaced speeds, rounded to 100 rpm inside the range.
fn evenly_spaced_rpm((low_rpm, high_rpm): (f64, f64)) -> Vec<f64> {
    let step_rpm = (high_rpm - low_rpm) / (GRID_LINES - 1) as f64;
    let speed = |index: usize| (low_rpm + step_rpm * index as f64).clamp(low_rpm, high_rpm);
    (0..GRID_LINES).map(|index| (speed(index) / 100.0).round() * 100.0).collect()
}

/// The nominal map of a first campaign.
#[derive(Debug)]
pub(crate) struct FirstMap {
    /// Name of its file in the campaign's directory.
    pub file_name: String,
    /// The file's text.
    pub text: String,
    /// Corrected speeds of the grid in order, rpm.
    pub speeds_rpm: Vec<f64>,
    /// Choke flow of the machine's own map over that of a similar compressor at equal speed; `None` without an own map.
    pub flow_ratio: Option<f64>,
}

impl FirstMap {
    /// The map of a request.
    ///
    /// # Errors
    /// [`FirstMapError`] if the machine's own map cannot be read, or has no line in the speed range.
    pub(crate) fn of(registry: &Registry, request: &FirstCampaignRequest) -> Result<Self, SessionError> {
        let (wheel_m, (low_m, high_m)) = (request.wheel_diameter_m, USUAL_WHEEL_DIAMETERS_M);
        if !(low_m..=high_m).contains(&wheel_m) {
            return Err(Box::new(FirstMapError::Wheel { wheel_m }).into());
        }
        match &request.map {
            Some(path) => map_from_file(registry, request, path),
            None => Ok(similar_map(request)),
        }
    }
}

/// The table of a nominal map: monotone cubics through the file's points, on its lines and on others between them, or the points themselves if
/// there are too few. Linear interpolation between few points has kinks, which identification would mistake for heat transfer; a fitted surface
/// would not pass through the points.
fn resample_table(
    registry: &Registry,
    path: &Path,
    reference: ReferenceState,
) -> Result<String, SessionError> {
    let map = registry.read_map(path, Some(reference))?;
    let misfit = |misfit| FirstMapError::Misfit { path: path.to_owned(), misfit };
    let efficiencies = map.lines.iter().flat_map(|line| &line.points).filter_map(|point| point.eta);
    if let Some(poor) = efficiencies.reduce(f64::max).and_then(MapMisfit::of_peak_efficiency) {
        return Err(Box::new(misfit(poor)).into());
    }
    let mut text = format!(
        "# Monotone cubics through the points of {}.\nspeed [rpm],flow [kg/s],pressure ratio,efficiency\n",
        one_line(&path.display().to_string())
    );
    let mut row = |rpm: f64, flow_kg_s: f64, pressure_ratio: f64, eta: f64| {
        text += &format!("{rpm:.1},{flow_kg_s:.6},{pressure_ratio:.5},{eta:.5}\n");
    };
    match interpolated_lines(&map) {
        Some(lines) => {
            for InterpolatedLine { speed_corrected_rpm, nodes } in lines.iter().step_by(LINE_STRIDE) {
                for [flow_kg_s, pressure_ratio, eta] in nodes.iter().filter(|node| node[2].is_finite()) {
                    row(*speed_corrected_rpm, *flow_kg_s, *pressure_ratio, *eta);
                }
            }
        }
        None => {
            for line in &map.lines {
                for (point, eta) in line.points.iter().filter_map(|point| Some((point, point.eta?))) {
                    row(line.speed_corrected_rpm, point.flow_corrected_kg_s, point.pressure_ratio, eta);
                }
            }
        }
    }
    Ok(text)
}

fn map_from_file(
    registry: &Registry,
    request: &FirstCampaignRequest,
    path: &Path,
) -> Result<FirstMap, SessionError> {
    let reference = request.reference.state;
    let text = resample_table(registry, path, reference)?;
    let map = nominal_table(&text, Some(reference))
        .map_err(|source| Box::new(FirstMapError::NotAMap(path.to_owned(), source)))?;
    if let Some(misfit) = find_map_misfit(&map, request.wheel_diameter_m) {
        return Err(Box::new(FirstMapError::Misfit { path: path.to_owned(), misfit }).into());
    }
    let map_speeds_rpm = map.speeds_corrected_rpm();
    let map_rpm =
        (map_speeds_rpm.first().copied().unwrap_or(0.0), map_speeds_rpm.last().copied().unwrap_or(0.0));
    let requested_rpm = request.speeds_rpm.unwrap_or(map_rpm);
    let selected_rpm: Vec<f64> = map_speeds_rpm
        .iter()
        .copied()
        .filter(|rpm| (requested_rpm.0..=requested_rpm.1).contains(rpm))
        .collect();
    let speeds_rpm = match (selected_rpm.first(), selected_rpm.last()) {
        _ if MAP_LINE_COUNTS.contains(&selected_rpm.len()) => selected_rpm,
        (Some(low), Some(high)) if low < high => evenly_spaced_rpm((*low, *high)),
        _ => return Err(Box::new(FirstMapError::NoLines { requested_rpm, map_rpm }).into()),
    };
    let similar = ClosedFormMap { wheel_diameter_m: request.wheel_diameter_m };
    let choke = |map: &dyn CompressorCharacteristic| map.choke_flow_corrected_kg_s(map_rpm.1);
    Ok(FirstMap {
        file_name: format!("{}_map.csv", request.name),
        flow_ratio: Some(choke(&map) / choke(&similar)),
        text,
        speeds_rpm,
    })
}

/// The map of a compressor similar to turbo_a, as a table.
fn similar_map(request: &FirstCampaignRequest) -> FirstMap {
    let wheel_diameter_m = request.wheel_diameter_m;
    let map = ClosedFormMap { wheel_diameter_m };
    let reference = request.reference.state;
    let speed_factor = TURBO_A_WHEEL_M / wheel_diameter_m;
    let default = (speed_factor * TURBO_A_SPEEDS_RPM.0, speed_factor * TURBO_A_SPEEDS_RPM.1);
    let speeds_rpm = evenly_spaced_rpm(request.speeds_rpm.unwrap_or(default));
    let mut text = format!(
        "# Nominal map of a compressor with a {} mm wheel, geometrically similar to turbo_a. Replace it with your own map if you have one.\n\
         # Corrected to {} ({}).\n\
         speed [rpm],flow [kg/s],pressure ratio,efficiency\n",
        significant_digits(1e3 * wheel_diameter_m, 6),
        request.reference.name,
        request.reference.printed
    );
    for rpm in &speeds_rpm {
        let speed_sae_rpm = rpm * reference.speed_factor_to(ReferenceState::SAE);
        let (surge_pr, choke_pr) =
            (map.surge_point(speed_sae_rpm).1, 1.0 + 0.15 * (map.surge_point(speed_sae_rpm).1 - 1.0));
        for index in 0..POINTS_PER_LINE {
            // Close to surge the flow changes steeply with pressure.
            let from_surge = (index as f64 / (POINTS_PER_LINE - 1) as f64).powi(2);
            let pressure_ratio = surge_pr - from_surge * (surge_pr - choke_pr);
            let point = map.evaluate(speed_sae_rpm, pressure_ratio);
            let flow_kg_s = point.flow_corrected_kg_s * ReferenceState::SAE.flow_factor_to(reference);
            text += &format!("{rpm:.0},{flow_kg_s:.6},{pressure_ratio:.5},{:.5}\n", point.efficiency);
        }
    }
    FirstMap { file_name: format!("{}_map.csv", request.name), text, speeds_rpm, flow_ratio: None }
}
