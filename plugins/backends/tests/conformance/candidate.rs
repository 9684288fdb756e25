//! A backend that is put to the test.

use mapper_core::{Backend, BackendError, SampleBatch, Setpoints};

/// How a backend is made and driven.
pub struct Candidate {
    /// Its name, as it describes itself.
    pub name: &'static str,
    /// Makes it again, each time the same.
    pub make: fn() -> Box<dyn Backend>,
    /// Setpoints that it can follow.
    pub setpoints: Setpoints,
    /// Run time after which it has nothing more to give; `None` for a rig that goes on.
    pub lasts_s: Option<f64>,
}

impl Candidate {
    /// A backend that is armed and has its first setpoints.
    pub fn running(&self) -> Box<dyn Backend> {
        let mut rig = (self.make)();
        rig.arm().unwrap();
        rig.set(&self.setpoints).unwrap();
        rig
    }
}

/// Asserts that a call was refused for its place in the life cycle.
#[track_caller]
pub fn out_of_order<T: std::fmt::Debug>(result: Result<T, BackendError>) {
    assert!(matches!(result, Err(BackendError::OutOfOrder { .. })), "{result:?}");
}

/// First sequence number, times, and columns of a batch, to the bit.
type Bits = (u64, Vec<u64>, Vec<(String, Vec<u64>)>);

/// What a batch holds, to the bit: NaN is equal to NaN here.
pub fn bits(batch: &SampleBatch) -> Bits {
    let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    let columns = batch.columns.iter().map(|column| (column.channel.to_string(), bits(&column.values)));
    (batch.first_sequence, bits(&batch.t_s), columns.collect())
}
