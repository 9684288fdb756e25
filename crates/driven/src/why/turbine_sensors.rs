//! Turbine-side causes outside the effect library: the library has one effect there, and engine sensors are slow.
//!
//! They work like library effects, but only in this mode: on a gas stand T3 and the turbine flow are held constant, so sensor lag does not
//! matter.

use mapper_core::Channel;
use mapper_physics::effect::{Effect, Rig, Submodel};
use mapper_physics::effect_kind::{About, EffectKind, effect_of};
use mapper_physics::effect_parameters;
use mapper_physics::hooks::TooManyExtraStates;
use std::sync::Arc;

/// All turbine sensor causes.
pub fn turbine_sensors() -> Vec<Arc<dyn Effect>> {
    vec![
        effect_of::<T4Lag>(),
        effect_of::<T3Lag>(),
        effect_of::<T4Offset>(),
        effect_of::<T3Offset>(),
        effect_of::<TurbineFlowGain>(),
        effect_of::<TurbineFlowLag>(),
    ]
}

macro_rules! sensor {
    ($kind:ident, $id:literal, $name:literal, $unit:literal, $low:literal, $high:literal, $neutral:literal, $step:literal, $channel:ident, $change:expr, $description:literal, $equation:literal) => {
        effect_parameters! {
            /// A turbine-side sensor fault.
            #[derive(Debug)]
            struct $kind {
                /// Size.
                value = $id [$unit] $low .. $high, neutral $neutral, step $step;
            }
        }

        impl EffectKind for $kind {
            const ABOUT: About = About {
                id: $id,
                name: $name,
                description: $description,
                equation: $equation,
                source: "first-order sensor",
                submodel: Submodel::TurbineHousing,
                also_shows_in: &[],
            };

            fn put_into(self, rig: &mut Rig) -> Result<(), TooManyExtraStates> {
                let change: fn(&mut mapper_physics::instruments::ChannelPath, f64) = $change;
                change(rig.instruments.path_mut(Channel::$channel), self.value);
                Ok(())
            }
        }
    };
}

sensor!(
    T4Lag,
    "t4_lag",
    "slow T4 probe",
    "s",
    0.0,
    30.0,
    0.0,
    1.0,
    T4,
    |path, s| path.lag_s += s,
    "the T4 probe follows the gas with a lag",
    "dT4_r/dt = (T4 - T4_r)/tau"
);
sensor!(
    T3Lag,
    "t3_lag",
    "slow T3 probe",
    "s",
    0.0,
    30.0,
    0.0,
    1.0,
    T3,
    |path, s| path.lag_s += s,
    "the T3 probe, which drives, follows the gas with a lag",
    "dT3_r/dt = (T3 - T3_r)/tau"
);
sensor!(
    T4Offset,
    "t4_offset",
    "offset of T4",
    "K",
    -60.0,
    60.0,
    0.0,
    5.0,
    T4,
    |path, k| path.offset += k,
    "the T4 probe reads too high",
    "T4_r = T4 + dT"
);
sensor!(
    T3Offset,
    "t3_offset",
    "offset of T3",
    "K",
    -60.0,
    60.0,
    0.0,
    5.0,
    T3,
    |path, k| path.offset += k,
    "the T3 probe, which drives, reads too high",
    "T3_r = T3 + dT"
);
sensor!(
    TurbineFlowGain,
    "turbine_flow_gain",
    "gain of the turbine's flow",
    "1",
    0.6,
    1.5,
    1.0,
    0.05,
    TurbineFlow,
    |path, gain| path.gain_ratio *= gain,
    "the turbine's flow reads too high",
    "m_r = g m"
);
sensor!(
    TurbineFlowLag,
    "turbine_flow_lag",
    "slow flow of the turbine",
    "s",
    0.0,
    30.0,
    0.0,
    1.0,
    TurbineFlow,
    |path, s| path.lag_s += s,
    "the turbine's flow follows with a lag",
    "dm_r/dt = (m - m_r)/tau"
);
