//! Heat-transfer coefficients of the joint fit compared with the declared machine's.
//!
//! The fit takes h from the slope of T2 over Tc, `s = 1 - exp(-n)` with `n = h A/(m cp)` transfer units. A constant error of a reading hardly
//! changes it. A gain `g` of T2 makes it `s (1 + g)`, and a probe that reads a share `x` of the way to the housing `s + x (1 - s)`: ln h rises by
//! `g s/((1 - s) n)` and by `x/n`.

use crate::IdentifyConfig;
use crate::faults::balance_rows::{Machine, Rows, common, own};
use crate::faults::balances::efficiency::{FittedEfficiencies, compressed};
use crate::faults::end_readings::{CHANNELS, Readings};
use crate::faults::nominal_rig::NominalRig;
use crate::single_step::fit::ETA_BOUNDS;
use mapper_core::{Channel, FaultKind};
use mapper_physics::laws::convection;
use nalgebra::DMatrix;

/// Scatter of the points about the declared law, ratio: its shape over the map. Bound: correlations that fit one rig scatter by less,
/// 0.003 in the joint fit.
const SHAPE_RATIO: f64 = 0.01;

/// ln h itself, with the effects of errors on it. `readings`: of all steps, by position.
pub(crate) fn measured(
    fitted: &FittedEfficiencies,
    readings: &[Option<Readings>],
    config: &IdentifyConfig,
) -> Rows {
    let heat = &fitted.ln_h;
    let known = fitted.known(readings);
    let count = known.len();
    let units = |(row, readings): &(usize, Readings)| {
        let capacity_w_k = readings.flow_kg_s() * config.air.heat_capacity_j_kgk(readings.t2_k());
        heat.values[*row].exp() * config.internal_area_m2 / capacity_w_k
    };
    let units: Vec<f64> = known.iter().map(units).collect();
    let by_gain: Vec<f64> = units.iter().map(|units| units.exp_m1() / units).collect();
    let by_reading = |(row, readings): &(usize, Readings)| {
        let by_fit = &heat.by_reading[*row];
        // At equal transfer units h is proportional to the flow.
        let fallback = |channel| {
            if CHANNELS[channel] == Channel::CompressorFlow { readings.flow_kg_s().recip() } else { 0.0 }
        };
        std::array::from_fn(|channel| by_fit[channel].unwrap_or_else(|| fallback(channel)))
    };
    Rows {
        residual: known.iter().map(|(row, _)| heat.values[*row]).collect(),
        covariance: DMatrix::from_fn(count, count, |i, j| heat.covariance[(known[i].0, known[j].0)]),
        by_reading: known.iter().map(by_reading).collect(),
        readings: known.iter().map(|(_, readings)| *readings).collect(),
        by_machine: Vec::new(),
        by_fault: vec![
            (Channel::T2, FaultKind::TowardsWall, units.iter().map(|units| units.recip()).collect()),
            (Channel::Tc, FaultKind::Gain, by_gain.iter().map(|gain| -gain).collect()),
            (Channel::T2, FaultKind::Gain, by_gain),
            (Channel::T1, FaultKind::Gain, vec![0.0; count]),
        ],
    }
}

/// ln h over that of the declared machine.
pub(crate) fn rows(
    fitted: &FittedEfficiencies,
    readings: &[Option<Readings>],
    config: &IdentifyConfig,
    nominal: &NominalRig<'_>,
) -> Option<Rows> {
    let mut rows = measured(fitted, readings, config);
    let compressor = &nominal.model.params.compressor;
    let known = fitted.known(readings).into_iter();
    let etas: Vec<f64> =
        known.map(|(row, _)| fitted.eta.values[row].clamp(ETA_BOUNDS.0, ETA_BOUNDS.1)).collect();
    for (i, (readings, eta)) in rows.readings.iter().zip(etas).enumerate() {
        let declared = |readings: &Readings| {
            let h_w_m2k = convection::coefficient_w_m2k(
                compressor.nusselt_coefficient,
                compressor.nusselt_exponent,
                compressor.outlet_diameter_m,
                readings.flow_kg_s(),
                compressed(readings, eta),
                readings.tc_k(),
            );
            h_w_m2k.ln()
        };
        rows.residual[i] -= declared(readings);
        let law = readings.derivatives(declared);
        rows.by_reading[i].iter_mut().zip(law).for_each(|(own, law)| *own -= law);
    }
    let count = rows.residual.len();
    (count > 0).then_some(())?;
    rows.covariance += own(vec![SHAPE_RATIO; count].into_iter())
        + common(&vec![1.0; count], nominal.tolerances.convection_ratio);
    rows.by_machine = vec![(Machine::Convection, vec![1.0; count])];
    Some(rows)
}
