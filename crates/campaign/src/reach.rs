//! Whether the nominal model can reach each point within the limits.

use crate::campaign::{Campaign, MapSource};
use mapper_core::OperatingPoint;
use mapper_physics::characteristic::CompressorCharacteristic;
use mapper_physics::closed_form_map::ClosedFormMap;
use mapper_physics::model::Model;
use mapper_physics::params::BoundaryConditions;
use mapper_physics::steady::hold_speed;
use mapper_physics::tabulated_map::{MapError, TabulatedMap};
use std::sync::Arc;

/// A point that cannot be measured.
#[derive(Debug, Clone, PartialEq)]
pub struct Unreachable {
    /// Index in [`Campaign::points`].
    pub point: usize,
    /// Why, with values and units.
    pub reason: String,
    /// What to do.
    pub remedy: String,
}

/// The nominal model of a campaign, on its map.
///
/// # Errors
/// [`MapError`] where the map file's text is no map; a checked campaign has none.
pub fn nominal_model(campaign: &Campaign) -> Result<Model, MapError> {
    let params = campaign.machine.params;
    let map: Arc<dyn CompressorCharacteristic> = match &campaign.machine.map {
        MapSource::ClosedForm => {
            Arc::new(ClosedFormMap { wheel_diameter_m: params.compressor.wheel_diameter_m })
        }
        MapSource::Table { text, reference, .. } => Arc::new(TabulatedMap::from_csv(text, *reference)?),
    };
    Ok(Model::new(params, map))
}

/// The points that cannot be measured: no steady state, beyond the surge line or too close to it, P3 or compressor
/// outlet temperature outside their limits. One reason each, the first that applies.
pub fn unreachable_points(campaign: &Campaign, model: &Model) -> Vec<Unreachable> {
    let complaint = |(index, point): (usize, &OperatingPoint)| {
        let (reason, remedy) = complaint(campaign, model, point)?;
        let name = format!("{} krpm at opening {}", point.speed_rpm / 1000.0, point.valve_opening_ratio);
        Some(Unreachable { point: index, reason: format!("{name} {reason}"), remedy: remedy.to_owned() })
    };
    campaign.points.iter().enumerate().filter_map(complaint).collect()
}

/// What is wrong with a point, to follow its name, and what to do.
fn complaint(campaign: &Campaign, model: &Model, point: &OperatingPoint) -> Option<(String, &'static str)> {
    let limits = &campaign.limits;
    let boundary = BoundaryConditions { valve_opening_ratio: point.valve_opening_ratio, ..campaign.boundary };
    let steady = match hold_speed(model, point.speed_rpm, &boundary) {
        Ok(steady) => steady,
        Err(error) => {
            return Some((
                format!("cannot be held: {error}"),
                "leave the point out, or change speed or opening",
            ));
        }
    };
    let margin_ratio = steady.surge_margin_ratio(model);
    if margin_ratio < 0.0 {
        return Some((
            format!(
                "lies beyond the surge line of the nominal map, at {:.0} % of the surge flow",
                100.0 * (1.0 + margin_ratio)
            ),
            "leave the point out, or open the valve further",
        ));
    }
    if let Some(limit_ratio) = limits.surge_margin_min_ratio.filter(|limit_ratio| margin_ratio < *limit_ratio)
    {
        return Some((
            format!(
                "has a surge margin of {:.1} %, below `limits.surge_margin` = {} %",
                100.0 * margin_ratio,
                100.0 * limit_ratio
            ),
            "leave the point out, open the valve further, or lower the limit if the rig allows it",
        ));
    }
    let p3_pa = steady.boundary.p3_pa;
    if p3_pa > limits.p3_max_pa || p3_pa < limits.p3_min_pa {
        let (side, limit, limit_pa) = if p3_pa > limits.p3_max_pa {
            ("above", "max", limits.p3_max_pa)
        } else {
            ("below", "min", limits.p3_min_pa)
        };
        return Some((
            format!(
                "needs P3 = {:.1} kPa, {side} `limits.turbine_inlet_pressure.{limit}` = {} kPa",
                p3_pa / 1000.0,
                limit_pa / 1000.0
            ),
            "leave the point out, change it, or widen the limit if the rig allows it",
        ));
    }
    let limit_k = limits.t2_max_k.filter(|limit_k| steady.outputs.t2_k > *limit_k)?;
    Some((
        format!(
            "heats the compressor outlet to {:.1} K, above `limits.compressor_outlet_temperature` = {limit_k} K",
            steady.outputs.t2_k
        ),
        "leave the point out, change it, or raise the limit if the machine allows it",
    ))
}
