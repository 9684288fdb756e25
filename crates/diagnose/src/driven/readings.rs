//! Driving and judged channels of the compressor side, one row per sample.

use crate::driven::DrivenError;
use crate::driven::log_rows::{Rows, Wanted};
use mapper_core::{Channel, Recording};

/// Pressure ratio below which a compressor or turbine does hardly any work, so that its temperatures do not show its efficiency.
pub(crate) const WORKING_RATIO: f64 = 1.02;
/// Minimum flow at which the gas path is evaluated, kg/s (its equations divide by it).
pub(crate) const SMALLEST_FLOW_KG_S: f64 = 1e-3;
/// Channels that the compressor side needs.
pub(crate) const COMPRESSOR: Wanted<'_> = Wanted {
    drives: &[Channel::ShaftSpeed, Channel::CompressorFlow, Channel::P1, Channel::P2, Channel::T1],
    judged: &[Channel::T2, Channel::Tc],
    works: |row| {
        let [speed_rpm, flow_kg_s, p1_pa, p2_pa, _] = *row else { return false };
        p2_pa >= WORKING_RATIO * p1_pa && flow_kg_s >= SMALLEST_FLOW_KG_S && speed_rpm > 0.0
    },
};

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
    /// Outlet temperature as measured by the probe, K.
    pub t2_k: Vec<f64>,
    /// Housing temperature, K; NaN if not measured.
    pub tc_k: Vec<f64>,
    /// Omitted rows of T2: a value is missing or impossible, or the compressor does no work.
    pub lost: usize,
}

impl Readings {
    /// Rows of a recording at the times of T2.
    ///
    /// # Errors
    /// [`DrivenError::Channel`] if speed, flow, P1, P2, T1 or T2 is missing.
    pub fn of(recording: &Recording) -> Result<Self, DrivenError> {
        let rows = Rows::read(recording, COMPRESSOR)?;
        Ok(Readings::from(rows))
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.t_s.len()
    }

    /// Whether there are zero rows.
    pub fn is_empty(&self) -> bool {
        self.t_s.is_empty()
    }
}

impl From<Rows> for Readings {
    fn from(rows: Rows) -> Self {
        let column = |columns: &[(Channel, Vec<f64>)], place: usize| {
            columns.get(place).map_or_else(Vec::new, |(_, v)| v.clone())
        };
        let drive = |place: usize| column(&rows.drives, place);
        Readings {
            speed_rpm: drive(0),
            flow_kg_s: drive(1),
            p1_pa: drive(2),
            p2_pa: drive(3),
            t1_k: drive(4),
            t2_k: column(&rows.judged, 0),
            tc_k: column(&rows.judged, 1),
            lost: rows.lost,
            t_s: rows.t_s,
        }
    }
}
