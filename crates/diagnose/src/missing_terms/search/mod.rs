//! Search for missing terms: residual source term of each balance, and closed-form evidence of library terms.

pub mod columns;
pub mod evidence;
pub mod onset;
pub mod residual_source;
pub mod select;
