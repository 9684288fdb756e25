//! Errors that all points of one recording share.

use serde::{Deserialize, Serialize};

/// Signed effects of a recording's common errors on one of its points.
///
/// Entry `k` of a list is the change due to one standard deviation of error `k`; error `k` is the same at every point of the
/// recording, and errors of different `k` are independent. The covariance of two points is therefore the sum of the products of
/// their entries. The variance of one point is the sum of the squares of its entries plus its own part, which no other
/// point shares. The lists of `eta` and of `h` number their errors independently.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct CommonErrors {
    /// Changes of `eta`, fraction; empty if no shared errors are known.
    pub eta_changes: Vec<f64>,
    /// Changes of `h`, W/(m2 K); empty if no shared errors are known.
    pub h_changes_w_m2k: Vec<f64>,
    /// Standard error that all corrected flows share (gain and offset of the flow meter, offsets of P1 and T1), ratio to
    /// the flow.
    pub flow_corrected_standard_error_ratio: f64,
    /// Standard error that all pressure ratios share (offsets and gains of P1 and P2), absolute.
    pub pressure_ratio_standard_error: f64,
}

impl CommonErrors {
    /// Standard error of `eta` from shared errors, fraction.
    pub fn eta_standard_error(&self) -> f64 {
        self.eta_changes.iter().map(|change| change * change).sum::<f64>().sqrt()
    }
}
