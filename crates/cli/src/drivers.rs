//! Rigs behind programs of their own.

use mapper_backends::BACKENDS;
use mapper_core::{Backend, BackendError};
use mapper_host::{Driver, Places};
use serde_json::Value;

/// Drivers that come with the source and are built by themselves: name, what for, the line that builds it.
pub const KNOWN: &[(&str, &str, &str)] = &[
    (
        "lab",
        "the virtual lab behind the protocol, to rehearse on",
        "cargo build --release -p mapper-backend-lab",
    ),
    ("modbus", "a PLC that speaks Modbus TCP, docs/rig.md", "cargo build --release -p mapper-backend-modbus"),
    ("ak", "an instrument, read alone, docs/rig.md", "cargo build --release -p mapper-backend-ak"),
    ("opcua", "a PLC that speaks OPC UA, docs/rig.md", "cargo build --release -p mapper-backend-opcua"),
];

/// Where drivers are looked for: beside this program, then on `PATH`.
pub fn places() -> Places {
    Places::new(std::env::current_exe().ok().as_deref(), std::env::var_os("PATH").as_deref())
}

/// The driver that a campaign asks for.
pub fn driver(name: &str, settings: &Value) -> Result<Box<dyn Backend>, BackendError> {
    let built_in = BACKENDS.iter().map(|plugin| plugin.name).collect::<Vec<_>>().join(", ");
    let known = KNOWN.iter().find(|(known, ..)| *known == name);
    let hint =
        known.map_or_else(String::new, |(.., line)| format!("; `{line}` in the source of mapper builds it"));
    Ok(Box::new(Driver::find(&places(), name, settings, &built_in, &hint)?))
}
