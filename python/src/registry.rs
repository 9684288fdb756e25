//! The one place of the package that names plug-ins.

use crate::frame::log_formats;
use mapper_backends::BACKENDS;
use mapper_effects::ScriptEffect;
use mapper_formats::FORMATS;
use mapper_physics::effect::Effect;
use mapper_session::{Registry, SessionError};
use std::path::Path;
use std::sync::Arc;

/// Every plug-in of the package. It starts no drivers: a rig in real time is run by the command, which handles all signals.
pub fn registry() -> Registry {
    Registry {
        backends: BACKENDS.to_vec(),
        driver: None,
        effects: mapper_effects::catalogue(),
        read_effect,
        formats: FORMATS,
        logs: log_formats(),
        commit: "",
    }
}

/// A suspected effect, written in rhai.
fn read_effect(path: &Path) -> Result<Arc<dyn Effect>, SessionError> {
    let text = mapper_campaign::read_text(path).map_err(|source| SessionError::File {
        action: "read",
        path: path.to_owned(),
        source,
    })?;
    let effect = ScriptEffect::new(&text, path).map_err(|error| SessionError::Effect(Box::new(error)))?;
    Ok(Arc::new(effect))
}
