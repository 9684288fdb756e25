//! A simulated rig that behaves like a physical one: its samples arrive unrequested, in wall time.

use mapper_core::{Backend, BackendError, RigDescription, SampleBatch, Setpoints};

/// Another backend, in real time.
pub(crate) struct RealTime(pub Box<dyn Backend>);

impl Backend for RealTime {
    fn describe(&self) -> RigDescription {
        RigDescription { simulated_time: false, ..self.0.describe() }
    }

    fn arm(&mut self) -> Result<(), BackendError> {
        self.0.arm()
    }

    fn set(&mut self, setpoints: &Setpoints) -> Result<(), BackendError> {
        self.0.set(setpoints)
    }

    fn poll(&mut self, until_s: f64) -> Result<SampleBatch, BackendError> {
        self.0.poll(until_s)
    }

    fn hold(&mut self) -> Result<(), BackendError> {
        self.0.hold()
    }

    fn make_safe(&mut self) -> Result<(), BackendError> {
        self.0.make_safe()
    }

    fn disarm(&mut self) -> Result<(), BackendError> {
        self.0.disarm()
    }
}
