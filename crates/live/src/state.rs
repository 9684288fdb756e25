//! The state shown by a browser, with a size limit for any run.

use mapper_campaign::campaign::DisplayUnits;
use mapper_report::page::{LiveMap, LivePoint, Planned};
use serde::Serialize;
use std::collections::VecDeque;

/// Number of stored rows of readings, one per second of rig time.
pub(crate) const TRACE_ROWS: usize = 300;
/// Maximum number of stored events; the latest are kept.
pub(crate) const MAX_EVENTS: usize = 200;
/// Maximum number of stored points, more than a night produces.
pub(crate) const MAX_POINTS: usize = 2000;

#[derive(Debug, Clone, Serialize)]
pub(crate) struct State {
    pub(crate) machine: String,
    pub(crate) campaign: String,
    pub(crate) units: DisplayUnits,
    /// Names of the speed lines, from slow to fast.
    pub(crate) lines: Vec<String>,
    /// Expected points on the map.
    pub(crate) planned: Vec<Planned>,
    pub(crate) steps: usize,
    /// Planned rig time, s.
    pub(crate) duration_s: f64,
    pub(crate) pace: Option<f64>,
    /// Names and units of the columns of `rows`.
    pub(crate) traced: Vec<TracedChannel>,
    /// Run time, s, and readings.
    pub(crate) rows: VecDeque<Vec<Option<f64>>>,
    pub(crate) points: Vec<LivePoint>,
    /// Speed lines and contours of the points so far.
    pub(crate) map: LiveMap,
    pub(crate) events: VecDeque<LoggedMessage>,
    pub(crate) now: CurrentValues,
    pub(crate) outcome: Option<String>,
    pub(crate) page: Option<String>,
}

#[derive(Debug, Clone, Serialize)]
pub(crate) struct TracedChannel {
    pub(crate) name: String,
    pub(crate) unit: String,
}

#[derive(Debug, Clone, Serialize)]
pub(crate) struct LoggedMessage {
    pub(crate) t_s: f64,
    pub(crate) message: String,
}

/// Values that change every second.
#[derive(Debug, Clone, Default, Serialize)]
pub(crate) struct CurrentValues {
    pub(crate) t_s: f64,
    /// Current activity, in words.
    pub(crate) phase: String,
    pub(crate) step: Option<Step>,
    /// Remaining rig time and half-width of its 95 % interval, s.
    pub(crate) left_s: f64,
    pub(crate) left_half_s: f64,
    pub(crate) holds: bool,
    pub(crate) stops: bool,
    pub(crate) readings: Vec<Reading>,
}

/// The current step.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Step {
    /// Its number, from 1; `None` for one that a resumed run repeats.
    pub(crate) step: Option<usize>,
    pub(crate) place: String,
    pub(crate) start_s: f64,
    pub(crate) end_s: f64,
    /// Expected settling time, s after its start.
    pub(crate) settle_s: Option<f64>,
}

/// A channel with its reading and its limits.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Reading {
    pub(crate) symbol: &'static str,
    pub(crate) what: &'static str,
    pub(crate) unit: String,
    pub(crate) value: f64,
    /// The value formatted as in reports.
    pub(crate) shown: String,
    pub(crate) low: Option<f64>,
    pub(crate) high: Option<f64>,
}
