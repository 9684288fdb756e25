//! Drivers that come with the source, so that a missing driver can be reported with its build command.

/// Drivers that come with the source and are built separately: name, purpose, build command.
pub const KNOWN: &[(&str, &str, &str)] = &[
    (
        "lab",
        "the virtual lab behind the protocol, to rehearse on",
        "cargo build --release -p mapper-backend-lab",
    ),
    (
        "modbus",
        "a PLC that speaks Modbus TCP, docs/how-to/rig.md",
        "cargo build --release -p mapper-backend-modbus",
    ),
    ("ak", "an instrument, read alone, docs/how-to/rig.md", "cargo build --release -p mapper-backend-ak"),
    (
        "opcua",
        "a PLC that speaks OPC UA, docs/how-to/rig.md",
        "cargo build --release -p mapper-backend-opcua",
    ),
];
