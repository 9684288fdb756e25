//! The check of the gap diagnosis on withheld data: draws cases on the virtual lab, seals their causes, scores diagnoses.
//!
//! [`make`] writes recordings and sealed answers, [`score`](score::score) opens them. What diagnoses is not this crate's
//! business: it sees recordings alone. The causes reserved as "outside" live here and are not part of the catalogue.

pub mod calibrate;
mod case;
mod cause;
mod error;
mod interval;
mod keep;
mod kind;
mod lab;
mod laboratory;
mod logistic;
mod make;
mod outside;
pub mod reliability;
mod ruler;
pub mod score;
mod score_text;
mod seal;
mod steps;
mod stored;
mod strength;
mod truth;

pub use case::{Case, Draw, SIGMA_RANGE};
pub use cause::Cause;
pub use error::BlindError;
pub use interval::{Share, clopper_pearson_95};
pub use kind::{CaseKind, UnknownKind};
pub use laboratory::{Laboratory, UnknownLaboratory};
pub use make::{Made, drawn, make, record, seal};
pub use outside::{OutsideUse, outside_kinds};
pub use ruler::study_without_causes;
pub use seal::{ANSWERS_NAME, MANIFEST_NAME, Manifest};
pub use stored::StoredCase;
pub use strength::Ruler;
pub use truth::{Truth, TruthPoint};
