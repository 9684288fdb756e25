//! A campaign: a checked file, its plan, and its runs.

use crate::error::{Error, show_in_campaign};
use crate::plugins::plugins;
use mapper_campaign::CampaignError;
use mapper_core::Plan;
use mapper_session::{
    PlanInputs, Registry, Rehearsal, Session, SessionError, nominal_model, plan_of, rehearse,
};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A checked campaign with its text and the plug-ins that it may name. Cheap to clone.
#[derive(Clone)]
pub struct Campaign {
    contents: Arc<Contents>,
    plugins: Arc<Registry>,
}

struct Contents {
    checked: mapper_campaign::Campaign,
    text: String,
    origin: PathBuf,
}

impl Campaign {
    /// Reads and checks a campaign file.
    ///
    /// # Errors
    /// If the file cannot be read, or has mistakes: all of them, each with its line.
    pub fn load(file: impl AsRef<Path>) -> Result<Campaign, Error> {
        let file = file.as_ref();
        let text = mapper_campaign::read_text(file)
            .map_err(|source| CampaignError::Read { path: file.to_owned(), source })
            .map_err(SessionError::from)?;
        Campaign::from_yaml(text, file)
    }

    /// Checks the text of a campaign. `origin` is its name in messages, and the base of relative paths in it.
    ///
    /// # Errors
    /// If the text has mistakes.
    pub fn from_yaml(text: impl Into<String>, origin: impl AsRef<Path>) -> Result<Campaign, Error> {
        let (text, origin) = (text.into(), origin.as_ref().to_owned());
        let checked = mapper_campaign::check(&text, &origin, &mapper_campaign::read_named_file)
            .map_err(|findings| SessionError::from(CampaignError::Mistakes(Box::new(findings))))?;
        Ok(Campaign { contents: Arc::new(Contents { checked, text, origin }), plugins: Arc::new(plugins()) })
    }

    /// The campaign with other plug-ins than [`plugins`](crate::plugins()), e.g. with a backend of your own.
    #[must_use]
    pub fn with_plugins(self, plugins: Registry) -> Campaign {
        Campaign { plugins: Arc::new(plugins), ..self }
    }

    /// Name of the campaign.
    pub fn name(&self) -> &str {
        &self.settings().name
    }

    /// Name of the machine.
    pub fn machine(&self) -> &str {
        &self.settings().machine.name
    }

    /// Every setting, checked and in SI units.
    pub fn settings(&self) -> &mapper_campaign::Campaign {
        &self.contents.checked
    }

    /// The text.
    pub fn text(&self) -> &str {
        &self.contents.text
    }

    /// The file, or the name of the text in messages.
    pub fn origin(&self) -> &Path {
        &self.contents.origin
    }

    /// The plug-ins.
    pub fn plugins(&self) -> &Registry {
        &self.plugins
    }

    /// The plan: the steps in order, each with its expected results. That of a sequence script is its rehearsal on the nominal machine.
    ///
    /// # Errors
    /// If points cannot be reached, no order is allowed, or the script has a mistake.
    pub fn plan(&self) -> Result<Plan, Error> {
        Ok(self.plan_with(1.0)?.plan)
    }

    /// The plan with the notes of a sequence script. `effort` of the search for the best order: 1 is normal, 100 takes a hundred times as
    /// long.
    ///
    /// # Errors
    /// As [`Campaign::plan`].
    pub fn plan_with(&self, effort: f64) -> Result<Rehearsal, Error> {
        let settings = self.settings();
        let model = nominal_model(settings)?;
        if let Some(script) = &settings.sequence {
            return Ok(rehearse(&Session::new(&self.plugins), settings, &model, script)?);
        }
        let inputs = PlanInputs::of(settings)?;
        let mut request = inputs.request(settings, &model);
        request.effort = effort;
        Ok(Rehearsal { plan: plan_of(settings, &request)?, notes: Vec::new() })
    }

    pub(crate) fn show(&self, error: SessionError) -> Error {
        show_in_campaign(error, self.text(), self.origin()).into()
    }
}
