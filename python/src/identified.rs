//! Identification of recordings.

use crate::attended::compute;
use crate::campaign::Campaign;
use crate::error::{Fault, IdentificationError};
use crate::map::Map;
use crate::recording::{Recording, reader_warnings};
use crate::registry::registry;
use mapper_core::Method;
use mapper_session::{
    Identified as Found, Recorded, Session, SessionError, compressor_map, result_remark_text,
};
use pyo3::prelude::*;
use serde_json::Value;
use std::path::Path;
use std::sync::Arc;

/// Points of one recording or of several.
#[pyclass(frozen, module = "mapper._mapper")]
pub struct Identified {
    found: Arc<Found>,
    machine: String,
    json: Value,
}

impl Identified {
    /// Points of recordings of a machine, the first with this path.
    pub fn of(found: Found, path: Option<&Path>, warnings: &[String], machine: String) -> Identified {
        let json = found.json(path, warnings);
        Identified { found: Arc::new(found), machine, json }
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

    /// The map of the points, with a fitted surface if there are enough of them.
    fn map(&self, py: Python<'_>) -> PyResult<Map> {
        let (found, machine) = (self.found.clone(), self.machine.clone());
        let (map, remarks) = compute(py, None, move |_| {
            let mut remarks = Vec::new();
            Ok((compressor_map(&machine, &found, &mut remarks), remarks))
        })?;
        map.map(|map| Map { map }).ok_or_else(|| {
            IdentificationError::new_err(
                remarks.iter().map(result_remark_text).collect::<Vec<_>>().join("; "),
            )
        })
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
    let sources: Vec<_> = recordings.iter().map(|recording| recording.source.clone()).collect();
    let campaign = campaign.map(|campaign| campaign.inner.clone());
    drop(recordings);
    compute(py, None, move |_| {
        let given = campaign.as_ref().map(|inner| &inner.campaign);
        let map = &sources.first().ok_or(SessionError::NoRecording)?.map;
        if sources.iter().any(|source| source.map != *map) {
            let message = "recordings that are identified together need the same channel map";
            return Err(Fault::Argument(message.to_owned()));
        }
        let method = method.map(named_method).transpose()?;
        let runs = sources.iter().map(|source| source.with(given)).collect::<Result<Vec<_>, _>>()?;
        let recorded: Vec<Recorded> = runs.into_iter().flatten().collect();
        let path = recorded.first().map(|first| first.path.clone());
        let warnings = reader_warnings(&recorded);
        let machine = machine_of(&recorded);
        let registry = registry();
        let found = Session::new(&registry).identify(recorded, map, method)?;
        found.has_points(&warnings)?;
        Ok(Identified::of(found, path.as_deref(), &warnings, machine))
    })
}

/// Name of the machine: the campaign's, or the file's.
fn machine_of(recorded: &[Recorded]) -> String {
    let Some(first) = recorded.first() else { return String::new() };
    let named = || first.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    first.campaign.as_ref().map_or_else(named, |campaign| campaign.machine.name.clone())
}

pub fn named_method(name: String) -> Result<Method, SessionError> {
    serde_json::from_value(Value::from(name.clone())).map_err(|source| SessionError::Method(name, source))
}
