//! The state to which corrected flow and speed refer.

use serde::{Deserialize, Serialize};

/// Reference total temperature and pressure of corrected quantities.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ReferenceState {
    /// Reference temperature, K.
    pub t_ref_k: f64,
    /// Reference pressure, Pa.
    pub p_ref_pa: f64,
}

impl ReferenceState {
    /// SAE J922: 298 K, 100 kPa.
    pub const SAE: ReferenceState = ReferenceState { t_ref_k: 298.0, p_ref_pa: 100_000.0 };

    /// Corrected shaft speed `N sqrt(T_ref/T1)`, rpm.
    pub fn corrected_speed_rpm(&self, speed_rpm: f64, t1_total_k: f64) -> f64 {
        speed_rpm * (self.t_ref_k / t1_total_k).sqrt()
    }

    /// Physical shaft speed of a corrected one, rpm.
    pub fn physical_speed_rpm(&self, speed_corrected_rpm: f64, t1_total_k: f64) -> f64 {
        speed_corrected_rpm * (t1_total_k / self.t_ref_k).sqrt()
    }

    /// Corrected mass flow `m sqrt(T1/T_ref) / (P1/P_ref)`, kg/s.
    pub fn corrected_flow_kg_s(&self, flow_kg_s: f64, t1_total_k: f64, p1_total_pa: f64) -> f64 {
        flow_kg_s * (t1_total_k / self.t_ref_k).sqrt() / (p1_total_pa / self.p_ref_pa)
    }

    /// Physical mass flow of a corrected one, kg/s.
    pub fn physical_flow_kg_s(&self, flow_corrected_kg_s: f64, t1_total_k: f64, p1_total_pa: f64) -> f64 {
        flow_corrected_kg_s * (p1_total_pa / self.p_ref_pa) / (t1_total_k / self.t_ref_k).sqrt()
    }
}

impl std::fmt::Display for ReferenceState {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} K, {} kPa", self.t_ref_k, self.p_ref_pa / 1000.0)
    }
}
