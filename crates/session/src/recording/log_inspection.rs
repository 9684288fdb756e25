//! Inspects the log of another program.

use crate::{Registry, SessionError};
use mapper_core::JsonMessages;
use mapper_recording::logs::proposal::{NominalFlows, Proposal, channel_map_text, propose};
use mapper_recording::logs::{Layout, LogFile, LogOptions, Survey, survey};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Contents of a log, and the channel map proposed for it.
#[derive(Debug)]
pub struct LogInspection {
    /// The file.
    pub path: PathBuf,
    /// Name of its format.
    pub format: &'static str,
    /// Groups, columns and detected layout.
    pub layout: Layout,
    /// Rates, ranges, gaps.
    pub survey: Survey,
    /// The proposed channel map.
    pub proposal: Proposal,
    /// Options that were used to read it.
    pub options: Vec<(String, String)>,
}

/// Reads a log once and proposes a channel map; `options` are keys and values of the log reader, `machine` is the campaign of the machine,
/// whose map shows the unit of a flow.
///
/// # Errors
/// [`SessionError::Campaign`] for a wrong campaign, [`SessionError::LogOption`] for a wrong key or value, [`SessionError::Log`] if the file
/// cannot be read as a log.
pub fn inspect_log(
    registry: &Registry,
    path: &Path,
    options: Vec<(String, String)>,
    machine: Option<&Path>,
) -> Result<LogInspection, SessionError> {
    let mut reader_options = LogOptions::default();
    for (key, value) in &options {
        reader_options.set(key, value)?;
    }
    let (format, mut log) = registry.logs.open(&LogFile::from_path(path), &reader_options)?;
    let survey = survey(log.as_mut())?;
    let layout = log.layout().clone();
    let model = match machine {
        Some(campaign) => Some(mapper_campaign::nominal_model(&mapper_campaign::load(campaign)?)?),
        None => None,
    };
    let flows = model.as_ref().map(|model| {
        move |speed_rpm: f64| {
            (model.map.surge_point(speed_rpm).0, model.map.choke_flow_corrected_kg_s(speed_rpm))
        }
    });
    let proposal = propose(&layout, &survey, flows.as_ref().map(|flows| flows as NominalFlows<'_>));
    Ok(LogInspection { path: path.to_owned(), format: format.name, layout, survey, proposal, options })
}

impl LogInspection {
    /// Machine-readable output; missing numbers are null.
    pub fn json(&self) -> Value {
        let columns = self.layout.columns.iter().zip(&self.survey.columns).map(|(column, data)| {
            json!({
                "name": column.name,
                "header": column.header,
                "unit": column.unit,
                "description": column.description,
                "group": column.group,
                "count": data.count,
                "missing": data.missing,
                "min": data.min,
                "max": data.max,
            })
        });
        json!({
            "log": self.path,
            "format": self.format,
            "findings": JsonMessages(&self.layout.findings),
            "start_time_ns": self.layout.start_time_ns,
            "groups": self.layout.groups.iter().zip(&self.survey.groups).map(|(group, data)| {
                let mut value = json!(data);
                value["name"] = json!(group.name);
                value["clock"] = json!(group.clock);
                value
            }).collect::<Vec<_>>(),
            "columns": columns.collect::<Vec<_>>(),
            "proposal": self.proposal,
            "channel_map": self.channel_map(),
        })
    }

    /// The proposal as text of a channel map.
    pub fn channel_map(&self) -> String {
        let name = self.path.file_name().unwrap_or_default().to_string_lossy();
        channel_map_text(&name, &self.layout, &self.proposal, &self.options)
    }
}
