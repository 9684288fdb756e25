//! Every backend follows every rule of the interface. A new backend needs only its row in [`candidates`].
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_backends::other_lab::{self, OtherStructure};
use mapper_backends::replay::{self, ReplayBackend};
use mapper_backends::virtual_lab::{self, ActuatorDynamics, LabSettings, SensorErrors, Start, VirtualLab};
use mapper_core::{Backend, BackendError, Channel, Recording, RigMode, Series, Setpoints};
use mapper_driver_host::conformance::{Candidate, RULES};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::Model;

/// All backends, in their practical configuration.
fn candidates() -> [Candidate<'static>; 5] {
    [
        Candidate {
            name: virtual_lab::NAME,
            make: &settled_lab,
            setpoints: setpoints(150e3),
            duration_s: None,
        },
        Candidate {
            name: virtual_lab::NAME,
            make: &lab_at_rest,
            setpoints: setpoints(150e3),
            duration_s: None,
        },
        Candidate {
            name: other_lab::NAME,
            make: &settled_other,
            setpoints: setpoints(150e3),
            duration_s: None,
        },
        Candidate {
            name: other_lab::NAME,
            make: &other_at_rest,
            setpoints: setpoints(150e3),
            duration_s: None,
        },
        Candidate {
            name: replay::NAME,
            make: &replay_of_the_lab,
            setpoints: setpoints(150e3),
            duration_s: Some(RECORDED_S),
        },
    ]
}

fn setpoints(p3_pa: f64) -> Setpoints {
    Setpoints {
        mode: RigMode::Running,
        p3_pa,
        t3_k: 773.15,
        valve_opening_ratio: 0.7,
        oil_temperature_k: 323.15,
    }
}

/// Noise, offsets and slow actuators: everything that depends on the seed.
fn lab(start: Start) -> LabSettings {
    let errors = SensorErrors {
        white_sigma: 0.08,
        coloured_sigma: 0.06,
        coloured_time_constant_s: 2.0,
        offset: 0.3,
        ..SensorErrors::default()
    };
    LabSettings {
        sensors: [(Channel::T1, errors), (Channel::T2, errors)].into(),
        p3_actuator: ActuatorDynamics::new(0.3, 50e3),
        start,
        seed: 42,
        ..LabSettings::ideal(Model::nominal(), BoundaryConditions::default())
    }
}

fn settled_lab() -> Result<Box<dyn Backend>, BackendError> {
    Ok(Box::new(VirtualLab::new(lab(Start::Settled))))
}

fn lab_at_rest() -> Result<Box<dyn Backend>, BackendError> {
    Ok(Box::new(VirtualLab::new(lab(Start::Standstill))))
}

fn other(start: Start) -> Result<Box<dyn Backend>, BackendError> {
    let mut settings = lab(start);
    other_lab::apply_structure(&mut settings, OtherStructure::default());
    Ok(Box::new(VirtualLab::new(settings)))
}

fn settled_other() -> Result<Box<dyn Backend>, BackendError> {
    other(Start::Settled)
}

fn other_at_rest() -> Result<Box<dyn Backend>, BackendError> {
    other(Start::Standstill)
}

/// Longer than any rule needs.
const RECORDED_S: f64 = 30.0;

/// Half a minute of the lab.
fn replay_of_the_lab() -> Result<Box<dyn Backend>, BackendError> {
    let mut rig = settled_lab()?;
    rig.arm().unwrap();
    rig.set(&setpoints(150e3)).unwrap();
    let batch = rig.poll(RECORDED_S).unwrap();
    let series = batch
        .columns
        .into_iter()
        .map(|column| (column.channel, Series { t_s: batch.t_s.clone(), values: column.values }));
    Ok(Box::new(ReplayBackend::new(&Recording { series: series.collect(), ..Recording::default() })))
}

#[test]
fn every_backend_keeps_every_rule() {
    for candidate in candidates() {
        for (rule, check) in RULES {
            let kept = check(&candidate);
            assert!(kept.is_ok(), "{} does not keep the rule: {rule}: {}", candidate.name, kept.unwrap_err());
        }
    }
}
