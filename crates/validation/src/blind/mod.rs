//! The check of the gap diagnosis on withheld data: draws cases on the virtual lab, seals their causes, scores diagnoses.
//!
//! [`make`] writes recordings and sealed answers, [`score`](score::score) opens them. The diagnosis itself runs separately and
//! gets only the recordings. The causes reserved as "outside" are defined here and are not part of the catalogue.

pub mod calibration;
mod cases;
mod make_cases;
mod outside;
pub mod reliability;
pub mod score;
mod virtual_runs;

pub use crate::blind::cases::{
    Case, CaseKind, Cause, Draw, Laboratory, SIGMA_RANGE, SignatureMeter, StoredCase, Truth, TruthPoint,
};
pub use crate::blind::make_cases::{ANSWERS_NAME, MANIFEST_NAME, Manifest};
pub use cases::BlindError;
pub use make_cases::{CreatedCases, Planted, draw_cases, make, plant, record, seal};
pub use outside::{OutsideUse, outside_kinds};
pub use reliability::{Share, clopper_pearson_95};
