//! Assumptions for campaigns that declare no tolerances.

use crate::gap::residuals::study::Study;
use mapper_observe::model_inputs::lagged_command::Response;

/// One sentence per assumption.
pub(crate) fn assumed(study: &Study) -> Vec<String> {
    let t = &study.declared.tolerances;
    let tolerances = [
        ("gain of the flow meter", t.flow_meter_gain_ratio),
        ("flow of the compressor map", t.flow_map_ratio),
        ("compressor efficiency", t.compressor_efficiency_ratio),
        ("shape of the efficiency map", t.efficiency_shape_ratio),
        ("turbine efficiency", t.turbine_efficiency_ratio),
        ("valve area", t.valve_area_ratio),
        ("convection", t.convection_ratio),
        ("external convection", t.external_convection_ratio),
        ("conductance to the oil", t.oil_conductance_ratio),
    ]
    .map(|(tolerance, ratio)| format!("{tolerance} {} %", 100.0 * ratio));
    let lag_and_rate = |response: Response, scale: f64, unit: &str| {
        let lag = format!("a lag of {:.2} s", response.lag_s);
        if response.slew_per_s.is_finite() {
            format!("{lag} and at most {:.3} {unit}", scale * response.slew_per_s)
        } else {
            lag
        }
    };
    vec![
        format!(
            "the campaign declares no tolerances; default tolerances, one sigma: {}",
            tolerances.join(", ")
        ),
        format!(
            "the responses of the actuators are estimated from the recording and not diagnosed: P3 has {}, the valve {}",
            lag_and_rate(study.actuators.p3, 1e-3, "kPa/s"),
            lag_and_rate(study.actuators.valve, 1.0, "openings/s"),
        ),
    ]
}
