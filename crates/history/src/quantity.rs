//! What is kept of each point.

use crate::{Floor, PointRow};
use serde::Serialize;

/// One quantity of a point. The error is the identified value minus the true one, so that a model that moves truth
/// and result alike shows in the absolute values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PointQuantity {
    /// True efficiency, fraction.
    EtaTrue,
    /// Identified efficiency, fraction.
    Eta,
    /// Identified less true efficiency, fraction.
    EtaError,
    /// True heat-transfer coefficient, W/(m2 K).
    HTrue,
    /// Identified heat-transfer coefficient, W/(m2 K).
    H,
    /// Identified over true heat-transfer coefficient, less one, ratio.
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

    /// In words.
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

    /// Half width that the band has at least; see [`crate::Metric::floor`].
    pub fn floor(self) -> Floor {
        match self {
            PointQuantity::EtaTrue | PointQuantity::Eta | PointQuantity::EtaError => Floor::Absolute(5e-4),
            // h answers to the third digit of everything; a hundredth is a change that matters.
            PointQuantity::HTrue | PointQuantity::H => Floor::Relative(0.01),
            PointQuantity::HError => Floor::Absolute(0.01),
        }
    }

    /// A shift of it for people: points for efficiencies, per cent of `level` for h.
    pub fn show_shift(self, shift: f64, level: f64) -> String {
        match self {
            PointQuantity::EtaTrue | PointQuantity::Eta | PointQuantity::EtaError => {
                format!("{:+.2} points", 100.0 * shift)
            }
            PointQuantity::HTrue | PointQuantity::H => format!("{:+.2} %", 100.0 * shift / level),
            PointQuantity::HError => format!("{:+.2} %", 100.0 * shift),
        }
    }
}
