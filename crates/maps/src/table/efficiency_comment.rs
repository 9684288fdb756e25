//! The definition of the efficiency in a comment of a map file.

use mapper_core::EfficiencyDefinition;

/// Start of the comment that names the definition of the efficiency.
pub const DEFINITION_PREFIX: &str = "definition of efficiency: ";

/// The definition of the efficiency that a comment names.
pub fn efficiency_in_comment(comment: &str) -> Option<EfficiencyDefinition> {
    let (_, definition) = comment.split_once(DEFINITION_PREFIX)?;
    definition.split('(').next()?.parse().ok()
}
