//! Gas bypasses the turbine wheel.

use mapper_core::Channel;
use mapper_physics::effect;
use mapper_physics::machine::hooks::{Hooks, Site};

effect! {
    pub(crate) struct TurbineLeak "turbine_leak";
    name: "leak past the turbine wheel",
    description: "hot gas flows past the turbine wheel and mixes with the gas after it",
    equation: "the meter reads (1 + r) m_t; T4 = (T4,wheel + r T3)/(1 + r)",
    source: "mixing balance of a waste gate that does not close",
    submodel: TurbineFlow, also_shows_in: [TurbineHousing];
    /// Leak flow over the wheel's flow.
    leak_ratio = "turbine_leak" ["1"] 0.0 .. 0.3, neutral 0.0, step 0.03;
    |effect, rig| if effect.leak_ratio != 0.0 {
        rig.hook(effect)?;
    }
}

impl Hooks for TurbineLeak {
    fn reading(&self, site: &Site<'_>, channel: Channel, value: f64) -> f64 {
        let r = self.leak_ratio;
        match channel {
            Channel::TurbineFlow => (1.0 + r) * value,
            Channel::T4 => (value + r * site.boundary.t3_k) / (1.0 + r),
            _ => value,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;
    use mapper_physics::rig::instruments::true_value;

    /// The wheel's own flow and power stay; the enthalpy after the mixing is that of both parts.
    #[test]
    fn the_meter_reads_both_parts_and_the_wheel_has_its_own() {
        let (nominal, at) = (Instant::nominal(), Instant::with(TurbineLeak { leak_ratio: 0.05 }));
        assert_eq!(at.outputs.turbine, nominal.outputs.turbine);
        let prepared = at.rig.model.prepare(&at.boundary);
        let read = |channel| true_value(channel, &prepared, &at.state, &at.outputs).unwrap();
        let (wheel_kg_s, wheel_k) = (nominal.outputs.turbine_flow_kg_s, nominal.outputs.turbine.t4_k);
        assert!((read(Channel::TurbineFlow) / wheel_kg_s - 1.05).abs() < 1e-12);
        let mixed_k = (wheel_kg_s * wheel_k + 0.05 * wheel_kg_s * at.boundary.t3_k) / (1.05 * wheel_kg_s);
        assert!((read(Channel::T4) - mixed_k).abs() < 1e-9 && mixed_k > wheel_k);
    }
}
