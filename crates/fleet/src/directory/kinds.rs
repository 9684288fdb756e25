//! Lookup of the kind of a study.

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
        "" => "the kind of study is missing".to_owned(),
        other => format!("`{other}` is not a kind of study"),
    };
    Err(study.mistake("study", message, &remedy).into())
}
