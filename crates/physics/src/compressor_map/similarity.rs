//! Similarity of speed lines: at equal position on the line, flow is proportional to speed and isentropic head to its square.
//!
//! The fan laws (e.g. Dixon and Hall, Fluid Mechanics and Thermodynamics of Turbomachinery, ch. 2). They apply to small
//! changes of speed: within 2 % here. For larger changes compressibility changes the shape of the line.

/// (gamma - 1)/gamma of cold air.
const KAPPA: f64 = 1.0 - 1.0 / crate::gas::air::HEAT_CAPACITY_RATIO;

/// Isentropic head over cp T1 of cold air, `PR^((gamma-1)/gamma) - 1`, ratio; `pressure_ratio` > 0.
pub fn head_ratio(pressure_ratio: f64) -> f64 {
    pressure_ratio.powf(KAPPA) - 1.0
}

/// Pressure ratio of a head ([`head_ratio`]); a negative head counts as 0.
pub fn pressure_ratio_of_head(head_ratio: f64) -> f64 {
    pressure_ratio_of_signed_head(head_ratio.max(0.0))
}

/// Pressure ratio of a head that may be negative (the machine brakes the gas); heads below -0.9 count as -0.9.
pub fn pressure_ratio_of_signed_head(head_ratio: f64) -> f64 {
    (1.0 + head_ratio.max(-0.9)).powf(1.0 / KAPPA)
}

/// Flow and pressure ratio of a point converted to `speed_factor` times its corrected speed; the efficiency stays.
pub fn at_speed(flow_corrected_kg_s: f64, pressure_ratio: f64, speed_factor: f64) -> (f64, f64) {
    let head = head_ratio(pressure_ratio) * speed_factor * speed_factor;
    (flow_corrected_kg_s * speed_factor, pressure_ratio_of_signed_head(head))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn head_is_the_text_book_value_and_turns_back() {
        // PR 2 at gamma 1.4: T2s/T1 = 2^(2/7) = 1.21901.
        assert!((head_ratio(2.0) - 0.219_014).abs() < 1e-6);
        for ratio in [0.6, 1.0, 1.3, 4.2] {
            assert!((pressure_ratio_of_signed_head(head_ratio(ratio)) - ratio).abs() < 1e-12);
        }
        let (flow, ratio) = at_speed(0.1, 2.0, 1.01);
        assert!((flow - 0.101).abs() < 1e-15);
        assert!((head_ratio(ratio) / head_ratio(2.0) - 1.0201).abs() < 1e-12);
    }
}
