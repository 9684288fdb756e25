//! The simulated outside of one run: rig, disk, clock, operator. All of it follows from a scenario, and a kill freezes the files between any
//! two calls.

use super::faulty_backend::{Fault, FaultyBackend};
use super::scenario::{Disk, Kill, Life};
use mapper_core::{
    Backend, BackendError, Channel, RigDescription, RigMode, SampleBatch, Setpoints, WallClock,
};
use mapper_session::RigStates;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};

pub const RIG: &str = "simulated cell";

/// Channels that are compared with the recording.
pub const COMPARED: [Channel; 4] = [Channel::ShaftSpeed, Channel::P2, Channel::T2, Channel::CompressorFlow];

/// What really happened, next to what the run says.
#[derive(Debug, Default)]
pub struct Ledger {
    /// Whether air flows, whatever the rig has acknowledged.
    pub air_on: bool,
    /// Whether it has ever flowed.
    pub was_on: bool,
    /// Run time until which the rig was polled, s.
    pub now_s: f64,
    /// Run time at which the air was switched on, s.
    pub on_s: f64,
    /// Run time at which the air was cut last, s.
    pub cut_s: f64,
    /// Samples that the run received: time, s, and values; NaN for none.
    pub received: Vec<(f64, [f64; COMPARED.len()])>,
    /// Whether a call failed, and at which run time, s.
    pub failed_s: Option<f64>,
    /// Whether the disk refused a write or a synchronisation.
    pub disk_failed: bool,
    /// Run time at which a stop was requested, s.
    pub stopped_s: Option<f64>,
    /// Contradictions that are seen at once.
    pub wrong: Vec<String>,
}

impl Ledger {
    /// Whether the run was polled for two more seconds with the air on.
    pub fn air_was_on_at(&self, t_s: f64) -> bool {
        self.was_on && self.on_s < t_s && t_s + 2.0 < self.cut_s
    }
}

struct State {
    calls: u64,
    writes: u64,
    written: u64,
    wall_s: f64,
    is_killed: bool,
    ledger: Ledger,
}

pub struct World {
    state: Mutex<State>,
    life: Life,
    /// Files of the run and of the rig's locks, and where a kill keeps them.
    live: PathBuf,
    kept: PathBuf,
    pub stop: AtomicBool,
    pub stop_after_step: AtomicBool,
}

impl World {
    pub fn new(life: &Life, live: &Path, kept: &Path) -> Arc<World> {
        let state = State {
            calls: 0,
            writes: 0,
            written: 0,
            wall_s: 0.0,
            is_killed: false,
            ledger: Ledger::default(),
        };
        Arc::new(World {
            state: Mutex::new(state),
            life: life.clone(),
            live: live.to_owned(),
            kept: kept.to_owned(),
            stop: AtomicBool::new(false),
            stop_after_step: AtomicBool::new(false),
        })
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // A panic on demand may have poisoned it.
        self.state.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }

    pub fn is_killed(&self) -> bool {
        self.state().is_killed
    }

    /// Calls and writes so far.
    pub fn count(&self) -> (u64, u64) {
        let state = self.state();
        (state.calls, state.writes)
    }

    pub fn take_ledger(&self) -> Ledger {
        std::mem::take(&mut self.state().ledger)
    }

    /// The process ends here: what it does afterwards has no effect.
    fn kill(&self, state: &mut State) {
        copy(&self.live, &self.kept);
        state.is_killed = true;
        self.stop.store(true, Ordering::SeqCst);
    }

    /// One call of the run to its outside.
    pub fn call(&self) {
        let mut state = self.state();
        state.calls += 1;
        if self.life.intruder_at == Some(state.calls) {
            let states = RigStates::new(&self.live.join("states"));
            let status = states.status(RIG).unwrap();
            if status.in_use && (states.claim(RIG, None).is_ok() || states.acknowledge(RIG).is_ok()) {
                state.ledger.wrong.push("a second runner got the rig".to_owned());
            }
        }
        if self.life.kill == Some(Kill::Call(state.calls)) {
            self.kill(&mut state);
        }
    }

    /// One write to the disk.
    pub fn write(&self, _path: &Path, bytes: usize) -> io::Result<usize> {
        let mut state = self.state();
        if state.is_killed {
            return Err(io::Error::other("killed"));
        }
        state.writes += 1;
        if self.life.kill == Some(Kill::Write(state.writes)) {
            self.kill(&mut state);
            return Err(io::Error::other("killed"));
        }
        state.wall_s += self.life.write_takes_s;
        let number = state.writes;
        let taken = match self.life.disk {
            Disk::Full(capacity) if bytes > 0 => {
                let room = capacity.saturating_sub(state.written);
                if room == 0 { Err(ErrorKind::StorageFull.into()) } else { Ok(bytes.min(room as usize)) }
            }
            Disk::Fails(at) if number == at => Err(io::Error::other("input/output error")),
            Disk::Interrupts if number.is_multiple_of(3) && bytes > 0 => {
                return Err(ErrorKind::Interrupted.into());
            }
            Disk::Short if bytes > 1 => Ok(bytes.div_ceil(3)),
            _ => Ok(bytes),
        };
        match &taken {
            Ok(taken) => state.written += *taken as u64,
            Err(_) => state.ledger.disk_failed = true,
        }
        taken
    }

    /// A point of run time: the operator's stop.
    fn reach(&self, state: &mut State, now_s: f64) {
        if let Some((stop_s, is_gentle)) = self.life.stop
            && now_s >= stop_s
            && state.ledger.stopped_s.is_none()
        {
            state.ledger.stopped_s = Some(now_s);
            let flag = if is_gentle { &self.stop_after_step } else { &self.stop };
            flag.store(true, Ordering::SeqCst);
        }
    }

    fn is_dead(&self) -> Result<(), BackendError> {
        match self.is_killed() {
            true => Err(BackendError::Lost { t_s: 0.0, source: "killed".into() }),
            false => Ok(()),
        }
    }
}

/// The computer's clock, which advances only during waits and writes, and may jump.
impl WallClock for &World {
    fn now_s(&self) -> f64 {
        self.state().wall_s
    }

    fn wait_s(&self, duration_s: f64) {
        let mut state = self.state();
        let before_s = state.wall_s;
        state.wall_s += duration_s;
        if let Some((at_s, by_s)) = self.life.wall_jump
            && (before_s..state.wall_s).contains(&at_s)
        {
            state.wall_s += by_s;
        }
        let now_s = state.wall_s;
        self.reach(&mut state, now_s);
    }
}

/// The true rig, below all faults.
struct Truth {
    lab: Box<dyn Backend>,
    world: Arc<World>,
}

impl Backend for Truth {
    fn describe(&self) -> RigDescription {
        self.lab.describe()
    }
    fn arm(&mut self) -> Result<(), BackendError> {
        self.lab.arm()
    }
    fn set(&mut self, setpoints: &Setpoints) -> Result<(), BackendError> {
        self.lab.set(setpoints)?;
        let mut state = self.world.state();
        if setpoints.mode == RigMode::Running && !state.ledger.air_on {
            state.ledger.on_s = state.ledger.now_s;
        }
        state.ledger.air_on = setpoints.mode == RigMode::Running;
        state.ledger.was_on |= state.ledger.air_on;
        Ok(())
    }
    fn poll(&mut self, until_s: f64) -> Result<SampleBatch, BackendError> {
        self.lab.poll(until_s)
    }
    fn hold(&mut self) -> Result<(), BackendError> {
        self.lab.hold()
    }
    fn make_safe(&mut self) -> Result<(), BackendError> {
        self.lab.make_safe()?;
        let mut state = self.world.state();
        if state.ledger.air_on {
            state.ledger.cut_s = state.ledger.now_s;
        }
        state.ledger.air_on = false;
        Ok(())
    }
    fn disarm(&mut self) -> Result<(), BackendError> {
        self.lab.disarm()
    }
}

/// The rig as the run sees it.
pub struct SimulatedRig {
    faulty: FaultyBackend<Truth>,
    world: Arc<World>,
    life: Life,
    is_exclusive: bool,
}

impl SimulatedRig {
    pub fn new(lab: Box<dyn Backend>, world: &Arc<World>, life: &Life, is_exclusive: bool) -> Self {
        let truth = Truth { lab, world: world.clone() };
        let faulty = FaultyBackend::new(truth, life.faults.clone());
        SimulatedRig { faulty, world: world.clone(), life: life.clone(), is_exclusive }
    }

    /// Makes a call, unless the process has been killed.
    fn made<T>(
        &mut self,
        call: impl FnOnce(&mut FaultyBackend<Truth>) -> Result<T, BackendError>,
    ) -> Result<T, BackendError> {
        self.world.call();
        self.world.is_dead()?;
        let made = call(&mut self.faulty);
        if made.is_err() {
            let mut state = self.world.state();
            let now_s = state.ledger.now_s;
            state.ledger.failed_s.get_or_insert(now_s);
        }
        made
    }
}

impl Backend for SimulatedRig {
    fn describe(&self) -> RigDescription {
        RigDescription {
            backend: "sim".to_owned(),
            simulated_time: !self.life.is_real_time,
            exclusive: self.is_exclusive.then(|| RIG.to_owned()),
            ..self.faulty.describe()
        }
    }
    fn arm(&mut self) -> Result<(), BackendError> {
        let fails = self.life.arm_fails;
        self.made(|rig| match fails {
            Some(true) => Err(BackendError::Deadline { call: "arm", limit_s: 10.0 }),
            Some(false) => Err(BackendError::Lost { t_s: 0.0, source: "no controller".into() }),
            None => rig.arm(),
        })
    }
    fn set(&mut self, setpoints: &Setpoints) -> Result<(), BackendError> {
        self.made(|rig| rig.set(setpoints))
    }
    fn poll(&mut self, until_s: f64) -> Result<SampleBatch, BackendError> {
        let batch = self.made(|rig| rig.poll(until_s))?;
        let mut state = self.world.state();
        let columns = COMPARED.map(|channel| batch.column(channel));
        for (index, t_s) in batch.t_s.iter().enumerate() {
            let value = |column: Option<&[f64]>| {
                column.and_then(|values| values.get(index)).copied().unwrap_or(f64::NAN)
            };
            state.ledger.received.push((*t_s, columns.map(value)));
        }
        state.ledger.now_s = until_s;
        if !self.life.is_real_time {
            self.world.reach(&mut state, until_s);
        }
        Ok(batch)
    }
    fn hold(&mut self) -> Result<(), BackendError> {
        self.made(FaultyBackend::hold)
    }
    fn make_safe(&mut self) -> Result<(), BackendError> {
        self.made(FaultyBackend::make_safe)
    }
    fn disarm(&mut self) -> Result<(), BackendError> {
        let fails = self.life.disarm_fails;
        self.made(|rig| match fails {
            Some(true) => Err(BackendError::Lost { t_s: 0.0, source: "the link is gone".into() }),
            Some(false) => Err(BackendError::Simulation { t_s: 0.0, source: "no release".into() }),
            None => rig.disarm(),
        })
    }
}

/// Copies a folder with everything in it.
fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap().flatten() {
        let (from, to) = (entry.path(), to.join(entry.file_name()));
        if from.is_dir() {
            copy(&from, &to);
        } else {
            std::fs::copy(&from, &to).unwrap();
        }
    }
}

/// Whether a fault of this kind must end the run.
pub fn must_end(fault: &Fault) -> bool {
    match fault {
        Fault::Nan(_) | Fault::Absent(_) | Fault::Bad(_) | Fault::Old(_) | Fault::Torn(_) => true,
        Fault::Doubled | Fault::Reordered | Fault::Backward(_) => true,
        Fault::Refuses | Fault::Lost | Fault::Silent | Fault::Panics => true,
        Fault::Mute(duration_s) | Fault::Late(duration_s) => *duration_s > 5.0,
        Fault::Trips { is_reported } => *is_reported,
        Fault::Reads(..) => true,
        // Found only if something is commanded meanwhile, or by chance.
        Fault::Frozen(_) | Fault::Scaled(..) | Fault::Shifted(..) | Fault::Ignores => false,
        Fault::LostFor(_) | Fault::NotMadeSafe | Fault::NotSafe(_) => false,
    }
}
