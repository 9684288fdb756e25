//! Reasons that forbid a jump.

use mapper_core::{readable, temperature};

/// Reason why a jump is not allowed.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum Rejection {
    #[error("it stays {longest_s:.1} s beyond the surge line; {allowed_s:.1} s are allowed")]
    Surge { longest_s: f64, allowed_s: f64 },
    #[error("the shaft reaches {}; its limit is {}", readable(*.highest_rpm, "rpm"), readable(*.limit_rpm, "rpm"))]
    Overspeed { highest_rpm: f64, limit_rpm: f64 },
    #[error("T2 reaches {}; its limit is {}", temperature(*.highest_k), temperature(*.limit_k))]
    OutletTemperature { highest_k: f64, limit_k: f64 },
    #[error("T3 is {}; its limit is {}", temperature(*.t3_k), temperature(*.limit_k))]
    TurbineInletTemperature { t3_k: f64, limit_k: f64 },
    #[error(
        "the housing temperature changes by {gradient_k:.1} K in the window; its limit is {limit_k:.1} K"
    )]
    HousingGradient { gradient_k: f64, limit_k: f64 },
    #[error("P3 takes {needed_s:.1} s to reach its new value; the window begins after {available_s:.1} s")]
    Slew { needed_s: f64, available_s: f64 },
}

impl Rejection {
    /// What the jump reaches, relative to its limit.
    pub(crate) fn ratio(&self) -> f64 {
        match *self {
            Rejection::Surge { longest_s, allowed_s } => longest_s / allowed_s,
            Rejection::Overspeed { highest_rpm, limit_rpm } => highest_rpm / limit_rpm,
            Rejection::OutletTemperature { highest_k, limit_k } => highest_k / limit_k,
            Rejection::TurbineInletTemperature { t3_k, limit_k } => t3_k / limit_k,
            Rejection::HousingGradient { gradient_k, limit_k } => gradient_k.abs() / limit_k,
            Rejection::Slew { needed_s, available_s } => needed_s / available_s,
        }
    }
}
