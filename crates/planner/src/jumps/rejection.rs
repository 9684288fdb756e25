//! Reasons that forbid a jump.

use mapper_core::{readable, temperature};

/// Reason why a jump is not allowed.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Rejection {
    /// The compressor stays beyond the surge line for too long.
    #[error("it stays {longest_s:.1} s beyond the surge line; {allowed_s:.1} s are allowed")]
    Surge {
        /// Longest period, s.
        longest_s: f64,
        /// Allowed, s.
        allowed_s: f64,
    },
    /// The shaft overshoots its limit.
    #[error("the shaft reaches {}; its limit is {}", readable(*.highest_rpm, "rpm"), readable(*.limit_rpm, "rpm"))]
    Overspeed {
        /// Highest speed during the jump, rpm.
        highest_rpm: f64,
        /// Limit, rpm.
        limit_rpm: f64,
    },
    /// The outlet gets too hot.
    #[error("T2 reaches {}; its limit is {}", temperature(*.highest_k), temperature(*.limit_k))]
    OutletTemperature {
        /// Highest temperature during the jump, K.
        highest_k: f64,
        /// Limit, K.
        limit_k: f64,
    },
    /// The turbine inlet is too hot.
    #[error("T3 is {}; its limit is {}", temperature(*.t3_k), temperature(*.limit_k))]
    TurbineInletTemperature {
        /// T3, K.
        t3_k: f64,
        /// Limit, K.
        limit_k: f64,
    },
    /// The housing temperature changes too much.
    #[error(
        "the housing temperature changes by {gradient_k:.1} K in the window; its limit is {limit_k:.1} K"
    )]
    HousingGradient {
        /// Change in the window, K.
        gradient_k: f64,
        /// Limit, K.
        limit_k: f64,
    },
    /// The rig cannot change P3 before the window begins.
    #[error("P3 takes {needed_s:.1} s to reach its new value; the window begins after {available_s:.1} s")]
    Slew {
        /// Time P3 takes, s.
        needed_s: f64,
        /// Time until the window, s.
        available_s: f64,
    },
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
