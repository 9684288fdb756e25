//! Drivers that come with the source, so that a missing driver can be reported with its build command.

/// Drivers that come with the source and are built separately: name, purpose, build command.
pub const INCLUDED_DRIVERS: &[(&str, &str, &str)] = &[
    (
        "lab",
        "the virtual lab as a driver, for rehearsals",
        "cargo build --release --locked -p mapper-backend-lab",
    ),
    (
        "modbus",
        "a PLC with Modbus TCP, docs/how-to/rig.md",
        "cargo build --release --locked -p mapper-backend-modbus",
    ),
    (
        "ak",
        "an instrument, read only, docs/how-to/rig.md",
        "cargo build --release --locked -p mapper-backend-ak",
    ),
    (
        "opcua",
        "a PLC with OPC UA, docs/how-to/rig.md",
        "cargo build --release --locked -p mapper-backend-opcua",
    ),
];
