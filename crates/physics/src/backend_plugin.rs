//! What a backend says of itself before any rig is there: its name, a sentence, and how it is made.

use crate::nominal_rig::NominalRig;
use mapper_core::{Backend, BackendError};

/// Makes a backend from the declared rig and from its own settings, the value below `backend: {NAME: ...}` of a
/// campaign; `null` where the campaign writes none.
///
/// A mistake in the settings is [`BackendError::Settings`].
pub type MakeBackend = fn(&NominalRig, &serde_json::Value) -> Result<Box<dyn Backend>, BackendError>;

/// One backend that campaigns can ask for. Each backend has one, `PLUGIN`; the program lists them.
#[derive(Debug, Clone, Copy)]
pub struct BackendPlugin {
    /// Name in campaigns: lower case, digits and `_`.
    pub name: &'static str,
    /// What it is, one line for people.
    pub summary: &'static str,
    /// Makes it.
    pub make: MakeBackend,
}

impl BackendPlugin {
    /// The backend called `name` of a list, made from its settings.
    ///
    /// # Errors
    /// [`BackendError::Settings`] where the list has no such backend, and what the backend itself finds wrong.
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

/// A campaign asks for a backend that nobody has listed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("there is no such backend; the backends are {known}")]
pub struct UnknownBackend {
    /// Names of the backends there are.
    pub known: String,
}
