//! The work loop of nights, diagnoses, calibrations and fleets.

use mapper_numerics::parallel;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Number of cores that this process may use.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}

/// Settings of the work loop.
#[derive(Clone, Copy)]
pub struct Engine<'a> {
    /// Maximum number of pieces at a time; `None` for the number of cores.
    pub jobs: Option<usize>,
    /// Set by the caller to start no further piece.
    pub stop: &'a AtomicBool,
    /// Receives the number of finished pieces and the total, from the first second on.
    pub on_progress: &'a (dyn Fn(usize, usize) + Sync),
}

impl Engine<'_> {
    /// Number of pieces at a time, limited by their total.
    pub fn parallel_jobs(&self, pieces: usize) -> usize {
        self.jobs.unwrap_or_else(cores).clamp(1, pieces.max(1))
    }

    /// Applies `work` to every piece. Results are in the order of the pieces for any number of jobs. Concurrent pieces share the cores. After
    /// an error or a stop no further piece starts; pieces that did not start because of a stop are `None`.
    ///
    /// # Errors
    /// That of the first piece whose work fails.
    pub fn each<T: Sync, R: Send, E: Send>(
        &self,
        pieces: &[T],
        work: impl Fn(usize, &T) -> Result<R, E> + Sync,
    ) -> Result<Vec<Option<R>>, E> {
        let jobs = self.parallel_jobs(pieces.len());
        let threads = (cores() / jobs).max(1);
        let done = AtomicUsize::new(0);
        (self.on_progress)(0, pieces.len());
        parallel::try_map_on(jobs, pieces, |index, piece| {
            if self.stop.load(Ordering::Relaxed) {
                return Ok(None);
            }
            let result = parallel::with_threads(threads, || work(index, piece))?;
            (self.on_progress)(done.fetch_add(1, Ordering::Relaxed) + 1, pieces.len());
            Ok(Some(result))
        })
    }
}
