//! The quantity of a heading, from its name and unit.

use crate::table::columns::quantity::Quantity;
use mapper_core::LineEnd;
use mapper_table::{ColumnName, Measured, Place, Word, channel_at};

/// Whether a name belongs to a turbine.
pub(crate) fn is_turbine(plain: &str) -> bool {
    ColumnName::read(plain).has(Word::Expansion)
        || matches!(plain, "mfp" | "prt" | "pit" | "etat")
        || has_root(plain) && ["t3", "t4", "p3", "tt3", "t03"].iter().any(|inlet| plain.contains(inlet))
}

fn has_root(plain: &str) -> bool {
    ["sqrt", "√", "^0.5"].iter().any(|root| plain.contains(root))
}

/// The quantity of a parameter that only turbine maps use.
fn parameter_of_turbine(plain: &str, by_unit: Option<Quantity>) -> Option<Quantity> {
    match plain {
        "sp" | "nred" | "reducedspeed" => {
            let is_corrected = by_unit == Some(Quantity::Speed);
            Some(if is_corrected { Quantity::Speed } else { Quantity::ReducedSpeed })
        }
        "mfp" | "massparameter" | "phi" => Some(Quantity::ReducedFlow),
        "nt" => Some(by_unit.unwrap_or(Quantity::Speed)),
        _ => None,
    }
}

/// The quantity of a name, and of the same in lower case with only letters, digits, `/`, `√` and `η`. The unit decides between volume
/// and mass flow.
pub(crate) fn quantity_of_name(
    name: &str,
    plain: &str,
    by_unit: Option<Quantity>,
    is_turbine_map: bool,
) -> Option<Quantity> {
    if plain.is_empty() {
        return by_unit;
    }
    // `N/√θ` and `W√θ/δ` are corrected.
    if has_root(plain) && (plain.contains('θ') || plain.contains("theta")) {
        let is_flow = plain.contains('δ') || plain.contains("delta");
        return Some(if is_flow { Quantity::Flow } else { Quantity::Speed });
    }
    // `P1t` is a total pressure; in logs it is the turbine's.
    let is_total = plain.len() <= 4 && plain.starts_with(['p', 't']) && plain.ends_with('t');
    let short = plain.trim_end_matches('t');
    let read = ColumnName::read(if is_total && short.ends_with(|c: char| c.is_ascii_digit()) {
        short
    } else {
        name
    });
    if read.is_other() {
        return None;
    }
    // `speedpar.`, `Mass Flow Parameter`: reduced quantities, unless their unit is one of corrected ones.
    let parameter = plain.trim_end_matches('.');
    if ["par", "param", "parameter"].iter().any(|end| parameter.ends_with(end)) {
        match (read.measured(), by_unit) {
            (Some(Measured::Speed), None) => return Some(Quantity::ReducedSpeed),
            (Some(Measured::Flow), None) => return Some(Quantity::ReducedFlow),
            _ => {}
        }
    }
    if is_turbine_map {
        if read.has(Word::Is(Measured::Vane)) {
            return Some(Quantity::Vane);
        }
        if let Some(parameter) = parameter_of_turbine(plain, by_unit) {
            return Some(parameter);
        }
    }
    if has_root(plain) && plain.starts_with('n') || by_unit == Some(Quantity::ReducedSpeed) {
        return Some(Quantity::ReducedSpeed);
    }
    if has_root(plain) && plain.contains("/p") || by_unit == Some(Quantity::ReducedFlow) {
        return Some(Quantity::ReducedFlow);
    }
    let is_of_other_machine = !is_turbine_map && read.is_of_turbine();
    if ["eta", "η", "eff"].iter().any(|start| plain.starts_with(start)) {
        return (!is_of_other_machine).then_some(Quantity::Efficiency);
    }
    if read.has(Word::Expansion) || plain.starts_with('π') || read.has(Word::Ratio) && read.part_count() == 1
    {
        return Some(Quantity::PressureRatio);
    }
    let measured = read.measured();
    let place = read.place(measured.unwrap_or(Measured::Temperature));
    let place = place.map_or(Place::Unnamed, |(place, _)| place);
    match (measured?, place) {
        (Measured::PressureRatio, _) if !is_of_other_machine => Some(Quantity::PressureRatio),
        (Measured::Efficiency, _) if !is_of_other_machine => Some(Quantity::Efficiency),
        (Measured::Humidity, _) => Some(Quantity::Humidity),
        (Measured::Speed, _) => Some(Quantity::Speed),
        (Measured::Flow | Measured::VolumeFlow, Place::Oil) => None,
        (Measured::Flow, _) if by_unit == Some(Quantity::VolumeFlow) => Some(Quantity::VolumeFlow),
        (Measured::VolumeFlow, _) if by_unit != Some(Quantity::Flow) => Some(Quantity::VolumeFlow),
        (Measured::Flow, Place::Turbine) => Some(Quantity::TurbineFlow),
        (Measured::Flow | Measured::VolumeFlow, _) => Some(Quantity::Flow),
        (Measured::Pressure, Place::Ambient) => Some(Quantity::Ambient),
        (measured, place) => channel_at(measured, place).and_then(Quantity::of_channel),
    }
}

/// The end of speed lines that a text names, in several languages.
pub(crate) fn end_in(text: &str) -> Option<LineEnd> {
    let lower = text.to_lowercase();
    let has = |words: &[&str]| words.iter().any(|word| lower.contains(word));
    if has(&["surge", "pump", "pompage", "bombeo", "pompaggio", "помпаж", "喘振", "サージ"]) {
        return Some(LineEnd::Surge);
    }
    has(&["choke", "stopf", "schluck", "blocage", "gavage", "bloqueo"]).then_some(LineEnd::Choke)
}

/// Maximum number of words of the title of such a block. Bound: `Surge line of the compressor map`; a sentence has more.
const MAX_TITLE_WORDS: usize = 6;

/// The end that a title names; one that names both is about the order of points.
pub(crate) fn end_of_title(text: &str) -> Option<LineEnd> {
    let mut ends = text.split(|c: char| !c.is_alphanumeric()).filter_map(end_in);
    let end = ends.next()?;
    let is_title = text.split_whitespace().count() <= MAX_TITLE_WORDS && ends.all(|other| other == end);
    is_title.then_some(end)
}

/// Maximum number of words of the title of a block above the table. Bound: `Surge line:`; the title of a map has more.
const MAX_WORDS_ABOVE: usize = 3;

/// Whether a title is that of an end alone, and not of a map.
pub(crate) fn is_end_title(text: &str) -> bool {
    let is_short = text.split_whitespace().count() <= MAX_WORDS_ABOVE;
    is_short && !text.contains(char::is_numeric) && end_of_title(text).is_some()
}
