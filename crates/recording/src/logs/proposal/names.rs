//! Channels that the name of a column may mean.

use mapper_core::{CHANNELS, Channel};
use mapper_table::{Clarity, ColumnName, Measured, Place, Word, channel_at};
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

/// Channels of a name with their weights; `kind` is that of its unit.
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

/// The command channel of a measured channel.
fn commanded(channel: Channel) -> Option<Channel> {
    let symbol = format!("{}_command", channel.symbol());
    let row = CHANNELS.iter().find(|row| row.symbol == symbol);
    row.map(|row| row.channel).or((channel == Channel::ValveCommand).then_some(channel))
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
