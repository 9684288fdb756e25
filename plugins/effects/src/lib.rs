//! The effect library of `mapper`: deviations of a rig from the nominal model, one file each, listed in `effects`.
//!
//! To add one, write its file (one `effect!`: description, parameters, change to the rig), and its line below. Faults of sensors
//! are rows of [`mapper_physics::rig::sensor_fault`].

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod script;
#[cfg(test)]
#[path = "../tests/inside/testing.rs"]
mod testing;

pub use script::{HOOK_NAMES, ScriptEffect, ScriptEffectError};

use mapper_physics::rig::effect::{Effect, effect_of};
use mapper_physics::rig::sensor_fault;
use std::sync::Arc;

/// Declares the effects' modules and the list of them.
macro_rules! effects {
    ($($name:ident::$kind:ident),* $(,)?) => {
        $(mod $name;)*

        /// Every effect of the library, in the order of reports.
        pub fn catalogue() -> Vec<Arc<dyn Effect>> {
            let mut all = vec![$(effect_of::<$name::$kind>()),*];
            let mut faults = sensor_fault::effects();
            // The order matters: blind cases draw effects by their index. Conduction along the probe is next to the probe.
            let (probe, air) = (3, all.len() - 5);
            all.splice(air..air, faults.split_off(1));
            all.splice(probe..probe, faults);
            all
        }
    };
}

effects! {
    area_split::AreaSplit,
    inlet_htc::InletHtc,
    tip_diameter::TipDiameter,
    recovery::Recovery,
    directional_htc::DirectionalHtc,
    htc_scale::HtcScale,
    inner_node::InnerNode,
    oil_scale::OilScale,
    ventilation::Ventilation,
    turbine_radiation::TurbineRadiation,
    recirculation::Recirculation,
    bearing_friction::BearingFriction,
    turbine_efficiency::TurbineEfficiency,
    turbine_capacity::TurbineCapacity,
    turbine_leak::TurbineLeak,
    efficiency_scale::EfficiencyScale,
    flow_map_scale::FlowMapScale,
    valve_area::ValveArea,
    actuator_lag::ActuatorLag,
    humidity::Humidity,
    inlet_preheat::InletPreheat,
    slow_valve::SlowValve,
    valve_play::ValvePlay,
    valve_stuck::ValveStuck,
}

/// Finds an effect by its id.
pub fn find(id: &str) -> Option<Arc<dyn Effect>> {
    catalogue().into_iter().find(|effect| effect.info().id == id)
}
