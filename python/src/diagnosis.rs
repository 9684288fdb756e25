//! Diagnosis of the gap between a recording and the nominal model.

use crate::attended::compute;
use crate::campaign::Campaign;
use crate::error::Fault;
use crate::identified::{Identified, named_method};
use crate::recording::{Recording, reader_warnings};
use crate::registry::registry;
use mapper_session::{Recorded, Session, SessionError};
use pyo3::prelude::*;
use std::path::PathBuf;

/// Diagnoses a recording, as `mapper gap diagnose` does; returns the JSON of that command. `effects`: suspected effects written in rhai.
#[pyfunction]
#[pyo3(signature = (recording, campaign, effects, baseline=None, on_event=None))]
pub fn diagnose(
    py: Python<'_>,
    recording: &Recording,
    campaign: &Campaign,
    effects: Vec<PathBuf>,
    baseline: Option<&Recording>,
    on_event: Option<Py<PyAny>>,
) -> PyResult<String> {
    let (source, campaign) = (recording.source.clone(), campaign.inner.clone());
    let baseline = baseline.map(|recording| recording.source.clone());
    compute(py, on_event.as_ref(), move |events| {
        let registry = registry();
        let effects = registry.effects_with(&effects)?;
        let given = Some(&campaign.campaign);
        let read = source.with(given)?;
        let recorded = single(&read)?;
        let baseline = baseline.map(|source| source.with(given)).transpose()?;
        let baseline = baseline.as_ref().and_then(|read| read.first());
        let on_event = |event: &_| events.show(event);
        let session = Session { on_event: &on_event, ..Session::new(&registry) };
        let gap = session.diagnose_gap(recorded, &campaign.campaign, &source.map, effects, baseline)?;
        Ok::<String, Fault>(gap.json().map_err(|error: SessionError| Fault::from(error))?.to_string())
    })
}

/// Diagnoses a recording and identifies it again without the causes found, as `mapper gap correct` does; returns the JSON of the correction
/// and the points.
#[pyfunction]
#[pyo3(signature = (recording, campaign, effects, method=None))]
pub fn correct(
    py: Python<'_>,
    recording: &Recording,
    campaign: &Campaign,
    effects: Vec<PathBuf>,
    method: Option<String>,
) -> PyResult<(String, Identified)> {
    let (source, campaign) = (recording.source.clone(), campaign.inner.clone());
    compute(py, None, move |_| {
        let registry = registry();
        let effects = registry.effects_with(&effects)?;
        let method = method.map(named_method).transpose()?;
        let read = source.with(Some(&campaign.campaign))?;
        let recorded = single(&read)?;
        let machine = campaign.campaign.machine.name.clone();
        let given = (&campaign.campaign, &source.map);
        let corrected = Session::new(&registry).correct_gap(recorded, given, effects, method, None)?;
        let map = serde_json::to_string(&corrected.map).map_err(SessionError::from)?;
        let (path, warnings) = (Some(&*recorded.path), reader_warnings(&read));
        Ok((map, Identified::of(corrected.identified, path, &warnings, machine)))
    })
}

fn single(read: &[Recorded]) -> Result<&Recorded, Fault> {
    let message = "a resumed run has several recordings; diagnose one of its files";
    let [recorded] = read else { return Err(Fault::Argument(message.to_owned())) };
    Ok(recorded)
}
