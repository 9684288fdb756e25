//! Stops while the rig is being connected.

use crate::run::plan;
use mapper_backends::virtual_lab::{LabSettings, VirtualLab};
use mapper_core::{
    Backend, BackendError, Event, RigDescription, RunEnding, SampleBatch, Setpoints, UnpacedClock,
};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::Model;
use mapper_runner::{ObserverError, PlanSteps, Protection, RunObserver, Runner};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

/// A rig that is connected only after a stop was answered.
struct Connects<'a> {
    lab: VirtualLab,
    stop: &'a AtomicBool,
    answered: Mutex<Receiver<()>>,
    calls: Vec<&'static str>,
}

impl Backend for Connects<'_> {
    fn describe(&self) -> RigDescription {
        self.lab.describe()
    }
    fn arm(&mut self) -> Result<(), BackendError> {
        self.stop.store(true, Ordering::Relaxed);
        // Without the answer the test fails instead of waiting for ever.
        let answer = self.answered.lock().unwrap().recv_timeout(Duration::from_secs(20));
        self.calls.push(if answer.is_ok() { "armed after the answer" } else { "armed without an answer" });
        self.lab.arm()
    }
    fn set(&mut self, setpoints: &Setpoints) -> Result<(), BackendError> {
        self.calls.push("set");
        self.lab.set(setpoints)
    }
    fn poll(&mut self, until_s: f64) -> Result<SampleBatch, BackendError> {
        self.lab.poll(until_s)
    }
    fn make_safe(&mut self) -> Result<(), BackendError> {
        self.calls.push("made safe");
        self.lab.make_safe()
    }
    fn disarm(&mut self) -> Result<(), BackendError> {
        self.calls.push("disarmed");
        self.lab.disarm()
    }
}

/// Signals the first event to a rig; may fail to write it.
struct Answers {
    sender: Sender<()>,
    fails: bool,
}

impl RunObserver for Answers {
    fn on_event(&mut self, _: &Event) -> Result<(), ObserverError> {
        // Later events have no receiver.
        let _ = self.sender.send(());
        if self.fails { Err(ObserverError::new(std::io::Error::other("the disk is full"))) } else { Ok(()) }
    }
}

/// A stop while the rig is being connected is answered at once, even if the answer cannot be written; the safe command is the only one.
#[test]
fn a_stop_while_the_rig_is_connected_is_answered_before_it_is_armed() {
    for (gentle, fails) in [(false, false), (true, false), (false, true)] {
        let (stop, never) = (AtomicBool::new(false), AtomicBool::new(false));
        let (sender, answered) = channel();
        let lab = VirtualLab::new(LabSettings::ideal(Model::nominal(), BoundaryConditions::default()));
        let mut rig = Connects { lab, stop: &stop, answered: Mutex::new(answered), calls: Vec::new() };
        let plan = plan();
        let end = Runner {
            steps: &mut PlanSteps::new(&plan),
            backend: &mut rig,
            clock: &mut UnpacedClock,
            guards: Vec::new(),
            observer: &mut Answers { sender, fails },
            speed: None,
            stop: if gentle { &never } else { &stop },
        }
        .run_under(&Protection {
            stop_after_step: if gentle { &stop } else { &never },
            ..Protection::default()
        });
        let ended = if fails { end.is_err() } else { end.unwrap() == RunEnding::Interrupted { t_s: 0.0 } };
        assert!(ended, "gentle {gentle}, fails {fails}");
        assert_eq!(rig.calls, ["armed after the answer", "made safe", "disarmed"]);
    }
}
