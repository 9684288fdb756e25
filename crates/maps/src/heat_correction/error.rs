//! Why a map cannot be corrected.

use mapper_core::Method;

/// Why a map cannot be corrected for heat.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum HeatCorrectionError {
    /// Its efficiencies hold no heat.
    #[error("the map was identified by the {method} method: its efficiencies are free of heat already")]
    Adiabatic {
        /// The method.
        method: Method,
    },
    /// Too little to see a heat in.
    #[error(
        "{points} points on {lines} speed lines have an efficiency and lie outside choke; the heat of a map shows in at least 8 points on 3 lines, \
         or give it by `--heat`"
    )]
    TooFew {
        /// Points.
        points: usize,
        /// Lines with points.
        lines: usize,
    },
    /// Lines of nearly one speed.
    #[error(
        "the fastest line turns at {ratio:.2} times the speed of the slowest; below 1.5 the heat cannot be distinguished from the wheel's work; or give it by `--heat`"
    )]
    OneSpeed {
        /// Fastest over slowest.
        ratio: f64,
    },
    /// Points that determine nothing.
    #[error("flows and speeds of the map do not separate heat from work; give the heat by `--heat`")]
    Singular,
    /// A heat that is none.
    #[error("a heat of {heat_w} W cannot be taken off; it must be finite and not negative")]
    Heat {
        /// What was given, W.
        heat_w: f64,
    },
}
