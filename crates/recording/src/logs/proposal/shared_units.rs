//! Infers the units of a log without units: columns of one kind share a unit, and physics excludes the others.

use super::channel_proposal::{Certainty, NominalFlows, Proposal, ProposedChannel};
use super::physics::EXPONENT;
use crate::logs::finding::{STANDARD_ATMOSPHERE_PA, TRIMMED_SHARE, fitting_units};
use crate::logs::proposal::channel_proposal::ProposalRemark as Remark;
use crate::logs::{Layout, Survey};
use mapper_core::Channel;
use mapper_core::unit_factors::S_PER_MIN;
use mapper_table::kind_of;
use mapper_yaml::units::{Kind, Unit};
use std::f64::consts::PI;
use std::ops::RangeInclusive;

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
        let mut by_inlet = None;
        if kind == Kind::Temperature {
            by_inlet = unit_by_inlet(&channels, &common);
            common = by_inlet.map_or(common, |unit| vec![unit]);
        }
        let Some((unit, similar)) = common.split_first() else { continue };
        // bar and kgf/cm2 differ by less than the sensors of many stands: the usual one counts, and both are named.
        let is_similar = |other: &&'static Unit| {
            (other.to_inside(1.0) / unit.to_inside(1.0) - 1.0).abs() < SIMILAR_UNITS_RATIO
        };
        if !(kind == Kind::Pressure && similar.iter().all(is_similar) || similar.is_empty()) {
            let remark = Remark::SeveralUnitsFit {
                units: common.iter().map(|unit| unit.symbol().to_owned()).collect(),
            };
            for proposed in proposal.channels.iter_mut().filter(|proposed| lacks_unit(proposed)) {
                proposed.unit = Some(unit.symbol());
                proposed.certainty = Certainty::Unsure;
                proposed.remarks = vec![remark.clone()];
            }
            continue;
        }
        for proposed in proposal.channels.iter_mut().filter(|proposed| lacks_unit(proposed)) {
            proposed.unit = Some(unit.symbol());
            proposed.certainty = Certainty::Likely;
            proposed.remarks = vec![match by_inlet {
                Some(unit) => Remark::InletTemperature { unit: unit.symbol().to_owned() },
                None if !similar.is_empty() => Remark::SeveralUnitsFit {
                    units: common.iter().map(|unit| unit.symbol().to_owned()).collect(),
                },
                None => Remark::OneUnitFits { unit: unit.symbol().to_owned(), columns: channels.len() },
            }];
        }
    }
}

/// Maximum relative difference of two units that the readings cannot tell apart. Bound: 1 bar is 1.020 kgf/cm2; the weather varies by more.
const SIMILAR_UNITS_RATIO: f64 = 0.03;

/// Range of the inlet temperature of a test cell, K. Bound: air of 10 to 50 degC. The inlet of a second stage may be warmer.
const INLET_K: RangeInclusive<f64> = 283.15..=323.15;

/// The unit in which the inlet has the temperature of a test cell, if degC and degF are both plausible. A value is below 50 in degC and
/// above it in degF.
fn unit_by_inlet(channels: &[(Channel, f64, f64)], common: &[&'static Unit]) -> Option<&'static Unit> {
    let (_, inlet, _) = channels.iter().find(|(channel, ..)| *channel == Channel::T1)?;
    let with_symbol = |symbol: &str| common.iter().copied().find(|unit| unit.symbol() == symbol);
    let (celsius, fahrenheit) = with_symbol("degC").zip(with_symbol("degF"))?;
    match fahrenheit.to_inside(*inlet) {
        inlet_k if INLET_K.contains(&inlet_k) => Some(fahrenheit),
        inlet_k if inlet_k < *INLET_K.start() => Some(celsius),
        _ => None,
    }
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
const TYPICAL_INLET_K: f64 = 298.0;

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
            let head_j_kg = CP_J_KGK * TYPICAL_INLET_K * (ratio.max(1.0).powf(EXPONENT) - 1.0);
            let tip_m_s = (head_j_kg / HEAD_COEFFICIENT).sqrt();
            let diameter_m = S_PER_MIN * tip_m_s / (PI * speed_rpm);
            let flow_kg_s = FLOW_COEFFICIENT * DENSITY_KG_M3 * tip_m_s * PI / 4.0 * diameter_m * diameter_m;
            let why = move |unit| Remark::FitsWheel { unit, diameter_m };
            (flow_kg_s / FLOW_FACTOR, flow_kg_s * FLOW_FACTOR, Box::new(why))
        }
    };
    let is_imperial =
        proposal.channels.iter().any(|other| matches!(other.unit, Some("psia" | "psi" | "inHg" | "degF")));
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
        let is_near = |unit: &&'static Unit| (low_kg_s..=high_kg_s).contains(&unit.to_inside(high));
        let mut near: Vec<&'static Unit> = fitting.into_iter().filter(is_near).collect();
        if near.len() > 1 {
            // A log in psi has pounds, and one in bar has none.
            near.retain(|unit| unit.symbol().starts_with("lb") == is_imperial);
        }
        if let [unit] = near.as_slice() {
            proposed.unit = Some(unit.symbol());
            proposed.certainty = Certainty::Likely;
            proposed.remarks = vec![why(unit.symbol().to_owned())];
        }
    }
}

fn ratios_are_possible(channels: &[(Channel, f64, f64)], unit: &Unit) -> bool {
    let inlet = channels.iter().find(|(channel, ..)| *channel == Channel::P1);
    let inlet_pa = inlet.map_or(STANDARD_ATMOSPHERE_PA, |(_, low, _)| unit.to_inside(*low));
    channels.iter().all(|(_, _, high)| unit.to_inside(*high) <= MAX_PRESSURE_RATIO * inlet_pa)
}
