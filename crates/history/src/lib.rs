//! The history of nightly runs: one row a run, one row a point, in one SQLite file; and whether tonight's figures
//! lie in the band of the nights before; and, over the machines of a production, what they have in common.
//!
//! A night is written in one transaction, so that a process killed in mid-write leaves the history as it was. Two
//! processes may write at once: the second waits for the first.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod band;
mod compare;
mod error;
mod metric;
mod night;
mod outlier;
mod production;
mod quantity;
mod store;

pub use band::{Band, Floor};
pub use compare::{Comparison, Moved, MovedPoints, Shift, compare};
pub use error::HistoryError;
pub use mapper_numerics::statistics::median;
pub use metric::Metric;
pub use night::{Night, PointRow, RunKey, RunRow};
pub use outlier::{MACHINES_FOR_OUTLIERS, Outlier, Sign};
pub use production::{Drift, Place, Production, Spread, Stand, productions};
pub use quantity::PointQuantity;
pub use store::{DEFAULT_NIGHTS, Filter, History, ListedRun, ObservedPoint, StoredNight};
