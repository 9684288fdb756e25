//! Opens fleet directories, with this computer as the worker.

use crate::environment::{SystemClock, registry};
use crate::interrupt;
use crate::output::failure::Failure;
use crate::output::output_options;
use mapper_core::WallClock;
use mapper_fleet::{Engine, Fleet, FleetError, Kind, Machine};
use mapper_session::Registry;
use std::path::Path;

/// Calls `then` with all kinds of studies and this computer.
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

/// Calls `then` with an opened fleet directory, and shows progress.
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
