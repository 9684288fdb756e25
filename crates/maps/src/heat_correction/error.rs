//! Errors of the heat correction.

use mapper_core::Method;

/// Why a map cannot be corrected for heat.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum HeatCorrectionError {
    /// The efficiencies contain no heat.
    #[error("the map was identified by the {0} method: its efficiencies already exclude heat")]
    Adiabatic(Method),
    /// Too few points or lines.
    #[error(
        "{points} points on {lines} speed lines have an efficiency and lie outside choke; estimating the heat takes at least 8 points on 3 lines; measure more, \
         or state the heat"
    )]
    TooFew {
        /// Points.
        points: usize,
        /// Lines with points.
        lines: usize,
    },
    /// Lines of nearly equal speed.
    #[error(
        "the fastest line turns at {ratio:.2} times the speed of the slowest; below 1.5 the heat cannot be distinguished from the wheel's work; state the heat"
    )]
    OneSpeed {
        /// Fastest over slowest.
        ratio: f64,
    },
    /// Points that do not determine the heat.
    #[error("flows and speeds of the map do not separate heat from work; state the heat")]
    Singular,
    /// A negative heat, or one that is not finite.
    #[error("a heat of {heat_w} W cannot be subtracted; it must be finite and not negative")]
    Heat {
        /// The heat, W.
        heat_w: f64,
    },
}
