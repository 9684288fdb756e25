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
mod virtual_runs;

pub use crate::blind::cases::CaseKind;
pub use crate::blind::cases::Cause;
pub use crate::blind::cases::Laboratory;
pub use crate::blind::cases::SignatureMeter;
pub use crate::blind::cases::StoredCase;
pub use crate::blind::cases::{Case, Draw, SIGMA_RANGE};
pub use crate::blind::cases::{Truth, TruthPoint};
pub use crate::blind::make_cases::{ANSWERS_NAME, MANIFEST_NAME, Manifest};
pub use calibration::visibility;
pub use error::BlindError;
pub use make_cases::{CreatedCases, draw_cases, make, record, seal};
pub use outside::{OutsideUse, outside_kinds};
pub use scoring::reliability::{Share, clopper_pearson_95};
