//! Settings of the virtual lab, in SI units. They are the simulator's truth: only the lab reads them.

use crate::virtual_lab::rig::actuator::ActuatorDynamics;
use crate::virtual_lab::rig::drift::{LabDrift, Weather};
use crate::virtual_lab::rig::precursor::SurgePrecursor;
use crate::virtual_lab::rig::running::{Lumped, Structure};
use crate::virtual_lab::sensors::{LabElements, SecondOrder, SensorErrors};
use mapper_core::Channel;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::rig::effect::Rig;
use mapper_physics::rig::instruments::Instruments;
use mapper_physics::simulation::model::Model;
use std::collections::BTreeMap;
use std::sync::Arc;

/// State of the machine when the lab is armed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Start {
    /// At rest and at ambient temperature.
    Standstill,
    /// Settled at the first setpoints.
    Settled,
}

/// All settings of a virtual lab.
#[derive(Debug, Clone)]
pub struct LabSettings {
    /// The true machine; it may differ from the declared one.
    pub model: Model,
    /// Lags, gains and offsets before the sensors' own errors; [`LabSettings::p3_actuator`] has the lag of P3.
    pub instruments: Instruments,
    /// Wander of cell and supplies.
    pub weather: Weather,
    /// T1, P1, P4 and ambient temperature are constant except for the weather; the other values are the state at arming.
    pub cell: BoundaryConditions,
    /// Name of the simulated rig, which two runs cannot share at once; `None`: each run has its own.
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
    /// Channels with redundant sensors, which replace the one in `sensors`.
    pub redundant: BTreeMap<Channel, LabElements>,
    /// Offset of the sensors' true temperatures at rest, in the channel's unit: no rig is perfectly uniform.
    pub uneven_at_rest: BTreeMap<Channel, f64>,
    /// Drifts at run time.
    pub drifts: Vec<LabDrift>,
    /// Pressures with a wall tap, with the inner diameter of the pipe, m; the others are total.
    pub static_tap_pipe_diameters_m: BTreeMap<Channel, f64>,
    /// Shaft speed at which the lab cuts the air by itself, rpm.
    pub trip_speed_rpm: f64,
    /// The equations of the machine.
    pub structure: Arc<dyn Structure>,
    /// Sensors with a second-order response before their own lag; none in the nominal lab.
    pub second_order: BTreeMap<Channel, SecondOrder>,
    /// Fluctuation of flow and outlet pressure beyond the surge line, ratio of their values.
    pub surge_swing_ratio: f64,
    /// Fluctuation of flow and pressures before the surge line.
    pub surge_precursor: SurgePrecursor,
    /// Seed of all noise.
    pub seed: u64,
}

impl LabSettings {
    /// Takes machine and instruments from a rig; the additional motion of P3 and valve goes to their actuators.
    pub fn take(&mut self, rig: Rig) {
        let slower_s = rig.instruments.p3_lag_s - mapper_physics::rig::instruments::NOMINAL_P3_LAG_S;
        self.p3_actuator.lag_s = (self.p3_actuator.lag_s + slower_s).max(0.0);
        self.valve_actuator.lag_s += rig.instruments.valve.lag_s;
        self.valve_actuator.play += rig.instruments.valve.play_ratio;
        self.model = rig.model;
        self.instruments = rig.instruments;
    }

    /// A lab without sensor errors and actuator lag: the model itself.
    pub fn ideal(model: Model, cell: BoundaryConditions) -> Self {
        let at_once = ActuatorDynamics::AT_ONCE;
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
