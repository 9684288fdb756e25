//! The catalogue of effects: what a rig may have and the nominal model has not, one file each.
//!
//! To add one, write its file with a function `effect`, and its line below.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod catalogued;
mod script;
#[cfg(test)]
mod testing;

pub use script::{HOOK_NAMES, ScriptEffect, ScriptEffectError};

use mapper_physics::effect::Effect;
use std::sync::Arc;

/// Declares the effects' modules and the list of them.
macro_rules! effects {
    ($($name:ident),* $(,)?) => {
        $(mod $name;)*

        /// Every effect of the catalogue, in the order of reports.
        pub fn catalogue() -> Vec<Arc<dyn Effect>> {
            vec![$(Arc::new($name::effect())),*]
        }
    };
}

effects! {
    area_split,
    tip_diameter,
    stem_conduction,
    recovery,
    directional_htc,
    htc_scale,
    inner_node,
    oil_scale,
    ventilation,
    turbine_radiation,
    recirculation,
    bearing_friction,
    turbine_efficiency,
    efficiency_scale,
    flow_map_scale,
    valve_area,
    actuator_lag,
    flowmeter_lag,
    flowmeter_gain,
    t1_offset,
    t2_offset,
    tc_offset,
    p2_offset,
    humidity,
    inlet_preheat,
}

/// The effect of an id, if there is one.
pub fn find(id: &str) -> Option<Arc<dyn Effect>> {
    catalogue().into_iter().find(|effect| effect.info().id == id)
}
