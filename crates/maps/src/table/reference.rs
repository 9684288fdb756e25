//! Reference states and definitions of the efficiency from the file, its comments, and the user.

use mapper_core::{EfficiencyDefinition, ImportError, ReferenceState};
use mapper_yaml::units::{Kind, parse, parse_with};

/// A reference state from a name (`SAE`, `Garrett`, `BorgWarner`) or `"T, P"` with units, as in `298 K, 100 kPa`.
///
/// # Errors
/// [`ImportError::Reference`].
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
///
/// # Errors
/// [`ImportError::NoReference`] and [`ImportError::ReferenceConflict`].
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
