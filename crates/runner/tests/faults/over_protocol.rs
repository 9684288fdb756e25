//! The same faults with the rig as a driver: a separate program, connected by pipes.

use super::faulty_driver::{ExpectedEnd, PROTOCOL_FAULTS};
use super::{default_guards, run_on};
use mapper_core::{EventKind, RunEnding};
use mapper_driver_host::{DEFAULT_TIMEOUTS, Driver};

#[test]
fn every_fault_over_the_protocol_ends_safe_or_is_reported_as_unsafe() {
    // target/debug/deps/run-..., with target/debug/examples next to deps.
    let own = std::env::current_exe().unwrap();
    let program = own.parent().unwrap().parent().unwrap().join("examples/mapper-backend-faulty");
    assert!(program.is_file(), "{} is built with the tests", program.display());
    for (place, (begin_s, fault, ends)) in PROTOCOL_FAULTS.iter().enumerate() {
        let mut driver = Driver::start_program(&program, "faulty", &place.into(), DEFAULT_TIMEOUTS).unwrap();
        let (end, notebook) = run_on(&mut driver, &default_guards());
        let at = |kind| notebook.events.iter().position(|seen| *seen == kind);
        match (ends, end) {
            (ExpectedEnd::Trips(words, at_most_s), Ok(RunEnding::Tripped(trip))) => {
                assert!(trip.reason.contains(words), "{fault:?}: {}", trip.reason);
                assert!((begin_s - 1.0..=*at_most_s).contains(&trip.t_s), "{fault:?}: at {} s", trip.t_s);
                let (tripped, safe) = (at(EventKind::GuardTripped), at(EventKind::SafeState));
                assert!(tripped.is_some() && tripped < safe, "{fault:?}: {:?}", notebook.events);
            }
            (ExpectedEnd::Fails(words) | ExpectedEnd::Lost(words), Err(error)) => {
                let lost = matches!(ends, ExpectedEnd::Lost(_));
                assert!(error.to_string().contains(words), "{fault:?}: {error}");
                assert_eq!(error.leaves_rig_state_unknown(), lost, "{fault:?}: {error}");
                assert!(at(EventKind::SafeState).is_some(), "{fault:?}: {:?}", notebook.events);
            }
            (ExpectedEnd::InDoubt(words), Err(error)) => {
                assert!(
                    error.to_string().contains(words) && error.leaves_rig_state_unknown(),
                    "{fault:?}: {error}"
                );
                assert!(at(EventKind::Latched).is_some(), "{fault:?}: {:?}", notebook.events);
            }
            (_, end) => panic!("{fault:?}: {end:?}"),
        }
    }
}
