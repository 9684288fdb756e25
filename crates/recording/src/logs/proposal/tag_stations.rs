//! Channels that the name of a column may mean, and stations of tag numbers: a temperature and a pressure with one loop number, where only one
//! order of the loops is a compressor.

use crate::logs::finding::STANDARD_ATMOSPHERE_PA;
use crate::logs::proposal::channel_proposal::{
    Certainty, Proposal, ProposalRemark as Remark, ProposedChannel,
};
use crate::logs::proposal::physics::EXPONENT;
use crate::logs::{Layout, Survey};
use mapper_core::{CHANNELS, Channel};
use mapper_table::{Clarity, ColumnName, HeaderUnit, Measured, Place, Reference, Word, channel_at};
use mapper_yaml::units::Kind;

/// How well a name fits a channel; larger is better.
pub(crate) type Weight = u32;

/// Minimum weight of a name that is not ambiguous, if its readings are plausible. Source: the scale of the weights in the table of words.
pub(crate) const MIN_CLEAR_WEIGHT: Weight = 60;

/// Kinds of units, and the quantity that a unit of each kind implies if the name has none.
const KINDS: [(Kind, Measured); 5] = [
    (Kind::Temperature, Measured::Temperature),
    (Kind::Pressure, Measured::Pressure),
    (Kind::Speed, Measured::Speed),
    (Kind::MassFlow, Measured::Flow),
    (Kind::Fraction, Measured::Opening),
];

fn channels_of_name(name: &ColumnName, kind: Option<Kind>) -> Vec<(Channel, Weight)> {
    let has_unit = |of: Kind| kind.is_none_or(|kind| kind == of);
    if name.has(Word::Dew) {
        return has_unit(Kind::Temperature).then_some((Channel::DewPoint, 7)).into_iter().collect();
    }
    if name.has(Word::Is(Measured::Humidity)) {
        return has_unit(Kind::Fraction).then_some((Channel::RelativeHumidity, 7)).into_iter().collect();
    }
    let by_unit = kind.and_then(|kind| KINDS.iter().find(|(known, _)| *known == kind));
    let measured = match (by_unit, name.measured()) {
        (Some((_, unit)), own) if own.is_none_or(|own| own == *unit) => *unit,
        (None, Some(own)) if kind.is_none() => own,
        _ => return Vec::new(),
    };
    let has_opening = name.has(Word::Is(Measured::Opening));
    if has_opening != (measured == Measured::Opening) {
        return Vec::new();
    }
    let Some((place, clarity)) = name.place(measured) else { return Vec::new() };
    let weight = match (clarity, place) {
        (Clarity::Vague, _) => 3,
        (Clarity::Short, _) => 4,
        (Clarity::Clear, Place::Compressor | Place::Turbine | Place::Oil) => 7,
        (Clarity::Clear, Place::OilOut) => 8,
        (Clarity::Clear, _) => 6,
    };
    let inlet = name.may_be_inlet().then(|| channel_at(measured, Place::Station(1))).flatten();
    inlet.into_iter().chain(channel_at(measured, place)).map(|channel| (channel, weight)).collect()
}

/// Channels that a column may be, by its name, group and description, with their weights.
pub(crate) fn channels_of(
    name: &str,
    group: &str,
    about: &str,
    kind: Option<Kind>,
) -> Vec<(Channel, Weight)> {
    let own = ColumnName::read(name);
    if own.is_other() {
        return Vec::new();
    }
    let full_name = format!("{group} {about} {}", if own.is_tag() { "" } else { name });
    let full_name = ColumnName::read(&full_name);
    let is_command = own.is_command() || ColumnName::read(group).is_command();
    let described =
        channels_of_name(&full_name, kind).into_iter().map(|(channel, weight)| (channel, 9 * weight));
    let named = channels_of_name(&own, kind).into_iter().map(|(channel, weight)| (channel, 10 * weight));
    let mut found: Vec<(Channel, Weight)> = Vec::new();
    for (channel, weight) in named.chain(described) {
        let Some(channel) = (if is_command { commanded(channel) } else { Some(channel) }) else { continue };
        let weight = if own.is_tag() { weight.min(MIN_CLEAR_WEIGHT / 2) } else { weight };
        match found.iter_mut().find(|(other, _)| *other == channel) {
            Some((_, best)) => *best = (*best).max(weight),
            None => found.push((channel, weight)),
        }
    }
    found.sort_by_key(|(_, weight)| std::cmp::Reverse(*weight));
    found
}

fn commanded(channel: Channel) -> Option<Channel> {
    let symbol = format!("{}_command", channel.symbol());
    let row = CHANNELS.iter().find(|row| row.symbol == symbol);
    row.map(|row| row.channel).or((channel == Channel::ValveCommand).then_some(channel))
}

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
pub(crate) fn propose_stations(
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_test_stands_in_english_and_german() {
        let (t, p, n, m) =
            (Some(Kind::Temperature), Some(Kind::Pressure), Some(Kind::Speed), Some(Kind::MassFlow));
        for (name, about, kind, symbol) in [
            ("T2", "", t, "T2"),
            ("T_C_out", "", t, "T2"),
            ("p2_stat", "", p, "P2"),
            ("n_TC", "", n, "N"),
            ("Turbocharger speed", "", n, "N"),
            ("Drehzahl ATL", "", n, "N"),
            ("Temperatur nach Verdichter", "", t, "T2"),
            ("rel. Luftfeuchte", "", Some(Kind::Fraction), "RH"),
            ("Dew point inlet", "", t, "T_dew"),
            ("Druck vor Verdichter", "", p, "P1"),
            ("Druck vor Turbine", "", p, "P3"),
            ("P1C_H", "P1C", p, "P1"),
            ("P1T_H", "P1T", p, "P3"),
            ("T2C_H", "", t, "T2"),
            ("CAF", "AirFlow", m, "m_c"),
            ("Massenstrom Verdichter", "", m, "m_c"),
            ("mdot_T", "", m, "m_t"),
            ("T_OIL_H", "", t, "T_oil"),
            ("Öltemperatur Ein", "", t, "T_oil"),
            ("Tc", "", t, "Tc"),
            ("T_Gehäuse_V", "", t, "Tc"),
            ("compressor housing temperature", "", t, "Tc"),
            ("Turbinengehäuse", "", t, "Tt"),
            ("outlet_temperature", "compressor outlet_temperature", t, "T2"),
            ("inlet_pressure", "turbine inlet_pressure", p, "P3"),
            ("T_amb", "", t, "T_amb"),
            ("Umgebungstemperatur", "", t, "T_amb"),
            ("p3_soll", "", p, "P3_command"),
            ("Stellung Drosselklappe", "", None, "valve_command"),
            ("Température sortie compresseur", "", t, "T2"),
            ("Pression avant turbine", "", p, "P3"),
            ("Régime turbo", "", n, "N"),
            ("Débit air", "", m, "m_c"),
            ("Temperatura entrada compresor", "", t, "T1"),
            ("Presión salida del compresor", "", p, "P2"),
            ("COT", "", t, "T2"),
            ("TIP", "", p, "P3"),
            ("T1tot", "", t, "T1"),
            ("M1", "", m, "m_c"),
            ("p_21", "", p, "P1"),
            ("T_41", "", t, "T4"),
            ("Druck vor dem Verdichter", "", p, "P1"),
            ("PT100 Verdichter aus", "", t, "T2"),
            ("TT-101", "Compressor inlet", t, "T1"),
            ("涡轮后温度", "", t, "T4"),
        ] {
            let found = channels_of(name, "", about, kind);
            assert_eq!(found.first().map(|(channel, _)| channel.symbol()), Some(symbol), "{name}: {found:?}");
        }
        for (name, kind) in [
            ("FEF", m),
            ("Fuel flow", m),
            ("Pbc in", p),
            ("engine speed", n),
            ("Status", None),
            ("Kühlwasser ein", t),
            ("TT-101", t),
            ("T2-T1", t),
            ("u(T2)", t),
            ("T2 limit", t),
            ("P2/P1", None),
            ("Exhaust back pressure", p),
        ] {
            assert_eq!(channels_of(name, "", "", kind), [], "{name}");
        }
    }
}
