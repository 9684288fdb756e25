//! Compressor maps.

use crate::attended::compute;
use crate::error::Fault;
use crate::plugins::plugins;
use mapper_core::CompressorMap;
use mapper_maps::table::parse_reference;
use mapper_maps::{MapFitOptions, fit_map};
use mapper_session::{Existing, SessionError, write_map_fitted_if_needed};
use pyo3::prelude::*;
use std::path::PathBuf;

/// A compressor map.
#[pyclass(frozen, module = "mapper._mapper")]
#[derive(Clone)]
pub struct Map {
    pub(crate) map: CompressorMap,
}

#[pymethods]
impl Map {
    /// Reads a map file and what the reader assumed, as `mapper map inspect` does.
    #[staticmethod]
    #[pyo3(signature = (path, reference=None))]
    fn read(py: Python<'_>, path: PathBuf, reference: Option<String>) -> PyResult<(Map, String)> {
        compute(py, None, move |_| {
            let reference = reference.map(|text| parse_reference(&text)).transpose();
            let reference = reference.map_err(|error| Fault::Argument(error.to_string()))?;
            let found = plugins().inspect_map(&path, reference)?;
            let remarks = serde_json::to_string(&found.remarks).map_err(SessionError::from)?;
            Ok((Map { map: found.map }, remarks))
        })
    }

    /// Name of the machine.
    #[getter]
    fn machine(&self) -> &str {
        &self.map.machine
    }

    /// The map as JSON, its fitted surface included.
    fn json(&self) -> PyResult<String> {
        let json = mapper::with_messages(|| serde_json::to_value(&self.map));
        let json = json.map_err(|error| Fault::from(SessionError::from(error)))?;
        Ok(json.to_string())
    }

    /// Writes the map to a file in a format. A format that tabulates the whole map gets a fitted one.
    fn write(&self, py: Python<'_>, path: PathBuf, format: &str, replace: bool) -> PyResult<()> {
        let format = plugins().written_format(format).map_err(Fault::from)?;
        let map = self.map.clone();
        let existing = if replace { Existing::Replaced } else { Existing::Kept };
        compute(py, None, move |_| Ok(write_map_fitted_if_needed(&path, format, map, existing).map(drop)?))
    }

    /// The same map with a fitted surface, as `mapper map fit` makes it.
    fn fit(&self, py: Python<'_>) -> PyResult<Map> {
        let map = self.map.clone();
        compute(py, None, move |_| {
            let map = fit_map(map, &MapFitOptions::default());
            Ok(Map { map: map.map_err(|error| Fault::Argument(error.to_string()))? })
        })
    }

    /// The same map at another reference state: SAE, Garrett, BorgWarner or "T, P".
    fn at_reference(&self, reference: &str) -> PyResult<Map> {
        let reference = parse_reference(reference).map_err(|error| Fault::Argument(error.to_string()))?;
        Ok(Map { map: self.map.clone().at_reference(reference) })
    }
}

/// Name, extension and description of each format that maps are written in.
#[pyfunction]
pub fn map_formats() -> Vec<(&'static str, &'static str, &'static str)> {
    plugins().formats.written().map(|format| (format.name, format.extension, format.description)).collect()
}
