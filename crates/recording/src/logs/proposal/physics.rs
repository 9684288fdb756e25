//! Checks the proposed channels against each other: a compressor raises pressure and temperature, and flow increases with speed.

use super::channel_proposal::{Ambient, Certainty, Proposal, ProposedChannel};
use crate::logs::finding::STANDARD_ATMOSPHERE_PA;
use crate::logs::proposal::channel_proposal::ProposalRemark as Remark;
use crate::logs::{Layout, Survey};
use mapper_core::Channel;
use mapper_table::{ColumnName, Word, kind_of, unit};

/// Shaft speed above which a machine turns, rpm. Bound: above the noise of any sensor, below any idle.
const MIN_TURNING_RPM: f64 = 2000.0;

/// Minimum share of samples that agree. Bound: transients and noise make fewer exceptions.
const MIN_AGREEMENT_SHARE: f64 = 0.9;

/// Minimum correlation of flow and speed. Bound: low, since flow varies alone along a speed line.
const MIN_CORRELATION: f64 = 0.3;

/// Maximum speed of road vehicle engines, rpm. Bound: the largest turbochargers, on ships, reach about 9000 rpm.
const MAX_ENGINE_RPM: f64 = 8e3;

/// Channels that most logs name by station numbers.
const NUMBERED: [Channel; 6] = [Channel::P2, Channel::T2, Channel::P3, Channel::T3, Channel::P4, Channel::T4];

#[derive(Clone, Copy, Default)]
pub(super) struct Agreement {
    pub(super) agreeing: usize,
    pub(super) contradicting: usize,
    /// Whether the log may number its stations differently.
    pub(super) suspects_numbering: bool,
}

pub(super) fn check(proposal: &mut Proposal, layout: &Layout, survey: &Survey) -> Agreement {
    let mut agreement = Agreement::default();
    decide_bare_housing(proposal, layout, survey);
    let readings = |proposal: &Proposal, channel: Channel| Readings::of(proposal, channel, layout, survey);
    let running: Option<Readings> = readings(proposal, Channel::ShaftSpeed);
    let raised = [
        (Channel::P2, Channel::P1),
        (Channel::T2, Channel::T1),
        (Channel::P3, Channel::P4),
        (Channel::T3, Channel::T4),
    ];
    for (higher, lower) in raised {
        let (Some(high), Some(low)) = (readings(proposal, higher), readings(proposal, lower)) else {
            continue;
        };
        let turning = |t_s: f64| {
            running.as_ref().is_none_or(|speed| speed.at(t_s).is_none_or(|rpm| rpm > MIN_TURNING_RPM))
        };
        let pairs: Vec<(f64, f64)> = high
            .samples()
            .filter(|(t_s, _)| turning(*t_s))
            .filter_map(|(t_s, value)| Some((value, low.at(t_s)?)))
            .collect();
        if pairs.is_empty() {
            continue;
        }
        let share = pairs.iter().filter(|(high, low)| high >= low).count() as f64 / pairs.len() as f64;
        if share >= MIN_AGREEMENT_SHARE {
            agreement.agreeing += 1;
            proposal.remarks.push(Remark::Above { higher, lower, share });
        } else {
            doubt(proposal, &[higher, lower], &Remark::SeldomAbove { higher, lower, share });
            agreement.contradicting += 1;
            if higher == Channel::T3 {
                agreement.suspects_numbering = true;
                doubt_stations(proposal);
            }
        }
    }
    doubt_bare_housings(proposal, layout);
    if layout.columns.iter().any(|column| ColumnName::read(&column.name).has(Word::Engine)) {
        doubt(proposal, &[Channel::ValveCommand], &Remark::EngineValve);
    }
    let fastest_rpm = running.as_ref().map(|speed| speed.samples().map(|(_, rpm)| rpm).fold(0.0, f64::max));
    if let Some(max_rpm) = fastest_rpm.filter(|rpm| *rpm < MAX_ENGINE_RPM) {
        doubt(proposal, &[Channel::ShaftSpeed], &Remark::EngineSpeed { max_rpm });
    }
    if let (Some(speed), Some(flow)) = (running, readings(proposal, Channel::CompressorFlow)) {
        let pairs: Vec<(f64, f64)> =
            speed.samples().filter_map(|(t_s, rpm)| Some((rpm, flow.at(t_s)?))).collect();
        match correlation(&pairs) {
            Some(r) if r >= MIN_CORRELATION => {
                proposal.remarks.push(Remark::Correlation { r, is_expected: true });
            }
            Some(r) => {
                for proposed in proposal
                    .channels
                    .iter_mut()
                    .filter(|p| [Channel::ShaftSpeed, Channel::CompressorFlow].contains(&p.channel))
                {
                    proposed.certainty = proposed.certainty.min(Certainty::Likely);
                    proposed.remarks.push(Remark::Correlation { r, is_expected: false });
                }
            }
            None => {}
        }
    }
    agreement
}

pub(super) fn doubt_stations(proposal: &mut Proposal) {
    doubt(proposal, &NUMBERED, &Remark::OtherStations);
}

pub(super) fn remark_stations(proposal: &mut Proposal, layout: &Layout) {
    for proposed in proposal.channels.iter_mut() {
        let name = layout.columns.get(proposed.column).map_or("", |column| column.name.as_str());
        if name.contains(char::is_numeric) && proposed.channel != Channel::ShaftSpeed {
            proposed.certainty = proposed.certainty.min(Certainty::Likely);
            proposed.remarks.push(Remark::GasTurbineStations);
        }
    }
}

/// (gamma - 1) / gamma of air. Source: gamma of 1.4 (ISO 5389).
pub(super) const EXPONENT: f64 = 0.2857;

/// Minimum pressure ratio. Bound: from here the gas is at least 38 K above the inlet, and an unheated housing is far below it.
const MIN_PRESSURE_RATIO: f64 = 1.5;

/// Maximum inlet temperature if the log has no column for it, K. Bound: test cells rarely exceed 40 degC.
const MAX_INLET_K: f64 = 313.15;

/// Decides whether `T_c` is gas or housing if no other column is the gas: gas cannot be cooler than after an ideal compression.
fn decide_bare_housing(proposal: &mut Proposal, layout: &Layout, survey: &Survey) {
    let certain = |proposal: &Proposal, channel: Channel| {
        proposal.entry(channel).is_some_and(|found| found.certainty > Certainty::Unsure)
    };
    let range = |proposal: &Proposal, channel: Channel| {
        let readings = Readings::of(proposal, channel, layout, survey)?;
        let values = || readings.samples().map(|(_, value)| value);
        Some((values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max)))
    };
    if certain(proposal, Channel::T2) || !certain(proposal, Channel::P2) {
        return;
    }
    let (Some((_, outlet_pa)), Some((_, hottest_k))) =
        (range(proposal, Channel::P2), range(proposal, Channel::Tc))
    else {
        return;
    };
    let inlet_pa = range(proposal, Channel::P1).map_or(STANDARD_ATMOSPHERE_PA, |(low, _)| low);
    let inlet_k = range(proposal, Channel::T1).map_or(MAX_INLET_K, |(_, high)| high);
    let ideal_k = inlet_k * (outlet_pa / inlet_pa).max(1.0).powf(EXPONENT);
    let bare = |proposed: &&mut ProposedChannel| proposed.channel == Channel::Tc && is_bare(proposed, layout);
    if outlet_pa < MIN_PRESSURE_RATIO * inlet_pa || hottest_k < ideal_k {
        return;
    }
    if let Some(proposed) = proposal.channels.iter_mut().find(bare) {
        proposed.channel = Channel::T2;
        proposed.certainty = proposed.certainty.min(Certainty::Likely);
        proposed.remarks.push(Remark::GasTemperature { max_k: hottest_k, ideal_k });
        proposal.channels.retain(|other| other.channel != Channel::T2 || other.certainty > Certainty::Unsure);
        proposal.channels.sort_by_key(|proposed| proposed.channel);
    }
}

/// Whether a name is just `T_c` or `T_t`.
fn is_bare(proposed: &ProposedChannel, layout: &Layout) -> bool {
    let column = layout.columns.get(proposed.column);
    column.is_some_and(|column| {
        column.description.is_empty() && ColumnName::read(&column.name).part_count() <= 2
    })
}

/// Marks `T_c` and `T_t` as unsure without a column for the gas: here they are housings, elsewhere the gas after compressor and turbine.
fn doubt_bare_housings(proposal: &mut Proposal, layout: &Layout) {
    for (housing, gas) in [(Channel::Tc, Channel::T2), (Channel::Tt, Channel::T4)] {
        let gas_is_known = proposal.entry(gas).is_some_and(|gas| gas.certainty > Certainty::Unsure);
        if !gas_is_known && proposal.entry(housing).is_some_and(|proposed| is_bare(proposed, layout)) {
            doubt(proposal, &[housing], &Remark::HousingOrGas { gas });
        }
    }
}

fn doubt(proposal: &mut Proposal, channels: &[Channel], remark: &Remark) {
    for proposed in proposal.channels.iter_mut().filter(|proposed| channels.contains(&proposed.channel)) {
        proposed.certainty = Certainty::Unsure;
        proposed.remarks.push(remark.clone());
    }
}

struct Readings {
    t_s: Vec<f64>,
    values: Vec<f64>,
}

impl Readings {
    fn of(proposal: &Proposal, channel: Channel, layout: &Layout, survey: &Survey) -> Option<Readings> {
        let proposed = proposal.entry(channel)?;
        let unit = unit(kind_of(channel), proposed.unit?).ok()?;
        let data = survey.columns.get(proposed.column)?;
        let group = survey.groups.get(layout.columns.get(proposed.column)?.group)?;
        let ambient_pa = match (&proposal.ambient, proposed.gauge) {
            (_, false) | (None, _) => 0.0,
            (Some(Ambient::Assumed), _) => STANDARD_ATMOSPHERE_PA,
            (Some(Ambient::Column { column, unit }), _) => {
                mapper_table::unit(mapper_yaml::units::Kind::Pressure, unit)
                    .ok()?
                    .to_inside(survey.columns.get(*column)?.quantile(0.5))
            }
        };
        let values = data.trace.means().into_iter().map(|value| unit.to_inside(value) + ambient_pa).collect();
        Some(Readings { t_s: group.trace.means(), values })
    }

    fn samples(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.t_s
            .iter()
            .copied()
            .zip(self.values.iter().copied())
            .filter(|(t_s, value)| t_s.is_finite() && value.is_finite())
    }

    /// Mean reading around a time.
    fn at(&self, t_s: f64) -> Option<f64> {
        let after = self.t_s.partition_point(|t| *t < t_s).min(self.t_s.len().checked_sub(1)?);
        self.values.get(after).copied().filter(|value| value.is_finite())
    }
}

/// Correlation of pairs; `None` if one of the two does not move.
fn correlation(pairs: &[(f64, f64)]) -> Option<f64> {
    let count = pairs.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| pairs.iter().map(of).sum::<f64>() / count;
    let (x0, y0) = (mean(|pair| pair.0), mean(|pair| pair.1));
    let (mut xx, mut yy, mut xy) = (0.0, 0.0, 0.0);
    for (x, y) in pairs {
        xx += (x - x0) * (x - x0);
        yy += (y - y0) * (y - y0);
        xy += (x - x0) * (y - y0);
    }
    let scale = (xx * yy).sqrt();
    (pairs.len() > 2 && scale > 0.0 && scale.is_finite()).then(|| xy / scale)
}
