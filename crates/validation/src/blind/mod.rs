//! The check of the gap diagnosis on withheld data: draws cases on the virtual lab, seals their causes, scores diagnoses.
//!
//! [`make`] writes recordings and sealed answers, [`score`](scoring::score::score) opens them. The diagnosis itself runs separately and
//! gets only the recordings. The causes reserved as "outside" are defined here and are not part of the catalogue.

pub mod calibration;
mod cases;
mod error;
mod make_cases;
mod outside;
pub mod scoring;
mod seal;
mod virtual_runs;

pub use calibration::no_cause_study::visibility;
pub use cases::case::{Case, Draw, SIGMA_RANGE};
pub use cases::cause::Cause;
pub use cases::equations::Laboratory;
pub use cases::kind::CaseKind;
pub use cases::stored_case::StoredCase;
pub use cases::strength::SignatureMeter;
pub use cases::truth::{Truth, TruthPoint};
pub use error::BlindError;
pub use make_cases::{CreatedCases, draw_cases, make, record, seal};
pub use outside::{OutsideUse, outside_kinds};
pub use scoring::interval::{Share, clopper_pearson_95};
pub use seal::{ANSWERS_NAME, MANIFEST_NAME, Manifest};
