//! A rig that logs its commands, to check them after a rehearsal.

use mapper_core::{Backend, BackendError, RigDescription, RigMode, SampleBatch, Setpoints};
use std::fs::File;
use std::io::Write;

/// Another backend, with a log file.
pub(crate) struct CommandLog {
    inner: Box<dyn Backend>,
    file: File,
    now_s: f64,
}

impl CommandLog {
    /// Logs the commands of `inner` into `file`.
    pub(crate) fn new(inner: Box<dyn Backend>, file: File) -> Self {
        CommandLog { inner, file, now_s: 0.0 }
    }

    fn write(&mut self, text: &str) {
        // A full disk must not block the rig's setpoints.
        let _ = writeln!(self.file, "{:.1} s: {text}", self.now_s);
    }
}

impl Backend for CommandLog {
    fn describe(&self) -> RigDescription {
        self.inner.describe()
    }

    fn arm(&mut self) -> Result<(), BackendError> {
        self.now_s = 0.0;
        self.write("arm");
        self.inner.arm()
    }

    fn set(&mut self, setpoints: &Setpoints) -> Result<(), BackendError> {
        let Setpoints { mode, p3_pa, t3_k, valve_opening_ratio, .. } = setpoints;
        let air = if *mode == RigMode::Running { "on" } else { "off" };
        self.write(&format!(
            "set air {air}, P3 {p3_pa:.0} Pa, T3 {t3_k:.0} K, valve {valve_opening_ratio:.2}"
        ));
        self.inner.set(setpoints)
    }

    fn poll(&mut self, until_s: f64) -> Result<SampleBatch, BackendError> {
        self.now_s = self.now_s.max(until_s);
        self.inner.poll(until_s)
    }

    fn hold(&mut self) -> Result<(), BackendError> {
        self.write("hold");
        self.inner.hold()
    }

    fn make_safe(&mut self) -> Result<(), BackendError> {
        self.write("make safe");
        self.inner.make_safe()
    }

    fn disarm(&mut self) -> Result<(), BackendError> {
        self.write("disarm");
        self.inner.disarm()
    }
}
