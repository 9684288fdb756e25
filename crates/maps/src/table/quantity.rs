//! Quantities of the columns of a map, and its reference state.

use mapper_core::{Channel, EfficiencyDefinition, ImportError, LineEnd, ReferenceState};
use mapper_table::{ColumnName, Measured, Place, Word, channel_at};
use mapper_yaml::units::{Kind, parse, parse_with};

/// Declares the quantities with their keys in a map description, their names in messages, and the kinds of their units.
macro_rules! quantities {
    ($($(#[doc = $doc:literal])* $quantity:ident $key:literal $name:literal $kind:ident,)*) => {
        /// Quantities of a table of points.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Quantity {
            $($(#[doc = $doc])* $quantity,)*
        }

        impl Quantity {
            /// Its key in a map description.
            pub fn key(self) -> &'static str {
                match self {
                    $(Quantity::$quantity => $key,)*
                }
            }

            pub(crate) fn of_key(key: &str) -> Option<Quantity> {
                match key {
                    $($key => Some(Quantity::$quantity),)*
                    _ => None,
                }
            }

            /// Its name in messages.
            pub fn name(self) -> &'static str {
                match self {
                    $(Quantity::$quantity => $name,)*
                }
            }

            /// Kind of its units.
            pub(crate) fn kind(self) -> Kind {
                match self {
                    $(Quantity::$quantity => Kind::$kind,)*
                }
            }
        }
    };
}

quantities! {
    /// Corrected speed; the measured speed in a table of measured points.
    Speed "speed" "speed" Speed,
    /// Speed over the root of T1.
    ReducedSpeed "reduced_speed" "speed over the root of temperature" Speed,
    /// Corrected flow; the measured flow in a table of measured points.
    Flow "flow" "mass flow" MassFlow,
    /// Volume flow at the inlet, at the reference state.
    VolumeFlow "volume_flow" "volume flow" MassFlow,
    /// Flow times the root of T1 over P1.
    ReducedFlow "reduced_flow" "flow times the root of temperature over pressure" MassFlow,
    /// Total pressure ratio.
    PressureRatio "pressure_ratio" "pressure ratio" Fraction,
    /// Isentropic efficiency.
    Efficiency "efficiency" "efficiency" Fraction,
    /// Position of a turbine's vanes.
    Vane "vane" "vane position" Fraction,
    /// Measured inlet pressure.
    P1 "p1" "P1" Pressure,
    /// Measured outlet pressure.
    P2 "p2" "P2" Pressure,
    /// Measured inlet temperature.
    T1 "t1" "T1" Temperature,
    /// Measured outlet temperature.
    T2 "t2" "T2" Temperature,
    /// Temperature of the compressor housing.
    Tc "tc" "housing temperature" Temperature,
    /// Humidity of the air: water per dry air, or relative.
    Humidity "humidity" "humidity" Fraction,
    /// Ambient pressure, the reference of gauge pressures.
    Ambient "ambient_pressure" "ambient pressure" Pressure,
    /// Measured turbine inlet pressure.
    P3 "p3" "P3" Pressure,
    /// Measured turbine outlet pressure.
    P4 "p4" "P4" Pressure,
    /// Measured turbine inlet temperature.
    T3 "t3" "T3" Temperature,
    /// Measured turbine outlet temperature.
    T4 "t4" "T4" Temperature,
    /// Measured flow of the turbine, in a table that has the compressor's as well.
    TurbineFlow "turbine_flow" "turbine flow" MassFlow,
    /// Temperature of the oil that enters the bearing housing.
    Oil "oil_temperature" "oil temperature" Temperature,
}

impl Quantity {
    /// The quantity that a channel of a stand measures, if tables of points have it.
    fn of_channel(channel: Channel) -> Option<Quantity> {
        let all = [
            (Channel::P1, Quantity::P1),
            (Channel::P2, Quantity::P2),
            (Channel::P3, Quantity::P3),
            (Channel::P4, Quantity::P4),
            (Channel::T1, Quantity::T1),
            (Channel::T2, Quantity::T2),
            (Channel::T3, Quantity::T3),
            (Channel::T4, Quantity::T4),
            (Channel::Tc, Quantity::Tc),
            (Channel::TOil, Quantity::Oil),
        ];
        all.into_iter().find(|(known, _)| *known == channel).map(|(_, quantity)| quantity)
    }

    /// Whether a point may be without it.
    pub(crate) fn is_optional(self) -> bool {
        use Quantity::{Ambient, Humidity, Oil, P3, P4, T3, T4, Tc, TurbineFlow};
        matches!(self, Tc | Humidity | Ambient | P3 | P4 | T3 | T4 | TurbineFlow | Oil)
    }

    /// Whether both are forms of one physical quantity.
    pub(crate) fn is_same_quantity(self, other: Quantity) -> bool {
        let form = |quantity| match quantity {
            Quantity::ReducedSpeed => Quantity::Speed,
            Quantity::VolumeFlow | Quantity::ReducedFlow => Quantity::Flow,
            quantity => quantity,
        };
        form(self) == form(other)
    }

    /// Its units in messages.
    pub(crate) fn unit_list(self) -> String {
        match self {
            Quantity::VolumeFlow => "m3/s, m3/min, m3/h, l/s, CFM".to_owned(),
            Quantity::ReducedFlow => "kg/s*K^0.5/kPa, kg/s*K^0.5/MPa, kg/s*K^0.5/bar".to_owned(),
            Quantity::Humidity => "%, g/kg, kg/kg".to_owned(),
            _ => self.kind().unit_list(),
        }
    }
}

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
        // A set or computed state was not measured.
        _ if read.is_command() || read.has(Word::Computed) => None,
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

/// Whether a title is that of a line at a distance from an end.
pub(crate) fn names_margin(text: &str) -> bool {
    let lower = text.to_lowercase();
    let words = ["margin", "reserve", "abstand", "marge", "margen", "запас", "裕度", "余量", "control"];
    lower.contains('%') || words.iter().any(|word| lower.contains(word))
}

/// Maximum number of words of the title of a block above the table. Bound: `Surge line:`; the title of a map has more.
const MAX_WORDS_ABOVE: usize = 3;

/// Whether a title is that of an end alone, and not of a map.
pub(crate) fn is_end_title(text: &str) -> bool {
    let is_short = text.split_whitespace().count() <= MAX_WORDS_ABOVE;
    is_short && !text.contains(char::is_numeric) && end_of_title(text).is_some()
}

/// A reference state from a name (`SAE`, `Garrett`, `BorgWarner`) or `"T, P"` with units, as in `298 K, 100 kPa`.
pub fn parse_reference(text: &str) -> Result<ReferenceState, ImportError> {
    let wrong = || ImportError::Reference { text: text.chars().take(60).collect() };
    if let Some(state) = ReferenceState::named(text) {
        return Ok(state);
    }
    let (temperature, pressure) = text.split_once(',').ok_or_else(wrong)?;
    // In a reference state `psi` can only be absolute.
    let pressure_unit = |unit: &str| Kind::Pressure.unit(if unit == "psi" { "psia" } else { unit });
    let state = ReferenceState {
        t_ref_k: parse(Kind::Temperature, temperature).map_err(|_| wrong())?,
        p_ref_pa: parse_with(Kind::Pressure, pressure, pressure_unit).map_err(|_| wrong())?,
    };
    if state.is_plausible() { Ok(state) } else { Err(wrong()) }
}

/// The reference state in a comment after the word "reference" and a colon.
pub fn reference_in_comment(comment: &str) -> Option<ReferenceState> {
    let lower = comment.to_ascii_lowercase();
    let at = lower.find("reference")?;
    let (_, behind) = comment.get(at..)?.split_once(':')?;
    parse_reference(behind.trim().trim_end_matches('.')).ok()
}

/// The reference state of the corrected quantities, from the file and the user.
pub fn resolve_reference(
    found: Option<ReferenceState>,
    given: Option<ReferenceState>,
) -> Result<ReferenceState, ImportError> {
    match (found, given) {
        (Some(found), Some(given)) if !equal_as_printed(found, given) => {
            Err(ImportError::ReferenceConflict { found, given })
        }
        (Some(found), _) => Ok(found),
        (None, Some(given)) => Ok(given),
        (None, None) => Err(ImportError::NoReference),
    }
}

/// Difference of two temperatures that are equal as printed, K. Bound: half of the last digit of `298.2`.
const SAME_K: f64 = 0.05;
/// Difference of two pressures that are equal as printed, Pa. Bound: some digits of `101.3 kPa`, which is 101.325.
const SAME_PA: f64 = 20.0;

/// Equal within the rounding of printed digits.
fn equal_as_printed(a: ReferenceState, b: ReferenceState) -> bool {
    (a.t_ref_k - b.t_ref_k).abs() < SAME_K && (a.p_ref_pa - b.p_ref_pa).abs() < SAME_PA
}

/// Start of the comment that names the definition of the efficiency.
pub const DEFINITION_PREFIX: &str = "definition of efficiency: ";

/// The definition of the efficiency that a comment names.
pub fn efficiency_in_comment(comment: &str) -> Option<EfficiencyDefinition> {
    let (_, definition) = comment.split_once(DEFINITION_PREFIX)?;
    definition.split('(').next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_numbers_are_read_and_nonsense_is_refused() {
        assert_eq!(parse_reference("sae").unwrap(), ReferenceState::SAE);
        assert_eq!(parse_reference("298 K, 100 kPa").unwrap(), ReferenceState::SAE);
        assert_eq!(parse_reference("298K,1 bar").unwrap(), ReferenceState::SAE);
        let garrett = parse_reference("545 degR, 13.95 psia").unwrap();
        assert!(equal_as_printed(garrett, ReferenceState::GARRETT));
        assert!((parse_reference("25 degC, 100 kPa").unwrap().t_ref_k - 298.15).abs() < 1e-12);
        for wrong in [
            "",
            "298",
            "298 K",
            "298, 100",
            "25 K, 100 kPa",
            "298 K, 100 Pa",
            "NaN K, 100 kPa",
            "ISO",
            "298 K, inf Pa",
        ] {
            let error = parse_reference(wrong).unwrap_err().to_string();
            assert!(error.contains("Garrett"), "{error}");
        }
        assert_eq!(
            reference_in_comment("# reference state of corrected flow and speed: 298 K, 100000 Pa"),
            Some(ReferenceState::SAE)
        );
        assert_eq!(reference_in_comment("# no state here"), None);
    }
}
