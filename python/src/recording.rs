//! Recordings and how they are read.

use crate::attended::compute;
use crate::campaign::Campaign;
use crate::error::Fault;
use crate::plugins::plugins;
use mapper::ChannelMap;
use mapper_core::{Channel, Series};
use mapper_session::{SessionError, channel_map};
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::PyBytes;
use serde_json::json;
use std::path::PathBuf;

/// A run directory, an MCAP file or a log of another program, with its channel map.
#[pyclass(frozen, module = "mapper._mapper")]
pub struct Recording {
    pub(crate) inner: mapper::Recording,
    summary: String,
}

impl Recording {
    /// With the steps, events and so on of all its parts.
    fn of(inner: mapper::Recording) -> Result<Recording, Fault> {
        let first = inner.parts().first().ok_or(SessionError::NoRecording)?;
        let summary = json!({
            "path": first.path,
            "start_time_ns": first.read.start_time_ns,
            "metadata": first.read.metadata,
            "warnings": inner.warnings(),
            "steps": inner.steps().collect::<Vec<_>>(),
            "events": inner.events().collect::<Vec<_>>(),
        });
        Ok(Recording { summary: summary.to_string(), inner })
    }

    /// The samples of the first part.
    fn series(&self) -> impl Iterator<Item = (&Channel, &Series)> {
        self.inner.parts().iter().take(1).flat_map(|first| &first.read.recording.series)
    }
}

#[pymethods]
impl Recording {
    /// Reads a recording.
    #[staticmethod]
    #[pyo3(signature = (path, channels=None, campaign=None))]
    fn read(
        py: Python<'_>,
        path: PathBuf,
        channels: Option<PathBuf>,
        campaign: Option<&Campaign>,
    ) -> PyResult<Recording> {
        let campaign = campaign.map(|campaign| campaign.inner.clone());
        compute(py, None, move |_| {
            let map = channels.map_or_else(|| Ok(ChannelMap::native()), |file| channel_map(&file))?;
            Recording::of(mapper::Recording::read(&path, map, campaign.as_ref(), plugins())?)
        })
    }

    /// Reads a DataFrame, as the log format of this package, with its channel map as text.
    #[staticmethod]
    fn of_frame(py: Python<'_>, content: PyBackedBytes, channels_text: String) -> PyResult<Recording> {
        compute(py, None, move |_| {
            Recording::of(mapper::Recording::from_bytes(&content, "DataFrame", &channels_text, plugins())?)
        })
    }

    /// Steps, events, warnings and metadata, as JSON.
    #[getter]
    fn summary(&self) -> &str {
        &self.summary
    }

    /// Symbol and unit of each channel.
    #[getter]
    fn channels(&self) -> Vec<(&'static str, &'static str)> {
        self.series().map(|(channel, _)| (channel.symbol(), channel.unit())).collect()
    }

    /// Times, s, and values of a channel in SI units, as native 64-bit floats.
    fn samples<'py>(
        &self,
        py: Python<'py>,
        symbol: &str,
    ) -> PyResult<(Bound<'py, PyBytes>, Bound<'py, PyBytes>)> {
        let found = self.series().find(|(channel, _)| channel.symbol() == symbol);
        let (_, series) = found.ok_or_else(|| {
            let known: Vec<&str> = self.series().map(|(channel, _)| channel.symbol()).collect();
            Fault::Argument(format!("the recording has no channel `{symbol}`; it has {}", known.join(", ")))
        })?;
        Ok((floats(py, &series.t_s)?, floats(py, &series.values)?))
    }
}

/// Copies numbers once, into memory of Python that NumPy then uses as it is.
fn floats<'py>(py: Python<'py>, values: &[f64]) -> PyResult<Bound<'py, PyBytes>> {
    PyBytes::new_with(py, size_of_val(values), |bytes| {
        for (cell, value) in bytes.chunks_exact_mut(size_of::<f64>()).zip(values) {
            cell.copy_from_slice(&value.to_ne_bytes());
        }
        Ok(())
    })
}
