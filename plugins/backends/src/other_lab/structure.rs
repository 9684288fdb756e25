//! Parameters of this lab's equations that the lumped model does not have.

use mapper_core::Channel;

/// Name of this backend in campaigns.
pub const NAME: &str = "other_lab";

/// The structure. The defaults were set from the usual design of such machines before any diagnosis, and
/// are not fitted to the results of a diagnosis.
#[derive(Debug, Clone, PartialEq)]
pub struct OtherStructure {
    /// Conductance between neighbouring nodes of the housing, W/K, > 0. Aluminium, 160 W/(m K), a wall of 150 mm by 8 mm,
    /// nodes 40 mm apart: 5 W/K.
    pub housing_coupling_w_k: f64,
    /// Decrease of h along the passage, ratio: 0 is uniform; 0.5 is from 1.5 times the mean after the wheel to 0.5
    /// times at the outlet flange.
    pub uneven_h_ratio: f64,
    /// Whether the gas has one temperature in the whole passage, as in the lumped model; otherwise it cools along it.
    pub mixed_gas: bool,
    /// Length of the duct between the two volumes, m, > 0: its gas has inertia.
    pub duct_length_m: f64,
    /// Pressure loss of the duct, relative to its dynamic pressure.
    pub duct_loss_ratio: f64,
    /// Share of the outlet volume between wheel and duct, in the open interval 0..1.
    pub volume_share_ratio: f64,
    /// Loss of efficiency after flow separation, as a ratio; the loss of flow is half of it.
    pub hysteresis_ratio: f64,
    /// Factor on the natural frequencies of all sensors; infinity for sensors without lag.
    pub sensor_speed_ratio: f64,
    /// Added to the exponent of the compressor's law of convection, `h ~ m^n`; h is unchanged at 0.05 kg/s.
    pub convection_exponent_change: f64,
    /// Share of the turbine housing's mass that meets the gas; the other part has the Tt probe and all losses. 0: one mass.
    pub turbine_inner_ratio: f64,
    /// Relative change of the turbine's efficiency for a change of ln(P3/P4) by 1, unchanged at P3/P4 = 2.
    pub turbine_efficiency_slope: f64,
}

/// Flow at which the other law of convection meets that of the model, kg/s: the middle of the map.
pub(super) const CONVECTION_FLOW_KG_S: f64 = 0.05;
/// Expansion ratio at which both turbines have equal efficiency: the middle of their range.
pub(super) const TURBINE_EXPANSION_RATIO: f64 = 2.0;
/// Conductance between the two masses of the turbine housing, W/K: a flange of 40 cm2, 4000 W/(m2 K) at its joint.
pub(super) const TURBINE_JOINT_W_K: f64 = 16.0;

impl Default for OtherStructure {
    fn default() -> Self {
        OtherStructure {
            housing_coupling_w_k: 5.0,
            uneven_h_ratio: 0.5,
            mixed_gas: false,
            duct_length_m: 0.4,
            duct_loss_ratio: 0.2,
            volume_share_ratio: 0.3,
            hysteresis_ratio: 0.01,
            sensor_speed_ratio: 1.0,
            convection_exponent_change: 0.0,
            turbine_inner_ratio: 0.0,
            turbine_efficiency_slope: 0.0,
        }
    }
}

impl OtherStructure {
    /// Another machine: a turbine housing of two masses, a flatter law of convection, a turbine that gains efficiency with expansion, a
    /// compressor housing of loosely coupled nodes, a short duct, slow sensors, no hysteresis.
    pub fn two_masses() -> Self {
        OtherStructure {
            housing_coupling_w_k: 2.0,
            uneven_h_ratio: 0.2,
            mixed_gas: true,
            duct_length_m: 0.1,
            duct_loss_ratio: 0.5,
            volume_share_ratio: 0.5,
            hysteresis_ratio: 0.0,
            sensor_speed_ratio: 0.5,
            convection_exponent_change: -0.2,
            turbine_inner_ratio: 0.4,
            turbine_efficiency_slope: 0.1,
        }
    }

    /// Second-order sensors: channel, natural frequency in Hz, damping. Pressure lines oscillate, meters are filtered, probes
    /// in a sheath have two lags.
    pub(super) fn sensors(&self) -> Vec<(Channel, f64, f64)> {
        let defaults = [
            (Channel::P2, 8.0, 0.5),
            (Channel::CompressorFlow, 3.0, 0.7),
            (Channel::TurbineFlow, 3.0, 0.7),
            (Channel::T2, 2.0, 1.2),
            (Channel::T4, 1.0, 1.2),
            (Channel::Tc, 0.2, 1.2),
            (Channel::Tt, 0.2, 1.2),
        ];
        if self.sensor_speed_ratio.is_infinite() {
            return Vec::new();
        }
        defaults.map(|(channel, hz, damping)| (channel, hz * self.sensor_speed_ratio, damping)).to_vec()
    }
}
