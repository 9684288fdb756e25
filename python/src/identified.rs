//! Identification and diagnosis of recordings.

use crate::attended::compute;
use crate::campaign::Campaign;
use crate::error::Fault;
use crate::map::Map;
use crate::recording::Recording;
use mapper::{DiagnosisOptions, Identification, Method};
use mapper_session::SessionError;
use pyo3::prelude::*;
use serde_json::Value;
use std::path::PathBuf;
use std::sync::Arc;

/// Points of one recording or of several.
#[pyclass(frozen, module = "mapper._mapper")]
pub struct Identified {
    found: Arc<Identification>,
    json: Value,
}

impl From<Identification> for Identified {
    fn from(found: Identification) -> Self {
        let json = found.json();
        Identified { found: Arc::new(found), json }
    }
}

#[pymethods]
impl Identified {
    /// What `mapper identify --json` prints.
    #[getter]
    fn json(&self) -> String {
        self.json.to_string()
    }

    /// Its points only.
    #[getter]
    fn points(&self) -> String {
        self.json["points"].to_string()
    }

    /// The turbine at the points.
    #[getter]
    fn turbine_points(&self) -> String {
        self.json["turbine"].to_string()
    }

    /// The nodes of the fitted map of the turbine, as JSON; `null` without one.
    #[getter]
    fn turbine_map(&self) -> PyResult<String> {
        let map = self.found.turbine_map();
        let lines = map.and_then(|map| map.fitted).map(|fitted| fitted.lines);
        Ok(serde_json::to_string(&lines).map_err(|error| Fault::from(SessionError::from(error)))?)
    }

    /// The map of the points, with a fitted surface if there are enough of them.
    fn map(&self, py: Python<'_>) -> PyResult<Map> {
        let found = self.found.clone();
        compute(py, None, move |_| Ok(Map { map: found.map()? }))
    }
}

/// Identifies all steps of recordings of one machine together, as `mapper identify` does.
#[pyfunction]
#[pyo3(signature = (recordings, campaign=None, method=None))]
pub fn identify(
    py: Python<'_>,
    recordings: Vec<PyRef<'_, Recording>>,
    campaign: Option<&Campaign>,
    method: Option<String>,
) -> PyResult<Identified> {
    let sources: Vec<_> = recordings.iter().map(|recording| recording.inner.clone()).collect();
    let campaign = campaign.map(|campaign| campaign.inner.clone());
    drop(recordings);
    compute(py, None, move |_| {
        let method = method.map(named_method).transpose()?;
        Ok(mapper::identify(&sources, campaign.as_ref(), method)?.into())
    })
}

fn named_method(name: String) -> Result<Method, SessionError> {
    serde_json::from_value(Value::from(name.clone())).map_err(|source| SessionError::Method(name, source))
}

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
    let (recording, campaign) = (recording.inner.clone(), campaign.inner.clone());
    let baseline = baseline.map(|recording| recording.inner.clone());
    compute(py, on_event.as_ref(), move |events| {
        let options =
            DiagnosisOptions { effects, baseline, observer: Some(events.observer()), ..Default::default() };
        Ok(recording.diagnose_with(&campaign, &options)?.json()?.to_string())
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
    let (recording, campaign) = (recording.inner.clone(), campaign.inner.clone());
    compute(py, None, move |_| {
        let method = method.map(named_method).transpose()?;
        let options = DiagnosisOptions { effects, method, ..Default::default() };
        let corrected = recording.correct(&campaign, &options)?;
        let map = serde_json::to_string(&corrected.map).map_err(SessionError::from)?;
        Ok::<_, Fault>((map, corrected.identification.into()))
    })
}
