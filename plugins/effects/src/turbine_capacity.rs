//! The swallowing capacity of the turbine is higher or lower.

use mapper_physics::effect;

effect! {
    pub(crate) struct TurbineCapacity "turbine_capacity";
    name: "flow capacity of the turbine",
    description: "the swallowing capacity of the turbine is higher or lower at every expansion ratio",
    equation: "m_t = s m_t,nominal",
    source: "deposits on vanes or volute, or another volute",
    submodel: TurbineFlow, also_shows_in: [Shaft];
    /// Choked flow over the nominal one.
    scale_ratio = "turbine_capacity" ["1"] 0.7 .. 1.3, neutral 1.0, step -0.03;
    |effect, rig| rig.model.params.turbine.choked_flow_kg_s *= effect.scale_ratio
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Instant;

    /// Unlike a gain of the flow meter, the power changes with the flow.
    #[test]
    fn flow_and_power_fall_together() {
        let (nominal, at) = (Instant::nominal(), Instant::with(TurbineCapacity { scale_ratio: 0.96 }));
        let flow = at.outputs.turbine_flow_kg_s / nominal.outputs.turbine_flow_kg_s;
        let power = at.outputs.turbine.power_w / nominal.outputs.turbine.power_w;
        assert!((flow - 0.96).abs() < 1e-12 && (power - 0.96).abs() < 5e-3, "{flow}, {power}");
    }
}
