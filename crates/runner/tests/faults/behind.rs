//! The rig of these tests and its faults as a driver. The test and `examples/mapper-backend-faulty.rs` both refer to a row
//! by its index.

use mapper_backends::virtual_lab::{LabSettings, SensorErrors, VirtualLab};
use mapper_core::Channel::{self, P2, P3, ShaftSpeed, T2};
use mapper_driver_host::conformance::Fault;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::Model;

/// Start of a fault in the middle of the second step, s.
pub(crate) const FAULT_S: f64 = 70.0;

pub(crate) fn lab() -> VirtualLab {
    let noise = |white_sigma| SensorErrors {
        white_sigma,
        coloured_sigma: 0.0,
        coloured_time_constant_s: 1.0,
        offset: 0.0,
        gain_ratio: 0.0,
    };
    let sensors = [(Channel::ShaftSpeed, noise(30.0)), (Channel::P2, noise(60.0)), (Channel::T2, noise(0.1))];
    VirtualLab::new(LabSettings {
        sensors: sensors.into(),
        ..LabSettings::ideal(Model::nominal(), BoundaryConditions::default())
    })
}

/// Expected end of a run.
pub(crate) enum Ends {
    /// A guard trips with this text, at this time at the latest, s.
    Trips(&'static str, f64),
    /// An error with this text; the rig has confirmed its safe state.
    Fails(&'static str),
    /// The same, but a person has to inspect what was lost.
    Lost(&'static str),
    /// An error with this text; the state of the rig is unknown.
    InDoubt(&'static str),
}

/// Start of a fault, s, the fault, and the end of the run over the protocol.
#[rustfmt::skip]
pub(crate) const OVER_THE_PROTOCOL: &[(f64, Fault, Ends)] = &[
    (FAULT_S, Fault::Nan(ShaftSpeed), Ends::Trips("(N) has given no good reading", FAULT_S + 4.0)),
    (FAULT_S, Fault::Absent(T2), Ends::Trips("(T2) has given no good reading", FAULT_S + 4.0)),
    (FAULT_S, Fault::Bad(P3), Ends::Trips("(P3) has given no good reading", FAULT_S + 4.0)),
    (FAULT_S, Fault::Old(P2), Ends::Trips("(P2) has given no good reading", FAULT_S + 4.0)),
    (FAULT_S, Fault::Mute(1e9), Ends::Trips("has given no good reading", FAULT_S + 4.0)),
    (FAULT_S, Fault::Late(6.0), Ends::Trips("has given no good reading", FAULT_S + 4.0)),
    (FAULT_S, Fault::Reads(ShaftSpeed, 181e3), Ends::Trips("(N) is 181", FAULT_S + 1.5)),
    (FAULT_S, Fault::Reads(P3, 401e3), Ends::Trips("(P3) is 401", FAULT_S + 1.5)),
    (FAULT_S, Fault::Reads(T2, 600.0), Ends::Trips("(T2) is", FAULT_S + 1.5)),
    (FAULT_S, Fault::Trips { says_so: true }, Ends::Trips("tripped by itself", FAULT_S + 1.5)),
    (FAULT_S, Fault::Trips { says_so: false }, Ends::Trips("no longer drives it", 130.0)),
    // These faults start before the jump.
    (60.0, Fault::Ignores, Ends::Trips("asked for", 130.0)),
    (40.0, Fault::Frozen(P2), Ends::Trips("frozen", 91.5)),
    // The host detects these before any guard.
    (FAULT_S, Fault::Mute(1.5), Ends::Lost("are missing")),
    (FAULT_S, Fault::Doubled, Ends::Lost("was expected")),
    (FAULT_S, Fault::Reordered, Ends::Lost("a sample at")),
    (FAULT_S, Fault::Backward(100.0), Ends::Lost("a sample at")),
    (FAULT_S, Fault::Torn(T2), Ends::Lost("values for")),
    (60.0, Fault::Refuses, Ends::Fails("outside the range of the rig")),
    // Faults of the driver, which continues to run.
    (FAULT_S, Fault::Panics, Ends::Lost("the driver failed")),
    (FAULT_S, Fault::Lost, Ends::InDoubt("Cut its air by hand")),
];
