//! The lab as a rig to rehearse on: in real time, and with a log of its commands to check them afterwards.

use mapper_core::{Backend, BackendError, RigDescription, RigMode, SampleBatch, Setpoints};
use std::fs::File;
use std::io::Write;

/// The lab behind the settings of the driver.
pub(crate) struct RehearsalRig {
    pub(crate) lab: Box<dyn Backend>,
    /// Whether its samples arrive unrequested, in wall time, as those of a physical rig.
    pub(crate) real_time: bool,
    /// File with a line for each command.
    pub(crate) log: Option<File>,
    /// Run time of the last poll, s.
    pub(crate) now_s: f64,
}

impl RehearsalRig {
    fn write(&mut self, text: &str) {
        if let Some(file) = &mut self.log {
            // A full disk must not block the rig's setpoints.
            let _ = writeln!(file, "{:.1} s: {text}", self.now_s);
        }
    }
}

impl Backend for RehearsalRig {
    fn describe(&self) -> RigDescription {
        let lab = self.lab.describe();
        RigDescription { simulated_time: lab.simulated_time && !self.real_time, ..lab }
    }

    fn arm(&mut self) -> Result<(), BackendError> {
        self.now_s = 0.0;
        self.write("arm");
        self.lab.arm()
    }

    fn set(&mut self, setpoints: &Setpoints) -> Result<(), BackendError> {
        let Setpoints { mode, p3_pa, t3_k, valve_opening_ratio, .. } = setpoints;
        let air = if *mode == RigMode::Running { "on" } else { "off" };
        self.write(&format!(
            "set air {air}, P3 {p3_pa:.0} Pa, T3 {t3_k:.0} K, valve {valve_opening_ratio:.2}"
        ));
        self.lab.set(setpoints)
    }

    fn poll(&mut self, until_s: f64) -> Result<SampleBatch, BackendError> {
        self.now_s = self.now_s.max(until_s);
        self.lab.poll(until_s)
    }

    fn hold(&mut self) -> Result<(), BackendError> {
        self.write("hold");
        self.lab.hold()
    }

    fn make_safe(&mut self) -> Result<(), BackendError> {
        self.write("make safe");
        self.lab.make_safe()
    }

    fn disarm(&mut self) -> Result<(), BackendError> {
        self.write("disarm");
        self.lab.disarm()
    }
}
