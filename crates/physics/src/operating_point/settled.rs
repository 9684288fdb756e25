//! When a point has settled, and how fast its speed responds.
//!
//! **Definition.** A quantity has settled at a time if, from that time to the end of the evaluated segment,
//! its maximum minus its minimum, minus the spread caused by its noise, is at most its band
//! ([`SettleBands`]) times the mean. An operating point has settled when shaft speed, compressor flow and pressure ratio
//! all have. Values of a model have no noise; recorded ones are condensed to medians over blocks first.
//!
//! Housing and outlet temperature do not count: at a settled operating point they still change, which the identification needs. Bands: Burke et al., section 3.

use crate::laws::turbine::TurbineInlet;
use crate::machine::params::BoundaryConditions;
use crate::simulation::model::{Model, rad_s_of_rpm};
use crate::simulation::steady::{SteadyError, hold_speed};
use mapper_core::{ActuatorMotion, SettleBands, SpeedResponse};
use mapper_numerics::statistics::robust_sigma;

/// Blocks over which recorded signals are condensed (to their median) before they are compared, s.
pub const BLOCK_S: f64 = 1.0;
/// Spread (maximum minus minimum) of about a hundred normally distributed values, standard deviations.
const NOISE_SPREAD_SIGMAS: f64 = 5.0;
/// Distance of the blocks whose second difference measures noise: longer than the correlation of noise.
const NOISE_LAG_BLOCKS: usize = 4;

/// Number of values, from the last one backwards, whose spread minus `noise_spread` (in the unit of the values, >= 0) is at most
/// `allowed_ratio` of their mean. NaN counts as settled; a series of only NaN never settles.
pub fn settled_count(
    backwards: impl IntoIterator<Item = f64>,
    allowed_ratio: f64,
    noise_spread: f64,
) -> usize {
    let (mut low, mut high, mut sum, mut valid) = (f64::INFINITY, f64::NEG_INFINITY, 0.0, 0.0);
    let mut count = 0;
    for value in backwards {
        if !value.is_nan() {
            (low, high, sum, valid) = (low.min(value), high.max(value), sum + value, valid + 1.0);
            if high - low - noise_spread > allowed_ratio * (sum / valid).abs() {
                return count;
            }
        }
        count += 1;
    }
    if valid > 0.0 { count } else { 0 }
}

/// Signals of an operating point by their names in messages, each with its band, for values counted backwards.
pub fn with_bands<T>(
    speed: T,
    flow: T,
    pressure_ratio: T,
    bands: &SettleBands,
) -> [(&'static str, T, f64); 3] {
    [
        ("speed", speed, bands.speed_ratio),
        ("flow", flow, bands.flow_ratio),
        ("pressure ratio", pressure_ratio, bands.pressure_ratio_ratio),
    ]
}

/// Spread caused by the noise of recorded `blocks` (medians, in order), from the median of their second differences, which ignores real
/// changes of the signal. 0 if there are too few blocks.
pub fn noise_spread(blocks: &[f64]) -> f64 {
    let lag = NOISE_LAG_BLOCKS;
    let differences = (2 * lag..blocks.len())
        .map(|i| blocks[i] - 2.0 * blocks[i - lag] + blocks[i - 2 * lag])
        .filter(|difference| difference.is_finite());
    // The second difference has six times the variance of a value.
    let sigma = robust_sigma(differences).map_or(0.0, |sigma| sigma / 6f64.sqrt());
    NOISE_SPREAD_SIGMAS * sigma
}

// Response of the shaft speed to P3 around a steady state, used to tune a speed controller.
// The shaft is `J w dw/dt = W_t(P3, w) - W_c(w) - W_f(w)` (eq. 12). Linearised around a steady state with the gas path
// steady, its gain is `dN/dP3` from one steady state to the next and its time constant `J w (dw/dP3) / (dW_t/dP3)`.

/// Relative step of the finite differences: much larger than the tolerance of steady states, much smaller than any curvature.
const STEP_RATIO: f64 = 1e-3;

/// The response at `speed_rpm` under `boundary`, whose `p3_pa` is ignored, with a P3 that moves like `p3`. `None` if the machine has no steady
/// state, or if the speed falls with rising P3.
pub fn speed_response(
    model: &Model,
    speed_rpm: f64,
    boundary: &BoundaryConditions,
    p3: &ActuatorMotion,
) -> Option<SpeedResponse> {
    differentiate(model, speed_rpm, boundary, p3).ok().filter(|response| {
        [response.rpm_per_pa, response.p3_per_power, response.time_constant_s]
            .iter()
            .all(|value| value.is_finite() && *value > 0.0)
    })
}

fn differentiate(
    model: &Model,
    speed_rpm: f64,
    boundary: &BoundaryConditions,
    p3: &ActuatorMotion,
) -> Result<SpeedResponse, SteadyError> {
    let steady_state = hold_speed(model, speed_rpm, boundary)?;
    let faster_rpm = speed_rpm * (1.0 + STEP_RATIO);
    let p3_pa = steady_state.boundary.p3_pa;
    let rpm_per_pa =
        (faster_rpm - speed_rpm) / (hold_speed(model, faster_rpm, boundary)?.boundary.p3_pa - p3_pa);
    let power_w = |p3_pa: f64| {
        let inlet =
            TurbineInlet::new(&model.params.turbine, &BoundaryConditions { p3_pa, ..steady_state.boundary });
        inlet.at(steady_state.state.tt_k, steady_state.state.shaft_speed_rad_s).power_w
    };
    let w_per_pa = (power_w(p3_pa * (1.0 + STEP_RATIO)) - power_w(p3_pa)) / (p3_pa * STEP_RATIO);
    let rad_s_per_pa = rad_s_of_rpm(rpm_per_pa);
    let shaft_s =
        model.params.shaft_inertia_kgm2 * steady_state.state.shaft_speed_rad_s * rad_s_per_pa / w_per_pa;
    Ok(SpeedResponse {
        rpm_per_pa,
        p3_per_power: power_w(p3_pa) / (p3_pa * w_per_pa),
        time_constant_s: shaft_s + p3.lag_s,
        delay_s: p3.lag_s + p3.dead_time_s,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn from_where_a_signal_varies_within_its_band() {
        // Range over mean of the last n values, by hand: 0, 0.01, 0.01, 0.0297.
        let backwards = [100.0, 101.0, 101.0, 103.0];
        for (allowed_ratio, noise, count) in
            [(0.0, 0.0, 1), (0.01, 0.0, 3), (0.029, 0.0, 3), (0.03, 0.0, 4), (0.01, 2.0, 4)]
        {
            assert_eq!(settled_count(backwards, allowed_ratio, noise), count, "{allowed_ratio} {noise}");
        }
        assert_eq!(settled_count([f64::NAN; 3], 0.01, 0.0), 0, "nothing known never settles");
        assert_eq!(settled_count([100.0, f64::NAN, 100.0], 0.01, 0.0), 3, "a gap is not a variation");
    }

    #[test]
    fn a_ramp_has_no_noise() {
        let ramp: Vec<f64> = (0..50).map(|i| 3.0 * f64::from(i)).collect();
        assert!(noise_spread(&ramp) < 1e-9, "second differences of a line vanish");
        assert_eq!(noise_spread(&[1.0; 8]), 0.0, "too few to judge");
    }
}

#[cfg(test)]
mod speed_response_tests {
    use super::*;
    use crate::simulation::simulate::{DEFAULT_RELATIVE_TOLERANCE, Simulator, Watch};
    use mapper_core::RigActuators;

    /// The integrated model after a small step of P3, with housings of constant temperature: the speed follows the gain, and
    /// reaches 63 % of the way in the shaft's time constant.
    #[test]
    fn the_integrated_machine_answers_as_stated() {
        for (speed_rpm, valve_opening_ratio) in [(50e3, 0.7), (110e3, 1.0), (150e3, 2.0)] {
            let mut model = Model::nominal();
            // Housings of a tonne: only the shaft moves.
            model.params.compressor.housing_mass_kg = 1e3;
            model.params.turbine.housing_mass_kg = 1e3;
            let boundary = BoundaryConditions { valve_opening_ratio, ..BoundaryConditions::default() };
            let p3 = RigActuators::FAST_VALVE.p3;
            let response = speed_response(&model, speed_rpm, &boundary, &p3).unwrap();
            let steady_state = hold_speed(&model, speed_rpm, &boundary).unwrap();
            let step_pa = 0.002 * steady_state.boundary.p3_pa;
            let stepped =
                BoundaryConditions { p3_pa: steady_state.boundary.p3_pa + step_pa, ..steady_state.boundary };
            let shaft_s = response.time_constant_s - p3.lag_s;
            let mut simulator =
                Simulator::new(&model, 0.0, steady_state.state, DEFAULT_RELATIVE_TOLERANCE, Watch::default());
            let mut rise_rpm = Vec::new();
            let times = [shaft_s, 20.0 * shaft_s + 5.0];
            simulator
                .run_to(
                    times[1],
                    &stepped,
                    times,
                    |_, state, _| rise_rpm.push(state.shaft_speed_rpm() - speed_rpm),
                    |_| {},
                )
                .unwrap();
            let (early, late) = (rise_rpm[0], rise_rpm[1]);
            // The gain includes the housings, which change the turbine's power by some per cent.
            let gain = late / (response.rpm_per_pa * step_pa);
            assert!((0.85..1.1).contains(&gain), "{speed_rpm} {gain}");
            // P2 follows the valve's volume in some tens of milliseconds: not quite first order.
            let share = early / late;
            assert!((0.5..0.75).contains(&share), "{speed_rpm} {share}");
        }
    }
}
