//! The same faults with the rig as a driver: a separate program, connected by pipes.

use super::behind::{Ends, OVER_THE_PROTOCOL};
use super::{night_on, usual};
use mapper_core::EventKind;
use mapper_driver_host::{Driver, PATIENCE};
use mapper_runner::RunEnd;

#[test]
fn every_fault_over_the_protocol_ends_the_run_in_the_safe_state_or_says_that_it_does_not() {
    // target/debug/deps/run-..., with target/debug/examples next to deps.
    let own = std::env::current_exe().unwrap();
    let program = own.parent().unwrap().parent().unwrap().join("examples/mapper-backend-faulty");
    assert!(program.is_file(), "{} is built with the tests", program.display());
    for (place, (begin_s, fault, ends)) in OVER_THE_PROTOCOL.iter().enumerate() {
        let mut driver = Driver::of_program(&program, "faulty", &place.into(), PATIENCE).unwrap();
        let (end, notebook) = night_on(&mut driver, &usual());
        let at = |kind| notebook.events.iter().position(|seen| *seen == kind);
        match (ends, end) {
            (Ends::Trips(words, at_most_s), Ok(RunEnd::Tripped(trip))) => {
                assert!(trip.reason.contains(words), "{fault:?}: {}", trip.reason);
                assert!((begin_s - 1.0..=*at_most_s).contains(&trip.t_s), "{fault:?}: at {} s", trip.t_s);
                let (tripped, safe) = (at(EventKind::GuardTripped), at(EventKind::SafeState));
                assert!(tripped.is_some() && tripped < safe, "{fault:?}: {:?}", notebook.events);
            }
            (Ends::Fails(words) | Ends::Lost(words), Err(error)) => {
                let lost = matches!(ends, Ends::Lost(_));
                assert!(error.to_string().contains(words), "{fault:?}: {error}");
                assert_eq!(error.leaves_doubt(), lost, "{fault:?}: {error}");
                assert!(at(EventKind::SafeState).is_some(), "{fault:?}: {:?}", notebook.events);
            }
            (Ends::InDoubt(words), Err(error)) => {
                assert!(error.to_string().contains(words) && error.leaves_doubt(), "{fault:?}: {error}");
                assert!(at(EventKind::Latched).is_some(), "{fault:?}: {:?}", notebook.events);
            }
            (_, end) => panic!("{fault:?}: {end:?}"),
        }
    }
}
