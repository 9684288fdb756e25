//! The one place of the package that names plug-ins.

use crate::frame::log_formats;
use mapper_backends::BACKENDS;
use mapper_core::{Backend, BackendError};
use mapper_driver_host::{DEFAULT_TIMEOUTS, Driver, SearchPath};
use mapper_effects::ScriptEffect;
use mapper_formats::FORMATS;
use mapper_physics::rig::effect::Effect;
use mapper_session::{Registry, SessionError};
use serde_json::Value;
use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::sync::Arc;

thread_local! {
    /// The rig in Python that the work of this thread runs: its name in the campaign, and its socket.
    static RIG: RefCell<Option<(String, PathBuf)>> = const { RefCell::new(None) };
}

/// The registry for a run in this thread on a rig in Python, of this name and at this socket.
pub fn registry_with_rig(rig: (String, PathBuf)) -> Registry {
    RIG.set(Some(rig));
    Registry { driver: Some(rig_in_python), ..registry() }
}

/// Connects to the rig of this thread, and finds no other driver.
fn rig_in_python(name: &str, settings: &Value) -> Result<Box<dyn Backend>, BackendError> {
    let rig = RIG.with_borrow(Clone::clone).filter(|(own, _)| own == name);
    Ok(Box::new(match rig {
        Some((_, socket)) => Driver::connect_socket(&socket, name, settings, DEFAULT_TIMEOUTS)?,
        None => Driver::find(&SearchPath::default(), name, settings, "", "")?,
    }))
}

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
