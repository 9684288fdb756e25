//! The source of a study's campaigns, and the errors of studies.

use mapper_campaign::{Campaign, CampaignError, check_with, load, read_named_file, read_text};
use mapper_fleet::FleetError;
use mapper_session::Registry;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::io::{Error, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum StudyError {
    #[error("{}: its rig `{backend}` is not simulated; studies run only on backends of this program", .campaign.display())]
    Rig { campaign: PathBuf, backend: String },
    #[error("the campaign of the item has mistakes: {0}")]
    Campaign(String),
    #[error("the item has no file {0}")]
    File(String),
    #[error("the effect library has no effect `{0}`")]
    Cause(String),
    #[error("{name} has the wrong content: {source}")]
    Content { name: String, source: serde_json::Error },
}

impl From<StudyError> for FleetError {
    fn from(error: StudyError) -> Self {
        FleetError::kind(error)
    }
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CampaignSource {
    text: String,
    /// The files that it names, relative to its folder.
    files: BTreeMap<PathBuf, String>,
}

impl CampaignSource {
    pub fn read(path: &Path, registry: &Registry) -> Result<(CampaignSource, Campaign), FleetError> {
        // All mistakes, as every other command reports them.
        let campaign = load(path).map_err(FleetError::kind)?;
        let backend = &campaign.backend.name;
        if !registry.backends.iter().any(|plugin| plugin.name == backend) {
            return Err(StudyError::Rig { campaign: path.to_owned(), backend: backend.clone() }.into());
        }
        let unread = |source| FleetError::kind(CampaignError::Read { path: path.to_owned(), source });
        let text = read_text(path).map_err(unread)?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let files = Mutex::new(BTreeMap::new());
        let keep = |file: &Path| {
            let text = read_named_file(file)?;
            let name = file.strip_prefix(folder).unwrap_or(file).to_owned();
            files.lock().unwrap_or_else(PoisonError::into_inner).insert(name, text.clone());
            Ok(text)
        };
        check_with(&text, path, &keep, &|_| Vec::new()).map_err(FleetError::kind)?;
        let files = files.into_inner().unwrap_or_else(PoisonError::into_inner);
        Ok((CampaignSource { text, files }, campaign))
    }

    /// Parses the campaign. Its points are not checked again, because they were checked when the study was made.
    pub fn campaign(&self) -> Result<Campaign, StudyError> {
        let files = |file: &Path| {
            let missing = || Error::new(ErrorKind::NotFound, StudyError::File(file.display().to_string()));
            self.files.get(file).cloned().ok_or_else(missing)
        };
        check_with(&self.text, Path::new("campaign.yaml"), &files, &|_| Vec::new())
            .map_err(|findings| StudyError::Campaign(findings.to_string()))
    }
}
