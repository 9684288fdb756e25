//! A driver at a local socket, in real time: hosts come one after the other, and when one disconnects the rig becomes safe.
#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_core::{Backend, RigMode, Setpoints};
use mapper_driver_host::{DEFAULT_TIMEOUTS, Driver, Endpoint, SearchPath};
use notify::{RecommendedWatcher, RecursiveMode, Watcher};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

const PROGRAM: &str = env!("CARGO_BIN_EXE_mapper-backend-lab");
const SETPOINTS: Setpoints = Setpoints {
    mode: RigMode::Running,
    p3_pa: 150e3,
    t3_k: 773.15,
    valve_opening_ratio: 0.7,
    oil_temperature_k: 323.15,
};

/// A directory of files that the tests poll.
struct CommandFiles {
    directory: tempfile::TempDir,
    news: Receiver<notify::Result<notify::Event>>,
    _watcher: RecommendedWatcher,
}

impl CommandFiles {
    fn new() -> CommandFiles {
        let directory = tempfile::tempdir().unwrap();
        let (sender, news) = channel();
        let mut watcher = notify::recommended_watcher(sender).unwrap();
        watcher.watch(directory.path(), RecursiveMode::NonRecursive).unwrap();
        CommandFiles { directory, news, _watcher: watcher }
    }

    fn file(&self, name: &str) -> PathBuf {
        self.directory.path().join(name)
    }

    fn until(&self, reached: impl Fn() -> bool) {
        while !reached() {
            self.news.recv_timeout(Duration::from_secs(60)).expect("something happens").unwrap();
        }
    }

    /// The commands of a rig, as soon as they contain these words.
    fn commands(&self, name: &str, words: &str) -> String {
        let text = || std::fs::read_to_string(self.file(name)).unwrap_or_default();
        self.until(|| text().contains(words));
        text()
    }

    fn settings(&self, file: &str) -> Value {
        let campaign = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../campaigns/turbo_a.yaml");
        json!({"campaign": campaign, "real_time": true, "command_log": self.file(file)})
    }
}

/// A driver process that ends with the test.
struct Listening(Child);

impl Drop for Listening {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Listening {
    fn at(socket: &Path, scratch: &CommandFiles) -> Listening {
        let child = Command::new(PROGRAM).arg("--socket").arg(socket).spawn().unwrap();
        scratch.until(|| std::os::unix::net::UnixStream::connect(socket).is_ok());
        Listening(child)
    }
}

/// A host that connects as soon as the previous one has disconnected completely.
fn connect(places: &SearchPath, settings: &Value) -> Driver {
    loop {
        match Driver::find(places, "lab", settings, "", "") {
            Ok(driver) => return driver,
            Err(error) => assert!(error.to_string().contains("serves another host"), "{error}"),
        }
    }
}

#[test]
fn hosts_are_served_one_after_the_other_and_a_lost_host_leaves_a_safe_rig() {
    let scratch = CommandFiles::new();
    let socket = scratch.file("lab.socket");
    let mut listening = Listening::at(&socket, &scratch);
    let places = SearchPath { programs: Vec::new(), sockets: Some(scratch.directory.path().to_owned()) };
    assert_eq!(places.find("lab"), Some(Endpoint::Socket(socket.clone())));

    let mut first = connect(&places, &scratch.settings("first"));
    first.arm().unwrap();
    first.set(&SETPOINTS).unwrap();
    first.hold().unwrap();
    assert!(!first.poll(1.0).unwrap().t_s.is_empty());
    // A second host is refused before a rig exists.
    let refused =
        Driver::connect_socket(&socket, "lab", &scratch.settings("second"), DEFAULT_TIMEOUTS).err().unwrap();
    assert!(refused.to_string().contains("this driver serves another host"), "{refused}");
    // As if a runner is killed: the connection ends without a message. The rig runs down and is disarmed, and the next host is served.
    drop(first);
    let commands = scratch.commands("first", "disarm");
    let run_down: Vec<&str> = commands.lines().skip_while(|line| !line.contains("T3 293 K")).collect();
    assert!(
        commands.contains("hold") && run_down.len() > 3 && run_down[run_down.len() - 2].contains("make safe"),
        "{commands}"
    );

    let mut second = connect(&places, &scratch.settings("second"));
    second.arm().unwrap();
    second.set(&SETPOINTS).unwrap();
    assert!(!second.poll(1.0).unwrap().t_s.is_empty());

    // A signal ends the driver with its rig, and removes the socket.
    let pid = listening.0.id().to_string();
    assert!(Command::new("kill").args(["-s", "TERM", &pid]).status().unwrap().success());
    assert!(listening.0.wait().unwrap().success());
    assert!(scratch.commands("second", "disarm").contains("make safe"));
    assert!(!socket.exists());
    assert!(second.make_safe().is_err(), "the driver has gone, so that the safe state is unknown");
}

/// The socket of a killed driver is reported as such, and the next driver replaces it.
#[test]
fn a_socket_without_a_listener_is_reported_and_can_be_reused() {
    let scratch = CommandFiles::new();
    let socket = scratch.file("lab.socket");
    drop(Listening::at(&socket, &scratch));
    assert!(socket.exists());
    let places = SearchPath { programs: Vec::new(), sockets: Some(scratch.directory.path().to_owned()) };
    let refusal = Driver::find(&places, "lab", &Value::Null, "", "").err().unwrap().to_string();
    assert!(refusal.contains("no driver listens at the socket") && refusal.contains("--socket"), "{refusal}");
    let _again = Listening::at(&socket, &scratch);
    connect(&places, &scratch.settings("third"));
}
