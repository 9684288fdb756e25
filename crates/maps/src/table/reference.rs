//! Parses reference states, and resolves those of the file and of the user.

use mapper_core::{ImportError, ReferenceState};

/// A reference state from a name (`SAE`, `Garrett`, `BorgWarner`) or `"T, P"` with units: K, degC, degR, degF; Pa, kPa,
/// hPa, bar, psi.
///
/// # Errors
/// [`ImportError::Reference`].
pub fn parse_reference(text: &str) -> Result<ReferenceState, ImportError> {
    let wrong = || ImportError::Reference { text: text.chars().take(60).collect() };
    if let Some(state) = ReferenceState::named(text) {
        return Ok(state);
    }
    let (temperature, pressure) = text.split_once(',').ok_or_else(wrong)?;
    let t_ref_k = quantity(temperature, TEMPERATURES).ok_or_else(wrong)?;
    let p_ref_pa = quantity(pressure, PRESSURES).ok_or_else(wrong)?;
    let state = ReferenceState { t_ref_k, p_ref_pa };
    if state.is_plausible() { Ok(state) } else { Err(wrong()) }
}

/// Unit, factor, offset before the factor.
type Units = &'static [(&'static str, f64, f64)];
const TEMPERATURES: Units =
    &[("K", 1.0, 0.0), ("degC", 1.0, 273.15), ("degR", 5.0 / 9.0, 0.0), ("degF", 5.0 / 9.0, 459.67)];
const PRESSURES: Units = &[
    ("Pa", 1.0, 0.0),
    ("kPa", 1e3, 0.0),
    ("hPa", 1e2, 0.0),
    ("mbar", 1e2, 0.0),
    ("bar", 1e5, 0.0),
    ("psia", PSI_PA, 0.0),
    ("psi", PSI_PA, 0.0),
];
/// Pound-force per square inch, exactly as in [`ReferenceState::GARRETT`].
const PSI_PA: f64 = 4.448_221_615_260_5 / 0.000_645_16;

fn quantity(text: &str, units: Units) -> Option<f64> {
    let text = text.trim();
    let digits =
        text.find(|c: char| !(c.is_ascii_digit() || matches!(c, '.' | '-' | '+'))).unwrap_or(text.len());
    let unit = text[digits..].trim();
    let (_, factor, offset) = units.iter().find(|(name, ..)| *name == unit)?;
    let value: f64 = text[..digits].trim().parse().ok()?;
    // No conversion if the factor is 1, so that written values are read back to the bit.
    Some(if *factor == 1.0 && *offset == 0.0 { value } else { (value + offset) * factor })
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

/// Equal within the rounding of printed digits.
fn equal_as_printed(a: ReferenceState, b: ReferenceState) -> bool {
    (a.t_ref_k - b.t_ref_k).abs() < 0.05 && (a.p_ref_pa - b.p_ref_pa).abs() < 20.0
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
