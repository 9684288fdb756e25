//! The turbine at the points of a recording.
//!
//! At the end of each step the compressor takes `m (h(T2') - h(T1))` from the shaft, T2' by the identified efficiency, and the shaft's acceleration
//! `I w dw/dt`. Their sum over `m_t (h(T3') - h_s(T3', P4/P3))` is turbine efficiency times mechanical efficiency (SAE J1826), total to static. T3' is
//! T3 less the heat to the turbine housing ([`housing`]). Bearing friction cannot be separated from the turbine without the heat to the oil.
//!
//! Each declared error moves its reading, and the identified efficiency as the method says, and the point is computed again: an offset of P2 moves
//! the isentropic rise and the efficiency together, and leaves the power nearly as it is.

mod housing;

use crate::single_step::budgets;
use crate::single_step::dynamic::ReadingError;
use crate::turbine::housing::{HousingBalance, Line, housing_state};
use crate::{IdentifyConfig, PressureTap};
use mapper_core::{
    Channel, DeclaredUncertainty, IdentifiedPoint, Recording, StepMarker, TurbineCommonErrors, TurbineDoubt,
    TurbineHousing, TurbinePoint, UncertaintyBudget, Verdict, Warning, confidence_interval_95, half_width_95,
    is_reading, standard_error_of,
};
use mapper_numerics::statistics::mean;
use mapper_observe::declared::usual_sensor;
use mapper_physics::gas::air::Air;
use mapper_physics::laws::compression::{compressed_k, isentropic_rise_ratio};
use mapper_physics::laws::turbine::{blade_speed_ratio, isentropic_drop_j_kg};
use mapper_physics::machine::params::rad_s_of_rpm;

/// Time before a step's end over which the channels are averaged, s. Bound: noise of pressures averages out, and speed and housings hardly change.
const AVERAGE_S: f64 = 10.0;
/// Step of the derivatives, in standard deviations. Bound: between rounding and curvature.
const STEP_SIGMAS: f64 = 0.1;
/// Pascals in a kilopascal. Source: definition.
const PA_PER_KPA: f64 = 1e3;

/// Channels whose readings give a turbine point, in the order of [`Inputs::readings`].
const READINGS: [Channel; 8] = [
    Channel::CompressorFlow,
    Channel::T1,
    Channel::P1,
    Channel::P2,
    Channel::TurbineFlow,
    Channel::P3,
    Channel::T3,
    Channel::P4,
];

/// Everything a turbine point is computed from.
#[derive(Debug, Clone, Copy)]
struct Inputs {
    /// Means in the order of [`READINGS`], total pressures except P4.
    readings: [f64; READINGS.len()],
    eta: Option<f64>,
    speed_rad_s: f64,
    acceleration_w: f64,
    heat_w: f64,
}

#[derive(Debug, Clone, Copy)]
struct Numbers {
    flow_parameter_kg_sqrt_k_s_kpa: f64,
    expansion_ratio: f64,
    t3_prime_k: f64,
    blade_speed_ratio: f64,
    power_w: f64,
    efficiency: f64,
}

impl Inputs {
    fn numbers(&self, config: &IdentifyConfig) -> Numbers {
        let [flow_kg_s, t1_k, p1_pa, p2_pa, turbine_kg_s, p3_pa, t3_k, p4_pa] = self.readings;
        let air = config.air.between(p1_pa, p2_pa);
        let compressor_w = self.eta.map_or(f64::NAN, |eta| {
            let rise = isentropic_rise_ratio(p2_pa / p1_pa, t1_k, air);
            flow_kg_s * air.enthalpy_rise_j_kg(t1_k, compressed_k(t1_k, rise, eta, air))
        });
        let power_w = compressor_w + self.acceleration_w;
        let t3_prime_k = Air::new(config.turbine_gas, 0.0).heated_k(t3_k, -self.heat_w / turbine_kg_s);
        let expansion_ratio = p3_pa / p4_pa;
        let drop_j_kg = isentropic_drop_j_kg(config.turbine_gas, t3_prime_k, expansion_ratio);
        Numbers {
            flow_parameter_kg_sqrt_k_s_kpa: turbine_kg_s * t3_k.sqrt() / (p3_pa / PA_PER_KPA),
            expansion_ratio,
            t3_prime_k,
            blade_speed_ratio: blade_speed_ratio(config.turbine.wheel_radius_m, self.speed_rad_s, drop_j_kg),
            power_w,
            efficiency: power_w / (turbine_kg_s * drop_j_kg),
        }
    }
}

#[derive(Debug, Clone, Copy, Default)]
struct Change {
    ln_flow: f64,
    ln_ratio: f64,
    efficiency: f64,
}

/// The turbine at every point with plausible readings of flow, pressures and temperature. `eta_errors`: what each error of a reading makes of a step's
/// efficiency, for one standard deviation.
pub(crate) fn turbine_points<'a>(
    recording: &Recording,
    points: impl Iterator<Item = (&'a IdentifiedPoint, &'a [(ReadingError, f64)])>,
    config: &IdentifyConfig,
) -> (Vec<TurbinePoint>, Option<TurbineHousing>) {
    let needed = [Channel::TurbineFlow, Channel::P3, Channel::T3, Channel::P4];
    if needed.iter().any(|channel| !recording.series.contains_key(channel)) {
        return (Vec::new(), None);
    }
    let balance = HousingBalance::of(recording, config);
    let point = |(point, eta_errors): (&IdentifiedPoint, _)| {
        let step = recording.steps.iter().find(|step| step.index == point.step)?;
        turbine_point(recording, step, (point, eta_errors), &balance, config)
    };
    (points.filter_map(point).collect(), balance.housing())
}

fn turbine_point(
    recording: &Recording,
    step: &StepMarker,
    (point, eta_errors): (&IdentifiedPoint, &[(ReadingError, f64)]),
    balance: &HousingBalance<'_>,
    config: &IdentifyConfig,
) -> Option<TurbinePoint> {
    let span_s = ((step.end_s - AVERAGE_S).max(step.start_s), step.end_s);
    let state = housing_state(recording, span_s)?;
    let (heat_w, heat_sigma_w) = balance.heat_w(&state);
    let (inputs, samples) = inputs(recording, span_s, point, heat_w, config)?;
    let numbers = inputs.numbers(config);
    let ratio = numbers.expansion_ratio;
    if !(ratio > 1.0 && ratio.is_finite() && inputs.speed_rad_s > 0.0) {
        return None;
    }
    let change = |moved: Inputs, scale: f64| {
        let there = moved.numbers(config);
        Change {
            ln_flow: (there.flow_parameter_kg_sqrt_k_s_kpa / numbers.flow_parameter_kg_sqrt_k_s_kpa).ln()
                / scale,
            ln_ratio: (there.expansion_ratio / ratio).ln() / scale,
            efficiency: (there.efficiency - numbers.efficiency) / scale,
        }
    };
    let mut eta_left =
        point.eta_low.zip(point.eta_high).map_or(0.0, |(low, high)| standard_error_of(low, high).powi(2));
    let mut rows = Vec::new();
    let mut common = TurbineCommonErrors::default();
    let mut variances = Change::default();
    let mut push = |source: String, sigma: f64, unit: &str, change: Change, is_common: bool| {
        variances.ln_flow += change.ln_flow.powi(2);
        variances.ln_ratio += change.ln_ratio.powi(2);
        variances.efficiency += change.efficiency.powi(2);
        if is_common {
            common.ln_flow_changes.push(change.ln_flow);
            common.ln_expansion_ratio_changes.push(change.ln_ratio);
            common.efficiency_changes.push(change.efficiency);
        }
        if sigma > 0.0 && change.efficiency.is_finite() && change.efficiency != 0.0 {
            rows.push(budgets::row(source, sigma, unit, change.efficiency / sigma, change.efficiency));
        }
    };
    let mut declared_errors = |error: ReadingError, source: String, sigma: f64, unit: &str, by: [f64; 8]| {
        let eta_change =
            eta_errors.iter().find(|(known, _)| *known == error).map_or(0.0, |(_, change)| *change);
        eta_left -= eta_change * eta_change;
        let mut moved = inputs;
        for (reading, by) in moved.readings.iter_mut().zip(by) {
            *reading += STEP_SIGMAS * by;
        }
        moved.eta = moved.eta.map(|eta| eta + STEP_SIGMAS * eta_change);
        push(source, sigma, unit, change(moved, STEP_SIGMAS), true);
    };
    for (place, channel) in READINGS.into_iter().enumerate() {
        let declared = sensor(channel, config);
        let alone = |by: f64| std::array::from_fn(|i| if i == place { by } else { 0.0 });
        let unit = channel.unit();
        let offset = declared.offset_sigma;
        declared_errors(
            ReadingError::Offset(channel),
            format!("offset of {channel}"),
            offset,
            unit,
            alone(offset),
        );
        let gain = declared.gain_sigma_ratio;
        let by = gain * config.exact_at.gain_error(channel, inputs.readings[place]);
        declared_errors(ReadingError::Gain(channel), format!("gain of {channel}"), gain, "1", alone(by));
    }
    let barometer_pa = config.barometer_sigma_pa;
    let pressures = READINGS.map(|channel| if is_pressure(channel) { barometer_pa } else { 0.0 });
    declared_errors(ReadingError::Barometer, "barometer".to_owned(), barometer_pa, "Pa", pressures);
    let heated = Inputs { heat_w: heat_w + STEP_SIGMAS * heat_sigma_w, ..inputs };
    push("heat before the wheel".to_owned(), heat_sigma_w, "W", change(heated, STEP_SIGMAS), true);
    for (place, channel) in READINGS.into_iter().enumerate() {
        let declared = sensor(channel, config);
        let share = config.noise().variance_of_mean(samples[place], span_s.1 - span_s.0).sqrt();
        let sigma = declared.noise_sigma * share;
        let mut moved = inputs;
        moved.readings[place] += STEP_SIGMAS * sigma;
        push(format!("noise of {channel}"), sigma, channel.unit(), change(moved, STEP_SIGMAS), false);
    }
    let eta_sigma = eta_left.max(0.0).sqrt();
    let moved = Inputs { eta: inputs.eta.map(|eta| eta + STEP_SIGMAS * eta_sigma), ..inputs };
    push(
        "efficiency of the compressor, other sources".to_owned(),
        eta_sigma,
        "1",
        change(moved, STEP_SIGMAS),
        false,
    );
    let efficiency = Some(numbers.efficiency).filter(|efficiency| efficiency.is_finite());
    let error = variances.efficiency.sqrt();
    let interval = efficiency.map(|efficiency| confidence_interval_95(efficiency, error));
    let (verdict, doubts) = judged(point, efficiency, error, config);
    let flow = numbers.flow_parameter_kg_sqrt_k_s_kpa;
    let flow_half = half_width_95(variances.ln_flow.sqrt());
    Some(TurbinePoint {
        step: point.step,
        vane_position: None,
        speed_parameter_rpm_sqrt_k: point.speed_rpm / state.t3_k.sqrt(),
        flow_parameter_kg_sqrt_k_s_kpa: flow,
        flow_low: flow * (-flow_half).exp(),
        flow_high: flow * flow_half.exp(),
        expansion_ratio: ratio,
        expansion_ratio_standard_error: ratio * variances.ln_ratio.sqrt(),
        blade_speed_ratio: numbers.blade_speed_ratio,
        power_w: efficiency.map(|_| numbers.power_w),
        heat_w,
        heat_standard_error_w: heat_sigma_w,
        t3_prime_k: numbers.t3_prime_k,
        efficiency,
        efficiency_low: interval.map(|(low, _)| low),
        efficiency_high: interval.map(|(_, high)| high),
        budget: efficiency.map(|value| UncertaintyBudget::of(value, rows, half_width_95(error))),
        common,
        verdict,
        doubts,
    })
}

/// The errors of a sensor: as declared, otherwise those of a usual one.
fn sensor(channel: Channel, config: &IdentifyConfig) -> DeclaredUncertainty {
    config.declared.get(&channel).copied().unwrap_or_else(|| usual_sensor(channel))
}

fn is_pressure(channel: Channel) -> bool {
    matches!(channel, Channel::P1 | Channel::P2 | Channel::P3 | Channel::P4)
}

fn judged(
    point: &IdentifiedPoint,
    efficiency: Option<f64>,
    error: f64,
    config: &IdentifyConfig,
) -> (Verdict, Vec<TurbineDoubt>) {
    let mut doubts = Vec::new();
    let mut verdict = point.verdict;
    if point.verdict != Verdict::Good {
        doubts.push(TurbineDoubt::CompressorPoint);
    }
    if point.warnings.contains(&Warning::Apparent) {
        doubts.push(TurbineDoubt::ApparentEfficiency);
        verdict = verdict.doubted();
    }
    if efficiency.is_some_and(|efficiency| !(efficiency > 0.0 && efficiency < 1.0)) {
        doubts.push(TurbineDoubt::Impossible);
        verdict = Verdict::Unusable;
    }
    if efficiency.is_some() && error > config.thresholds.sigma_eta {
        doubts.push(TurbineDoubt::WideInterval);
        verdict =
            if error > config.thresholds.unusable_sigma_eta { Verdict::Unusable } else { verdict.doubted() };
    }
    (if efficiency.is_none() { Verdict::Unusable } else { verdict }, doubts)
}

/// The means of a time span, and the number of readings of each; `None` if a reading is missing.
fn inputs(
    recording: &Recording,
    span_s: (f64, f64),
    point: &IdentifiedPoint,
    heat_w: f64,
    config: &IdentifyConfig,
) -> Option<(Inputs, [usize; READINGS.len()])> {
    let mut readings = [f64::NAN; READINGS.len()];
    let mut samples = [0; READINGS.len()];
    for (place, channel) in READINGS.into_iter().enumerate() {
        let values = recording.series.get(&channel)?.slice(span_s.0, span_s.1).1;
        let usable: Vec<f64> = values.iter().copied().filter(|value| is_reading(channel, *value)).collect();
        readings[place] = mean(&usable).filter(|mean| *mean > 0.0)?;
        samples[place] = usable.len();
    }
    let t2 = recording.series.get(&Channel::T2)?.slice(span_s.0, span_s.1).1;
    let t2_k = mean(t2.iter().filter(|value| is_reading(Channel::T2, **value)))?;
    let total = |tap: PressureTap, place: usize, flow: usize, total_k: f64| {
        tap.total_pa(readings[place], readings[flow], total_k)
    };
    let (p1_pa, p2_pa) = (total(config.inlet_tap, 2, 0, readings[1]), total(config.outlet_tap, 3, 0, t2_k));
    let p3_pa = total(config.turbine_inlet_tap, 5, 4, readings[6]);
    (readings[2], readings[3], readings[5]) = (p1_pa, p2_pa, p3_pa);
    let (t_s, speeds_rpm) = recording.series.get(&Channel::ShaftSpeed)?.slice(span_s.0, span_s.1);
    let is_usable = |value| is_reading(Channel::ShaftSpeed, value);
    let speed_rad_s = rad_s_of_rpm(mean(speeds_rpm.iter().filter(|value| is_usable(**value)))?);
    let slope_rpm_s = Line::through(t_s, speeds_rpm, is_usable).map_or(0.0, |line| line.slope);
    let acceleration_w = config.shaft_inertia_kgm2 * speed_rad_s * rad_s_of_rpm(slope_rpm_s);
    let eta = point.eta.filter(|eta| *eta > 0.0);
    Some((Inputs { readings, eta, speed_rad_s, acceleration_w, heat_w }, samples))
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::{CommonErrors, Method, OperatingPoint, Series, StepKind, confidence_interval_95};

    /// Steady states of the nominal model at openings 0.5 and 1 that a second implementation gave (docs/reference/model.md; T1 298.15 K, P1 100 kPa, T3
    /// 773.15 K, P4 110 kPa): speed rpm, P3 Pa, P2 Pa, Tc K, Tt K, compressor flow kg/s, turbine flow kg/s, efficiency, T2 K, T4 K. The power of
    /// the turbine is in T4 alone, which the code under test does not see.
    const STATES: [[f64; 10]; 8] = [
        [50e3, 121_226.4, 111_864.7, 315.94, 423.08, 0.019_391, 0.018_139_8, 0.666_801, 313.91, 745.865],
        [50e3, 126_408.0, 111_119.7, 312.89, 433.42, 0.037_691, 0.022_371_4, 0.718_791, 311.64, 741.763],
        [90e3, 145_882.0, 142_029.2, 342.65, 459.70, 0.034_526_6, 0.035_422_3, 0.688_063, 343.36, 722.942],
        [90e3, 160_392.4, 137_240.0, 336.72, 471.79, 0.065_741_5, 0.043_923_9, 0.729_515, 336.78, 711.636],
        [110e3, 164_213.1, 166_957.4, 363.61, 475.75, 0.041_885_5, 0.046_074_6, 0.685_730, 365.47, 707.804],
        [110e3, 185_372.5, 158_208.5, 354.70, 488.64, 0.079_452_4, 0.057_574_4, 0.725_646, 355.26, 693.022],
        [150e3, 218_647.1, 246_383.1, 424.37, 507.24, 0.057_723_5, 0.074_827_8, 0.657_467, 428.51, 672.559],
        [150e3, 258_571.0, 223_941.5, 406.44, 521.27, 0.107_535_8, 0.094_863_4, 0.695_296, 408.01, 652.079],
    ];
    const T3_K: f64 = 773.15;
    const P4_PA: f64 = 110e3;
    const STEP_S: f64 = 100.0;

    /// Efficiency and temperature before the wheel by the turbine's law (docs/reference/model.md) that give T4.
    fn by_the_law(state: &[f64; 10]) -> (f64, f64) {
        // R/cp of air at about 760 K.
        let drop = 1.0 - (state[1] / P4_PA).powf(-287.05 / 1090.0);
        let (mut t3_prime_k, mut eta) = (T3_K, 0.7);
        for _ in 0..50 {
            let spouting_m_s = (2.0 * 1090.0 * t3_prime_k * drop).sqrt();
            let blade_speed_ratio = std::f64::consts::PI * state[0] / 30.0 * 0.0235 / spouting_m_s;
            eta = 0.75 * (1.0 - 0.8 * ((blade_speed_ratio - 0.65) / 0.65).powi(2));
            t3_prime_k = state[9] / (1.0 - eta * drop);
        }
        (eta, t3_prime_k)
    }

    /// All states one after the other, each constant.
    fn recording() -> Recording {
        let mut recording = Recording::default();
        for (index, state) in STATES.iter().enumerate() {
            let start_s = STEP_S * index as f64;
            let readings = [
                (Channel::ShaftSpeed, state[0]),
                (Channel::P1, 100e3),
                (Channel::T1, 298.15),
                (Channel::P2, state[2]),
                (Channel::T2, state[8]),
                (Channel::CompressorFlow, state[5]),
                (Channel::TurbineFlow, state[6]),
                (Channel::P3, state[1]),
                (Channel::T3, T3_K),
                (Channel::P4, P4_PA),
                (Channel::Tt, state[4]),
                (Channel::Tc, state[3]),
                (Channel::TOil, 323.15),
                (Channel::TAmb, 298.15),
            ];
            for (channel, value) in readings {
                let series: &mut Series = recording.series.entry(channel).or_default();
                series.t_s.extend((0..100).map(|second| start_s + f64::from(second)));
                series.values.extend([value; 100]);
            }
            let to = OperatingPoint { speed_rpm: state[0], valve_opening_ratio: 1.0 };
            recording.steps.push(StepMarker {
                index,
                kind: StepKind::Point,
                start_s,
                end_s: start_s + STEP_S - 1.0,
                from: None,
                to: Some(to),
                p3_pa: state[1],
                valve_opening_ratio: 1.0,
            });
        }
        recording
    }

    fn identified(step: usize) -> IdentifiedPoint {
        let state = &STATES[step];
        let (eta_low, eta_high) = confidence_interval_95(state[7], 0.002);
        IdentifiedPoint {
            step,
            kind: StepKind::Point,
            target: None,
            speed_rpm: state[0],
            valve_opening_ratio: 1.0,
            flow_kg_s: state[5],
            flow_corrected_kg_s: state[5],
            speed_corrected_rpm: state[0],
            pressure_ratio: state[2] / 100e3,
            t1_k: 298.15,
            p1_pa: 100e3,
            eta: Some(state[7]),
            eta_low: Some(eta_low),
            eta_high: Some(eta_high),
            eta_allowance: None,
            eta_uncertainty: None,
            h_w_m2k: None,
            h_low_w_m2k: None,
            h_high_w_m2k: None,
            h_uncertainty: None,
            common: CommonErrors::default(),
            method: Method::Joint,
            verdict: Verdict::Good,
            warnings: Vec::new(),
            window: None,
            residual_rms_k: None,
            dt2_k: None,
            dtc_k: None,
        }
    }

    fn all(
        recording: &Recording,
        config: &IdentifyConfig,
        errors: &[(ReadingError, f64)],
    ) -> Vec<TurbinePoint> {
        let points: Vec<IdentifiedPoint> = (0..STATES.len()).map(identified).collect();
        turbine_points(recording, points.iter().map(|point| (point, errors)), config).0
    }

    /// The reference efficiency of the compressor is the paper's (kappa of T1), and so is the closed form of its air; all sensors are exact.
    fn paper() -> IdentifyConfig {
        let exact = READINGS.map(|channel| (channel, DeclaredUncertainty::default()));
        IdentifyConfig { air: Air::PAPER, declared: exact.into(), ..IdentifyConfig::default() }
    }

    #[test]
    fn efficiency_and_heat_are_those_of_the_reference() {
        let points = all(&recording(), &paper(), &[]);
        assert_eq!(points.len(), STATES.len());
        for (point, state) in points.iter().zip(&STATES) {
            let (eta, t3_prime_k) = by_the_law(state);
            // Heat capacities are held through a process at the inlet's value there, and are means here (0.4 to 1.7 % in docs/reference/model.md).
            let ours = point.efficiency.unwrap();
            assert!((ours / eta - 1.0).abs() < 0.02, "{} rpm: {ours} {eta}", state[0]);
            // The temperature before the wheel follows there from the whole drop to T4: a per cent of the drop of 20 to 110 K.
            assert!((point.t3_prime_k - t3_prime_k).abs() < 1.2, "{} {t3_prime_k}", point.t3_prime_k);
            assert!(point.t3_prime_k < T3_K - 4.0);
            assert!((point.expansion_ratio - state[1] / P4_PA).abs() < 1e-12);
            let flow = state[6] * T3_K.sqrt() / (state[1] / 1e3);
            assert!((point.flow_parameter_kg_sqrt_k_s_kpa / flow - 1.0).abs() < 1e-12);
        }
    }

    /// 1 % more flow at the same power is 1 % less efficiency: by definition, and so is its interval.
    #[test]
    fn the_interval_follows_from_the_flow_meter() {
        let gain = DeclaredUncertainty { gain_sigma_ratio: 0.01, ..DeclaredUncertainty::default() };
        let mut config = paper();
        let without = all(&recording(), &config, &[]);
        config.declared.insert(Channel::TurbineFlow, gain);
        for (point, without) in all(&recording(), &config, &[]).iter().zip(&without) {
            let half = |point: &TurbinePoint| {
                0.5 * (point.efficiency_high.unwrap() - point.efficiency_low.unwrap()) / half_width_95(1.0)
            };
            let added = (half(point).powi(2) - half(without).powi(2)).sqrt() / point.efficiency.unwrap();
            // The heat before the wheel falls with the flow: some per cent of the effect.
            assert!((added - 0.01).abs() < 1e-3, "{added}");
            assert!(
                (point.flow_high / point.flow_parameter_kg_sqrt_k_s_kpa).ln() / half_width_95(0.01) - 1.0
                    < 1e-6
            );
        }
    }

    /// The work of a compressor follows from its temperatures. An offset of P2 that the efficiency has taken up leaves it: the rise over the efficiency
    /// is as before.
    #[test]
    fn an_offset_of_p2_is_not_counted_twice() {
        let offset = DeclaredUncertainty { offset_sigma: 300.0, ..DeclaredUncertainty::default() };
        let mut config = paper();
        config.declared.insert(Channel::P2, offset);
        let (recording, point) = (recording(), identified(1));
        let rise = |p2_pa: f64| (p2_pa / 100e3).powf(287.05 / 1005.0) - 1.0;
        let change = STATES[1][7] * (rise(STATES[1][2] + 300.0) / rise(STATES[1][2]) - 1.0);
        let error = |errors: &[(ReadingError, f64)]| {
            let points = turbine_points(&recording, std::iter::once((&point, errors)), &config).0;
            let budget = points[0].budget.clone().unwrap();
            budget.rows.iter().find(|row| row.source == "offset of P2").map_or(0.0, |row| row.contribution)
        };
        let (alone, together) = (error(&[]), error(&[(ReadingError::Offset(Channel::P2), change)]));
        assert!(alone > 0.01 && together.abs() < 0.03 * alone, "{alone} {together}");
    }

    /// A sensor that nobody declared is not exact.
    #[test]
    fn an_undeclared_sensor_has_the_error_of_a_usual_one() {
        let half = |config: &IdentifyConfig| {
            let point = all(&recording(), config, &[]).swap_remove(0);
            point.efficiency_high.unwrap() - point.efficiency.unwrap()
        };
        let mut undeclared = paper();
        undeclared.declared.remove(&Channel::P3);
        // 600 Pa of the 11.2 kPa between P3 and P4 at 50 krpm: 5 % of the drop, and so of the efficiency of 0.67 (1.96 sigma).
        let added = (half(&undeclared).powi(2) - half(&paper()).powi(2)).sqrt();
        assert!((0.055..0.085).contains(&added), "{added}");
    }

    /// Heat to the compressor's housing counts as power then, and no interval contains it.
    #[test]
    fn an_apparent_efficiency_makes_no_good_turbine_point() {
        let mut point = identified(2);
        point.warnings.push(Warning::Apparent);
        let config = paper();
        let points = turbine_points(&recording(), std::iter::once((&point, &[][..])), &config).0;
        assert_eq!(points[0].verdict, Verdict::Doubtful);
    }

    #[test]
    fn what_is_not_known_is_absent_and_never_a_number() {
        let mut unknown = identified(3);
        (unknown.eta, unknown.eta_low, unknown.eta_high) = (None, None, None);
        let config = paper();
        let of = |recording: &Recording, point: &IdentifiedPoint| {
            turbine_points(recording, std::iter::once((point, &[][..])), &config).0
        };
        let points = of(&recording(), &unknown);
        assert_eq!((points[0].efficiency, points[0].verdict), (None, Verdict::Unusable));
        // No expansion, a channel that is missing, one that is not a number: no point.
        let mut backwards = recording();
        backwards.series.get_mut(&Channel::P3).unwrap().values.fill(100_000.0);
        let mut missing = recording();
        missing.series.remove(&Channel::P4);
        let mut broken = recording();
        broken.series.get_mut(&Channel::T3).unwrap().values.fill(f64::NAN);
        for recording in [backwards, missing, broken] {
            assert!(of(&recording, &identified(3)).is_empty());
        }
        // Without Tt the heat is known to a half.
        let mut blind = recording();
        blind.series.remove(&Channel::Tt);
        let point = &of(&blind, &identified(3))[0];
        assert!((point.heat_standard_error_w / point.heat_w - 0.5).abs() < 1e-9);
        assert!((point.t3_prime_k - by_the_law(&STATES[3]).1).abs() < 5.0, "{}", point.t3_prime_k);
    }
}
