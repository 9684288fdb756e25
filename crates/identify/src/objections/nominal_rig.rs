//! Flow and speed beside the nominal valve and map, where a campaign declares how far the rig may be off them.
//!
//! A flow meter with a wrong gain makes no contradiction within a recording: every point has the same share too much, and h with
//! it. The valve's declared area tells it. N with a wrong gain puts all points on the wrong speed lines: the map, at the measured flow
//! and pressure ratio, has a speed of its own.

use crate::IdentifyConfig;
use crate::findings::code;
use crate::nominal_map::NominalRig;
use crate::objections::ends::Ends;
use crate::objections::linear::fit;
use crate::objections::objection::Objection;
use mapper_core::Channel;
use mapper_numerics::root::bisect;
use mapper_numerics::statistics::median;
use mapper_physics::orifice;

/// Declared standard deviations that are allowed for, and what pressures' offsets and taps add, ratio.
const SIGMAS: f64 = 6.0;
const BESIDES_RATIO: f64 = 0.01;
/// Flow over a pressure difference below this says nothing of the valve, Pa.
const LEAST_PA: f64 = 1e4;
/// Standard deviations of a pressure's offset.
const OFFSET_SIGMAS: f64 = 4.0;
/// What an error of the map or of the flow looks like as an offset of the isentropic rise, K per ratio: half of the slowest points' rise.
const MAP_K: f64 = 8.0;
/// R/cp of air.
const KAPPA: f64 = 0.286;
/// Range about the measured speed in which the map's own is sought.
const SPEEDS: (f64, f64) = (0.4, 2.5);

pub(crate) fn objections(
    ends: &[Option<Ends>],
    nominal: &NominalRig<'_>,
    config: &IdentifyConfig,
) -> Vec<Objection> {
    let tolerances = nominal.tolerances;
    let known: Vec<&Ends> = ends.iter().flatten().filter(|end| end.p2_pa - end.p1_pa > LEAST_PA).collect();
    let all = || (0..ends.len()).collect::<Vec<usize>>();
    let outlet = &nominal.model.params.outlet;
    let flows = known.iter().filter_map(|end| {
        let area_m2 = end.valve_opening_ratio * outlet.discharge_coefficient * outlet.valve_area_m2;
        let nominal_kg_s = orifice::flow_kg_s(area_m2, end.p2_pa, end.t2_k, end.p1_pa);
        Some(end.flow_kg_s / nominal_kg_s).filter(|ratio| ratio.is_finite() && *ratio > 0.0)
    });
    let mut found = Vec::new();
    let allowed =
        SIGMAS * tolerances.valve_area_ratio.hypot(tolerances.flow_meter_gain_ratio) + BESIDES_RATIO;
    if let Some(flow) = median(flows).filter(|flow| flow.ln().abs() > allowed) {
        let message = format!(
            "m_c is {:.3} of what the nominal valve passes at P2, T2 and its opening (median; {:.3} to {:.3} are declared to be \
             possible): the flow meter or its unit is wrong, or P2, or the valve is another",
            flow,
            (-allowed).exp(),
            allowed.exp()
        );
        found.push(Objection::new(code::SCALED_CHANNEL, message, all()));
    }
    found.extend(pressure_offset(&known, ends.len(), nominal, config));
    // Speed goes with flow, and less than so.
    let allowed = SIGMAS * tolerances.flow_map_ratio.hypot(tolerances.flow_meter_gain_ratio) + BESIDES_RATIO;
    let speeds = known.iter().filter_map(|end| Some(end.speed_rpm / speed_of_map_rpm(end, nominal)?));
    if let Some(speed) = median(speeds).filter(|speed| speed.ln().abs() > allowed && found.is_empty()) {
        let message = format!(
            "N is {speed:.3} of the speed at which the nominal map has the measured flow and pressure ratio (median; {:.3} to {:.3} are \
             declared to be possible): N, P1 or P2 is scaled, or the machine is another",
            (-allowed).exp(),
            allowed.exp()
        );
        found.push(Objection::new(code::SCALED_CHANNEL, message, all()));
    }
    found
}

/// An offset of the pressures: head that is too large by the same at all speeds.
fn pressure_offset(
    known: &[&Ends],
    steps: usize,
    nominal: &NominalRig<'_>,
    config: &IdentifyConfig,
) -> Option<Objection> {
    let offs: Vec<(f64, f64)> = known
        .iter()
        .filter_map(|end| {
            // Head goes with the speed squared.
            let off_ratio = 2.0 * (speed_of_map_rpm(end, nominal)? / end.speed_rpm).ln();
            Some((end.isentropic_rise_k().recip(), off_ratio))
        })
        .collect();
    let values: Vec<f64> = offs.iter().map(|(_, off_ratio)| *off_ratio).collect();
    let columns = [vec![1.0; offs.len()], offs.iter().map(|(column, _)| *column).collect()];
    let rise = *fit(&columns, &values)?.get(1)?;
    let p1_pa = median(known.iter().map(|end| end.p1_pa))?;
    let t1_k = median(known.iter().map(|end| end.t1_k))?;
    // dT_is = T1 kappa dPR at a pressure ratio near 1.
    let k_per_pa = t1_k * KAPPA / p1_pa;
    let offset_pa =
        |channel: Channel| config.declared.get(&channel).map_or(0.0, |declared| declared.offset_sigma);
    let declared_k = k_per_pa * offset_pa(Channel::P1).hypot(offset_pa(Channel::P2));
    let map_k = nominal.tolerances.flow_map_ratio.hypot(nominal.tolerances.flow_meter_gain_ratio) * MAP_K;
    let limit_k = OFFSET_SIGMAS * declared_k.hypot(map_k).hypot(rise.error);
    (rise.value.abs() > limit_k).then(|| {
        let message = format!(
            "P2 - P1 is {:+.2} kPa off what the nominal map has at the measured speeds and flows, the same at all speeds ({:.2} kPa are \
             declared to be possible): P1 or P2 is off; compare them at standstill (`zero`)",
            rise.value / k_per_pa / 1e3,
            limit_k / k_per_pa / 1e3,
        );
        Objection::new(code::SCALED_CHANNEL, message, (0..steps).collect())
    })
}

/// The speed at which the nominal map has a point's flow and pressure ratio, rpm.
fn speed_of_map_rpm(end: &Ends, nominal: &NominalRig<'_>) -> Option<f64> {
    let map = nominal.model.map.as_ref();
    let reference = map.reference();
    let flow_kg_s = reference.corrected_flow_kg_s(end.flow_kg_s, end.t1_k, end.p1_pa);
    let ratio = end.p2_pa / end.p1_pa;
    let missing_kg_s = |speed_rpm: f64| {
        map.evaluate(reference.corrected_speed_rpm(speed_rpm, end.t1_k), ratio).flow_corrected_kg_s
            - flow_kg_s
    };
    let (low, high) = (SPEEDS.0 * end.speed_rpm, SPEEDS.1 * end.speed_rpm);
    (low > 0.0 && missing_kg_s(low) < 0.0 && missing_kg_s(high) > 0.0).then_some(())?;
    Some(bisect(low, high, 1e-3 * end.speed_rpm, |speed_rpm| missing_kg_s(speed_rpm) < 0.0).0)
}
