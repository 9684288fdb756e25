//! Whether the nominal model can reach each point within the limits.

use crate::campaign::{Campaign, MapSource};
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
    Ok(Model { params, map })
}

/// The points at which `model` needs a turbine inlet pressure outside the limits, or has no steady state at all,
/// or leaves the limit of the compressor outlet temperature.
pub fn unreachable_points(campaign: &Campaign, model: &Model) -> Vec<Unreachable> {
    let limits = &campaign.limits;
    let mut found = Vec::new();
    for (index, point) in campaign.points.iter().enumerate() {
        let boundary =
            BoundaryConditions { valve_opening_ratio: point.valve_opening_ratio, ..campaign.boundary };
        let name = format!("{} krpm at opening {}", point.speed_rpm / 1000.0, point.valve_opening_ratio);
        let complaint = match hold_speed(model, point.speed_rpm, &boundary) {
            Err(error) => Some((
                format!("{name} cannot be held: {error}"),
                "leave the point out, or change speed or opening".to_owned(),
            )),
            Ok(steady) => {
                let p3_pa = steady.boundary.p3_pa;
                if p3_pa > limits.p3_max_pa || p3_pa < limits.p3_min_pa {
                    let (side, limit, limit_pa) = if p3_pa > limits.p3_max_pa {
                        ("above", "max", limits.p3_max_pa)
                    } else {
                        ("below", "min", limits.p3_min_pa)
                    };
                    Some((
                        format!(
                            "{name} needs P3 = {:.1} kPa, {side} `limits.turbine_inlet_pressure.{limit}` = {} kPa",
                            p3_pa / 1000.0,
                            limit_pa / 1000.0
                        ),
                        "leave the point out, change it, or widen the limit if the rig allows it".to_owned(),
                    ))
                } else {
                    limits.t2_max_k.filter(|limit_k| steady.outputs.t2_k > *limit_k).map(|limit_k| {
                        (
                            format!(
                                "{name} heats the compressor outlet to {:.1} K, above `limits.compressor_outlet_temperature` = {limit_k} K",
                                steady.outputs.t2_k
                            ),
                            "leave the point out, change it, or raise the limit if the machine allows it".to_owned(),
                        )
                    })
                }
            }
        };
        found.extend(complaint.map(|(reason, remedy)| Unreachable { point: index, reason, remedy }));
    }
    found
}
