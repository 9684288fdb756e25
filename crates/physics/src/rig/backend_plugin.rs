//! A backend's registration, before any rig exists: its name, a description, and its constructor.

use crate::rig::nominal_rig::NominalRig;
use mapper_core::{Backend, BackendError};

/// Makes a backend from the declared rig and from its own settings, the value below `backend: {NAME: ...}` of a
/// campaign; `null` if the campaign gives none.
///
/// A mistake in the settings is [`BackendError::Settings`].
pub type MakeBackend = fn(&NominalRig, &serde_json::Value) -> Result<Box<dyn Backend>, BackendError>;

/// A backend that campaigns can name. Each backend has one, `PLUGIN`; the program lists them.
#[derive(Debug, Clone, Copy)]
pub struct BackendPlugin {
    /// Name in campaigns: lower case, digits and `_`.
    pub name: &'static str,
    /// A one-line description.
    pub summary: &'static str,
    /// Constructor.
    pub make: MakeBackend,
}

impl BackendPlugin {
    /// Makes the backend called `name` of a list from its settings.
    ///
    /// # Errors
    /// [`BackendError::Settings`] if the list has no such backend, or the backend rejects its settings.
    pub fn make_by_name(
        plugins: &[BackendPlugin],
        name: &str,
        rig: &NominalRig,
        settings: &serde_json::Value,
    ) -> Result<Box<dyn Backend>, BackendError> {
        match plugins.iter().find(|plugin| plugin.name == name) {
            Some(plugin) => (plugin.make)(rig, settings),
            None => {
                let known = plugins.iter().map(|plugin| plugin.name).collect::<Vec<_>>().join(", ");
                let source = Box::new(UnknownBackend { known });
                Err(BackendError::Settings { backend: name.to_owned(), path: String::new(), source })
            }
        }
    }
}

/// A campaign names an unknown backend.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("unknown backend; the backends are {known}")]
pub struct UnknownBackend {
    /// Names of the known backends.
    pub known: String,
}
