//! Mean readings over segments of a step, for the comparison of a recording with the model.

pub mod block;
pub mod mean_reading;
pub mod schedule;
pub mod time_table;
