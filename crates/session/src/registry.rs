//! The plug-ins that a session works with, handed in by whoever opens it.

use crate::{ErrorKind, SessionError};
use mapper_campaign::Campaign;
use mapper_core::{Backend, BackendError};
use mapper_physics::effect::Effect;
use mapper_physics::model::Model;
use std::path::PathBuf;
use std::sync::Arc;

/// What a backend is made from.
pub struct BackendContext<'a> {
    /// The campaign; its backend settings are the backend's alone to read.
    pub campaign: &'a Campaign,
    /// The nominal model.
    pub model: &'a Model,
    /// Every effect that the registry knows, for simulated rigs.
    pub effects: &'a [Arc<dyn Effect>],
}

/// A backend by its name.
#[derive(Clone, Copy)]
pub struct BackendPlugin {
    /// Name in campaigns.
    pub name: &'static str,
    /// One line for people.
    pub summary: &'static str,
    /// Makes the backend, or says what is wrong with its settings.
    pub make: fn(&BackendContext<'_>) -> Result<Box<dyn Backend>, BackendError>,
}

/// Reads a suspected effect from a script; the error is a sentence for people.
pub type ReadEffect = fn(&std::path::Path) -> Result<Arc<dyn Effect>, SessionError>;

/// Every plug-in of a session.
#[derive(Clone)]
pub struct Registry {
    /// Rigs, real and simulated.
    pub backends: Vec<BackendPlugin>,
    /// The catalogue of effects.
    pub effects: Vec<Arc<dyn Effect>>,
    /// How a suspected effect is read from a file.
    pub read_effect: ReadEffect,
}

impl Registry {
    /// The backend that a campaign asks for.
    ///
    /// # Errors
    /// [`SessionError::Backend`] where the name is unknown or the settings are wrong.
    pub fn make_backend(&self, campaign: &Campaign, model: &Model) -> Result<Box<dyn Backend>, SessionError> {
        let wanted = &campaign.backend.name;
        let context = BackendContext { campaign, model, effects: &self.effects };
        let made = match self.backends.iter().find(|plugin| plugin.name == wanted) {
            Some(plugin) => (plugin.make)(&context),
            None => {
                let known: Vec<&str> = self.backends.iter().map(|plugin| plugin.name).collect();
                Err(BackendError::Settings {
                    backend: wanted.clone(),
                    path: String::new(),
                    message: format!("there is no such backend; there are {}", known.join(", ")),
                })
            }
        };
        made.map_err(|error| SessionError::Backend { kind: ErrorKind::BadInput, source: error })
    }

    /// The catalogue, and the effects that scripts define.
    ///
    /// # Errors
    /// A script that cannot be read, is not an effect, or takes the name of another.
    pub fn effects_with(&self, scripts: &[PathBuf]) -> Result<Vec<Arc<dyn Effect>>, SessionError> {
        let mut effects = self.effects.clone();
        for path in scripts {
            let scripted = (self.read_effect)(path)?;
            let id = &scripted.info().id;
            if effects.iter().any(|effect| effect.info().id == *id) {
                return Err(SessionError::EffectTaken { path: path.clone(), id: id.to_string() });
            }
            effects.push(scripted);
        }
        Ok(effects)
    }
}
