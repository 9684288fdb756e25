//! What the program takes from its computer: plug-ins with the commit, the directory of rig states, the clock, the worker of a fleet.

use crate::interrupt;
use crate::output::failure::Failure;
use crate::output::output_options;
use mapper_campaign::campaign::Date;
use mapper_core::WallClock;
use mapper_fleet::{Engine, Fleet, FleetError, Kind, Machine};
use mapper_session::{Registry, shared_state_directory};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

pub fn registry() -> Registry {
    Registry { commit: env!("MAPPER_COMMIT"), ..mapper::plugins() }
}

/// The directory of locks and lockouts, which all users of a computer share: the given one, or `$MAPPER_STATE_DIR`, or the default that all users of the computer share.
pub fn rig_states_directory(argument: Option<&Path>) -> PathBuf {
    let variable = std::env::var_os("MAPPER_STATE_DIR").filter(|value| !value.is_empty());
    argument.map(Path::to_owned).or(variable.map(PathBuf::from)).unwrap_or_else(shared_state_directory)
}

pub struct SystemClock(Instant);

impl SystemClock {
    pub fn new() -> Self {
        SystemClock(Instant::now())
    }
}

pub fn today() -> Option<Date> {
    Date::from_epoch_ns(u64::try_from(jiff::Timestamp::now().as_nanosecond()).unwrap_or(0))
}

impl WallClock for SystemClock {
    fn now_s(&self) -> f64 {
        self.0.elapsed().as_secs_f64()
    }

    fn wait_s(&self, duration_s: f64) {
        if let Ok(duration) = Duration::try_from_secs_f64(duration_s) {
            std::thread::sleep(duration);
        }
    }
}

pub fn with_machine<T>(
    then: impl FnOnce(&Registry, &[&dyn Kind], &Machine<'_>) -> Result<T, Failure>,
) -> Result<T, Failure> {
    let (registry, wall) = (registry(), SystemClock::new());
    let host = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    let task = std::env::var("SLURM_JOB_ID").map_or_else(|_| String::new(), |id| format!(" job {id}"));
    let name = format!("{} process {}{task}", host.trim(), std::process::id());
    let machine =
        Machine { name: &name, thread_s: &|| thread_s(&wall), peak_memory_bytes: &peak_memory_bytes };
    let kinds = mapper_validation::studies::kinds(&registry);
    let kinds: Vec<&dyn Kind> = kinds.iter().map(AsRef::as_ref).collect();
    then(&registry, &kinds, &machine)
}

pub fn with_fleet<T>(
    directory: &Path,
    jobs: Option<usize>,
    then: impl FnOnce(&Fleet, &dyn Kind, &Engine<'_>, &Machine<'_>) -> Result<T, FleetError>,
) -> Result<T, Failure> {
    with_machine(|registry, kinds, machine| {
        let fleet = Fleet::open(directory, &mapper_validation::studies::program(registry))?;
        let (kind, stop, progress) =
            (fleet.kind(kinds)?, interrupt::stop_flag()?, output_options::progress());
        let report = |done, of| progress.pieces(done, of);
        let result = then(&fleet, kind, &Engine { jobs, stop: &stop, on_progress: &report }, machine);
        progress.clear();
        Ok(result?)
    })
}

/// Processor time of this thread on Linux; elsewhere the elapsed time.
fn thread_s(wall: &SystemClock) -> f64 {
    let counted = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let ns = counted.and_then(|line| line.split(' ').next()?.parse::<f64>().ok());
    ns.map_or_else(|| wall.now_s(), |ns| ns * 1e-9)
}

/// Peak memory of this process; `None` except on Linux.
fn peak_memory_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? << 10)
}
