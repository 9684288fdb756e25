//! Assigns the columns of a log to channels.

use super::channel_proposal::{Ambient, Certainty, NominalFlows, Proposal, ProposedChannel};
use super::tag_stations::{MIN_CLEAR_WEIGHT, Weight, channels_of};
use super::{physics, shared_units, tag_stations};
use crate::logs::finding::{AMBIENT_RANGE_PA, TRIMMED_SHARE, fitting_units, looks_like_gauge};
use crate::logs::proposal::channel_proposal::ProposalRemark as Remark;
use crate::logs::{Column, ColumnSurvey, Layout, Survey};
use mapper_core::{CHANNELS, Channel, is_plausible_range, plausible};
use mapper_table::{
    ColumnName, HeaderUnit, Measured, Place, Reference, Word, header_unit, kind_of, volume_flow_m3_s,
};
use mapper_yaml::units::{Kind, Unit};

/// Minimum reading of an absolute outlet pressure if the inlet is gauge, Pa. Bound: gauge readings at idle are lower, as are absolute ones.
const MAX_GAUGE_MIN_PA: f64 = 1.6e5;

struct Candidate {
    column: usize,
    weight: Weight,
    is_plausible: bool,
}

/// Proposes a channel map; `nominal` gives the machine's flows, if it is known.
pub fn propose(layout: &Layout, survey: &Survey, nominal: Option<NominalFlows<'_>>) -> Proposal {
    let (mut proposal, agreement) = propose_with_numbering(layout, survey, nominal, StationNumbering::Usual);
    let has_first = [Channel::P1, Channel::T1].iter().any(|channel| proposal.entry(*channel).is_some());
    let is_without_first = !has_first && has_fifth_station(layout);
    if agreement.suspects_numbering || is_without_first {
        let (mut renumbered, agreement) =
            propose_with_numbering(layout, survey, nominal, StationNumbering::GasTurbine);
        let has_fifth = [Channel::P4, Channel::T4].iter().any(|channel| renumbered.entry(*channel).is_some());
        if has_fifth && agreement.contradicting == 0 && agreement.agreeing >= 2 {
            physics::remark_stations(&mut renumbered, layout);
            return renumbered;
        }
    }
    if is_without_first {
        physics::doubt_stations(&mut proposal);
    }
    proposal
}

/// Whether a column has a pressure or temperature of station 5, which only a gas turbine's numbering has.
fn has_fifth_station(layout: &Layout) -> bool {
    let outlet = |name: &str| {
        let is_outlet = |(channel, _): &(Channel, Weight)| [Channel::P4, Channel::T4].contains(channel);
        channels_of(name, "", "", None).iter().any(is_outlet)
    };
    let is_fifth = |column: &Column| {
        column.name.contains('5') && outlet(&StationNumbering::GasTurbine.renumber(&column.name))
    };
    layout.columns.iter().any(is_fifth)
}

#[derive(Clone, Copy, PartialEq)]
enum StationNumbering {
    /// Compressor 1 and 2, turbine 3 and 4.
    Usual,
    /// Compressor 2 and 3, turbine 4 and 5.
    GasTurbine,
}

impl StationNumbering {
    /// The name with this program's station number: its first digit minus 1, if the digit is a number by itself.
    fn renumber(self, name: &str) -> String {
        let digits: Vec<(usize, char)> =
            name.char_indices().filter(|(_, letter)| letter.is_ascii_digit()).collect();
        let alone = digits.first().filter(|(at, _)| digits.get(1).is_none_or(|(next, _)| *next > at + 1));
        match alone.and_then(|(at, digit)| Some((*at, digit.to_digit(10)?.checked_sub(1)?))) {
            Some((at, lower)) if self == StationNumbering::GasTurbine => {
                format!("{}{lower}{}", &name[..at], &name[at + 1..])
            }
            _ => name.to_owned(),
        }
    }
}

fn propose_with_numbering(
    layout: &Layout,
    survey: &Survey,
    nominal: Option<NominalFlows<'_>>,
    numbers: StationNumbering,
) -> (Proposal, physics::Agreement) {
    let units: Vec<Option<HeaderUnit>> =
        layout.columns.iter().map(|column| column.unit.as_deref().and_then(header_unit)).collect();
    let mut proposal = Proposal::default();
    let mut taken = vec![false; layout.columns.len()];
    // Best matches first, so that a column that fits two channels goes to the better one.
    let named: Vec<Vec<(Channel, Weight)>> =
        (0..layout.columns.len()).map(|column| channels_by_name(column, layout, &units, numbers)).collect();
    let mut proposals: Vec<(Channel, Vec<Candidate>)> = CHANNELS
        .iter()
        .map(|row| (row.channel, rank_candidates(row.channel, &named, layout, survey, &units)))
        .collect();
    proposals.sort_by_key(|(_, list)| std::cmp::Reverse(list.first().map_or(0, |best| best.weight)));
    for (channel, list) in proposals {
        let free: Vec<&Candidate> = list.iter().filter(|candidate| !taken[candidate.column]).collect();
        let Some((best, others)) = free.split_first() else { continue };
        taken[best.column] = true;
        let sensors = find_redundant_columns(best.column, others, layout, survey, &units);
        for sensor in &sensors {
            taken[*sensor] = true;
        }
        let rivals: Vec<String> = others
            .iter()
            .filter(|other| other.is_plausible == best.is_plausible && other.weight + 10 > best.weight)
            .filter(|other| !sensors.contains(&other.column))
            .map(|other| layout.columns[other.column].name.clone())
            .take(3)
            .collect();
        let mut proposed = propose_channel(channel, best, layout, survey, &units);
        if !rivals.is_empty() {
            proposed.certainty = proposed.certainty.min(Certainty::Likely);
            proposed.remarks.push(Remark::Rivals { columns: rivals });
        }
        proposed.others = sensors;
        proposal.channels.push(proposed);
    }
    tag_stations::propose_stations(&mut proposal, &mut taken, layout, survey, &units);
    note_unknown_units(&mut proposal, &taken, layout, &units);
    let is_free_tag =
        |(index, column): &(usize, &Column)| !taken[*index] && ColumnName::read(&column.name).is_tag();
    let tags = layout.columns.iter().enumerate().filter(is_free_tag);
    let columns: Vec<String> = tags.map(|(_, column)| column.name.clone()).collect();
    if !columns.is_empty() {
        proposal.remarks.push(Remark::TagNumbers { columns });
    }
    proposal.channels.sort_by_key(|proposed| proposed.channel);
    shared_units::infer_units(&mut proposal, layout, survey);
    decide_gauge(&mut proposal, layout, survey, &units);
    shared_units::infer_flow_unit(&mut proposal, layout, survey, nominal);
    let agreement = physics::check(&mut proposal, layout, survey);
    (proposal, agreement)
}

fn channels_by_name(
    index: usize,
    layout: &Layout,
    units: &[Option<HeaderUnit>],
    numbers: StationNumbering,
) -> Vec<(Channel, Weight)> {
    let Some(column) = layout.columns.get(index) else { return Vec::new() };
    let unit = units.get(index).copied().flatten();
    if column.unit.is_some() && unit.is_none() {
        return Vec::new();
    }
    let group = layout.groups.get(column.group).map_or("", |group| group.name.as_str());
    let kind = unit.map(|unit| unit.kind).filter(|kind| *kind != Kind::Frequency);
    // A shaft may have a number too.
    let numbers = if kind == Some(Kind::Speed) { StationNumbering::Usual } else { numbers };
    let mut channels =
        channels_of(&numbers.renumber(without_number(column, layout)), group, &column.description, kind);
    // In a log with `P11` or `T11` the first digit is the station: `P21` is the first reading of P2.
    let has_first =
        || layout.columns.iter().any(|other| ColumnName::read(&other.name).has_station(FIRST_OF_INLET));
    if ColumnName::read(&column.name).may_be_inlet() && has_first() {
        channels.retain(|(channel, _)| ![Channel::P1, Channel::T1].contains(channel));
    }
    channels
}

/// Number of the first reading at the inlet. Source: the station, then the number of the reading.
const FIRST_OF_INLET: u32 = 11;

/// The name without the number that a reader adds to equal names: `Pressure (2)` is not a pressure at station 2.
fn without_number<'a>(column: &'a Column, layout: &Layout) -> &'a str {
    let by = |mark: &str| {
        column
            .name
            .rsplit_once(mark)
            .filter(|(_, number)| number.trim_end_matches(')').parse::<usize>().is_ok())
            .map(|(name, _)| name)
    };
    let is_column = |name: &&str| layout.columns.iter().any(|other| other.name == *name);
    // pandas numbers with a point.
    let of_reader = by(" (").filter(|_| !column.header.contains(&column.name));
    of_reader.or_else(|| by(".").filter(is_column)).unwrap_or(&column.name)
}

/// Maximum difference between the medians of two sensors at one place, as a ratio. Bound: wakes and stratification make a few per cent.
const MAX_SAME_PLACE_DIFFERENCE_RATIO: f64 = 0.1;

/// Candidates that are further sensors at the place of `best`: their names differ only in the final number, and their readings agree.
fn find_redundant_columns(
    best: usize,
    others: &[&Candidate],
    layout: &Layout,
    survey: &Survey,
    units: &[Option<HeaderUnit>],
) -> Vec<usize> {
    let stem = |column: usize| {
        let name = layout.columns.get(column).map_or("", |column| column.name.as_str());
        let stem = name.trim_end_matches(|letter: char| letter.is_ascii_digit());
        (stem.len() < name.len() && stem.ends_with(['_', ' ', '-', '.', '#'])).then_some((stem, column))
    };
    let Some((own, _)) = stem(best) else { return Vec::new() };
    let middle = |column: usize| {
        let value = survey.columns.get(column).map_or(f64::NAN, |data| data.quantile(0.5));
        units.get(column).copied().flatten().map_or(value, |unit| unit.unit.to_inside(value))
    };
    let agrees = |column: usize| {
        (middle(column) - middle(best)).abs() <= MAX_SAME_PLACE_DIFFERENCE_RATIO * middle(best).abs()
    };
    let same = others.iter().map(|other| other.column).filter(|column| {
        stem(*column).is_some_and(|(stem, _)| stem == own)
            && units.get(*column).map(|unit| unit.map(|unit| unit.unit.symbol()))
                == units.get(best).map(|unit| unit.map(|unit| unit.unit.symbol()))
            && agrees(*column)
    });
    same.take(mapper_core::MAX_ELEMENTS - 1).collect()
}

/// Adds remarks about columns that have a channel's name and an unknown unit.
fn note_unknown_units(
    proposal: &mut Proposal,
    taken: &[bool],
    layout: &Layout,
    units: &[Option<HeaderUnit>],
) {
    for (index, column) in layout.columns.iter().enumerate() {
        let (Some(spelling), None, false) = (&column.unit, units[index], taken[index]) else { continue };
        let group = layout.groups.get(column.group).map_or("", |group| group.name.as_str());
        let named = channels_of(without_number(column, layout), group, &column.description, None);
        let kind = volume_flow_m3_s(spelling).map(|_| Kind::MassFlow);
        let is_plausible = |channel: Channel| kind.is_none_or(|kind| kind == kind_of(channel));
        let named = named.iter().map(|(channel, _)| *channel).find(|channel| is_plausible(*channel));
        // The unit alone shows a flow.
        let by_unit =
            kind.filter(|_| !ColumnName::read(&column.name).is_other()).map(|_| Channel::CompressorFlow);
        let Some(channel) = named.or(by_unit).filter(|channel| proposal.entry(*channel).is_none()) else {
            continue;
        };
        let (column, unit) = (column.name.clone(), spelling.clone());
        proposal.remarks.push(match volume_flow_m3_s(spelling) {
            Some(None) => Remark::StandardFlow { channel, column, unit, known_units: standard_flows() },
            Some(Some(_)) => Remark::VolumeFlow { channel, column, unit },
            None => Remark::UnknownUnit { channel, column, unit },
        });
    }
}

fn standard_flows() -> Vec<String> {
    let standard = |unit: &&Unit| unit.symbol().contains('(') || unit.symbol().contains("m3/h");
    Kind::MassFlow.units().iter().filter(standard).map(|unit| unit.symbol().to_owned()).collect()
}

/// Candidate columns of a channel, best first; `named` has the channels of each column's name.
fn rank_candidates(
    channel: Channel,
    named: &[Vec<(Channel, Weight)>],
    layout: &Layout,
    survey: &Survey,
    units: &[Option<HeaderUnit>],
) -> Vec<Candidate> {
    let mut list: Vec<Candidate> = Vec::new();
    for (index, ((column, data), named)) in layout.columns.iter().zip(&survey.columns).zip(named).enumerate()
    {
        let Some((_, weight)) = named.iter().find(|(named, _)| *named == channel) else { continue };
        if data.is_empty() {
            continue;
        }
        let (low, high) = (data.quantile(TRIMMED_SHARE), data.quantile(1.0 - TRIMMED_SHARE));
        let is_plausible = match units[index] {
            Some(unit) => {
                let (low, high) = (unit.unit.to_inside(low), unit.unit.to_inside(high));
                is_plausible_range(channel, low, high) || looks_like_gauge(channel, low, high)
            }
            None => !fitting_units(channel, low, high, 0.0).is_empty(),
        };
        let weight = weight + if is_plausible { 20 } else { 0 };
        // Values that the stand computed rank after all measured ones: no weight of a name is below ten.
        let weight = if ColumnName::read(&column.name).is_computed() { weight / 10 } else { weight };
        list.push(Candidate { column: index, weight, is_plausible });
    }
    list.sort_by_key(|candidate| std::cmp::Reverse(candidate.weight));
    list
}

fn propose_channel(
    channel: Channel,
    best: &Candidate,
    layout: &Layout,
    survey: &Survey,
    units: &[Option<HeaderUnit>],
) -> ProposedChannel {
    let mut proposed = ProposedChannel {
        channel,
        column: best.column,
        others: Vec::new(),
        unit: None,
        gauge: false,
        certainty: Certainty::Sure,
        remarks: Vec::new(),
    };
    let data = &survey.columns[best.column];
    let (low, high) = (data.quantile(TRIMMED_SHARE), data.quantile(1.0 - TRIMMED_SHARE));
    let fitting = fitting_units(channel, low, high, 0.0);
    let symbols = |units: &[&'static Unit]| units.iter().map(|unit| unit.symbol().to_owned()).collect();
    match (units[best.column], fitting.as_slice()) {
        (Some(unit), _) => {
            proposed.unit = Some(unit.unit.symbol());
            proposed.gauge = unit.reference == Reference::Gauge;
            if !best.is_plausible {
                proposed.certainty = Certainty::Unsure;
                proposed.remarks.push(Remark::ImplausibleRange {
                    min: data.min,
                    max: data.max,
                    unit: unit.unit.symbol().to_owned(),
                    plausible_units: symbols(&fitting),
                });
            }
        }
        (None, [only]) => {
            proposed.unit = Some(only.symbol());
            proposed.certainty = Certainty::Likely;
            proposed.remarks.push(Remark::OneUnitFits { unit: only.symbol().to_owned(), columns: 1 });
        }
        (None, []) => {
            proposed.certainty = Certainty::Unsure;
            proposed.remarks.push(Remark::NoUnitFits { min: data.min, max: data.max });
        }
        (None, several) => {
            proposed.unit = several.first().map(|unit| unit.symbol());
            proposed.certainty = Certainty::Unsure;
            proposed.remarks.push(Remark::SeveralUnitsFit { units: symbols(several) });
        }
    }
    if let Some(remark) = impossible_readings(channel, data, proposed.unit) {
        proposed.certainty = proposed.certainty.min(Certainty::Likely);
        proposed.remarks.push(remark);
    }
    let name = ColumnName::read(&layout.columns[best.column].name);
    if name.is_computed() {
        proposed.certainty = Certainty::Unsure;
        proposed.remarks.push(Remark::Computed);
    }
    if best.weight < MIN_CLEAR_WEIGHT && proposed.certainty == Certainty::Sure {
        proposed.certainty = Certainty::Likely;
        proposed.remarks.push(if name.is_tag() {
            Remark::TagNumbers { columns: vec![layout.columns[best.column].name.clone()] }
        } else {
            Remark::AmbiguousName
        });
    }
    proposed
}

/// A remark about readings that no sensor of the channel can have: marks of missing values, or faults.
fn impossible_readings(channel: Channel, data: &ColumnSurvey, unit: Option<&'static str>) -> Option<Remark> {
    let unit = mapper_table::unit(kind_of(channel), unit?).ok()?;
    let range = plausible(channel);
    let (low, high) = (unit.to_inside(data.min), unit.to_inside(data.max));
    // Gauge pressures may be negative.
    let below = kind_of(channel) == Kind::Temperature && low < *range.any.start();
    let value = if below {
        data.min
    } else if high > *range.running.end() {
        data.max
    } else {
        return None;
    };
    Some(Remark::ImpossibleReadings { value, unit: unit.symbol().to_owned() })
}

/// Decides which pressures are gauge pressures, and finds the ambient pressure.
fn decide_gauge(proposal: &mut Proposal, layout: &Layout, survey: &Survey, units: &[Option<HeaderUnit>]) {
    let in_pa = |proposed: &ProposedChannel| -> Option<(f64, f64)> {
        let unit = mapper_table::unit(Kind::Pressure, proposed.unit?).ok()?;
        let data: &ColumnSurvey = survey.columns.get(proposed.column)?;
        Some((
            unit.to_inside(data.quantile(TRIMMED_SHARE)),
            unit.to_inside(data.quantile(1.0 - TRIMMED_SHARE)),
        ))
    };
    let unstated = |proposed: &ProposedChannel| {
        kind_of(proposed.channel) == Kind::Pressure
            && !units[proposed.column].is_some_and(|unit| unit.reference != Reference::Unstated)
    };
    let inlet_is_gauge = proposal.entry(Channel::P1).is_some_and(|inlet| {
        inlet.gauge || in_pa(inlet).is_some_and(|(low, high)| looks_like_gauge(Channel::P1, low, high))
    });
    for proposed in proposal.channels.iter_mut().filter(|proposed| unstated(proposed)) {
        let Some((low, high)) = in_pa(proposed) else { continue };
        if looks_like_gauge(proposed.channel, low, high) {
            proposed.gauge = true;
            proposed.certainty = proposed.certainty.min(Certainty::Likely);
            proposed.remarks.push(Remark::TakenAsGauge { min_pa: low });
        } else if inlet_is_gauge && low < MAX_GAUGE_MIN_PA {
            proposed.gauge = true;
            proposed.certainty = proposed.certainty.min(Certainty::Likely);
            proposed.remarks.push(Remark::GaugeLikeInlet);
        }
    }
    if !proposal.channels.iter().any(|proposed| proposed.gauge) {
        return;
    }
    let ambient = layout.columns.iter().enumerate().find_map(|(index, column)| {
        let unit =
            units[index].filter(|unit| unit.kind == Kind::Pressure && unit.reference != Reference::Gauge)?;
        let is_ambient = |name: &String| {
            let name = ColumnName::read(name);
            name.has(Word::Ambient) || matches!(name.place(Measured::Pressure), Some((Place::Ambient, _)))
        };
        let named = [&column.name, &column.description].into_iter().any(is_ambient);
        let median_pa = unit.unit.to_inside(survey.columns[index].quantile(0.5));
        let (min_pa, max_pa) = AMBIENT_RANGE_PA;
        (named && (min_pa..=max_pa).contains(&median_pa))
            .then_some(Ambient::Column { column: index, unit: unit.unit.symbol() })
    });
    proposal.ambient = Some(ambient.unwrap_or(Ambient::Assumed));
}
