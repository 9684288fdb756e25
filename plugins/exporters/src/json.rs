//! JSON: the map as it is. Keys carry units, efficiencies are fractions, what is undefined is null.

use crate::ExportError;
use mapper_core::CompressorMap;

pub(crate) fn export(map: &CompressorMap) -> Result<Vec<u8>, ExportError> {
    for point in map.lines.iter().flat_map(|line| &line.points) {
        let p = &point.identified;
        for (quantity, value) in [
            ("flow_corrected_kg_s", point.flow_corrected_kg_s),
            ("pressure_ratio", point.pressure_ratio),
            ("speed_corrected_rpm", p.speed_corrected_rpm),
            ("speed_rpm", p.speed_rpm),
            ("flow_kg_s", p.flow_kg_s),
            ("valve", p.valve_opening_ratio),
            ("t1_k", p.t1_k),
            ("p1_pa", p.p1_pa),
        ] {
            if !value.is_finite() {
                return Err(ExportError::NotFinite { step: p.step, quantity, value });
            }
        }
    }
    let mut bytes = serde_json::to_vec_pretty(map)?;
    bytes.push(b'\n');
    Ok(bytes)
}
