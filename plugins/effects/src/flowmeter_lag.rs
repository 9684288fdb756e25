//! The compressor's flow meter is slow.

use crate::catalogued::{Catalogued, parameter};
use mapper_core::Channel;
use mapper_physics::effect::Submodel;

pub(crate) fn effect() -> Catalogued {
    Catalogued::new(
        "flowmeter_lag",
        "the compressor's flow meter follows the flow with a lag",
        "dm_read/dt = (m - m_read)/tau",
        "first-order meter",
        Submodel::FlowMeter,
        vec![parameter("flowmeter_lag", "s", [0.0, 30.0], 0.0, 2.0)],
        |values, rig| rig.instruments.path_mut(Channel::CompressorFlow).lag_s += values[0],
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;
    use mapper_physics::instruments::ChannelFollower;

    /// A flow that rises by 1 g/s each second is read 2 g/s low by a meter of 2 s, once it has settled.
    #[test]
    fn a_rising_flow_is_read_late() {
        let at = Instant::with(&effect(), &[2.0]);
        let mut meter = ChannelFollower::new(*at.rig.instruments.path(Channel::CompressorFlow));
        let readings = (0..600).map(|i| meter.read(f64::from(i) * 0.1, f64::from(i) * 1e-4));
        assert!((readings.last().unwrap() - (599e-4 - 2e-3)).abs() < 1e-12);
    }
}
