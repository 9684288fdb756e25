//! Gap diagnosis without steps: which cause explains the judged channels of a side driven by its measured neighbours.

mod compressor;
mod denoise;
mod detectable;
mod diagnose;
mod diagnosis;
mod fit;
mod held_out;
mod noise;
mod phases;
mod search;
mod side;
mod turbine;

pub use diagnose::{Ask, diagnose};
pub use diagnosis::{Beyond, Cause, Course, Diagnosis, HeldOut, NotAsked, Phase, Unknown, Word};
pub use side::{NoSide, Which};
