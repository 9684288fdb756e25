//! The nominal map of a first campaign: the machine's own, or that of a similar compressor.

use crate::SessionError;
use crate::first_campaign::{FirstCampaignRequest, digits};
use mapper_campaign::{NominalTableError, nominal_table};
use mapper_core::ReferenceState;
use mapper_physics::characteristic::CompressorCharacteristic;
use mapper_physics::closed_form_map::{ClosedFormMap, TURBO_A_WHEEL_M};
use std::path::PathBuf;

/// Lowest and highest corrected speed of campaigns/turbo_a.yaml, rpm: tip speeds of 136 and 422 m/s.
const TURBO_A_SPEEDS_RPM: (f64, f64) = (50e3, 155e3);
/// Speed lines of a grid that is not taken from a map.
const LINES: usize = 8;
/// Numbers of lines of a map that are all measured; fewer give too small a map, more too long a night.
const MAP_LINES: std::ops::RangeInclusive<usize> = 4..=10;
/// Points of a line in the table of a similar compressor; a straight line between two departs by less than 0.3 % in flow.
const TABLE_POINTS: usize = 13;

/// Why there is no nominal map.
#[derive(Debug, thiserror::Error)]
pub enum FirstMapError {
    /// The file cannot be read.
    #[error("failed to read the map {}: {source}", .path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It is not a map.
    #[error(
        "the file {} is not a map: {source}; write a table with corrected speed, corrected flow, pressure ratio and efficiency, with \
         units in its heading, or convert it with `mapper map convert`", .path.display()
    )]
    NotAMap {
        /// The file.
        path: PathBuf,
        /// Why.
        source: NominalTableError,
    },
    /// The speed range does not overlap with the map.
    #[error(
        "the speeds {:.1} to {:.1} krpm leave no line of the map, which has {:.1} to {:.1} krpm; choose speeds within it",
        .asked_rpm.0 / 1e3, .asked_rpm.1 / 1e3, .map_rpm.0 / 1e3, .map_rpm.1 / 1e3
    )]
    NoLines {
        /// The speeds asked for, rpm.
        asked_rpm: (f64, f64),
        /// The lowest and highest line of the map, rpm.
        map_rpm: (f64, f64),
    },
}

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
    /// Whether the file is to be written: the machine's own may already be in the directory.
    pub is_written: bool,
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
    pub fn of(request: &FirstCampaignRequest) -> Result<Self, SessionError> {
        match &request.map {
            Some(path) => Ok(own(request, path).map_err(Box::new)?),
            None => Ok(similar(request)),
        }
    }
}

fn own(request: &FirstCampaignRequest, path: &PathBuf) -> Result<FirstMap, FirstMapError> {
    let text = mapper_campaign::read_text(path)
        .map_err(|source| FirstMapError::Read { path: path.clone(), source })?;
    let reference = request.reference.state;
    let map = nominal_table(&text, reference)
        .map_err(|source| FirstMapError::NotAMap { path: path.clone(), source })?;
    let in_map = map.speeds_corrected_rpm();
    let map_rpm = (in_map.first().copied().unwrap_or(0.0), in_map.last().copied().unwrap_or(0.0));
    let asked_rpm = request.speeds_rpm.unwrap_or(map_rpm);
    let within: Vec<f64> =
        in_map.iter().copied().filter(|rpm| (asked_rpm.0..=asked_rpm.1).contains(rpm)).collect();
    let lines = match (within.first(), within.last()) {
        _ if MAP_LINES.contains(&within.len()) => MapLines { speeds_rpm: within },
        (Some(low), Some(high)) if low < high => MapLines::even((*low, *high)),
        _ => return Err(FirstMapError::NoLines { asked_rpm, map_rpm }),
    };
    let similar = ClosedFormMap { wheel_diameter_m: request.wheel_diameter_m };
    let choke = |map: &dyn CompressorCharacteristic| map.choke_flow_corrected_kg_s(map_rpm.1);
    let named = path.file_name().map(|name| name.to_string_lossy().into_owned());
    let in_place = named.as_ref().filter(|name| {
        let there = std::fs::canonicalize(request.directory.join(name)).ok();
        there.is_some() && there == std::fs::canonicalize(path).ok()
    });
    Ok(FirstMap {
        is_written: in_place.is_none(),
        file_name: in_place.cloned().unwrap_or_else(|| format!("{}_map.csv", request.name)),
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
    FirstMap {
        file_name: format!("{}_map.csv", request.name),
        text,
        is_written: true,
        lines,
        flow_ratio: None,
    }
}
