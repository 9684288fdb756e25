//! What one constant does to readings and points.

/// A constant of one standard deviation, as readings and points show it.
#[derive(Debug, Clone)]
pub(crate) struct Constant {
    /// Readings, stretch after stretch.
    pub readings: Vec<f64>,
    /// Efficiency at the end of each step, fraction.
    pub eta: Vec<f64>,
    /// Heat-transfer coefficient at the end of each step, W/(m2 K).
    pub h_w_m2k: Vec<f64>,
}
