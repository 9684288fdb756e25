//! The private module `mapper._mapper`: the crate `mapper` for the Python package.
//!
//! Every function here does what one command does, and returns the same JSON. The classes that users see are written in Python
//! (`python/mapper`). No function holds the interpreter's lock while it works.

mod attended;
mod campaign;
mod error;
mod identified;
mod map;
mod plugins;
mod recording;
mod run;

use pyo3::pymodule;

/// Campaigns, recordings, identification and maps of `mapper`.
#[pymodule]
mod _mapper {
    #[pymodule_export]
    use crate::campaign::{Campaign, write_template};
    #[pymodule_export]
    use crate::error::{CampaignError, IdentificationError, MapperError, RecordingError};
    #[pymodule_export]
    use crate::identified::{Identified, correct, diagnose, identify};
    #[pymodule_export]
    use crate::map::{Map, map_formats};
    #[pymodule_export]
    use crate::recording::Recording;
    #[pymodule_export]
    use crate::run::{Outcome, run_campaign};
}
