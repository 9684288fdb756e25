//! A backend that is put to the test.

use mapper_core::{Backend, BackendError, SampleBatch, Setpoints};

/// Nothing, or what a rule found, in words.
pub type Checked = Result<(), String>;

/// How a backend is made and driven.
pub struct Candidate<'a> {
    /// Its name, as it describes itself.
    pub name: &'a str,
    /// Makes it again, each time the same.
    pub make: &'a dyn Fn() -> Result<Box<dyn Backend>, BackendError>,
    /// Setpoints that it can follow.
    pub setpoints: Setpoints,
    /// Run time after which it has nothing more to give, s; `None` for a rig that goes on.
    pub lasts_s: Option<f64>,
}

impl Candidate<'_> {
    /// A backend that has not been armed.
    ///
    /// # Errors
    /// What the backend says, in words.
    pub fn new_one(&self) -> Result<Box<dyn Backend>, String> {
        (self.make)().map_err(|error| error.to_string())
    }

    /// A backend that is armed and has its first setpoints.
    ///
    /// # Errors
    /// What the backend says, in words.
    pub fn running(&self) -> Result<Box<dyn Backend>, String> {
        let mut rig = self.new_one()?;
        fine("arm", rig.arm())?;
        fine("set", rig.set(&self.setpoints))?;
        Ok(rig)
    }
}

/// An answer that has to be a good one.
pub(crate) fn fine<T>(call: &str, answer: Result<T, BackendError>) -> Result<T, String> {
    answer.map_err(|error| format!("`{call}` failed: {error}"))
}

/// An answer that has to be a refusal for the place in the life cycle.
pub(crate) fn out_of_order<T>(call: &str, answer: Result<T, BackendError>) -> Checked {
    match answer {
        Err(BackendError::OutOfOrder { .. }) => Ok(()),
        Err(error) => Err(format!("`{call}` out of its place gave another error: {error}")),
        Ok(_) => Err(format!("`{call}` out of its place was not refused")),
    }
}

/// First sequence number, times, and columns of a batch, to the bit.
type Bits = (u64, Vec<u64>, Vec<(String, Vec<u64>)>);

/// What a batch holds, to the bit: NaN is equal to NaN here.
pub(crate) fn bits(batch: &SampleBatch) -> Bits {
    let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    let columns = batch.columns.iter().map(|column| (column.channel.to_string(), bits(&column.values)));
    (batch.first_sequence, bits(&batch.t_s), columns.collect())
}
