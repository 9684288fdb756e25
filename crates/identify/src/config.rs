//! What identification is told: method, window, geometry, declared uncertainty, thresholds.

use mapper_core::{Channel, InletConvection, JointSettings, Method, ReferenceState, SettleBands, WindowRule};
pub use mapper_core::{DeclaredUncertainty, NoiseColour};
use mapper_numerics::coloured_noise::ColouredNoise;
use mapper_physics::air::Air;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// How a recording is to be identified.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct IdentifyConfig {
    /// Conventional or dynamic.
    pub method: Method,
    /// Which part of each step is used by the dynamic method.
    pub window: WindowRule,
    /// When the operating point counts as settled.
    pub settle_bands: SettleBands,
    /// Assumed share of the internal area before compression, alpha_A, 0..1.
    pub alpha_area_ratio: f64,
    /// How far the true share may be off the assumed one, one standard deviation: part of the intervals of the dynamic
    /// method, which cannot find it. 0 believes the assumption.
    pub alpha_area_sigma_ratio: f64,
    /// Internal area of the compressor housing A_c, m2, > 0.
    pub internal_area_m2: f64,
    /// What h before the wheel is declared to follow.
    pub inlet_convection: InletConvection,
    /// Diameter of the inlet pipe, m, > 0: characteristic length of the convection law before the wheel.
    pub inlet_diameter_m: f64,
    /// Diameter of the outlet pipe, m, > 0: characteristic length of the convection law, and where the T2 probe stands.
    pub outlet_diameter_m: f64,
    /// Declared diameter of the T2 probe's tip, m, >= 0; 0 is a probe without inertia.
    pub probe_diameter_m: f64,
    /// Which refinements the joint method makes.
    pub joint: JointSettings,
    /// Reference state of corrected quantities, dry air.
    pub reference: ReferenceState,
    /// The air that is compressed.
    pub air: Air,
    /// One standard deviation of its humidity, kg/kg: part of the intervals of the joint method.
    pub humidity_sigma_kg_kg: f64,
    /// What the tap of P1 reads.
    pub inlet_tap: PressureTap,
    /// What the tap of P2 reads.
    pub outlet_tap: PressureTap,
    /// Declared uncertainty of the sensors, SI units. Channels that are left out count as exact.
    pub declared: BTreeMap<Channel, DeclaredUncertainty>,
    /// How sensor noise is correlated in time.
    pub noise_colour: NoiseColour,
    /// When a point is doubted.
    pub thresholds: Thresholds,
}

impl Default for IdentifyConfig {
    /// The dynamic method on the nominal machine (Appendix A of the paper), total-pressure taps, nothing declared.
    fn default() -> Self {
        IdentifyConfig {
            method: Method::Dynamic,
            window: WindowRule::default(),
            settle_bands: SettleBands::default(),
            alpha_area_ratio: 0.0,
            alpha_area_sigma_ratio: 0.0,
            internal_area_m2: 29e-3,
            inlet_convection: InletConvection::Shared,
            inlet_diameter_m: 40e-3,
            outlet_diameter_m: 35e-3,
            probe_diameter_m: 0.0,
            joint: JointSettings::default(),
            reference: ReferenceState::SAE,
            air: Air::DRY,
            humidity_sigma_kg_kg: 0.0,
            inlet_tap: PressureTap::Total,
            outlet_tap: PressureTap::Total,
            declared: BTreeMap::new(),
            noise_colour: NoiseColour::default(),
            thresholds: Thresholds::default(),
        }
    }
}

impl IdentifyConfig {
    /// Corrected flow, kg/s: what dry air in the reference state would flow at the same Mach numbers.
    pub(crate) fn corrected_flow_kg_s(&self, flow_kg_s: f64, t1_k: f64, p1_pa: f64) -> f64 {
        self.reference.corrected_flow_kg_s(flow_kg_s * self.air.dry_flow_ratio(), t1_k, p1_pa)
    }
}

/// What a pressure tap reads.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PressureTap {
    /// Total pressure (or the channel was converted before).
    #[default]
    Total,
    /// Static pressure at the wall of a pipe.
    Static {
        /// Inner diameter of the pipe at the tap, m, > 0.
        pipe_diameter_m: f64,
    },
}

/// When a point is doubted or refused.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Thresholds {
    /// Fewest complete samples in the window; fewer make the point unusable.
    pub fewest_samples: usize,
    /// Largest share of lost samples in the window that passes without doubt.
    pub lost_samples_ratio: f64,
    /// Standard error of eta (fraction) above which the gradient counts as too small.
    pub sigma_eta: f64,
    /// Standard error of eta (fraction) above which the point is unusable.
    pub unusable_sigma_eta: f64,
    /// Smallest change of T2 over the window that passes without doubt, K.
    pub dt2_k: f64,
    /// Estimated error of eta (fraction) from flow that moves within the window, above which the point is doubtful.
    pub flow_drift_eta: f64,
    /// Residual over what the declared noise explains, above which the fit is poor.
    pub residual_over_noise_ratio: f64,
    /// Slow part of the residual (10 s means) over the change of T2, above which the fit is poor.
    pub structure_ratio: f64,
    /// `steady`: mean over this last part of the step, s.
    pub steady_mean_s: f64,
    /// `steady`: drift of T2 or Tc above which the step has not settled, K/min.
    pub steady_drift_k_min: f64,
    /// State of the point: mean over this last part of the step, s.
    pub end_mean_s: f64,
}

impl Default for Thresholds {
    fn default() -> Self {
        Thresholds {
            fewest_samples: 20,
            lost_samples_ratio: 0.05,
            sigma_eta: 0.02,
            unusable_sigma_eta: 0.2,
            dt2_k: 0.5,
            flow_drift_eta: 0.005,
            residual_over_noise_ratio: 1.5,
            structure_ratio: 0.02,
            steady_mean_s: 10.0,
            steady_drift_k_min: 0.5,
            end_mean_s: 2.0,
        }
    }
}

/// The declared noise, with what numerics know of it.
pub(crate) fn coloured(colour: NoiseColour) -> ColouredNoise {
    ColouredNoise::new(colour.first_order_share_ratio, colour.time_constant_s)
}
