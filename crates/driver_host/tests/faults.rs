//! Faults of a driver, with real processes and pipes: the host returns in bounded time, with an error that states the cause.
#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_core::{Backend, BackendError, RigMode, Setpoints};
use mapper_driver_host::{DEFAULT_TIMEOUTS, Driver, SearchPath, Timeouts};
use serde_json::Value;
use std::path::PathBuf;
use std::time::Duration;

const SETPOINTS: Setpoints = Setpoints {
    mode: RigMode::Running,
    p3_pa: 150e3,
    t3_k: 773.15,
    valve_opening_ratio: 0.7,
    oil_temperature_k: 323.15,
};

/// The timeouts of a run, but short ones for faults that reach them.
fn timeouts(fault: &str) -> Timeouts {
    let short = Duration::from_millis(300);
    match fault {
        "mute" | "deaf" => Timeouts { hello: short, ..DEFAULT_TIMEOUTS },
        "hangs" => Timeouts { call: short, ..DEFAULT_TIMEOUTS },
        _ => DEFAULT_TIMEOUTS,
    }
}

/// The driver of examples/misbehaving.rs under the name of its fault.
fn program(fault: &str) -> PathBuf {
    // target/debug/deps/faults-..., with target/debug/examples next to deps.
    let own = std::env::current_exe().unwrap();
    let built = own.parent().unwrap().parent().unwrap().join("examples/mapper-backend-misbehaving");
    assert!(built.is_file(), "{} is built with the tests", built.display());
    let directory = std::env::temp_dir().join(format!("mapper-host-faults-{}", std::process::id()));
    std::fs::create_dir_all(&directory).unwrap();
    let link = directory.join(format!("mapper-backend-{fault}"));
    let _ = std::os::unix::fs::symlink(built, &link);
    link
}

fn start(fault: &str) -> Result<Driver, BackendError> {
    Driver::start_program(&program(fault), fault, &Value::Null, timeouts(fault))
}

/// A driver that has measured for a second.
fn start_and_poll(fault: &str) -> Driver {
    let mut driver = start(fault).unwrap();
    driver.arm().unwrap();
    assert_eq!(driver.poll(1.0).unwrap().t_s.len(), 11);
    driver
}

#[test]
fn a_program_that_is_not_a_driver_is_refused_before_a_rig_exists() {
    for (fault, expected) in [
        ("mute", "did not answer `hello` within 0.3 s"),
        ("garbage", "text that begins with `Welc`"),
        ("too_large", "2147483647 bytes; at most 1048576"),
        ("half_a_frame", "the stream ended after 1 of 256 bytes"),
        ("dies_at_once", "no licence for this rig"),
        ("wrong_version", "version 2.99 of the protocol; this program uses 1.1"),
        ("wrong_magic", "another magic word"),
        ("wrong_name", "the name `another`"),
        ("unknown_channel", "no channel is called `T99`"),
        ("wrong_unit", "T2 in degC"),
        ("no_rate", "sample rate is 0 Hz"),
        ("deaf", "did not answer `hello`"),
    ] {
        let error = start(fault).err().unwrap_or_else(|| panic!("{fault} was accepted")).to_string();
        assert!(error.contains(expected), "{fault}: {error}");
    }
}

#[test]
fn an_armed_driver_that_exits_or_hangs_is_lost_in_bounded_time() {
    let mut gone = start_and_poll("exits_armed");
    assert!(matches!(gone.set(&SETPOINTS), Err(BackendError::Lost { .. })));
    // The state of the rig is unknown.
    assert!(matches!(gone.make_safe(), Err(BackendError::Lost { .. })));
    let mut hangs = start_and_poll("hangs");
    assert!(matches!(hangs.set(&SETPOINTS), Err(BackendError::Deadline { call: "set", .. })));
    assert!(matches!(hangs.make_safe(), Err(BackendError::Deadline { call: "make_safe", .. })));
    // The test's own driver would hang for ever: a real one has its lease.
    drop(hangs);
}

#[test]
fn invalid_samples_are_a_lost_rig_that_can_still_be_made_safe() {
    for (fault, expected) in [
        ("twice", "expected sample 21, received sample 11"),
        ("reordered", "expected sample 11, received sample 16"),
        ("backward", "a sample at"),
        ("no_numbers", "an invalid message"),
        ("flood", "more samples than were requested"),
    ] {
        let mut driver = start_and_poll(fault);
        driver.set(&SETPOINTS).unwrap();
        match driver.poll(2.0) {
            Err(BackendError::Lost { t_s, source }) => {
                assert!(source.to_string().contains(expected), "{fault}: {source}");
                assert!((1.0..=2.0).contains(&t_s), "{fault}: {t_s}");
            }
            other => panic!("{fault}: {other:?}"),
        }
        driver.make_safe().unwrap();
        driver.disarm().unwrap();
    }
}

#[test]
fn late_answers_are_discarded_and_a_refusal_is_reported() {
    let mut talks = start_and_poll("answers_twice");
    talks.set(&SETPOINTS).unwrap();
    assert_eq!(talks.poll(2.0).unwrap().t_s.len(), 10);
    let mut stuck = start_and_poll("not_safe");
    let error = stuck.make_safe().unwrap_err().to_string();
    assert!(error.contains("the valve does not answer"), "{error}");
}

/// A file with the right name that cannot be started is reported with a remedy, not as missing.
#[test]
fn a_file_that_cannot_be_started_is_reported_with_the_reason() {
    use std::os::unix::fs::PermissionsExt;
    let directory = std::env::temp_dir().join(format!("mapper-host-files-{}", std::process::id()));
    std::fs::create_dir_all(&directory).unwrap();
    let places = SearchPath { programs: vec![directory.clone()], sockets: None };
    for (name, text, mode, expected) in [
        ("locked", "#!/bin/sh\n", 0o644, "`chmod +x "),
        ("bare", "import sys\n", 0o755, "`#!/usr/bin/env python3`"),
        ("elsewhere", "#!/no/such/interpreter\n", 0o755, "the interpreter in its first line"),
    ] {
        let file = directory.join(format!("mapper-backend-{name}"));
        std::fs::write(&file, text).unwrap();
        std::fs::set_permissions(&file, std::fs::Permissions::from_mode(mode)).unwrap();
        let message = Driver::find(&places, name, &Value::Null, "", "").err().unwrap().to_string();
        assert!(message.contains(expected) && message.contains(file.to_str().unwrap()), "{name}: {message}");
    }
    std::fs::remove_dir_all(&directory).unwrap();
}

/// The message names the searched places and what to do, and a name from a campaign reaches no other directory.
#[test]
fn a_missing_driver_is_reported_with_the_searched_places() {
    let places = SearchPath { programs: vec!["/nowhere/at/all".into()], sockets: None };
    for name in ["opcuaa", "../../bin/sh"] {
        let error = Driver::find(&places, name, &Value::Null, "virtual_lab, replay", "").err().unwrap();
        let expected = error.to_string();
        assert!(
            expected.contains("/nowhere/at/all") && expected.contains("virtual_lab, replay"),
            "{expected}"
        );
    }
}
