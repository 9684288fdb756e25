//! Recordings and how they are read.

use crate::attended::compute;
use crate::error::Fault;
use crate::registry::registry;
use mapper_campaign::Campaign as Checked;
use mapper_core::Channel;
use mapper_record::{ChannelMap, ChannelMapError};
use mapper_session::{Recorded, SessionError, channel_map};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A run directory, an MCAP file or a log of another program, with its channel map.
#[pyclass(frozen, module = "mapper._mapper")]
pub struct Recording {
    pub(crate) source: Arc<Source>,
    summary: String,
    series: Vec<(Channel, Vec<f64>, Vec<f64>)>,
}

/// Where a recording comes from.
pub struct Source {
    path: PathBuf,
    pub(crate) map: ChannelMap,
}

impl Source {
    /// Reads it as the command does.
    pub fn read(&self, given: Option<&Checked>) -> Result<Vec<Recorded>, SessionError> {
        Recorded::read_run(&registry(), &self.path, &self.map, given)
    }
}

/// The channel map from a file or a text; that of this program's recordings if there is none.
fn map_of(file: Option<&Path>, text: Option<&str>) -> Result<ChannelMap, SessionError> {
    match (file, text) {
        (_, Some(text)) => ChannelMap::from_yaml(text, file.unwrap_or(Path::new("channels.yaml")))
            .map_err(|findings| ChannelMapError::Mistakes(Box::new(findings)).into()),
        (Some(file), None) => channel_map(file),
        (None, None) => Ok(ChannelMap::native()),
    }
}

#[pymethods]
impl Recording {
    /// Reads a recording. `channels_text`: a channel map as text, which `channels` then names in messages.
    #[staticmethod]
    #[pyo3(signature = (path, channels=None, channels_text=None))]
    fn read(
        py: Python<'_>,
        path: PathBuf,
        channels: Option<PathBuf>,
        channels_text: Option<String>,
    ) -> PyResult<Recording> {
        compute(py, None, move |_| {
            let map = map_of(channels.as_deref(), channels_text.as_deref())?;
            let source = Source { path, map };
            let read = source.read(None)?;
            let first = read.first().ok_or(SessionError::NoRecording)?;
            let recording = &first.read.recording;
            let warnings: Vec<String> =
                read.iter().flat_map(|one| &one.read.warnings).map(ToString::to_string).collect();
            let steps: Vec<_> = read.iter().flat_map(|one| &one.read.recording.steps).collect();
            let summary = json!({
                "path": first.path,
                "start_time_ns": first.read.start_time_ns,
                "has_campaign": first.campaign.is_some(),
                "metadata": first.read.metadata,
                "warnings": warnings,
                "steps": steps,
                "events": recording.events,
            });
            let series = recording
                .series
                .iter()
                .map(|(channel, series)| (*channel, series.t_s.clone(), series.values.clone()));
            Ok(Recording { summary: summary.to_string(), series: series.collect(), source: Arc::new(source) })
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
        self.series.iter().map(|(channel, ..)| (channel.symbol(), channel.unit())).collect()
    }

    /// Times, s, and values of a channel in SI units, as native 64-bit floats.
    fn samples<'py>(
        &self,
        py: Python<'py>,
        symbol: &str,
    ) -> PyResult<(Bound<'py, PyBytes>, Bound<'py, PyBytes>)> {
        let found = self.series.iter().find(|(channel, ..)| channel.symbol() == symbol);
        let (_, t_s, values) = found.ok_or_else(|| {
            let known: Vec<&str> = self.series.iter().map(|(channel, ..)| channel.symbol()).collect();
            Fault::Argument(format!("the recording has no channel `{symbol}`; it has {}", known.join(", ")))
        })?;
        Ok((floats(py, t_s), floats(py, values)))
    }
}

fn floats<'py>(py: Python<'py>, values: &[f64]) -> Bound<'py, PyBytes> {
    let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_ne_bytes()).collect();
    PyBytes::new(py, &bytes)
}
