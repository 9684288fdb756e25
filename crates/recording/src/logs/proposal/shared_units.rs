//! Infers the units of a log without units: columns of one kind share a unit, and physics excludes the others.

use super::channel_proposal::{Certainty, NominalFlows, Proposal, ProposedChannel};
use super::physics::EXPONENT;
use super::remark::ProposalRemark as Remark;
use crate::logs::plausible::{STANDARD_ATMOSPHERE_PA, TRIMMED_SHARE, fitting_units};
use crate::logs::{Layout, Survey};
use mapper_core::Channel;
use mapper_core::unit_factors::S_PER_MIN;
use mapper_table::{header_unit, kind_of};
use mapper_yaml::units::{Kind, Unit};
use std::f64::consts::PI;

/// Maximum pressure ratio. Bound: one stage reaches 6 at the tip speed limit of aluminium wheels; a third more is margin for a throttled
/// inlet.
const MAX_PRESSURE_RATIO: f64 = 8.0;

/// Looks for one unit that fits all channels of a kind that have none.
pub(super) fn infer_units(proposal: &mut Proposal, layout: &Layout, survey: &Survey) {
    for kind in [Kind::Temperature, Kind::Pressure, Kind::Speed] {
        let lacks_unit = |proposed: &ProposedChannel| {
            kind_of(proposed.channel) == kind
                && layout.columns.get(proposed.column).is_some_and(|column| column.unit.is_none())
        };
        let channels: Vec<(Channel, f64, f64)> = proposal
            .channels
            .iter()
            .filter(|proposed| lacks_unit(proposed))
            .filter_map(|proposed| {
                let data = survey.columns.get(proposed.column)?;
                Some((proposed.channel, data.quantile(TRIMMED_SHARE), data.quantile(1.0 - TRIMMED_SHARE)))
            })
            .collect();
        // If another column of the kind has a unit, the stand uses that one.
        let written =
            proposal.channels.iter().filter(|other| kind_of(other.channel) == kind && !lacks_unit(other));
        let written: Vec<&str> = written.filter_map(|other| other.unit).collect();
        let fits_all = |unit: &&'static Unit| {
            let is_plausible = |(channel, low, high): &(Channel, f64, f64)| {
                fitting_units(*channel, *low, *high, 0.0).iter().any(|other| other.symbol() == unit.symbol())
            };
            channels.iter().all(is_plausible)
                && (kind != Kind::Pressure || ratios_are_possible(&channels, unit))
        };
        let mut common: Vec<&'static Unit> = kind.units().iter().filter(fits_all).collect();
        if common.iter().any(|unit| written.contains(&unit.symbol())) {
            common.retain(|unit| written.contains(&unit.symbol()));
        }
        if kind == Kind::Temperature && is_imperial(layout) && inlet_is_too_warm(&channels, &common) {
            common = kind.units().iter().filter(|unit| unit.symbol() == "degF").collect();
        }
        let [unit] = common.as_slice() else { continue };
        for proposed in proposal.channels.iter_mut().filter(|proposed| lacks_unit(proposed)) {
            proposed.unit = Some(unit.symbol());
            proposed.certainty = Certainty::Likely;
            proposed.remarks = vec![if unit.symbol() == "degF" {
                Remark::Imperial
            } else {
                Remark::OneUnitFits { unit: unit.symbol().to_owned(), columns: channels.len() }
            }];
        }
    }
}

/// Whether a log writes its other units in the imperial system.
fn is_imperial(layout: &Layout) -> bool {
    let imperial = |unit: &str| {
        header_unit(unit).is_some_and(|found| {
            matches!(found.unit.symbol(), "psi" | "psia" | "lb/min" | "lb/s" | "inHg" | "inH2O")
        })
    };
    layout.columns.iter().any(|column| column.unit.as_deref().is_some_and(imperial))
}

/// Inlet temperature that no test cell exceeds, K. The inlet of a second stage may. Bound: air of 50 degC; the inlet of a second stage
/// may be warmer.
const MAX_INLET_K: f64 = 323.15;

/// Whether the only unit of the temperatures is degC, and the inlet would be too warm in it.
fn inlet_is_too_warm(channels: &[(Channel, f64, f64)], common: &[&'static Unit]) -> bool {
    let [unit] = common else { return false };
    let is_warm = |(channel, low, _): &(Channel, f64, f64)| {
        *channel == Channel::T1 && unit.to_inside(*low) > MAX_INLET_K
    };
    unit.symbol() == "degC" && channels.iter().any(is_warm)
}

/// Isentropic head over the square of the tip speed. Slip and backsweep leave 0.6 to 0.9 of it as work, of which 0.5 to 0.8 is head.
/// Bound: slip and backsweep leave 0.6 to 0.9 of it as work, of which 0.5 to 0.8 is head.
const HEAD_COEFFICIENT: f64 = 0.45;
/// Flow over density, tip speed and disc area. Bound: wheels from 0.01 to 0.15 are radial.
const FLOW_COEFFICIENT: f64 = 0.06;

/// Maximum ratio, either way, of a flow to that of the mean coefficients. Bound: both ranges together give 0.1 to 4. Units that differ by
/// less (g/s and kg/h: 3.6) cannot be distinguished.
const FLOW_FACTOR: f64 = 8.0;

/// Heat capacity of dry air at room temperature, J/(kg K). Source: within a few per cent, small compared with [`FLOW_FACTOR`].
const CP_J_KGK: f64 = 1005.0;
/// Density of air, kg/m3. Source: as for the heat capacity.
const DENSITY_KG_M3: f64 = 1.15;
/// Inlet temperature, K. Source: as for the heat capacity.
const INLET_K: f64 = 298.0;

/// Maximum ratio by which the flow may lie outside surge and choke. Bound: for the correction to the inlet, and for lines between nominal
/// ones.
const NOMINAL_FACTOR: f64 = 1.3;

/// Infers the unit of a flow from the machine's flow range if it is known, else from the wheel size that pressure ratio and speed give.
pub(super) fn infer_flow_unit(
    proposal: &mut Proposal,
    layout: &Layout,
    survey: &Survey,
    nominal: Option<NominalFlows<'_>>,
) {
    let value_at = |channel: Channel, share: f64| -> Option<f64> {
        let proposed = proposal.entry(channel).filter(|proposed| proposed.certainty > Certainty::Unsure)?;
        let unit = mapper_table::unit(kind_of(channel), proposed.unit?).ok()?;
        let offset_pa = if proposed.gauge { STANDARD_ATMOSPHERE_PA } else { 0.0 };
        Some(unit.to_inside(survey.columns.get(proposed.column)?.quantile(share)) + offset_pa)
    };
    let Some(speed_rpm) = value_at(Channel::ShaftSpeed, 1.0 - TRIMMED_SHARE).filter(|rpm| *rpm > 0.0) else {
        return;
    };
    let (low_kg_s, high_kg_s, why): (f64, f64, Box<dyn Fn(String) -> Remark>) = match nominal {
        Some(flows) => {
            let (surge_kg_s, choke_kg_s) = flows(speed_rpm);
            let why = move |unit| Remark::FitsMachine { unit, surge_kg_s, choke_kg_s, speed_rpm };
            (surge_kg_s / NOMINAL_FACTOR, choke_kg_s * NOMINAL_FACTOR, Box::new(why))
        }
        None => {
            let Some(outlet_pa) = value_at(Channel::P2, 1.0 - TRIMMED_SHARE) else { return };
            let ratio = outlet_pa / value_at(Channel::P1, TRIMMED_SHARE).unwrap_or(STANDARD_ATMOSPHERE_PA);
            let head_j_kg = CP_J_KGK * INLET_K * (ratio.max(1.0).powf(EXPONENT) - 1.0);
            let tip_m_s = (head_j_kg / HEAD_COEFFICIENT).sqrt();
            let diameter_m = S_PER_MIN * tip_m_s / (PI * speed_rpm);
            let flow_kg_s = FLOW_COEFFICIENT * DENSITY_KG_M3 * tip_m_s * PI / 4.0 * diameter_m * diameter_m;
            let why = move |unit| Remark::FitsWheel { unit, diameter_m };
            (flow_kg_s / FLOW_FACTOR, flow_kg_s * FLOW_FACTOR, Box::new(why))
        }
    };
    for channel in [Channel::CompressorFlow, Channel::TurbineFlow] {
        let Some(proposed) = proposal.channels.iter_mut().find(|proposed| proposed.channel == channel) else {
            continue;
        };
        let lacks_unit = layout.columns.get(proposed.column).is_some_and(|column| column.unit.is_none());
        let Some(data) = survey.columns.get(proposed.column).filter(|_| lacks_unit) else { continue };
        let (low, high) = (data.quantile(TRIMMED_SHARE), data.quantile(1.0 - TRIMMED_SHARE));
        let fitting = fitting_units(channel, low, high, 0.0);
        if !fitting.iter().any(|unit| Some(unit.symbol()) == proposed.unit) || fitting.len() < 2 {
            continue;
        }
        let near = |unit: &&&'static Unit| (low_kg_s..=high_kg_s).contains(&unit.to_inside(high));
        let near: Vec<&&'static Unit> = fitting.iter().filter(near).collect();
        if let [unit] = near.as_slice() {
            proposed.unit = Some(unit.symbol());
            proposed.certainty = Certainty::Likely;
            proposed.remarks = vec![why(unit.symbol().to_owned())];
        }
    }
}

/// Whether all pressure ratios are possible for a compressor.
fn ratios_are_possible(channels: &[(Channel, f64, f64)], unit: &Unit) -> bool {
    let inlet = channels.iter().find(|(channel, ..)| *channel == Channel::P1);
    let inlet_pa = inlet.map_or(STANDARD_ATMOSPHERE_PA, |(_, low, _)| unit.to_inside(*low));
    channels.iter().all(|(_, _, high)| unit.to_inside(*high) <= MAX_PRESSURE_RATIO * inlet_pa)
}
