//! Words that several messages share.

/// Quotes a name so that a shell reads it as one word.
pub(crate) fn word(name: &str) -> String {
    let plain = !name.is_empty() && name.chars().all(|c| c.is_alphanumeric() || "-_./:@".contains(c));
    if plain { name.to_owned() } else { format!("'{}'", name.replace('\'', r"'\''")) }
}

/// The rigs that an operator has to acknowledge.
pub(crate) fn in_doubt_text(rigs: &[String]) -> String {
    if rigs.is_empty() { "no rig is in doubt".to_owned() } else { format!("in doubt: {}", rigs.join(", ")) }
}
