//! Recordings and how they are read.

use crate::attended::compute;
use crate::campaign::Campaign;
use crate::error::Fault;
use crate::registry::registry;
use mapper_campaign::Campaign as Checked;
use mapper_core::{Channel, Series};
use mapper_recording::{ChannelMap, ChannelMapError};
use mapper_session::{Recorded, SessionError, channel_map};
use pyo3::prelude::*;
use pyo3::pybacked::PyBackedBytes;
use pyo3::types::PyBytes;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A run directory, an MCAP file or a log of another program, with its channel map.
#[pyclass(frozen, module = "mapper._mapper")]
pub struct Recording {
    pub(crate) source: Arc<Source>,
    summary: String,
}

/// Where a recording comes from, and its contents.
pub struct Source {
    path: PathBuf,
    pub(crate) map: ChannelMap,
    recorded: Vec<Recorded>,
}

impl Source {
    /// The recordings with a given campaign in place of their own.
    pub fn with(&self, given: Option<&Checked>) -> Result<Vec<Recorded>, SessionError> {
        // Which steps of a resumed run count depends on the campaign.
        if given.is_some() && self.recorded.len() > 1 {
            return Recorded::read_run(&registry(), &self.path, &self.map, given);
        }
        let copy = |one: &Recorded| Recorded {
            path: one.path.clone(),
            read: one.read.clone(),
            campaign: given.or(one.campaign.as_ref()).cloned(),
            approaches: one.approaches.clone(),
        };
        Ok(self.recorded.iter().map(copy).collect())
    }

    /// The samples of the first recording.
    fn series(&self) -> impl Iterator<Item = (&Channel, &Series)> {
        self.recorded.iter().take(1).flat_map(|first| &first.read.recording.series)
    }
}

impl Recording {
    /// With the steps, events and so on of all its parts.
    fn of(source: Source) -> Result<Recording, Fault> {
        let read = &source.recorded;
        let first = read.first().ok_or(SessionError::NoRecording)?;
        let steps: Vec<_> = read.iter().flat_map(|one| &one.read.recording.steps).collect();
        let events: Vec<_> = read.iter().flat_map(|one| &one.read.recording.events).collect();
        let summary = json!({
            "path": first.path,
            "start_time_ns": first.read.start_time_ns,
            "metadata": first.read.metadata,
            "warnings": reader_warnings(read),
            "steps": steps,
            "events": events,
        });
        Ok(Recording { summary: summary.to_string(), source: Arc::new(source) })
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
            let given = campaign.as_ref().map(|inner| &inner.campaign);
            let recorded = Recorded::read_run(&registry(), &path, &map, given)?;
            Recording::of(Source { path, map, recorded })
        })
    }

    /// Reads a DataFrame, as the log format of this package, with its channel map as text.
    #[staticmethod]
    fn of_frame(py: Python<'_>, content: PyBackedBytes, channels_text: String) -> PyResult<Recording> {
        compute(py, None, move |_| {
            let map = ChannelMap::from_yaml(&channels_text, Path::new("channels.yaml"));
            let map =
                map.map_err(|findings| SessionError::from(ChannelMapError::Mistakes(Box::new(findings))))?;
            let path = PathBuf::from("DataFrame");
            let recorded = vec![Recorded::read_bytes(&registry(), &content, &path, &map, None)?];
            Recording::of(Source { path, map, recorded })
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
        self.source.series().map(|(channel, _)| (channel.symbol(), channel.unit())).collect()
    }

    /// Times, s, and values of a channel in SI units, as native 64-bit floats.
    fn samples<'py>(
        &self,
        py: Python<'py>,
        symbol: &str,
    ) -> PyResult<(Bound<'py, PyBytes>, Bound<'py, PyBytes>)> {
        let found = self.source.series().find(|(channel, _)| channel.symbol() == symbol);
        let (_, series) = found.ok_or_else(|| {
            let known: Vec<&str> = self.source.series().map(|(channel, _)| channel.symbol()).collect();
            Fault::Argument(format!("the recording has no channel `{symbol}`; it has {}", known.join(", ")))
        })?;
        Ok((floats(py, &series.t_s)?, floats(py, &series.values)?))
    }
}

/// Problems of the files.
pub fn reader_warnings(read: &[Recorded]) -> Vec<String> {
    read.iter().flat_map(|one| &one.read.warnings).map(ToString::to_string).collect()
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
