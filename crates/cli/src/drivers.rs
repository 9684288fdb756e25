//! Rigs behind programs of their own.

use mapper_backends::BACKENDS;
use mapper_core::{Backend, BackendError};
use mapper_host::{Driver, KNOWN, Places};
use serde_json::Value;

/// Where drivers are looked for: those that listen at a socket beside locks and latches, then beside this program, then on `PATH`.
pub fn places() -> Places {
    let sockets = crate::rig_states::directory(None).join("drivers");
    Places::new(std::env::current_exe().ok().as_deref(), std::env::var_os("PATH").as_deref(), Some(sockets))
}

/// The driver that a campaign asks for.
pub fn driver(name: &str, settings: &Value) -> Result<Box<dyn Backend>, BackendError> {
    let built_in = BACKENDS.iter().map(|plugin| plugin.name).collect::<Vec<_>>().join(", ");
    let known = KNOWN.iter().find(|(known, ..)| *known == name);
    let hint =
        known.map_or_else(String::new, |(.., line)| format!("; `{line}` in the source of mapper builds it"));
    Ok(Box::new(Driver::find(&places(), name, settings, &built_in, &hint)?))
}
