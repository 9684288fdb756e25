//! What the names of columns say about what was measured, in English, German, French, Spanish, Italian, Portuguese, Dutch and Swedish.

use crate::logs::units::kind_of;
use mapper_core::{CHANNELS, Channel};
use mapper_yaml::units::Kind;
use regex_lite::Regex;
use std::sync::LazyLock;

/// How well a name fits a channel; larger is better.
pub(crate) type Weight = u32;

/// Maximum number of letters of a name that are evaluated.
const MAX_NAME_LETTERS: usize = 120;

/// The name in lower case, umlauts spelled out, without accents, with `_` for everything but letters and digits and between the words of
/// `compInletTemp`.
pub(crate) fn normalise(text: &str) -> String {
    let mut normalised = String::new();
    let mut letters = text.chars().take(MAX_NAME_LETTERS).peekable();
    let mut was_small = false;
    while let Some(letter) = letters.next() {
        if was_small && letter.is_uppercase() && letters.peek().is_some_and(|next| next.is_lowercase()) {
            normalised.push('_');
        }
        was_small = letter.is_lowercase();
        for letter in letter.to_lowercase() {
            push_normalised(&mut normalised, letter);
        }
    }
    // German compounds: `Eintrittsdruck`.
    normalised.trim_matches('_').replace("eintritts", "eintritt_").replace("austritts", "austritt_")
}

fn push_normalised(normalised: &mut String, letter: char) {
    match letter {
        'ä' => normalised.push_str("ae"),
        'ö' => normalised.push_str("oe"),
        'ü' => normalised.push_str("ue"),
        'ß' => normalised.push_str("ss"),
        'à' | 'á' | 'â' | 'ã' | 'å' => normalised.push('a'),
        'è' | 'é' | 'ê' => normalised.push('e'),
        'ì' | 'í' | 'î' => normalised.push('i'),
        'ò' | 'ó' | 'ô' | 'õ' => normalised.push('o'),
        'ù' | 'ú' | 'û' => normalised.push('u'),
        'ç' => normalised.push('c'),
        'ñ' => normalised.push('n'),
        letter if letter.is_ascii_alphanumeric() => normalised.push(letter),
        _ if normalised.ends_with('_') => {}
        _ => normalised.push('_'),
    }
}

/// Patterns of one station: `{q}` stands for the letters of the quantity.
struct Place {
    temperature: Option<Channel>,
    pressure: Option<Channel>,
    /// Each pattern with its weight.
    patterns: &'static [(Weight, &'static str)],
}

/// The machines and places in patterns that name the quantity as well: a letter is enough. The words alone say it without.
const COMPRESSOR: &str =
    "(c|v|comp|compr|cmp|cmpr|compressor|verd|verdichter|kompressor|lader|compresseur|compresor|compressore)";
const TURBINE: &str = "(t|tur|turb|turbine|turbina|turbin)";
const IN: &str = "(e|in|inlet|ein|eintritt|suction|entree|entry|entrada|entrata|ingresso|admission|admision)";
const OUT: &str = "(a|out|outlet|aus|austritt|discharge|exit|sortie|salida|saida|uscita)";
const BEFORE: &str = "(v|vor|before|upstream|upstream_of|us|pre|avant|amont|antes|voor|foere|monte)";
const AFTER: &str =
    "(n|nach|hinter|after|behind|downstream|downstream_of|ds|post|apres|aval|despues|na|efter|valle)";
const HOUSING: &str = "(housing|hsg|casing|wall|skin|metal|wand|geh|gehaeuse|gehause|body|material|carter|carcasa|carcassa|paroi|pared)";

/// The alternatives of a pattern that are words, not single letters.
fn words(alternatives: &str) -> String {
    let all = alternatives.trim_matches(['(', ')']).split('|');
    format!("({})", all.filter(|word| word.len() > 1).collect::<Vec<_>>().join("|"))
}

/// Optional words between a place and a machine.
const OF: &str = "(dem_|der_|of_|of_the_|du_|de_|de_la_|de_l_|del_|do_|da_|della_)?";
/// Optional suffix of a station number: the machine, or total or static.
const KIND: &str = "(c|v|l|tot|total|stat|static|st)?";

// Capital letters in braces are words or letters, small ones words alone: `compressore` is not `compressor` and `e`.
#[rustfmt::skip]
const PLACES: &[Place] = &[
    Place { temperature: Some(Channel::T1), pressure: Some(Channel::P1), patterns: &[
        (6, "(^|_){q}_?0?1_?{K}(_|$)"), (6, "(^|_){q}_?{C}(_?{i}|_{I})(_|$)"), (6, "(^|_){B}_{D}{c}(_|$)"),
        (6, "(^|_){c}(_?{i}|_{I})(_|$)"), (3, "^(inlet|intake|ein|ansaug)"), (3, "(^|_){q}_?vv(_|$)"), (3, "ansaug|(^|_)(inlet|intake)(_|$)"),
        (6, "(^|_){i}_{D}{C}(_|$)"), (6, "(^|_){C}_{q}_{I}(_|$)"), (4, "(^|_)ci{s}(_|$)"), (3, "(^|_){q}_?[12]1(_|$)"),
        (6, "(^|_){c}_{b}(_|$)"), (6, "(^|_){q}_?c_?1(_|$)"), (3, "^{q}_{i}$"),
    ]},
    Place { temperature: Some(Channel::T2), pressure: Some(Channel::P2), patterns: &[
        (6, "(^|_){q}_?0?2_?{K}(_|$)"), (6, "(^|_){q}_?{C}(_?{o}|_{O})(_|$)"), (6, "(^|_){A}_{D}{c}(_|$)"),
        (6, "(^|_){c}(_?{o}|_{O})(_|$)"), (3, "(^|_){q}_?nv(_|$)"), (3, "boost|ladedruck|ladeluft"), (2, "(^|_)(outlet|discharge)(_|$)"),
        (6, "(^|_){o}_{D}{C}(_|$)"), (6, "(^|_){C}_{q}_{O}(_|$)"), (4, "(^|_)c[od]{s}(_|$)"), (3, "(^|_){q}_?2[12](_|$)"),
        (6, "(^|_){c}_{a}(_|$)"), (6, "(^|_){q}_?c_?2(_|$)"), (3, "^{q}_{o}$"),
    ]},
    Place { temperature: Some(Channel::T3), pressure: Some(Channel::P3), patterns: &[
        (6, "(^|_){q}_?0?3_?{K}(_|$)"), (6, "(^|_){q}_?1_?t(_|$)"), (6, "(^|_){q}_?{T}(_?{i}|_{I})(_|$)"), (6, "(^|_){B}_{D}{t}(_|$)"),
        (6, "(^|_){t}(_?{i}|_{I})(_|$)"), (3, "(^|_){q}_?vt(_|$)"),
        (6, "(^|_){i}_{D}{t}(_|$)"), (6, "(^|_){T}_{q}_{I}(_|$)"), (3, "(^|_)egt|abgas{q}|exhaust_gas_{q}|exhaust_{q}|exhaust_manifold"), (4, "(^|_)ti{s}(_|$)"), (3, "(^|_){q}_?31(_|$)"),
        (6, "(^|_){t}_{b}(_|$)"), (3, "(^|_){q}_t_?1(_|$)"),
    ]},
    Place { temperature: Some(Channel::T4), pressure: Some(Channel::P4), patterns: &[
        (6, "(^|_){q}_?0?4_?{K}(_|$)"), (6, "(^|_){q}_?2_?t(_|$)"), (6, "(^|_){q}_?{T}(_?{o}|_{O})(_|$)"), (6, "(^|_){A}_{D}{t}(_|$)"),
        (6, "(^|_){t}(_?{o}|_{O})(_|$)"), (3, "(^|_){q}_?nt(_|$)"),
        (6, "(^|_){o}_{D}{t}(_|$)"), (6, "(^|_){T}_{q}_{O}(_|$)"), (4, "(^|_)to{s}(_|$)"), (3, "(^|_){q}_?41(_|$)"),
        (6, "(^|_){t}_{a}(_|$)"), (3, "(^|_){q}_t_?2(_|$)"),
    ]},
    // `p_c` and `p_t` name no side: usually they are the compressor's outlet and the turbine's inlet pressure.
    Place { temperature: None, pressure: Some(Channel::P2), patterns: &[(2, "^{q}_?c$")]},
    Place { temperature: None, pressure: Some(Channel::P3), patterns: &[(2, "^{q}_?t$")]},
    Place { temperature: Some(Channel::Tc), pressure: None, patterns: &[
        (6, "^{q}_?c$"), (7, "{C}_?{H}"), (7, "{H}_?{C}(_|$)"), (3, "(^|_){H}"),
    ]},
    Place { temperature: Some(Channel::Tt), pressure: None, patterns: &[
        (6, "^{q}_?t$"), (8, "turb\\w*_?{H}"), (8, "(^|_){q}_t_?{H}"), (8, "{H}_?{T}(_|$)"),
    ]},
    Place { temperature: Some(Channel::TOil), pressure: None, patterns: &[
        (7, "(oil|oel).*(^|_)?{I}(_|$)"), (6, "(^|_)(oil|oel)"), (6, "(oil|oel)(_|$)"),
    ]},
    Place { temperature: Some(Channel::TOilOut), pressure: None, patterns: &[
        (8, "(oil|oel).*(^|_){O}(_|$)"),
    ]},
    Place { temperature: Some(Channel::TAmb), pressure: None, patterns: &[
        (6, "(^|_|{q})(amb|ambient|umg|umgebung|room|raum|cell|zelle|testbed|pruefstand)"),
    ]},
];

struct Row {
    channel: Channel,
    weight: Weight,
    pattern: Regex,
}

static ROWS: LazyLock<Vec<Row>> = LazyLock::new(rows);

fn rows() -> Vec<Row> {
    let mut rows = Vec::new();
    let mut add = |channel: Channel, weight: Weight, pattern: &str| {
        // A test compiles all patterns of this file.
        rows.extend(Regex::new(pattern).ok().map(|pattern| Row { channel, weight, pattern }));
    };
    for place in PLACES {
        for (weight, pattern) in place.patterns {
            let mut filled = pattern.replace("{D}", OF).replace("{K}", KIND).replace("{H}", HOUSING);
            for (letter, names) in
                [('C', COMPRESSOR), ('T', TURBINE), ('I', IN), ('O', OUT), ('B', BEFORE), ('A', AFTER)]
            {
                filled = filled
                    .replace(&format!("{{{letter}}}"), names)
                    .replace(&format!("{{{}}}", letter.to_ascii_lowercase()), &words(names));
            }
            if let Some(channel) = place.temperature {
                add(
                    channel,
                    *weight,
                    &filled
                        .replace("{q}", "(t|tt|temp|tmp|temperature|temperatur|temperatura|temperatuur)")
                        .replace("{s}", "t"),
                );
            }
            if let Some(channel) = place.pressure {
                add(
                    channel,
                    *weight,
                    &filled
                        .replace("{q}", "(p|pt|ps|press|prs|pressure|druck|pression|presion|pressione|pressao|druk|tryck)")
                        .replace("{s}", "p"),
                );
            }
        }
    }
    let flow = "(m|dm|mdot|m_dot|mp|mf|w|flow|massflow|mass_flow|mass_flow_rate|massenstrom|massenfluss|durchsatz|debit|caudal|portata|vazao|massastroom|floede)";
    for (channel, weight, pattern) in [
        (Channel::ShaftSpeed, 6, "(^|_)n_?(tc|atl|turbo|tl|lader|l|shaft)(_|$)".to_owned()),
        (
            Channel::ShaftSpeed,
            6,
            "(turbo|tc|atl|lader|shaft|rotor|welle|compressor|verdichter|compresseur|arbre|eje).*(speed|spd|drehzahl|rpm)".to_owned(),
        ),
        (
            Channel::ShaftSpeed,
            6,
            "(speed|drehzahl|rpm|vitesse|regime|velocidad|giri|rotacao|toerental|varvtal).*(turbo|tc|atl|lader|shaft|rotor|welle|verdichter|compressor|compresseur|compresor|arbre|eje)".to_owned(),
        ),
        (Channel::ShaftSpeed, 3, "(^|_)(turbo|tc|atl|lader)_(shaft|rotor|welle)(_|$)|^(nh|ng)$".to_owned()),
        (Channel::ShaftSpeed, 4, "^(n|n1|shaft_speed|rotational_speed|speed|drehzahl|speed_rpm|rpm|vitesse|regime|velocidad|giri|rotacao|toerental|varvtal)$".to_owned()),
        (
            Channel::CompressorFlow,
            6,
            format!("(^|_){flow}_?(c|comp|compressor|verd|verdichter|v|air|luft|l|compresseur|compresor|compressore|aire|aria|ar)(_|$)"),
        ),
        (Channel::CompressorFlow, 6, format!("(comp|compressor|verd|verdichter|luft|lucht|air)_?{flow}(_|$)")),
        (Channel::CompressorFlow, 6, "luftmasse|^maf|^caf(_|$)|airflow|air_flow".to_owned()),
        (Channel::CompressorFlow, 3, format!("^({flow}(_kg_s)?|air|luft|aria|aire)$")),
        (Channel::CompressorFlow, 3, format!("^{flow}_?1$")),
        (Channel::TurbineFlow, 3, format!("^{flow}_?3$")),
        (Channel::TurbineFlow, 7, format!("(^|_){flow}_?(t|turb|turbine|abgas|exh|exhaust|gas)(_|$)")),
        (Channel::TurbineFlow, 7, format!("(turb|turbine|abgas|exh|exhaust|hotgas|hot_gas)_?{flow}(_|$)")),
        (Channel::OilFlow, 7, format!("(^|_){flow}_?(oil|oel)(_|$)")),
        (Channel::OilFlow, 7, format!("(oil|oel)_?{flow}(_|$)")),
        (
            Channel::ValveCommand,
            6,
            "(valve|ventil|klappe|drossel|bpv|opening|backpressure|back_pressure)".to_owned(),
        ),
    ] {
        add(channel, weight, &pattern);
    }
    rows
}

static SET: LazyLock<Option<Regex>> = LazyLock::new(|| {
    Regex::new("(^|_)(soll\\w*|set|setpoint|sp|cmd|command|demand|dem|target|vorgabe|consigne|consigna|w)(_|$)|sollwert").ok()
});
static DERIVED: LazyLock<Option<Regex>> = LazyLock::new(|| {
    Regex::new(
        // A static temperature cannot be measured.
        "(^|_)(cor|corr|corrected|korr|korrigiert|red|reduced|reduziert|ideal|isentrop\\w*|calc|ber|berechnet|model|sim|est|std|stdev|sigma|dev|min|max|raw|roh)(_|$)|(^|_)t_?[0-9]?_?(stat|static)(_|$)",
    )
    .ok()
});
static OTHER: LazyLock<Option<Regex>> = LazyLock::new(|| {
    Regex::new("fuel|kraftstoff|egr|agr|cooler|kuehler|wasser|crankcase|burner|brenner|orifice|blende|venturi|bearing_(housing|temp)|bypass|leak|(intake|inlet)_manifold|saugrohr|(^|_)(engine|eng|motor|crank|erpm|torque|drehmoment|cool\\w*|kuehl\\w*|water|vgt|vtg|cac|llk|dpf|scr|doc)(_|$)|(^|_)p_?b").ok()
});

fn matches(pattern: &LazyLock<Option<Regex>>, text: &str) -> bool {
    pattern.as_ref().is_some_and(|pattern| pattern.is_match(text))
}

/// Whether a name is that of a setpoint.
pub(crate) fn is_set_value(name: &str) -> bool {
    matches(&SET, name)
}

/// Whether a name is that of a computed value.
pub(crate) fn is_derived(name: &str) -> bool {
    matches(&DERIVED, name)
}

/// Whether a name belongs to another part of an engine.
fn is_other(name: &str) -> bool {
    matches(&OTHER, name)
}

/// Whether a name speaks of an engine.
pub(crate) fn speaks_of_engine(name: &str) -> bool {
    name.split('_').any(|word| matches!(word, "engine" | "eng" | "motor" | "moteur" | "erpm"))
}

/// Whether a name is that of the ambient pressure.
pub(crate) fn is_ambient(name: &str) -> bool {
    ["amb", "baro", "umg", "atm", "luftdruck"].iter().any(|word| name.contains(word))
}

static OF_KIND: LazyLock<Vec<(Kind, Regex)>> = LazyLock::new(|| {
    let patterns = [
        // Not the compressor.
        (Kind::Pressure, "(^|[^m])press|druck|druk|tryck|presion|(^|_)p(_|[0-9])|baro"),
        (Kind::Temperature, "temp|(^|_)egt|(^|_)t(_|[0-9])"),
        (Kind::Speed, "speed|drehzahl|rpm|(^|_)n(_|[0-9])"),
    ];
    patterns.into_iter().filter_map(|(kind, pattern)| Some((kind, Regex::new(pattern).ok()?))).collect()
});

/// The one kind of quantity in a name, or at its start; `None` if there is none, or several.
fn kind_of_name(name: &str) -> Option<Kind> {
    let found = || OF_KIND.iter().filter_map(|(kind, pattern)| Some((*kind, pattern.find(name)?.start())));
    // The letter in front is the quantity: `T_L_n_Verd` is behind the compressor.
    let in_front = || found().filter(|(_, start)| *start == 0);
    let (mut kinds, mut first) = (found(), in_front());
    match (kinds.next(), kinds.next(), first.next(), first.next()) {
        (Some((kind, _)), None, ..) | (_, _, Some((kind, _)), None) => Some(kind),
        _ => None,
    }
}

/// Channels that a column may be, by its name, group and description, with their weights.
pub(crate) fn channels_of(
    name: &str,
    group: &str,
    about: &str,
    kind: Option<Kind>,
) -> Vec<(Channel, Weight)> {
    let (name, group) = (normalise(name), normalise(group));
    let about = normalise(&format!("{group} {about} {name}"));
    if is_other(&name) {
        return Vec::new();
    }
    let kind = kind.or_else(|| kind_of_name(&name));
    let set = is_set_value(&name) || is_set_value(&group);
    let mut found: Vec<(Channel, Weight)> = Vec::new();
    for row in ROWS.iter() {
        let fits_kind = kind.is_none_or(|kind| kind == kind_of(row.channel));
        let speaks = kind.is_some()
            || !matches!(kind_of(row.channel), Kind::Fraction)
            || row.channel == Channel::ValveCommand;
        let named = row.pattern.is_match(&name);
        let described = !about.is_empty() && row.pattern.is_match(&about);
        if !fits_kind || !speaks || !(named || described) {
            continue;
        }
        let channel = if set { commanded(row.channel) } else { Some(row.channel) };
        let Some(channel) = channel else { continue };
        let weight = 10 * row.weight * u32::from(named) + 9 * row.weight * u32::from(described && !named);
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
    fn every_pattern_compiles() {
        let places: usize = PLACES
            .iter()
            .map(|place| {
                place.patterns.len()
                    * (usize::from(place.temperature.is_some()) + usize::from(place.pressure.is_some()))
            })
            .sum();
        assert_eq!(ROWS.len(), places + 16);
        assert!(SET.is_some() && DERIVED.is_some() && OTHER.is_some() && OF_KIND.len() == 3);
    }

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
        ] {
            assert_eq!(channels_of(name, "", "", kind), [], "{name}");
        }
    }
}
