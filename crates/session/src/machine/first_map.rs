//! The nominal map of a first campaign: the machine's own, or that of a similar compressor.

use crate::errors::first_map_error::FirstMapError;
use crate::machine::first_request::{FirstCampaignRequest, digits};
use crate::{Registry, SessionError};
use mapper_campaign::nominal_table;
use mapper_core::{ReferenceState, one_line};
use mapper_maps::{MapFit, MapFitOptions};
use mapper_physics::compressor_map::characteristic::CompressorCharacteristic;
use mapper_physics::compressor_map::closed_form_map::{ClosedFormMap, TURBO_A_WHEEL_M};
use std::path::Path;

/// Lowest and highest corrected speed of campaigns/turbo_a.yaml, rpm: tip speeds of 136 and 422 m/s.
const TURBO_A_SPEEDS_RPM: (f64, f64) = (50e3, 155e3);
/// Speed lines of a grid that is not taken from a map.
const LINES: usize = 8;
/// Numbers of lines of a map that are all measured. Fewer have too few steps to determine alpha_A and the probe: 24 steps of four lines are
/// doubtful by their forecast. More take too long a night.
const MAP_LINES: std::ops::RangeInclusive<usize> = 7..=10;
/// Lines of the smooth surface between two measured ones: straight lines between them then depart by a sixteenth of what they did.
const LINES_BETWEEN: usize = 3;
/// Points of a line in the table of a similar compressor, closest to each other near surge, where the flow changes most with pressure.
const TABLE_POINTS: usize = 13;

/// Corrected speeds of a grid.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct MapLines {
    /// In order, rpm.
    pub speeds_rpm: Vec<f64>,
}

impl MapLines {
    /// Evenly spaced speeds, rounded to 100 rpm inside the range.
    fn even((low_rpm, high_rpm): (f64, f64)) -> Self {
        let step_rpm = (high_rpm - low_rpm) / (LINES - 1) as f64;
        let speed = |index: usize| (low_rpm + step_rpm * index as f64).clamp(low_rpm, high_rpm);
        MapLines { speeds_rpm: (0..LINES).map(|index| (speed(index) / 100.0).round() * 100.0).collect() }
    }

    /// The highest speed, rpm.
    pub fn highest_rpm(&self) -> f64 {
        self.speeds_rpm.last().copied().unwrap_or(0.0)
    }
}

/// The nominal map of a first campaign.
#[derive(Debug)]
pub(crate) struct FirstMap {
    /// Name of its file in the campaign's directory.
    pub file_name: String,
    /// The file's text.
    pub text: String,
    /// Speeds of the grid.
    pub lines: MapLines,
    /// Choke flow of the machine's own map over that of a similar compressor at equal speed; `None` without an own map.
    pub flow_ratio: Option<f64>,
}

impl FirstMap {
    /// The map of a request.
    ///
    /// # Errors
    /// [`FirstMapError`] if the machine's own map cannot be read, or has no line in the speed range.
    pub fn of(registry: &Registry, request: &FirstCampaignRequest) -> Result<Self, SessionError> {
        match &request.map {
            Some(path) => own(registry, request, path),
            None => Ok(similar(request)),
        }
    }
}

/// The table of a nominal map: the smooth surface through the file's map, or its points if they do not determine one. Straight lines between
/// few points have kinks, which no compressor has and which a transient would show as heat transfer.
fn own_text(registry: &Registry, path: &Path, reference: ReferenceState) -> Result<String, SessionError> {
    let map = registry.read_map(path, Some(reference))?;
    let mut text = format!(
        "# Smooth surface through the points of {}.\nspeed [rpm],flow [kg/s],pressure ratio,efficiency\n",
        one_line(&path.display().to_string())
    );
    let mut row = |rpm: f64, flow_kg_s: f64, pressure_ratio: f64, eta: f64| {
        text += &format!("{rpm:.1},{flow_kg_s:.6},{pressure_ratio:.5},{eta:.5}\n");
    };
    let speeds: Vec<f64> = map.lines.iter().map(|line| line.speed_corrected_rpm).collect();
    let between = speeds.windows(2).flat_map(|pair| {
        let step_rpm = (pair[1] - pair[0]) / (LINES_BETWEEN + 1) as f64;
        (1..=LINES_BETWEEN).map(move |index| pair[0] + step_rpm * index as f64)
    });
    let options = MapFitOptions {
        further_speeds_rpm: Some(between.collect()),
        leave_one_out: false,
        ..MapFitOptions::default()
    };
    match MapFit::new(&map).and_then(|fit| fit.table(&options)) {
        Ok(fitted) => {
            for line in &fitted.lines {
                for node in line.nodes.iter().filter(|node| !node.extrapolated) {
                    row(line.speed_corrected_rpm, node.flow_corrected_kg_s, node.pressure_ratio, node.eta);
                }
            }
        }
        Err(_) => {
            for line in &map.lines {
                for (point, eta) in line.points.iter().filter_map(|point| Some((point, point.eta?))) {
                    row(line.speed_corrected_rpm, point.flow_corrected_kg_s, point.pressure_ratio, eta);
                }
            }
        }
    }
    Ok(text)
}

fn own(registry: &Registry, request: &FirstCampaignRequest, path: &Path) -> Result<FirstMap, SessionError> {
    let reference = request.reference.state;
    let text = own_text(registry, path, reference)?;
    let map = nominal_table(&text, Some(reference))
        .map_err(|source| Box::new(FirstMapError::NotAMap { path: path.to_owned(), source }))?;
    let in_map = map.speeds_corrected_rpm();
    let map_rpm = (in_map.first().copied().unwrap_or(0.0), in_map.last().copied().unwrap_or(0.0));
    let asked_rpm = request.speeds_rpm.unwrap_or(map_rpm);
    let within: Vec<f64> =
        in_map.iter().copied().filter(|rpm| (asked_rpm.0..=asked_rpm.1).contains(rpm)).collect();
    let lines = match (within.first(), within.last()) {
        _ if MAP_LINES.contains(&within.len()) => MapLines { speeds_rpm: within },
        (Some(low), Some(high)) if low < high => MapLines::even((*low, *high)),
        _ => return Err(Box::new(FirstMapError::NoLines { asked_rpm, map_rpm }).into()),
    };
    let similar = ClosedFormMap { wheel_diameter_m: request.wheel_diameter_m };
    let choke = |map: &dyn CompressorCharacteristic| map.choke_flow_corrected_kg_s(map_rpm.1);
    Ok(FirstMap {
        file_name: format!("{}_map.csv", request.name),
        flow_ratio: Some(choke(&map) / choke(&similar)),
        text,
        lines,
    })
}

/// The map of a compressor similar to turbo_a, as a table.
fn similar(request: &FirstCampaignRequest) -> FirstMap {
    let wheel_diameter_m = request.wheel_diameter_m;
    let map = ClosedFormMap { wheel_diameter_m };
    let reference = request.reference.state;
    let speed_factor = TURBO_A_WHEEL_M / wheel_diameter_m;
    let usual = (speed_factor * TURBO_A_SPEEDS_RPM.0, speed_factor * TURBO_A_SPEEDS_RPM.1);
    let lines = MapLines::even(request.speeds_rpm.unwrap_or(usual));
    let mut text = format!(
        "# Nominal map of a compressor with a wheel of {} mm, geometrically similar to turbo_a. Replace it by your own map if you have one.\n\
         # Corrected to {} ({}).\n\
         speed [rpm],flow [kg/s],pressure ratio,efficiency\n",
        digits(1e3 * wheel_diameter_m, 6),
        request.reference.name,
        request.reference.printed
    );
    for rpm in &lines.speeds_rpm {
        let own_rpm = rpm * reference.speed_factor_to(ReferenceState::SAE);
        let (surge_pr, choke_pr) =
            (map.surge_point(own_rpm).1, 1.0 + 0.15 * (map.surge_point(own_rpm).1 - 1.0));
        for index in 0..TABLE_POINTS {
            // Close to surge the flow changes steeply with pressure.
            let from_surge = (index as f64 / (TABLE_POINTS - 1) as f64).powi(2);
            let pressure_ratio = surge_pr - from_surge * (surge_pr - choke_pr);
            let point = map.evaluate(own_rpm, pressure_ratio);
            let flow_kg_s = point.flow_corrected_kg_s * ReferenceState::SAE.flow_factor_to(reference);
            text += &format!("{rpm:.0},{flow_kg_s:.6},{pressure_ratio:.5},{:.5}\n", point.efficiency);
        }
    }
    FirstMap { file_name: format!("{}_map.csv", request.name), text, lines, flow_ratio: None }
}
