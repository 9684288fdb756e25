//! How P3 and the valve follow their commands, and whether that is judged.

use mapper_core::{Channel, Recording};
use mapper_observe::declared::Declared;
use mapper_observe::lagged_command::{Response, measured_p3_response, measured_valve_response};
use mapper_observe::table::Table;

/// How P3 and the valve follow their commands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Actuators {
    /// P3; Pa/s.
    pub p3: Response,
    /// The valve; 1/s.
    pub valve: Response,
    /// Whether P3 is held against what is declared of it.
    pub judged: bool,
}

impl Actuators {
    /// Of a campaign that declares its tolerances: P3 drives the model as measured and is held against its declared lag, the
    /// valve follows at once.
    pub fn declared(table: &Table, recording: &Recording, declared: &Declared) -> Actuators {
        let p3 = measured_p3_response(table, recording, declared.noise_sigma(Channel::P3));
        let p3 = p3.unwrap_or(Response::lag(declared.tolerances.actuator_lag_s));
        Actuators { p3, valve: Response::lag(0.0), judged: true }
    }

    /// Of a campaign that declares nothing: both as the recording has them.
    pub fn undeclared(table: &Table, recording: &Recording, declared: &Declared) -> Actuators {
        let valve = measured_valve_response(table, recording, declared.nominal.p1_pa);
        let valve = valve.unwrap_or(Response::lag(0.0));
        Actuators { valve, judged: false, ..Actuators::declared(table, recording, declared) }
    }
}
