//! The kind that a study names.

use crate::{FleetError, Kind, StudyFile};

/// The kind of this name; if it is unknown, a mistake at its place in the file.
///
/// # Errors
/// [`FleetError::StudyFile`].
pub fn kind_of<'a>(study: &StudyFile, kinds: &[&'a dyn Kind]) -> Result<&'a dyn Kind, FleetError> {
    if let Some(kind) = kinds.iter().find(|kind| kind.name() == study.kind) {
        return Ok(*kind);
    }
    let known = kinds.iter().map(|kind| format!("{} ({})", kind.name(), kind.summary()));
    let remedy = format!("write `study: KIND`; the kinds are {}", known.collect::<Vec<_>>().join(", "));
    let message = match study.kind.as_str() {
        "" => "it does not say what kind of study it is".to_owned(),
        other => format!("`{other}` is not a kind of study"),
    };
    Err(study.mistake("study", message, &remedy).into())
}
