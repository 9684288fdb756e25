//! Whatever a driver does, the host comes back in bounded time, with an error that names the cause. Real processes and pipes.
#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_core::{Backend, BackendError, RigMode, Setpoints};
use mapper_driver_host::{Driver, PATIENCE, Patience, Places};
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

/// As in a run, but for what is waited out.
fn patience(fault: &str) -> Patience {
    let short = Duration::from_millis(300);
    match fault {
        "mute" | "deaf" => Patience { hello: short, ..PATIENCE },
        "hangs" => Patience { call: short, ..PATIENCE },
        _ => PATIENCE,
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
    Driver::of_program(&program(fault), fault, &Value::Null, patience(fault))
}

/// A driver that has measured for a second.
fn running(fault: &str) -> Driver {
    let mut driver = start(fault).unwrap();
    driver.arm().unwrap();
    assert_eq!(driver.poll(1.0).unwrap().t_s.len(), 11);
    driver
}

#[test]
fn a_program_that_is_not_a_driver_is_refused_before_a_rig_exists() {
    for (fault, words) in [
        ("mute", "did not answer `hello` within 0.3 s"),
        ("garbage", "text that begins with `Welc` where frames belong"),
        ("too_large", "2147483647 bytes; at most 1048576"),
        ("half_a_frame", "the stream ended after 1 of 256 bytes"),
        ("dies_at_once", "no licence for this rig"),
        ("wrong_version", "version 2.99 of the protocol; this program speaks 1.1"),
        ("wrong_magic", "begins with another word"),
        ("wrong_name", "calls itself `another`"),
        ("unknown_channel", "no channel is called `T99`"),
        ("wrong_unit", "T2 in degC"),
        ("no_rate", "sample rate is 0 Hz"),
        ("deaf", "did not answer `hello`"),
    ] {
        let error = start(fault).err().unwrap_or_else(|| panic!("{fault} was accepted")).to_string();
        assert!(error.contains(words), "{fault}: {error}");
    }
}

#[test]
fn a_driver_that_ends_or_hangs_while_it_is_armed_is_lost_in_bounded_time() {
    let mut gone = running("exits_armed");
    assert!(matches!(gone.set(&SETPOINTS), Err(BackendError::Lost { .. })));
    // The state of the rig is unknown.
    assert!(matches!(gone.make_safe(), Err(BackendError::Lost { .. })));
    let mut hangs = running("hangs");
    assert!(matches!(hangs.set(&SETPOINTS), Err(BackendError::Deadline { call: "set", .. })));
    assert!(matches!(hangs.make_safe(), Err(BackendError::Deadline { call: "make_safe", .. })));
    // The test's own driver would hang for ever: a real one has its lease.
    drop(hangs);
}

#[test]
fn samples_that_cannot_be_are_the_loss_of_the_rig_which_can_still_be_made_safe() {
    for (fault, words) in [
        ("twice", "sample 21 was expected and sample 11 came"),
        ("reordered", "sample 11 was expected and sample 16 came"),
        ("backward", "a sample at"),
        ("no_numbers", "sent what no driver sends"),
        ("flood", "more samples than were requested"),
    ] {
        let mut driver = running(fault);
        driver.set(&SETPOINTS).unwrap();
        match driver.poll(2.0) {
            Err(BackendError::Lost { t_s, source }) => {
                assert!(source.to_string().contains(words), "{fault}: {source}");
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
    let mut talks = running("answers_twice");
    talks.set(&SETPOINTS).unwrap();
    assert_eq!(talks.poll(2.0).unwrap().t_s.len(), 10);
    let mut stuck = running("not_safe");
    let error = stuck.make_safe().unwrap_err().to_string();
    assert!(error.contains("the valve does not answer"), "{error}");
}

/// A file that has the name and cannot be started is reported as such, with what to do, not as missing.
#[test]
fn a_file_that_cannot_be_started_is_reported_with_the_reason() {
    use std::os::unix::fs::PermissionsExt;
    let directory = std::env::temp_dir().join(format!("mapper-host-files-{}", std::process::id()));
    std::fs::create_dir_all(&directory).unwrap();
    let places = Places { programs: vec![directory.clone()], sockets: None };
    for (name, text, mode, words) in [
        ("locked", "#!/bin/sh\n", 0o644, "is there, but may not be executed; `chmod +x "),
        ("bare", "import sys\n", 0o755, "a script begins with its interpreter"),
        ("elsewhere", "#!/no/such/interpreter\n", 0o755, "look at the interpreter in its first line"),
    ] {
        let file = directory.join(format!("mapper-backend-{name}"));
        std::fs::write(&file, text).unwrap();
        std::fs::set_permissions(&file, std::fs::Permissions::from_mode(mode)).unwrap();
        let message = Driver::find(&places, name, &Value::Null, "", "").err().unwrap().to_string();
        assert!(message.contains(words) && message.contains(file.to_str().unwrap()), "{name}: {message}");
    }
    std::fs::remove_dir_all(&directory).unwrap();
}

/// The message names the searched places and what to do, and a name from a campaign reaches no other directory.
#[test]
fn a_missing_driver_is_reported_with_the_searched_places() {
    let places = Places { programs: vec!["/nowhere/at/all".into()], sockets: None };
    for name in ["opcuaa", "../../bin/sh"] {
        let error = Driver::find(&places, name, &Value::Null, "virtual_lab, replay", "").err().unwrap();
        let words = error.to_string();
        assert!(words.contains("/nowhere/at/all") && words.contains("virtual_lab, replay"), "{words}");
    }
}
