//! The effect library: deviations of a rig from the nominal model, one file each.
//!
//! To add one, write its file (a struct of its parameters, its description, its changes to the model), and its line below.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod script;
#[cfg(test)]
mod testing;

pub use script::{HOOK_NAMES, ScriptEffect, ScriptEffectError};

use mapper_physics::effect::Effect;
use mapper_physics::effect_kind::effect_of;
use std::sync::Arc;

/// Declares the effects' modules and the list of them.
macro_rules! effects {
    ($($name:ident::$kind:ident),* $(,)?) => {
        $(mod $name;)*

        /// Every effect of the library, in the order of reports.
        pub fn catalogue() -> Vec<Arc<dyn Effect>> {
            vec![$(effect_of::<$name::$kind>()),*]
        }
    };
}

effects! {
    area_split::AreaSplit,
    inlet_htc::InletHtc,
    tip_diameter::TipDiameter,
    stem_conduction::StemConduction,
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
    efficiency_scale::EfficiencyScale,
    flow_map_scale::FlowMapScale,
    valve_area::ValveArea,
    actuator_lag::ActuatorLag,
    flowmeter_lag::FlowmeterLag,
    flowmeter_gain::FlowmeterGain,
    t1_offset::T1Offset,
    t2_offset::T2Offset,
    tc_offset::TcOffset,
    p2_offset::P2Offset,
    humidity::Humidity,
    inlet_preheat::InletPreheat,
}

/// Finds an effect by its id.
pub fn find(id: &str) -> Option<Arc<dyn Effect>> {
    catalogue().into_iter().find(|effect| effect.info().id == id)
}
