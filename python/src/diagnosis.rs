//! Diagnosis of the gap between a recording and the nominal model.

use crate::attended::compute;
use crate::campaign::Campaign;
use crate::error::Fault;
use crate::recording::Recording;
use crate::registry::registry;
use mapper_session::{Session, SessionError};
use pyo3::prelude::*;
use std::path::PathBuf;

/// Diagnoses a recording, as `mapper gap diagnose` does; returns the JSON of that command. `effects`: suspected effects written in rhai.
#[pyfunction]
#[pyo3(signature = (recording, campaign, effects, healthy=None, on_event=None))]
pub fn diagnose(
    py: Python<'_>,
    recording: &Recording,
    campaign: &Campaign,
    effects: Vec<PathBuf>,
    healthy: Option<&Recording>,
    on_event: Option<Py<PyAny>>,
) -> PyResult<String> {
    let (source, campaign) = (recording.source.clone(), campaign.inner.clone());
    let healthy = healthy.map(|recording| recording.source.clone());
    compute(py, on_event.as_ref(), move |events| {
        let registry = registry();
        let effects = registry.effects_with(&effects)?;
        let given = Some(&campaign.campaign);
        let read = source.with(given)?;
        let [recorded] = read.as_slice() else {
            let message = "a resumed run has several recordings; diagnose one of its files";
            return Err(Fault::Argument(message.to_owned()));
        };
        let healthy = healthy.map(|source| source.with(given)).transpose()?;
        let healthy = healthy.as_ref().and_then(|read| read.first());
        let on_event = |event: &_| events.show(event);
        let session = Session { on_event: &on_event, ..Session::new(&registry) };
        let gap = session.diagnose_gap(recorded, &campaign.campaign, &source.map, effects, healthy)?;
        Ok::<String, Fault>(gap.json().map_err(|error: SessionError| Fault::from(error))?.to_string())
    })
}
