//! Which column is which channel.

use super::names::{Weight, channels_of, is_ambient, is_derived, plain};
use super::physics;
use super::proposed::{Ambient, Certainty, Proposal, ProposedChannel};
use crate::plausible::{AMBIENT_PA, fits, fitting_units, looks_like_gauge};
use crate::units::kind_of;
use crate::{ColumnSurvey, Layout, Survey};
use mapper_core::{CHANNELS, Channel};
use mapper_yaml::units::{HeaderUnit, Kind, Reference, Unit, header_unit};

/// Share of a trace left out at each end when its range is judged.
const OUTER: f64 = 0.02;

/// A column as a candidate for a channel.
struct Candidate {
    column: usize,
    weight: Weight,
    fits: bool,
}

/// Suggests a channel map.
pub fn propose(layout: &Layout, survey: &Survey) -> Proposal {
    let units: Vec<Option<HeaderUnit>> =
        layout.columns.iter().map(|column| column.unit.as_deref().and_then(header_unit)).collect();
    let mut proposal = Proposal::default();
    let mut taken = vec![false; layout.columns.len()];
    // The surest first, so that a column that fits two channels goes to the one that it fits best.
    let named: Vec<Vec<(Channel, Weight)>> =
        (0..layout.columns.len()).map(|column| names_of(column, layout, &units)).collect();
    let mut wishes: Vec<(Channel, Vec<Candidate>)> = CHANNELS
        .iter()
        .map(|row| (row.channel, candidates(row.channel, &named, layout, survey, &units)))
        .collect();
    wishes.sort_by_key(|(_, list)| std::cmp::Reverse(list.first().map_or(0, |best| best.weight)));
    for (channel, list) in wishes {
        let free: Vec<&Candidate> = list.iter().filter(|candidate| !taken[candidate.column]).collect();
        let Some((best, others)) = free.split_first() else { continue };
        taken[best.column] = true;
        let rivals: Vec<&str> = others
            .iter()
            .filter(|other| other.fits == best.fits && other.weight + 10 > best.weight)
            .map(|other| layout.columns[other.column].name.as_str())
            .take(3)
            .collect();
        let mut proposed = entry(channel, best, layout, survey, &units);
        if !rivals.is_empty() {
            proposed.certainty = proposed.certainty.min(Certainty::Likely);
            proposed.remarks.push(format!("it could also be {}", rivals.join(" or ")));
        }
        proposal.channels.push(proposed);
    }
    proposal.channels.sort_by_key(|proposed| proposed.channel);
    settle_gauge(&mut proposal, layout, survey, &units);
    physics::judge(&mut proposal, layout, survey);
    proposal
}

/// The channels that a column may be by what is said about it.
fn names_of(index: usize, layout: &Layout, units: &[Option<HeaderUnit>]) -> Vec<(Channel, Weight)> {
    let Some(column) = layout.columns.get(index) else { return Vec::new() };
    let unit = units.get(index).copied().flatten();
    if column.unit.is_some() && unit.is_none() {
        return Vec::new();
    }
    let group = layout.groups.get(column.group).map_or("", |group| group.name.as_str());
    let kind = unit.map(|unit| unit.kind).filter(|kind| *kind != Kind::Frequency);
    channels_of(&column.name, group, &column.description, kind)
}

/// The columns that may be a channel, best first; `named` has the channels of each column's name.
fn candidates(
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
        let (low, high) = (data.quantile(OUTER), data.quantile(1.0 - OUTER));
        let fits = match units[index] {
            Some(unit) => {
                let (low, high) = (unit.unit.to_inside(low), unit.unit.to_inside(high));
                fits(channel, low, high) || looks_like_gauge(channel, low, high)
            }
            None => !fitting_units(channel, low, high, 0.0).is_empty(),
        };
        // What was computed by the stand counts after what was measured.
        let derived = if is_derived(&plain(&column.name)) { 15 } else { 0 };
        let weight = (weight + if fits { 20 } else { 0 }).saturating_sub(derived);
        list.push(Candidate { column: index, weight, fits });
    }
    list.sort_by_key(|candidate| std::cmp::Reverse(candidate.weight));
    list
}

fn entry(
    channel: Channel,
    best: &Candidate,
    layout: &Layout,
    survey: &Survey,
    units: &[Option<HeaderUnit>],
) -> ProposedChannel {
    let mut proposed = ProposedChannel {
        channel,
        column: best.column,
        unit: None,
        gauge: false,
        certainty: Certainty::Sure,
        remarks: Vec::new(),
    };
    let data = &survey.columns[best.column];
    let (low, high) = (data.quantile(OUTER), data.quantile(1.0 - OUTER));
    let fitting = fitting_units(channel, low, high, 0.0);
    let symbols =
        |units: &[&'static Unit]| units.iter().map(|unit| unit.symbol()).collect::<Vec<_>>().join(" or ");
    match (units[best.column], fitting.as_slice()) {
        (Some(unit), _) => {
            proposed.unit = Some(unit.unit.symbol());
            proposed.gauge = unit.reference == Reference::Gauge;
            if !best.fits {
                proposed.certainty = Certainty::Unsure;
                let instead = if fitting.is_empty() {
                    String::new()
                } else {
                    format!("; {} would be plausible", symbols(&fitting))
                };
                proposed.remarks.push(format!(
                    "{} to {} {} is not plausible{instead}",
                    short(data.min),
                    short(data.max),
                    unit.unit.symbol()
                ));
            }
        }
        (None, [only]) => {
            proposed.unit = Some(only.symbol());
            proposed.certainty = Certainty::Likely;
            proposed.remarks.push(format!("the log gives no unit; by its range it is {}", only.symbol()));
        }
        (None, []) => {
            proposed.certainty = Certainty::Unsure;
            proposed.remarks.push(format!(
                "the log gives no unit, and {} to {} fits none",
                short(data.min),
                short(data.max)
            ));
        }
        (None, several) => {
            proposed.unit = several.first().map(|unit| unit.symbol());
            proposed.certainty = Certainty::Unsure;
            proposed.remarks.push(format!("the log gives no unit; its range fits {}", symbols(several)));
        }
    }
    if is_derived(&plain(&layout.columns[best.column].name)) {
        proposed.certainty = Certainty::Unsure;
        proposed.remarks.push("by its name it was computed, not measured".to_owned());
    }
    if best.weight < 60 && proposed.certainty == Certainty::Sure {
        proposed.certainty = Certainty::Likely;
        proposed.remarks.push("the name says little".to_owned());
    }
    proposed
}

/// Which pressures are gauge pressures, and where the ambient pressure is.
fn settle_gauge(proposal: &mut Proposal, layout: &Layout, survey: &Survey, units: &[Option<HeaderUnit>]) {
    let in_pa = |proposed: &ProposedChannel| -> Option<(f64, f64)> {
        let unit = crate::units::unit(Kind::Pressure, proposed.unit?).ok()?;
        let data: &ColumnSurvey = survey.columns.get(proposed.column)?;
        Some((unit.to_inside(data.quantile(OUTER)), unit.to_inside(data.quantile(1.0 - OUTER))))
    };
    let unsaid = |proposed: &ProposedChannel| {
        kind_of(proposed.channel) == Kind::Pressure
            && !units[proposed.column].is_some_and(|unit| unit.reference != Reference::Unsaid)
    };
    let inlet_is_gauge = proposal.of(Channel::P1).is_some_and(|inlet| {
        inlet.gauge || in_pa(inlet).is_some_and(|(low, high)| looks_like_gauge(Channel::P1, low, high))
    });
    for proposed in proposal.channels.iter_mut().filter(|proposed| unsaid(proposed)) {
        let Some((low, high)) = in_pa(proposed) else { continue };
        if looks_like_gauge(proposed.channel, low, high) {
            proposed.gauge = true;
            proposed.certainty = proposed.certainty.min(Certainty::Likely);
            proposed.remarks.push(format!(
                "down to {:.1} kPa: too low for an absolute pressure, taken as gauge",
                low / 1e3
            ));
        } else if inlet_is_gauge && low < 1.6e5 {
            proposed.gauge = true;
            proposed.certainty = proposed.certainty.min(Certainty::Likely);
            proposed
                .remarks
                .push("the log does not say whether it is absolute; taken as gauge, as P1 is".to_owned());
        }
    }
    if !proposal.channels.iter().any(|proposed| proposed.gauge) {
        return;
    }
    let ambient = layout.columns.iter().enumerate().find_map(|(index, column)| {
        let unit =
            units[index].filter(|unit| unit.kind == Kind::Pressure && unit.reference != Reference::Gauge)?;
        let named = is_ambient(&plain(&column.name)) || is_ambient(&plain(&column.description));
        let median_pa = unit.unit.to_inside(survey.columns[index].quantile(0.5));
        let (least, most) = AMBIENT_PA;
        (named && (least..=most).contains(&median_pa))
            .then_some(Ambient::Column { column: index, unit: unit.unit.symbol() })
    });
    proposal.ambient = Some(ambient.unwrap_or(Ambient::Assumed));
}

/// A number for people.
pub(crate) fn short(value: f64) -> String {
    match value.abs() {
        _ if !value.is_finite() => "-".to_owned(),
        0.0 => "0".to_owned(),
        size if size >= 1e5 => format!("{value:.0}"),
        size if size >= 100.0 => format!("{value:.1}"),
        size if size >= 1.0 => format!("{value:.2}"),
        size if size >= 1e-3 => format!("{value:.4}"),
        _ => format!("{value:.2e}"),
    }
}
