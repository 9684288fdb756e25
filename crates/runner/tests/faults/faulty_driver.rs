//! The rig of these tests and its faults as a driver. The test and `examples/mapper-backend-faulty.rs` both refer to a row
//! by its index.

#[path = "faulty_backend.rs"]
pub(crate) mod faulty_backend;

use faulty_backend::Fault;
use mapper_backends::virtual_lab::{LabSettings, SensorErrors, VirtualLab};
use mapper_core::Channel::{self, P2, P3, ShaftSpeed, T2};
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
        ..SensorErrors::default()
    };
    let sensors = [(Channel::ShaftSpeed, noise(30.0)), (Channel::P2, noise(60.0)), (Channel::T2, noise(0.1))];
    VirtualLab::new(LabSettings {
        sensors: sensors.into(),
        ..LabSettings::ideal(Model::nominal(), BoundaryConditions::default())
    })
}

/// Expected end of a run.
pub(crate) enum ExpectedEnd {
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
pub(crate) const PROTOCOL_FAULTS: &[(f64, Fault, ExpectedEnd)] = &[
    (FAULT_S, Fault::Nan(ShaftSpeed), ExpectedEnd::Trips("(N) has given no good reading", FAULT_S + 4.0)),
    (FAULT_S, Fault::Absent(T2), ExpectedEnd::Trips("(T2) has given no good reading", FAULT_S + 4.0)),
    (FAULT_S, Fault::Bad(P3), ExpectedEnd::Trips("(P3) has given no good reading", FAULT_S + 4.0)),
    (FAULT_S, Fault::Old(P2), ExpectedEnd::Trips("(P2) has given no good reading", FAULT_S + 4.0)),
    (FAULT_S, Fault::Mute(1e9), ExpectedEnd::Trips("has given no good reading", FAULT_S + 4.0)),
    (FAULT_S, Fault::Late(6.0), ExpectedEnd::Trips("has given no good reading", FAULT_S + 4.0)),
    (FAULT_S, Fault::Reads(ShaftSpeed, 181e3), ExpectedEnd::Trips("(N) is 181", FAULT_S + 1.5)),
    (FAULT_S, Fault::Reads(P3, 401e3), ExpectedEnd::Trips("(P3) is 401", FAULT_S + 1.5)),
    (FAULT_S, Fault::Reads(T2, 600.0), ExpectedEnd::Trips("(T2) is", FAULT_S + 1.5)),
    (FAULT_S, Fault::Trips { is_reported: true }, ExpectedEnd::Trips("tripped by itself", FAULT_S + 1.5)),
    (FAULT_S, Fault::Trips { is_reported: false }, ExpectedEnd::Trips("no longer drives it", 130.0)),
    // These faults start before the jump.
    (60.0, Fault::Ignores, ExpectedEnd::Trips("instead of", 130.0)),
    (40.0, Fault::Frozen(P2), ExpectedEnd::Trips("frozen", 91.5)),
    // The host detects these before any guard.
    (FAULT_S, Fault::Mute(1.5), ExpectedEnd::Lost("are missing")),
    (FAULT_S, Fault::Doubled, ExpectedEnd::Lost("expected sample")),
    (FAULT_S, Fault::Reordered, ExpectedEnd::Lost("a sample at")),
    (FAULT_S, Fault::Backward(100.0), ExpectedEnd::Lost("a sample at")),
    (FAULT_S, Fault::Torn(T2), ExpectedEnd::Lost("values for")),
    (60.0, Fault::Refuses, ExpectedEnd::Fails("outside the range of the rig")),
    // Faults of the driver, which continues to run.
    (FAULT_S, Fault::Panics, ExpectedEnd::Lost("the driver failed")),
    (FAULT_S, Fault::Lost, ExpectedEnd::InDoubt("Cut its air by hand")),
];
