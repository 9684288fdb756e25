//! The virtual gas stand: the lumped model behind actuators and sensors, in simulated time.

use super::actuator::Actuator;
use super::drift::{self, LabDrift};
use super::inputs::{LOWEST_EXPANSION_RATIO, LabInputs};
use super::sensor::Sensor;
use super::settings::{LabSettings, Start};
use super::truth::TruthRecorder;
use crate::setpoint_limits;
use mapper_core::{
    Backend, BackendError, CHANNELS, Channel, ChannelColumn, Event, EventKind, RigDescription, RigMode,
    SampleBatch, Setpoints,
};
use mapper_physics::inputs::Inputs;
use mapper_physics::instruments::{self, ChannelFollower};
use mapper_physics::model::{Outputs, PreparedModel, State, rad_s_of_rpm};
use mapper_physics::params::BoundaryConditions;
use mapper_physics::pressure_tap;
use mapper_physics::simulate::{Crossing, DEFAULT_RELATIVE_TOLERANCE, ModelEvent, Simulator, Watch};
use mapper_physics::standstill::{self, StandstillState};
use mapper_physics::steady;

/// Name under which campaigns ask for this backend.
pub const NAME: &str = "virtual_lab";

/// Shaft speed at which a starting machine enters the running model and a stopping one leaves it, rpm.
const CRANKING_SPEED_RPM: f64 = 5_000.0;
/// Frequency of the surge cycle, Hz: the order of a small compressor with a short outlet duct.
const SURGE_FREQUENCY_HZ: f64 = 7.3;

/// What moves in the lab.
#[derive(Debug)]
enum Machine {
    /// Gas flows.
    Running(Box<Simulator>),
    /// The shaft is at rest.
    Standstill {
        /// Housing temperatures.
        state: StandstillState,
        /// Time of the state, s.
        t_s: f64,
    },
}

#[derive(Debug)]
struct Armed {
    inputs: LabInputs,
    /// `None` until the first setpoints, where the lab starts settled.
    machine: Option<Machine>,
    wanted: RigMode,
    tripped: bool,
    sensors: Vec<(Channel, Sensor)>,
    followers: Vec<ChannelFollower>,
    commands: Option<Setpoints>,
    now_s: f64,
    next_sequence: u64,
    pending_events: Vec<Event>,
}

/// A gas stand that exists in equations only. Same settings, same calls: same samples to the bit.
#[derive(Debug)]
pub struct VirtualLab {
    settings: LabSettings,
    armed: Option<Armed>,
}

/// Channels the lab delivers: all of them.
fn channels() -> Vec<Channel> {
    CHANNELS.iter().map(|row| row.channel).collect()
}

/// What the sensors see at one instant, before their errors.
struct Instant<'a> {
    boundary: BoundaryConditions,
    speed_rpm: f64,
    tc_k: f64,
    tt_k: f64,
    /// `None` at standstill.
    running: Option<(&'a State, &'a Outputs)>,
}

impl Instant<'_> {
    fn outputs(&self) -> Option<&Outputs> {
        self.running.map(|(_, outputs)| outputs)
    }
}

impl VirtualLab {
    /// A lab that is not armed yet.
    pub fn new(settings: LabSettings) -> Self {
        VirtualLab { settings, armed: None }
    }

    fn armed(&mut self, call: &'static str) -> Result<(&LabSettings, &mut Armed), BackendError> {
        match self.armed.as_mut() {
            Some(armed) => Ok((&self.settings, armed)),
            None => Err(BackendError::OutOfOrder { call, state: "not armed", needed: "armed" }),
        }
    }
}

impl Backend for VirtualLab {
    fn describe(&self) -> RigDescription {
        RigDescription {
            backend: NAME.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            channels: channels(),
            sample_rate_hz: self.settings.sample_rate_hz,
            simulated_time: true,
        }
    }

    fn arm(&mut self) -> Result<(), BackendError> {
        if self.armed.is_some() {
            return Err(BackendError::OutOfOrder { call: "arm", state: "armed", needed: "not armed" });
        }
        let settings = &self.settings;
        let cell = settings.cell;
        let sample_s = 1.0 / settings.sample_rate_hz;
        let sensors = channels()
            .into_iter()
            .filter_map(|channel| {
                let errors = settings.sensors.get(&channel)?;
                Some((channel, Sensor::new(*errors, sample_s, settings.seed, channel as u64)))
            })
            .collect();
        let at_rest = StandstillState { tc_k: cell.ambient_temperature_k, tt_k: cell.ambient_temperature_k };
        self.armed = Some(Armed {
            inputs: LabInputs {
                cell,
                weather: settings.weather.clone(),
                p3: Actuator::at_rest(settings.p3_actuator, cell.p4_pa * LOWEST_EXPANSION_RATIO),
                t3: Actuator::at_rest(settings.t3_actuator, cell.t3_k),
                valve: Actuator::at_rest(settings.valve_actuator, cell.valve_opening_ratio),
                oil: Actuator::at_rest(settings.oil_actuator, cell.oil_temperature_k),
            },
            machine: match settings.start {
                Start::Standstill => Some(Machine::Standstill { state: at_rest, t_s: 0.0 }),
                Start::Settled => None,
            },
            wanted: RigMode::Standstill,
            tripped: false,
            sensors,
            followers: CHANNELS
                .iter()
                .map(|row| ChannelFollower::new(*settings.instruments.path(row.channel)))
                .collect(),
            commands: None,
            now_s: 0.0,
            next_sequence: 0,
            pending_events: Vec::new(),
        });
        Ok(())
    }

    fn set(&mut self, setpoints: &Setpoints) -> Result<(), BackendError> {
        setpoint_limits::check(setpoints)?;
        let (settings, armed) = self.armed("set")?;
        armed.commands = Some(*setpoints);
        armed.wanted = if armed.tripped { RigMode::Standstill } else { setpoints.mode };
        let now_s = armed.now_s;
        let p3_pa = match armed.wanted {
            RigMode::Running => setpoints.p3_pa,
            RigMode::Standstill => armed.inputs.cell.p4_pa * LOWEST_EXPANSION_RATIO,
        };
        let first = armed.machine.is_none();
        for (actuator, command) in [
            (&mut armed.inputs.p3, p3_pa),
            (&mut armed.inputs.t3, setpoints.t3_k),
            (&mut armed.inputs.valve, setpoints.valve_opening_ratio),
            (&mut armed.inputs.oil, setpoints.oil_temperature_k),
        ] {
            actuator.set(now_s, command);
        }
        if first {
            // A rig that has stood at its first setpoints for long.
            armed.inputs.p3 = Actuator::at_rest(settings.p3_actuator, p3_pa);
            armed.inputs.t3 = Actuator::at_rest(settings.t3_actuator, setpoints.t3_k);
            armed.inputs.valve = Actuator::at_rest(settings.valve_actuator, setpoints.valve_opening_ratio);
            armed.inputs.oil = Actuator::at_rest(settings.oil_actuator, setpoints.oil_temperature_k);
            armed.machine = Some(settled(settings, armed, now_s)?);
        } else if let Some(Machine::Running(simulator)) = armed.machine.as_mut() {
            simulator.restart();
        }
        Ok(())
    }

    fn poll(&mut self, until_s: f64) -> Result<SampleBatch, BackendError> {
        let (settings, armed) = self.armed("poll")?;
        armed.advance(settings, until_s)
    }

    fn make_safe(&mut self) -> Result<(), BackendError> {
        let (settings, armed) = self.armed("make_safe")?;
        let now_s = armed.now_s;
        armed.wanted = RigMode::Standstill;
        armed.inputs.p3.set(now_s, armed.inputs.cell.p4_pa * LOWEST_EXPANSION_RATIO);
        armed.inputs.valve.set(now_s, 1.0f64.max(armed.inputs.valve.value(now_s)));
        if let Some(Machine::Running(simulator)) = armed.machine.as_mut() {
            simulator.restart();
        } else if armed.machine.is_none() {
            let ambient_k = settings.cell.ambient_temperature_k;
            let state = StandstillState { tc_k: ambient_k, tt_k: ambient_k };
            armed.machine = Some(Machine::Standstill { state, t_s: now_s });
        }
        Ok(())
    }

    fn disarm(&mut self) -> Result<(), BackendError> {
        self.armed("disarm")?;
        self.armed = None;
        Ok(())
    }
}

/// A machine that has settled under the inputs of now.
fn settled(settings: &LabSettings, armed: &Armed, now_s: f64) -> Result<Machine, BackendError> {
    match armed.wanted {
        RigMode::Running => {
            let rest = steady::settle_under(&settings.model, &armed.inputs.at(now_s))
                .map_err(|error| BackendError::Simulation { t_s: now_s, message: error.to_string() })?;
            Ok(Machine::Running(Box::new(running(settings, now_s, rest.state))))
        }
        RigMode::Standstill => {
            let ambient_k = settings.cell.ambient_temperature_k;
            let state = StandstillState { tc_k: ambient_k, tt_k: ambient_k };
            // A day at rest.
            let oil_k = armed.inputs.oil.value(now_s);
            let state = standstill::relax(&settings.model.params, state, oil_k, ambient_k, 86_400.0);
            Ok(Machine::Standstill { state, t_s: now_s })
        }
    }
}

fn running(settings: &LabSettings, t_s: f64, state: State) -> Simulator {
    let watch = Watch { overspeed_rpm: settings.trip_speed_rpm };
    Simulator::new(&settings.model, t_s, state, DEFAULT_RELATIVE_TOLERANCE, watch)
}

impl Armed {
    fn advance(&mut self, settings: &LabSettings, until_s: f64) -> Result<SampleBatch, BackendError> {
        let mut batch = BatchBuilder::new(self.next_sequence);
        // A time before the first sample, or none at all, asks for nothing.
        let asks_for_the_first = self.next_sequence == 0 && until_s >= 0.0;
        while self.now_s < until_s || (self.now_s == 0.0 && asks_for_the_first) {
            self.switch_machine(settings);
            self.drift(settings);
            let next_s = self.advance_machine(settings, until_s, &mut batch)?;
            self.now_s = next_s;
            if until_s <= 0.0 {
                break;
            }
        }
        batch.events.append(&mut self.pending_events);
        self.next_sequence += batch.t_s.len() as u64;
        Ok(batch.finish())
    }

    /// Starts a machine at rest that should run, and stops a slow one that should rest.
    fn switch_machine(&mut self, settings: &LabSettings) {
        let now_s = self.now_s;
        let next = match (&self.machine, self.wanted) {
            (Some(Machine::Standstill { state, .. }), RigMode::Running) => {
                let cell = &self.inputs.cell;
                let speed_rad_s = rad_s_of_rpm(CRANKING_SPEED_RPM);
                let start = State::new(speed_rad_s, cell.p1_pa * 1.0005, state.tc_k, state.tt_k, cell.t1_k);
                Machine::Running(Box::new(running(settings, now_s, start)))
            }
            (Some(Machine::Running(simulator)), RigMode::Standstill)
                if simulator.state().shaft_speed_rpm() < CRANKING_SPEED_RPM =>
            {
                let State { tc_k, tt_k, .. } = simulator.state();
                Machine::Standstill { state: StandstillState { tc_k, tt_k }, t_s: now_s }
            }
            _ => return,
        };
        self.machine = Some(next);
    }

    /// The machine as it has become by now.
    fn drift(&mut self, settings: &LabSettings) {
        if let Some(Machine::Running(simulator)) = self.machine.as_mut()
            && settings.drifts.iter().any(LabDrift::is_machine)
        {
            let held_s = (self.now_s / drift::MACHINE_HOLDS_S + 1e-9).floor() * drift::MACHINE_HOLDS_S;
            let middle_s = held_s + 0.5 * drift::MACHINE_HOLDS_S;
            simulator.change_params(drift::drifted_machine(
                &settings.drifts,
                settings.model.params,
                middle_s,
            ));
        }
    }

    /// Runs the machine to `until_s`, or for a second where it may have to be switched; returns the time reached.
    fn advance_machine(
        &mut self,
        settings: &LabSettings,
        until_s: f64,
        batch: &mut BatchBuilder,
    ) -> Result<f64, BackendError> {
        let start_s = self.now_s;
        let coasting = self.wanted == RigMode::Standstill;
        let mut end_s = if coasting { until_s.min(start_s + 1.0) } else { until_s };
        if settings.drifts.iter().any(LabDrift::is_machine) {
            // On a grid of its own: how often the lab is polled changes nothing.
            end_s =
                end_s.min(((start_s / drift::MACHINE_HOLDS_S + 1e-9).floor() + 1.0) * drift::MACHINE_HOLDS_S);
        }
        let first_index = self.next_sequence + batch.t_s.len() as u64;
        let rate_hz = settings.sample_rate_hz;
        let sample_times_s = (first_index..).map(|index| index as f64 / rate_hz).take_while(|t| *t <= end_s);
        let Armed { inputs, machine, sensors, followers, commands, .. } = self;
        match machine {
            None => Err(BackendError::OutOfOrder {
                call: "poll",
                state: "armed without setpoints",
                needed: "told its first setpoints (`set`)",
            }),
            Some(Machine::Running(simulator)) => {
                let mut crossings = Vec::new();
                let result = simulator.run_to(
                    end_s,
                    inputs,
                    sample_times_s,
                    |t_s, state, outputs| {
                        let instant = Instant {
                            boundary: inputs.at(t_s),
                            speed_rpm: state.shaft_speed_rpm(),
                            tc_k: state.tc_k,
                            tt_k: state.tt_k,
                            running: Some((state, outputs)),
                        };
                        batch.push(t_s, &instant, commands.as_ref(), sensors, followers, settings);
                    },
                    |event| crossings.push(event),
                );
                for crossing in crossings {
                    self.report(settings, crossing, end_s);
                }
                result.map_err(|error| {
                    // A hook cannot fail by itself: it gives NaN and keeps the reason.
                    let reason =
                        settings.model.hooks.fault().map_or_else(String::new, |fault| format!(": {fault}"));
                    BackendError::Simulation { t_s: start_s, message: format!("{error}{reason}") }
                })?;
                Ok(end_s)
            }
            Some(Machine::Standstill { state, t_s: state_s }) => {
                let params = &settings.model.params;
                let ambient_k = inputs.cell.ambient_temperature_k;
                let mut relax_to = |t_s: f64| {
                    let oil_k = inputs.oil.value(t_s);
                    if t_s > *state_s {
                        *state = standstill::relax(params, *state, oil_k, ambient_k, t_s - *state_s);
                        *state_s = t_s;
                    }
                    *state
                };
                for t_s in sample_times_s {
                    let StandstillState { tc_k, tt_k } = relax_to(t_s);
                    let boundary = inputs.at(t_s);
                    let instant = Instant { speed_rpm: 0.0, boundary, tc_k, tt_k, running: None };
                    batch.push(t_s, &instant, commands.as_ref(), sensors, followers, settings);
                }
                relax_to(end_s);
                Ok(end_s)
            }
        }
    }

    /// Turns a crossing into an event; beyond the trip speed the lab cuts its own air, at `now_s`.
    fn report(&mut self, settings: &LabSettings, event: ModelEvent, now_s: f64) {
        let ModelEvent { t_s, crossing, speed_rpm, pressure_ratio } = event;
        let (kind, message) = match crossing {
            Crossing::SurgeEntered => (
                EventKind::SurgeEntered,
                format!("surge: at {speed_rpm:.0} rpm the pressure ratio reached {pressure_ratio:.4}"),
            ),
            Crossing::SurgeLeft => (
                EventKind::SurgeLeft,
                format!("out of surge at {speed_rpm:.0} rpm, pressure ratio {pressure_ratio:.4}"),
            ),
            Crossing::OverspeedEntered => (
                EventKind::OverspeedEntered,
                format!(
                    "overspeed: the shaft passed {:.0} rpm, the rig has cut its air",
                    settings.trip_speed_rpm
                ),
            ),
            Crossing::OverspeedLeft => (
                EventKind::OverspeedLeft,
                format!("the shaft is below {:.0} rpm again", settings.trip_speed_rpm),
            ),
        };
        if crossing == Crossing::OverspeedEntered {
            self.tripped = true;
            self.wanted = RigMode::Standstill;
            self.inputs.p3.set(now_s, self.inputs.cell.p4_pa * LOWEST_EXPANSION_RATIO);
        }
        self.pending_events.push(Event { t_s, kind, message });
    }
}

/// Collects samples into columns.
struct BatchBuilder {
    first_sequence: u64,
    t_s: Vec<f64>,
    columns: Vec<Vec<f64>>,
    truth: TruthRecorder,
    events: Vec<Event>,
}

impl BatchBuilder {
    fn new(first_sequence: u64) -> Self {
        BatchBuilder {
            first_sequence,
            t_s: Vec::new(),
            columns: vec![Vec::new(); CHANNELS.len()],
            truth: TruthRecorder::default(),
            events: Vec::new(),
        }
    }

    fn push(
        &mut self,
        t_s: f64,
        instant: &Instant<'_>,
        commands: Option<&Setpoints>,
        sensors: &mut [(Channel, Sensor)],
        followers: &mut [ChannelFollower],
        settings: &LabSettings,
    ) {
        self.t_s.push(t_s);
        let surging = instant.outputs().is_some_and(|outputs| outputs.surge_position_ratio >= 1.0);
        let swing = if surging {
            settings.surge_swing_ratio * (2.0 * std::f64::consts::PI * SURGE_FREQUENCY_HZ * t_s).sin()
        } else {
            0.0
        };
        let prepared = instant.running.map(|_| settings.model.prepare(&instant.boundary));
        for ((row, column), follower) in CHANNELS.iter().zip(&mut self.columns).zip(followers) {
            let total = true_value(row.channel, instant, prepared.as_ref(), commands, swing);
            let truth = match settings.static_tap_pipe_diameters_m.get(&row.channel) {
                Some(pipe_diameter_m) => at_the_wall_pa(row.channel, total, *pipe_diameter_m, instant),
                None => total,
            };
            let truth = follower.read(t_s, truth);
            let sensor = sensors.iter_mut().find(|(channel, _)| *channel == row.channel);
            let reading = sensor.map_or(truth, |(_, sensor)| sensor.read(truth));
            column.push(drift::drifted_reading(&settings.drifts, row.channel, t_s, reading));
        }
        self.truth.push(instant.speed_rpm, instant.tc_k, instant.tt_k, instant.outputs());
    }

    fn finish(self) -> SampleBatch {
        let columns = CHANNELS.iter().zip(self.columns);
        SampleBatch {
            first_sequence: self.first_sequence,
            columns: columns.map(|(row, values)| ChannelColumn { channel: row.channel, values }).collect(),
            truth: self.truth.finish(),
            t_s: self.t_s,
            events: self.events,
        }
    }
}

/// Static pressure at the wall of the pipe of one of the four stations; the total one where the pipe would choke.
fn at_the_wall_pa(channel: Channel, total_pa: f64, pipe_diameter_m: f64, instant: &Instant<'_>) -> f64 {
    let Some(outputs) = instant.outputs() else { return total_pa };
    let (flow_kg_s, temperature_k) = match channel {
        Channel::P1 => (outputs.flow_kg_s, instant.boundary.t1_k),
        Channel::P2 => (outputs.flow_kg_s, outputs.t2_k),
        Channel::P3 => (outputs.turbine_flow_kg_s, instant.boundary.t3_k),
        Channel::P4 => (outputs.turbine_flow_kg_s, outputs.turbine.t4_k),
        _ => return total_pa,
    };
    pressure_tap::total_to_static_pa(total_pa, flow_kg_s, temperature_k, pipe_diameter_m).unwrap_or(total_pa)
}

fn true_value(
    channel: Channel,
    instant: &Instant<'_>,
    prepared: Option<&PreparedModel<'_>>,
    commands: Option<&Setpoints>,
    swing: f64,
) -> f64 {
    let boundary = &instant.boundary;
    let command = |value: fn(&Setpoints) -> f64| commands.map_or(f64::NAN, value);
    match channel {
        Channel::P3Command => return command(|setpoints| setpoints.p3_pa),
        Channel::T3Command => return command(|setpoints| setpoints.t3_k),
        Channel::ValveCommand => return command(|setpoints| setpoints.valve_opening_ratio),
        Channel::TOilCommand => return command(|setpoints| setpoints.oil_temperature_k),
        _ => {}
    }
    if let (Some((state, outputs)), Some(prepared)) = (instant.running, prepared) {
        let value = instruments::true_value(channel, prepared, state, outputs).unwrap_or(f64::NAN);
        return match channel {
            Channel::CompressorFlow => value * (1.0 + swing),
            // The pressure swings less than the flow: it is the volume's.
            Channel::P2 => value * (1.0 + 0.2 * swing),
            _ => value,
        };
    }
    // At rest every gas probe but T1's sees the cell.
    match channel {
        Channel::ShaftSpeed | Channel::CompressorFlow | Channel::TurbineFlow => 0.0,
        Channel::P1 | Channel::P2 => boundary.p1_pa,
        Channel::T1 => boundary.t1_k,
        Channel::Tc => instant.tc_k,
        Channel::Tt => instant.tt_k,
        Channel::P3 => boundary.p3_pa,
        Channel::P4 => boundary.p4_pa,
        Channel::TOil => boundary.oil_temperature_k,
        _ => boundary.ambient_temperature_k,
    }
}
