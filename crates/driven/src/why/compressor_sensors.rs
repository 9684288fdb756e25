//! A compressor-side cause outside the effect library: on engines, T2 is often measured by a sheathed sensor.
//!
//! Only for this mode: gas-stand probes are bare and declared, and the library's slow probe has a single time constant.

use mapper_core::Channel;
use mapper_physics::effect::{Effect, Rig, Submodel};
use mapper_physics::effect_kind::{About, EffectKind, effect_of};
use mapper_physics::effect_parameters;
use mapper_physics::hooks::TooManyExtraStates;
use std::sync::Arc;

/// All sensor causes.
pub fn compressor_sensors() -> Vec<Arc<dyn Effect>> {
    vec![effect_of::<SheathedProbe>()]
}

effect_parameters! {
    /// The T2 probe is a sheathed element: two lags in series.
    #[derive(Debug)]
    struct SheathedProbe {
        /// Diameter of the sheath's tip, which follows the gas like a bare tip, m.
        diameter_m = "sheath_diameter" ["m"] 0.0 .. 0.012, neutral 0.0, step 0.0015;
        /// Lag of the element behind the sheath, s.
        element_lag_s = "element_lag" ["s"] 0.0 .. 30.0, neutral 0.0, step 1.0;
    }
}

impl EffectKind for SheathedProbe {
    const ABOUT: About = About {
        id: "sheathed_probe",
        name: "sheathed T2 probe",
        description: "the T2 sensor sits in a sheath: the sheath follows the gas with a lag, the element the sheath with another",
        equation: "dT_s/dt = (T2 - T_s)/tau(d), dT_r/dt = (T_s - T_r)/tau_e",
        source: "Burke et al., eqs. 11 and 12 for the sheath; first-order sensor",
        submodel: Submodel::T2Probe,
        also_shows_in: &[],
    };

    fn put_into(self, rig: &mut Rig) -> Result<(), TooManyExtraStates> {
        rig.model.params.t2_probe_diameter_m += self.diameter_m;
        rig.instruments.path_mut(Channel::T2).lag_s += self.element_lag_s;
        Ok(())
    }
}
