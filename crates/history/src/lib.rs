//! Stores the results of nightly runs and the catalogue of run folders in one SQLite file ([`History`]), and finds changes between nights.
//!
//! Nights are for developers, who see the night after a change of the program ([`compare`]). The file has one row for each run and one for each point. A night is written in one transaction, so that a killed
//! process leaves the history unchanged; concurrent processes wait for each other.
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod catalogue;
mod compare;
mod night;
mod store;

pub use catalogue::{CatalogueFilter, CataloguePage, CataloguedRun, RunSummary};
pub use compare::{Comparison, MetricOutsideBand, PointsOutsideBand, Shift, compare};
pub use mapper_numerics::statistics::median;
pub use night::{Band, Floor, Metric, Night, PointQuantity, PointRow, RunKey, RunRow};
pub use store::{Filter, History, HistoryError, ListedRun, StoredNight};
