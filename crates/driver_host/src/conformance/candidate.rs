//! A backend under test.

use mapper_core::{Backend, BackendError, SampleBatch, Setpoints};

/// Success, or the finding of a rule.
pub type CheckResult = Result<(), String>;

/// Creates and drives the backend under test.
pub struct Candidate<'a> {
    /// Its name, from its description.
    pub name: &'a str,
    /// Creates a fresh instance, the same each time.
    pub make: &'a dyn Fn() -> Result<Box<dyn Backend>, BackendError>,
    /// Setpoints that the backend can follow.
    pub setpoints: Setpoints,
    /// Run time at which its data end, s; `None` for a rig that runs without limit.
    pub duration_s: Option<f64>,
}

impl Candidate<'_> {
    /// An unarmed backend.
    ///
    /// # Errors
    /// The backend's error message.
    pub fn create(&self) -> Result<Box<dyn Backend>, String> {
        (self.make)().map_err(|error| error.to_string())
    }

    /// An armed backend with its first setpoints.
    ///
    /// # Errors
    /// The backend's error message.
    pub fn create_running(&self) -> Result<Box<dyn Backend>, String> {
        let mut rig = self.create()?;
        require_success("arm", rig.arm())?;
        require_success("set", rig.set(&self.setpoints))?;
        Ok(rig)
    }
}

pub(crate) fn require_success<T>(call: &str, answer: Result<T, BackendError>) -> Result<T, String> {
    answer.map_err(|error| format!("`{call}` failed: {error}"))
}

/// Requires a refusal because the call is out of order in the life cycle.
pub(crate) fn require_out_of_order<T>(call: &str, answer: Result<T, BackendError>) -> CheckResult {
    match answer {
        Err(BackendError::OutOfOrder { .. }) => Ok(()),
        Err(error) => Err(format!("`{call}` in the wrong state returned another error: {error}")),
        Ok(_) => Err(format!("`{call}` in the wrong state was not refused")),
    }
}

/// First sequence number, times, and columns of a batch as bits.
type Bits = (u64, Vec<u64>, Vec<(String, Vec<u64>)>);

/// The content of a batch as bits: NaN equals NaN here.
pub(crate) fn bits(batch: &SampleBatch) -> Bits {
    let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    let columns = batch.columns.iter().map(|column| (column.channel.to_string(), bits(&column.values)));
    (batch.first_sequence, bits(&batch.t_s), columns.collect())
}
