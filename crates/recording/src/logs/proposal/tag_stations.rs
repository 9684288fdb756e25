//! Stations of tag numbers: a temperature and a pressure with one loop number, where only one order of the loops is a compressor.

use super::channel_proposal::{Certainty, Proposal, ProposedChannel};
use super::physics::EXPONENT;
use super::remark::ProposalRemark as Remark;
use crate::logs::plausible::STANDARD_ATMOSPHERE_PA;
use crate::logs::{Layout, Survey};
use mapper_core::Channel;
use mapper_table::{ColumnName, HeaderUnit, Measured, Reference};
use mapper_yaml::units::Kind;

/// Temperature and pressure of one loop, K and Pa, by row of the trace.
struct Station {
    number: u32,
    /// Columns of the temperature and the pressure.
    columns: [usize; 2],
    t_k: Vec<f64>,
    p_pa: Vec<f64>,
}

/// Minimum pressure ratio of the rows that count. Bound: below it, small errors of temperature decide.
const MIN_RATIO: f64 = 1.3;

/// Minimum number of such rows. Bound: fewer agree by chance.
const MIN_ROWS: usize = 5;
/// Minimum share of them that must agree. Bound: transients and noise make fewer exceptions.
const MIN_SHARE: f64 = 0.9;

/// Apparent efficiencies of a compressor. Bound: heat from the turbine lowers them, and none is above an ideal compression.
const COMPRESSION: std::ops::RangeInclusive<f64> = 0.3..=1.0;

/// Apparent efficiencies of a turbine. Bound: heat losses raise them above 1.
const EXPANSION: std::ops::RangeInclusive<f64> = 0.3..=1.2;

/// (gamma - 1) / gamma of exhaust gas. Source: gamma of 1.33.
const HOT_EXPONENT: f64 = 0.25;

/// Proposes the stations of free tag numbers if physics leaves only one order, and marks their columns as taken.
pub(super) fn propose_stations(
    proposal: &mut Proposal,
    taken: &mut [bool],
    layout: &Layout,
    survey: &Survey,
    units: &[Option<HeaderUnit>],
) {
    let stations = stations(taken, layout, survey, units);
    let all = || stations.iter().flat_map(|from| stations.iter().map(move |to| (from, to)));
    let compressors: Vec<(&Station, &Station)> = all().filter(|(from, to)| compresses(from, to)).collect();
    let [(inlet, outlet)] = compressors.as_slice() else { return };
    let is_free = |station: &Station| ![inlet.number, outlet.number].contains(&station.number);
    let turbines: Vec<(&Station, &Station)> = all()
        .filter(|(from, to)| is_free(from) && is_free(to) && expands(from, to) && is_hotter(from, outlet))
        .collect();
    let mut placed = vec![(*inlet, [Channel::T1, Channel::P1]), (*outlet, [Channel::T2, Channel::P2])];
    if let [(from, to)] = turbines.as_slice() {
        placed.extend([(*from, [Channel::T3, Channel::P3]), (*to, [Channel::T4, Channel::P4])]);
    }
    for (station, channels) in placed {
        for (channel, column) in channels.into_iter().zip(station.columns) {
            let Some(unit) = units.get(column).copied().flatten() else { continue };
            if proposal.entry(channel).is_some() {
                continue;
            }
            taken[column] = true;
            proposal.channels.push(ProposedChannel {
                channel,
                column,
                others: Vec::new(),
                unit: Some(unit.unit.symbol()),
                gauge: unit.reference == Reference::Gauge,
                certainty: Certainty::Likely,
                remarks: vec![Remark::TagStation { number: station.number }],
            });
        }
    }
}

/// Loops with one temperature and one pressure.
fn stations(taken: &[bool], layout: &Layout, survey: &Survey, units: &[Option<HeaderUnit>]) -> Vec<Station> {
    let tags: Vec<(usize, Measured, u32)> = (0..layout.columns.len())
        .filter(|column| !taken[*column])
        .filter_map(|column| {
            let (measured, number) = ColumnName::read(&layout.columns[column].name).tag()?;
            Some((column, measured, number))
        })
        .collect();
    let only = |number: u32, measured: Measured| {
        let mut found = tags.iter().filter(|tag| tag.2 == number && tag.1 == measured);
        found.next().filter(|_| found.next().is_none()).map(|tag| tag.0)
    };
    let values = |column: usize, kind: Kind| {
        let unit = units.get(column).copied().flatten().filter(|unit| unit.kind == kind)?;
        let over = if unit.reference == Reference::Gauge { STANDARD_ATMOSPHERE_PA } else { 0.0 };
        let means = survey.columns.get(column)?.trace.means();
        Some(means.into_iter().map(|value| unit.unit.to_inside(value) + over).collect::<Vec<f64>>())
    };
    let temperatures = tags.iter().filter(|tag| tag.1 == Measured::Temperature);
    let station = |tag: &(usize, Measured, u32)| {
        let number = tag.2;
        let columns = [only(number, Measured::Temperature)?, only(number, Measured::Pressure)?];
        let [t_k, p_pa] = [values(columns[0], Kind::Temperature)?, values(columns[1], Kind::Pressure)?];
        Some(Station { number, columns, t_k, p_pa })
    };
    temperatures.filter_map(station).collect()
}

/// Whether nearly all rows with pressure satisfy a condition on the temperatures before and after, and the pressure ratio.
fn agrees(low: &Station, high: &Station, is_right: impl Fn(f64, f64, f64) -> bool) -> bool {
    let rows = low.t_k.iter().zip(&low.p_pa).zip(high.t_k.iter().zip(&high.p_pa));
    let counted: Vec<bool> = rows
        .map(|((low_k, low_pa), (high_k, high_pa))| (*low_k, *high_k, high_pa / low_pa))
        .filter(|(.., ratio)| *ratio >= MIN_RATIO)
        .map(|(low_k, high_k, ratio)| is_right(low_k, high_k, ratio))
        .collect();
    let right = counted.iter().filter(|right| **right).count();
    counted.len() >= MIN_ROWS && right as f64 >= MIN_SHARE * counted.len() as f64
}

fn compresses(from: &Station, to: &Station) -> bool {
    agrees(from, to, |t1_k, t2_k, ratio| {
        COMPRESSION.contains(&(t1_k * (ratio.powf(EXPONENT) - 1.0) / (t2_k - t1_k)))
    })
}

fn expands(from: &Station, to: &Station) -> bool {
    agrees(to, from, |t4_k, t3_k, ratio| {
        EXPANSION.contains(&((t3_k - t4_k) / t3_k / (1.0 - ratio.powf(-HOT_EXPONENT))))
    })
}

/// Whether a gas is hotter than another in all rows.
fn is_hotter(station: &Station, other: &Station) -> bool {
    station.t_k.iter().zip(&other.t_k).all(|(hot, cold)| hot > cold || hot.is_nan() || cold.is_nan())
}
