//! How P3 and the valve follow their commands, and whether that is judged.

use mapper_core::{Channel, Recording};
use mapper_observe::declared::Declared;
use mapper_observe::lagged_command::{Response, measured_p3_response, measured_valve_response};
use mapper_observe::step_timing::{Times, as_told};
use mapper_observe::table::Table;

/// How often response and times are read off beside each other at most.
const TIMED_TURNS: usize = 3;

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
        let p3 = timed_p3(table, recording, declared).0;
        Actuators { p3, valve: Response::lag(0.0), judged: true }
    }

    /// Of a campaign that declares nothing: both as the recording has them.
    pub fn undeclared(table: &Table, recording: &Recording, declared: &Declared) -> Actuators {
        let (p3, timed) = timed_p3(table, recording, declared);
        let valve = measured_valve_response(table, &timed, declared.nominal.p1_pa);
        let valve = valve.unwrap_or(Response::lag(0.0));
        Actuators { p3, valve, judged: false }
    }
}

/// How P3 follows, and the recording with its steps from when their commands reached the rig: each is read off beside the other.
fn timed_p3(table: &Table, recording: &Recording, declared: &Declared) -> (Response, Recording) {
    let noise_sigma = declared.noise_sigma(Channel::P3);
    let follows = |recording: &Recording| {
        let p3 = measured_p3_response(table, recording, noise_sigma);
        p3.unwrap_or(Response::lag(declared.tolerances.actuator_lag_s))
    };
    let told = as_told(recording);
    let (mut p3, mut timed) = (follows(&told), told.clone());
    for _ in 0..TIMED_TURNS {
        let next = Times::read(table, &told, p3, noise_sigma).timed(&told);
        if next.steps == timed.steps {
            break;
        }
        (p3, timed) = (follows(&next), next);
    }
    (p3, timed)
}
