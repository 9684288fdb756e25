//! The one place that names plug-ins.

use crate::drivers;
use mapper_backends::BACKENDS;
use mapper_effects::ScriptEffect;
use mapper_formats::FORMATS;
use mapper_log_formats::LOG_FORMATS;
use mapper_physics::rig::effect::Effect;
use mapper_session::{Registry, SessionError};
use std::path::Path;
use std::sync::Arc;

/// Every plug-in of this program.
pub fn registry() -> Registry {
    Registry {
        backends: BACKENDS.to_vec(),
        driver: Some(drivers::driver),
        effects: mapper_effects::catalogue(),
        read_effect,
        formats: FORMATS,
        logs: LOG_FORMATS,
        commit: env!("MAPPER_COMMIT"),
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
