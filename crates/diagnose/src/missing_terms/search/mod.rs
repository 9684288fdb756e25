//! Search for missing terms: residual source term of each balance, and closed-form evidence of library terms.

pub mod columns;
pub(crate) mod evidence;
pub(crate) mod onset;
pub mod residual_source;
pub(crate) mod select;
