//! Errors of the heat correction.

use mapper_core::Method;

/// Why a map cannot be corrected for heat.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum HeatCorrectionError {
    #[error("the map was identified by the {0} method: its efficiencies already exclude heat")]
    Adiabatic(Method),
    #[error(
        "{points} points on {lines} speed lines have an efficiency and lie outside choke; estimating the heat takes at least 8 points on 3 lines; measure more, \
         or state the heat"
    )]
    TooFew { points: usize, lines: usize },
    #[error(
        "the fastest line turns at {ratio:.2} times the speed of the slowest; below 1.5 the heat cannot be distinguished from the wheel's work; state the heat"
    )]
    OneSpeed { ratio: f64 },
    #[error("flows and speeds of the map do not separate heat from work; state the heat")]
    Singular,
    #[error("a heat of {heat_w} W cannot be subtracted; it must be finite and not negative")]
    Heat { heat_w: f64 },
}
