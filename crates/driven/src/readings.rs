//! What drives the compressor side, and what is judged: one row a sample.

use crate::DrivenError;
use mapper_core::{Channel, Recording};
use mapper_observe::plausible::is_reading;

/// A pressure ratio below which a compressor does hardly any work: its temperature rise says nothing of its efficiency.
const WORKING_RATIO: f64 = 1.02;
/// Smallest flow, kg/s, that eqs. 1-3 are evaluated at (they divide by it).
const SMALLEST_FLOW_KG_S: f64 = 1e-3;
/// Rows are taken no denser than this, s: nothing on the compressor side is faster than a probe.
const SPACING_S: f64 = 0.1;
/// Most rows that are kept, of longer logs spread over all of it: five minutes at 10 Hz. What is sought goes through them some
/// hundred thousand times.
const MOST_ROWS: usize = 3_000;

/// Complete rows, as columns of equal length. SI units.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Readings {
    /// Time, s, rising.
    pub t_s: Vec<f64>,
    /// Shaft speed, rpm.
    pub speed_rpm: Vec<f64>,
    /// Compressor flow, kg/s.
    pub flow_kg_s: Vec<f64>,
    /// Inlet pressure, Pa.
    pub p1_pa: Vec<f64>,
    /// Outlet pressure, Pa.
    pub p2_pa: Vec<f64>,
    /// Inlet temperature, K.
    pub t1_k: Vec<f64>,
    /// Outlet temperature as the probe reads it, K.
    pub t2_k: Vec<f64>,
    /// Housing temperature, K; NaN where it was not measured.
    pub tc_k: Vec<f64>,
    /// Rows of T2 that were left out: a value missing or impossible, or a compressor that does not work.
    pub lost: usize,
}

impl Readings {
    /// The rows of a recording at the times of T2.
    ///
    /// # Errors
    /// [`DrivenError::Channel`] where speed, flow, P1, P2, T1 or T2 is missing.
    pub fn of(recording: &Recording) -> Result<Self, DrivenError> {
        let t2 = recording.require(Channel::T2)?;
        let drives = [Channel::ShaftSpeed, Channel::CompressorFlow, Channel::P1, Channel::P2, Channel::T1];
        let mut series = Vec::with_capacity(drives.len());
        for channel in drives {
            series.push((channel, recording.require(channel)?));
        }
        let housing = recording.series.get(&Channel::Tc);
        let span_s = t2.t_s.last().zip(t2.t_s.first()).map_or(0.0, |(last_s, first_s)| last_s - first_s);
        let spacing_s = SPACING_S.max(span_s / MOST_ROWS as f64);
        let mut rows = Readings::default();
        for (t_s, t2_k) in t2.t_s.iter().zip(&t2.values) {
            if rows.t_s.last().is_some_and(|last_s| t_s - last_s < 0.999 * spacing_s) {
                continue;
            }
            let at = |index: usize| {
                let (channel, series) = series[index];
                // Beyond the ends of a channel there is no reading.
                let inside = series.t_s.first() <= Some(t_s) && series.t_s.last() >= Some(t_s);
                series.interpolate(*t_s).filter(|value| inside && is_reading(channel, *value))
            };
            let row =
                (at(0), at(1), at(2), at(3), at(4), Some(*t2_k).filter(|k| is_reading(Channel::T2, *k)));
            let (Some(speed_rpm), Some(flow_kg_s), Some(p1_pa), Some(p2_pa), Some(t1_k), Some(t2_k)) = row
            else {
                rows.lost += 1;
                continue;
            };
            if p2_pa < WORKING_RATIO * p1_pa || flow_kg_s < SMALLEST_FLOW_KG_S || speed_rpm <= 0.0 {
                rows.lost += 1;
                continue;
            }
            // Spread over the log there is one more at most.
            if rows.t_s.len() > MOST_ROWS {
                break;
            }
            let tc_k = housing.and_then(|tc| tc.interpolate(*t_s)).filter(|k| is_reading(Channel::Tc, *k));
            rows.t_s.push(*t_s);
            rows.speed_rpm.push(speed_rpm);
            rows.flow_kg_s.push(flow_kg_s);
            rows.p1_pa.push(p1_pa);
            rows.p2_pa.push(p2_pa);
            rows.t1_k.push(t1_k);
            rows.t2_k.push(t2_k);
            rows.tc_k.push(tc_k.unwrap_or(f64::NAN));
        }
        Ok(rows)
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.t_s.len()
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.t_s.is_empty()
    }
}
