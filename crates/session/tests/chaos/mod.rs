//! Deterministic simulation of whole runs on the virtual lab: a seed decides campaign, time, faults, stops and kills; a checker compares what the
//! program states and leaves behind with what happened. `MAPPER_CHAOS_SEED` repeats one seed, `MAPPER_CHAOS_SECONDS` lasts longer.

mod check;
#[path = "../../../runner/tests/faults/faulty_backend.rs"]
#[allow(dead_code, reason = "shared with the runner's tests")]
mod faulty_backend;
mod scenario;
mod simulation;
mod world;

use simulation::Simulator;
use std::collections::BTreeMap;
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Seeds of an ordinary test run.
const SEEDS: std::ops::Range<u64> = 0..24;

fn from_environment(name: &str) -> Option<u64> {
    std::env::var(name)
        .ok()
        .map(|text| text.parse().unwrap_or_else(|_| panic!("{name}={text} is not a number")))
}

#[test]
fn no_fault_and_no_kill_violates_an_invariant() {
    let usual = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !simulation::is_on_demand(panic.payload()) {
            usual(panic);
        }
    }));
    let simulator = Simulator::new();
    let seed = from_environment("MAPPER_CHAOS_SEED");
    let seconds = from_environment("MAPPER_CHAOS_SECONDS");
    let (seeds, end) = match (seed, seconds) {
        (first, Some(seconds)) => {
            (first.unwrap_or(0)..u64::MAX, Some(Instant::now() + Duration::from_secs(seconds)))
        }
        (Some(seed), None) => (seed..seed + 1, None),
        (None, None) => (SEEDS, None),
    };
    let begun = Instant::now();
    let (next, total) = (Mutex::new(seeds), Mutex::new(Total::default()));
    let work = || {
        while end.is_none_or(|end| Instant::now() < end) {
            let Some(seed) = next.lock().unwrap().next() else { break };
            let outcome = simulator.simulate(seed);
            let mut total = total.lock().unwrap();
            total.kills += outcome.kills;
            outcome.ends.into_iter().for_each(|end| *total.ends.entry(end).or_default() += 1);
            if let Some(violation) = outcome.violation {
                eprintln!("seed {seed}: {violation}");
                total.violations.push(seed);
            }
        }
    };
    std::thread::scope(|scope| {
        (0..if seconds.is_some() { 2 } else { 1 }).for_each(|_| drop(scope.spawn(work)))
    });
    let Total { ends, kills, violations } = total.into_inner().unwrap();
    let runs: usize = ends.values().sum();
    eprintln!("{runs} runs, {kills} of them killed, in {:.0} s: {ends:#?}", begun.elapsed().as_secs_f64());
    assert!(violations.is_empty(), "repeat with MAPPER_CHAOS_SEED=, one of {violations:?}");
}

#[derive(Default)]
struct Total {
    /// Runs by their end.
    ends: BTreeMap<String, usize>,
    kills: usize,
    /// Seeds.
    violations: Vec<u64>,
}
