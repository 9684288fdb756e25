//! Several sensors of one channel: detection of faulty sensors, and the fused reading for all evaluations.

pub mod element_fault;
pub(crate) mod element_judge;
pub mod fuse;
