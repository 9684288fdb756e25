//! The quantities of a point that are compared.

use crate::{Floor, PointRow};
use serde::Serialize;

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
