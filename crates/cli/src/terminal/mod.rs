//! Output for a terminal, a pipe or another program: progress during the work, and the results of a run.
//!
//! Progress goes to standard error and never into results: a bar on a terminal, a line per step in a pipe, JSON lines for
//! a program.

mod progress;
mod results_text;

pub use progress::{Progress, ProgressFormat};
pub use results_text::{DetailLevel, identified_text, results_text};
