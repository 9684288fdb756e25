//! Suggestions for mistyped words.

/// The candidate closest to a mistyped word, with at most a third of its letters wrong; case is ignored.
pub fn closest<'a>(word: &str, candidates: &[&'a str]) -> Option<&'a str> {
    // A very long word is not a typing error, and the cost of the distance grows with its square.
    if word.len() > 64 {
        return None;
    }
    let lower = word.to_lowercase().replace('-', "_");
    candidates
        .iter()
        .map(|candidate| (strsim::osa_distance(&lower, &candidate.to_lowercase()), *candidate))
        .filter(|(distance, candidate)| {
            let length = candidate.chars().count().max(lower.chars().count());
            // A word with no correct letter is a different word.
            *distance <= length.div_ceil(3) && *distance < length
        })
        .min()
        .map(|(_, candidate)| candidate)
}

/// `did you mean ...? `, or nothing.
pub(crate) fn guess(word: &str, candidates: &[&str]) -> String {
    closest(word, candidates).map(|guess| format!("did you mean `{guess}`? ")).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_is_recognised_and_another_word_is_not() {
        let keys = ["inlet_pressure", "T_oil", "N"];
        for (word, meant) in [
            ("inlet_presure", Some("inlet_pressure")),
            ("Inlet-Pressure", Some("inlet_pressure")),
            ("t_oil", Some("T_oil")),
            ("speed", None),
            ("", None),
        ] {
            assert_eq!(closest(word, &keys), meant, "{word}");
        }
    }
}
