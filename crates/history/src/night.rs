//! A night with its runs and points, and the quantities of a point that are compared.

use crate::{Floor, Metric};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Identity of a run from night to night.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct RunKey {
    /// Name of the campaign.
    pub campaign: String,
    /// Name of the machine.
    pub machine: String,
    /// Method of identification.
    pub method: String,
    /// Seed of search and simulated rig.
    pub seed: u64,
}

impl std::fmt::Display for RunKey {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {} {} seed {}", self.campaign, self.machine, self.method, self.seed)
    }
}

/// One identified point with its truth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PointRow {
    /// Target speed, rpm.
    pub speed_rpm: f64,
    /// Valve opening relative to the nominal area.
    pub valve_opening_ratio: f64,
    /// Number of the visit to this point, from 0; repeats visit a point again.
    pub visit: usize,
    /// Identified efficiency, fraction.
    pub eta: Option<f64>,
    /// True efficiency, fraction.
    pub eta_true: Option<f64>,
    /// Identified heat-transfer coefficient, W/(m2 K).
    pub h_w_m2k: Option<f64>,
    /// True heat-transfer coefficient, W/(m2 K).
    pub h_true_w_m2k: Option<f64>,
}

impl PointRow {
    /// The point in words.
    pub fn label(&self) -> String {
        let visit = if self.visit == 0 { String::new() } else { format!(", visit {}", self.visit + 1) };
        format!("{} krpm at opening {}{visit}", self.speed_rpm / 1e3, self.valve_opening_ratio)
    }
}

/// One run of a night.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunRow {
    /// Which run.
    #[serde(flatten)]
    pub key: RunKey,
    /// SHA-256 of the campaign as parsed; empty if the run failed before.
    pub campaign_sha256: String,
    /// SHA-256 of the nominal model; empty if the run failed before.
    pub model_sha256: String,
    /// Why the run failed; `None` if it did not.
    pub failure: Option<String>,
    /// Its metrics.
    pub figures: BTreeMap<Metric, f64>,
    /// Its points.
    pub points: Vec<PointRow>,
}

/// All runs of one night.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Night {
    /// Name of the nightly campaign; nights of other names are never compared.
    pub name: String,
    /// Start, ms since 1970-01-01 00:00 UTC.
    pub started_ms: i64,
    /// Wall-clock duration, s.
    pub duration_s: f64,
    /// Program and version.
    pub program: String,
    /// Whether the changes of tonight are accepted: this night starts a new band.
    pub accepted: bool,
    /// The runs.
    pub runs: Vec<RunRow>,
}

/// One quantity of a point. Both absolute values and errors are compared, because a changed model shifts truth and result equally and leaves the
/// error unchanged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PointQuantity {
    /// True efficiency, fraction.
    EtaTrue,
    /// Identified efficiency, fraction.
    Eta,
    /// Identified minus true efficiency, fraction.
    EtaError,
    /// True heat-transfer coefficient, W/(m2 K).
    HTrue,
    /// Identified heat-transfer coefficient, W/(m2 K).
    H,
    /// Identified over true heat-transfer coefficient, minus one, ratio.
    HError,
}

impl PointQuantity {
    /// All of them.
    pub const ALL: [PointQuantity; 6] = [
        PointQuantity::EtaTrue,
        PointQuantity::Eta,
        PointQuantity::EtaError,
        PointQuantity::HTrue,
        PointQuantity::H,
        PointQuantity::HError,
    ];

    /// Value at a point; `None` if the point has none.
    pub fn of(self, point: &PointRow) -> Option<f64> {
        match self {
            PointQuantity::EtaTrue => point.eta_true,
            PointQuantity::Eta => point.eta,
            PointQuantity::EtaError => Some(point.eta? - point.eta_true?),
            PointQuantity::HTrue => point.h_true_w_m2k,
            PointQuantity::H => point.h_w_m2k,
            PointQuantity::HError => Some(point.h_w_m2k? / point.h_true_w_m2k? - 1.0),
        }
        .filter(|value| value.is_finite())
    }

    /// Name for users.
    pub fn words(self) -> &'static str {
        match self {
            PointQuantity::EtaTrue => "true efficiency",
            PointQuantity::Eta => "identified efficiency",
            PointQuantity::EtaError => "error of the efficiency",
            PointQuantity::HTrue => "true h",
            PointQuantity::H => "identified h",
            PointQuantity::HError => "error of h",
        }
    }

    /// Minimum half width of the band; see [`crate::Metric::floor`].
    pub fn floor(self) -> Floor {
        match self {
            PointQuantity::EtaTrue | PointQuantity::Eta | PointQuantity::EtaError => Floor::Absolute(5e-4),
            // h reacts to small changes of any input; only a change of one per cent matters.
            PointQuantity::HTrue | PointQuantity::H => Floor::Relative(0.01),
            PointQuantity::HError => Floor::Absolute(0.01),
        }
    }

    /// Formats a shift: in points for efficiencies, in per cent of `level` for h.
    pub fn format_shift(self, shift: f64, level: f64) -> String {
        match self {
            PointQuantity::EtaTrue | PointQuantity::Eta | PointQuantity::EtaError => {
                format!("{:+.2} points", 100.0 * shift)
            }
            PointQuantity::HTrue | PointQuantity::H => format!("{:+.2} %", 100.0 * shift / level),
            PointQuantity::HError => format!("{:+.2} %", 100.0 * shift),
        }
    }
}
