//! Checks that the nominal model can reach each point within the limits.

use crate::campaign::Campaign;
use crate::nominal_table::NominalTableError;
use mapper_core::OperatingPoint;
use mapper_physics::compressor_map::characteristic::CompressorCharacteristic;
use mapper_physics::compressor_map::closed_form_map::ClosedFormMap;
use mapper_physics::operating_point::reach::{describe_obstacles, reach};
use mapper_physics::simulation::model::Model;
use std::sync::Arc;

/// A point that cannot be measured.
#[derive(Debug, Clone, PartialEq)]
pub struct UnreachablePoint {
    /// Index in [`Campaign::points`].
    pub point: usize,
    /// Reason, with values and units.
    pub reason: String,
    /// The remedy.
    pub remedy: String,
    /// Key of the limit below `limits` that is in the way, if one is.
    pub limit: Option<&'static [&'static str]>,
}

/// The nominal model of a campaign, on its map.
///
/// # Errors
/// [`NominalTableError`] if the map file's text is not a map; this cannot happen in a checked campaign.
pub fn nominal_model(campaign: &Campaign) -> Result<Model, NominalTableError> {
    let params = campaign.machine.params;
    let map: Arc<dyn CompressorCharacteristic> = match campaign.machine.map.table() {
        None => Arc::new(ClosedFormMap { wheel_diameter_m: params.compressor.wheel_diameter_m }),
        Some(table) => Arc::new(table?),
    };
    Ok(Model::new(params, map))
}

/// The points that cannot be measured, each with all reasons; see [`mapper_physics::operating_point::reach`].
pub fn unreachable_points(campaign: &Campaign, model: &Model) -> Vec<UnreachablePoint> {
    let check_point = |(index, point): (usize, &OperatingPoint)| {
        let (boundary, limits) = (&campaign.boundary, &campaign.limits);
        let obstacles = reach(model, *point, boundary, campaign.follow_outlet, limits).err()?;
        let (krpm, opening) = point.shown();
        let krpm = (krpm * 1e2).round() / 1e2;
        Some(UnreachablePoint {
            point: index,
            reason: format!("{krpm} krpm at opening {opening} {}", describe_obstacles(&obstacles)),
            remedy: obstacles.first()?.remedy().to_owned(),
            limit: obstacles.first()?.limit(),
        })
    };
    campaign.points.iter().enumerate().filter_map(check_point).collect()
}
