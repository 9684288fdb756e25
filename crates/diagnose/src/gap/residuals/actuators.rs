//! Response of P3 and the valve to their commands, and whether it is diagnosed.

use mapper_core::{Channel, Recording};
use mapper_numerics::least_squares::descent::ROUNDS;
use mapper_observe::averages::time_table::Table;
use mapper_observe::declared::Declared;
use mapper_observe::model_inputs::lagged_command::{Response, measured_p3_response, measured_valve_response};
use mapper_observe::model_inputs::step_timing::{Times, with_command_times};

/// Response of P3 and the valve to their commands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Actuators {
    /// P3; Pa/s.
    pub p3: Response,
    /// The valve; 1/s.
    pub valve: Response,
    /// Whether P3 is compared with its declared response.
    pub judged: bool,
}

impl Actuators {
    /// With declared tolerances, measured P3 drives the model and is compared with its declared lag, and the valve follows at once. Without
    /// them, both responses are estimated from the recording.
    pub fn of(table: &Table, recording: &Recording, declared: &Declared, judged: bool) -> Actuators {
        let (p3, timed) = timed_p3(table, recording, declared);
        let valve =
            if judged { None } else { measured_valve_response(table, &timed, declared.nominal.p1_pa) };
        Actuators { p3, valve: valve.unwrap_or(Response::lag(0.0)), judged }
    }
}

/// Estimates the P3 response and shifts the steps to when their commands reached the rig; each estimate uses the other.
fn timed_p3(table: &Table, recording: &Recording, declared: &Declared) -> (Response, Recording) {
    let noise_sigma = declared.noise_sigma(Channel::P3);
    let follows = |recording: &Recording| {
        let p3 = measured_p3_response(table, recording, noise_sigma);
        p3.unwrap_or(Response::lag(declared.tolerances.actuator_lag_s))
    };
    let commanded = with_command_times(recording);
    let (mut p3, mut timed) = (follows(&commanded), commanded.clone());
    for _ in 0..ROUNDS {
        let next = Times::read(table, &commanded, p3, noise_sigma).timed(&commanded);
        if next.steps == timed.steps {
            break;
        }
        (p3, timed) = (follows(&next), next);
    }
    (p3, timed)
}
