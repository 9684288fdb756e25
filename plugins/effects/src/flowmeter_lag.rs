//! The compressor's flow meter is slow.

use mapper_core::Channel;
use mapper_physics::effect::{Rig, Submodel};
use mapper_physics::effect_kind::{About, EffectKind};
use mapper_physics::effect_parameters;
use mapper_physics::hooks::TooManyExtraStates;

effect_parameters! {
    /// The compressor's flow meter is slow.
    #[derive(Debug)]
    pub(crate) struct FlowmeterLag {
        /// Time constant of the meter, s.
        lag_s = "flowmeter_lag" ["s"] 0.0 .. 30.0, neutral 0.0, step 2.0;
    }
}

impl EffectKind for FlowmeterLag {
    const ABOUT: About = About {
        id: "flowmeter_lag",
        name: "slow flow meter",
        description: "the compressor's flow meter follows the flow with a lag",
        equation: "dm_read/dt = (m - m_read)/tau",
        source: "first-order meter",
        submodel: Submodel::FlowMeter,
        also_shows_in: &[],
    };

    fn put_into(self, rig: &mut Rig) -> Result<(), TooManyExtraStates> {
        rig.instruments.path_mut(Channel::CompressorFlow).lag_s += self.lag_s;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;
    use mapper_physics::instruments::ChannelFollower;

    /// For a flow that rises by 1 g/s each second, a meter with 2 s reads 2 g/s low once it has settled.
    #[test]
    fn a_rising_flow_is_read_late() {
        let at = Instant::with(FlowmeterLag { lag_s: 2.0 });
        let mut meter = ChannelFollower::new(*at.rig.instruments.path(Channel::CompressorFlow));
        let readings = (0..600).map(|i| meter.read(f64::from(i) * 0.1, f64::from(i) * 1e-4));
        assert!((readings.last().unwrap() - (599e-4 - 2e-3)).abs() < 1e-12);
    }
}
