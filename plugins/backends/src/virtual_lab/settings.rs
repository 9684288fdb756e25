//! Settings of the virtual lab, in SI units. They are truth: nothing but the lab reads them.

use super::actuator::ActuatorDynamics;
use super::drift::LabDrift;
use super::elements::LabElements;
use super::precursor::SurgePrecursor;
use super::running::{Lumped, Structure};
use super::second_order::SecondOrder;
use super::sensor::SensorErrors;
use super::boundary_wander::Weather;
use mapper_core::Channel;
use mapper_physics::effect::Rig;
use mapper_physics::instruments::Instruments;
use mapper_physics::model::Model;
use mapper_physics::params::BoundaryConditions;
use std::collections::BTreeMap;
use std::sync::Arc;

/// How the machine stands when the lab is armed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// At rest, everything at ambient temperature.
    Standstill,
    /// Settled at the first setpoints.
    Settled,
}

/// Everything a virtual lab is made of.
#[derive(Debug, Clone)]
pub struct LabSettings {
    /// The machine as it truly is; may differ from the one that the campaign declares.
    pub model: Model,
    /// Lags, gains and offsets before the sensors' own errors; the lag of P3 is [`LabSettings::p3_actuator`]'s.
    pub instruments: Instruments,
    /// How cell and supplies wander.
    pub weather: Weather,
    /// T1, P1, P4 and ambient temperature hold throughout but for the weather; the other values are the state at arming.
    pub cell: BoundaryConditions,
    /// Name of the rig that this lab stands for, which no two runs may have at once; `None`: each run has its own.
    pub rig: Option<String>,
    /// Sample rate, Hz.
    pub sample_rate_hz: f64,
    /// State at arming.
    pub start: Start,
    /// Turbine inlet pressure, Pa.
    pub p3_actuator: ActuatorDynamics,
    /// Turbine inlet temperature, K.
    pub t3_actuator: ActuatorDynamics,
    /// Valve opening.
    pub valve_actuator: ActuatorDynamics,
    /// Oil temperature, K.
    pub oil_actuator: ActuatorDynamics,
    /// Errors of the sensors; channels without an entry are ideal.
    pub sensors: BTreeMap<Channel, SensorErrors>,
    /// Channels with several sensors, which read in place of the one in `sensors`.
    pub redundant: BTreeMap<Channel, LabElements>,
    /// What the sensors see at rest beyond what the cell has throughout, in the channel's unit: no rig is quite even.
    pub uneven_at_rest: BTreeMap<Channel, f64>,
    /// What drifts while the lab runs.
    pub drifts: Vec<LabDrift>,
    /// Pressures that are tapped at the wall of a pipe, with its inner diameter, m; the others are total.
    pub static_tap_pipe_diameters_m: BTreeMap<Channel, f64>,
    /// Shaft speed at which the lab cuts the air by itself, rpm.
    pub trip_speed_rpm: f64,
    /// The equations that move the machine.
    pub structure: Arc<dyn Structure>,
    /// Sensors that follow in second order before their own lag; none in the nominal lab.
    pub second_order: BTreeMap<Channel, SecondOrder>,
    /// Swing of flow and outlet pressure beyond the surge line, ratio of their values.
    pub surge_swing_ratio: f64,
    /// Swing of flow and pressures before the surge line.
    pub surge_precursor: SurgePrecursor,
    /// Seed of all noise.
    pub seed: u64,
}

impl LabSettings {
    /// Takes machine and instruments from a rig; what its P3 is slower than declared, the actuator is.
    pub fn take(&mut self, rig: Rig) {
        let slower_s = rig.instruments.p3_lag_s - mapper_physics::instruments::NOMINAL_P3_LAG_S;
        self.p3_actuator.lag_s = (self.p3_actuator.lag_s + slower_s).max(0.0);
        self.model = rig.model;
        self.instruments = rig.instruments;
    }

    /// A lab without any sensor error whose actuators act at once: the model itself.
    pub fn ideal(model: Model, cell: BoundaryConditions) -> Self {
        let at_once = ActuatorDynamics { lag_s: 0.0, slew_per_s: f64::INFINITY };
        LabSettings {
            model,
            instruments: Instruments::default(),
            weather: Weather::default(),
            cell,
            rig: None,
            sample_rate_hz: 10.0,
            start: Start::Settled,
            p3_actuator: at_once,
            t3_actuator: at_once,
            valve_actuator: at_once,
            oil_actuator: at_once,
            sensors: BTreeMap::new(),
            redundant: BTreeMap::new(),
            uneven_at_rest: BTreeMap::new(),
            drifts: Vec::new(),
            static_tap_pipe_diameters_m: BTreeMap::new(),
            trip_speed_rpm: f64::INFINITY,
            structure: Arc::new(Lumped),
            second_order: BTreeMap::new(),
            surge_swing_ratio: 0.0,
            surge_precursor: SurgePrecursor::NONE,
            seed: 0,
        }
    }
}
