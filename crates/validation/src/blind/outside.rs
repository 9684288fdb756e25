//! Causes that are not candidates of the diagnosis: reserved ones for the check, other ones for calibration.
//!
//! They are effects like those of the catalogue, but never part of it. Their ids begin with `X_`, which identifies them in
//! the answers.

use mapper_core::Channel;
use mapper_physics::effect;
use mapper_physics::gas::air;
use mapper_physics::machine::hooks::{Hooks, Site};
use mapper_physics::rig::effect::{Effect, effect_of};
use std::sync::Arc;

/// Purpose of an outside cause.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OutsideUse {
    /// Reserved for the check; never used for tuning.
    Check,
    /// For tuning thresholds.
    Calibration,
}

/// The causes with this purpose.
pub fn outside_kinds(wanted: OutsideUse) -> Vec<Arc<dyn Effect>> {
    match wanted {
        OutsideUse::Check => vec![
            effect_of::<CoolantPassage>(),
            effect_of::<OutletDuct>(),
            effect_of::<Clearance>(),
            effect_of::<BackPlate>(),
            effect_of::<SlowPressureLine>(),
        ],
        OutsideUse::Calibration => vec![
            effect_of::<MountConduction>(),
            effect_of::<CoulombFriction>(),
            effect_of::<FlowDependentHtc>(),
            effect_of::<SlowHousingProbe>(),
        ],
    }
}

effect! {
    struct CoolantPassage "X_coolant_passage";
    name: "coolant passage in the compressor housing",
    description: "a coolant passage from the compressor housing to water at 85 degC",
    equation: "G (358.15 K - Tc) to the compressor housing",
    source: "withheld from the diagnosis",
    submodel: CompressorHousing, also_shows_in: [];
    /// Conductance to the water, W/K.
    conductance_w_k = "G" ["W/K"] 0.0 .. 20.0, neutral 0.0, step 1.5;
    |cause, rig| rig.hook(cause)?
}

/// Temperature of the water, K.
const WATER_K: f64 = 358.15;

impl Hooks for CoolantPassage {
    fn heat_to_compressor_w(&self, site: &Site<'_>) -> f64 {
        self.conductance_w_k * (WATER_K - site.state.tc_k)
    }
}

effect! {
    struct OutletDuct "X_outlet_duct";
    name: "outlet duct with its own mass",
    description: "an outlet duct with a mass of its own before the T2 probe",
    equation: "T2 leaves a duct of 250 J/K at T_d + (T2 - T_d) exp(-UA/(m cp)); 1 W/K of it to the cell",
    source: "withheld from the diagnosis",
    submodel: CompressorGas, also_shows_in: [];
    /// Conductance from gas to duct, W/K.
    conductance_w_k = "UA" ["W/K"] 0.0 .. 60.0, neutral 0.0, step 8.0;
    |cause, rig| rig.hook(cause)?
}

/// Heat capacity of the duct, J/K.
const DUCT_J_K: f64 = 250.0;
/// Conductance from the duct to the cell, W/K.
const DUCT_TO_CELL_W_K: f64 = 1.0;

impl Hooks for OutletDuct {
    fn gas_outlet_k(&self, site: &Site<'_>, t2_k: f64) -> f64 {
        let capacity_w_k = site.flow_kg_s * air::heat_capacity_j_kgk(t2_k);
        let duct_k = site.extra_k.first().copied().unwrap_or(t2_k);
        duct_k + (t2_k - duct_k) * (-self.conductance_w_k / capacity_w_k).exp()
    }

    fn extra_states(&self) -> usize {
        1
    }

    fn extra_rates_k_s(&self, site: &Site<'_>, rates: &mut [f64]) {
        // The gas temperature behind the duct is known here; the heat that it gave off follows from the same exponential.
        let (Some(rate), Some(duct_k)) = (rates.first_mut(), site.extra_k.first()) else { return };
        let capacity_w_k = site.flow_kg_s * air::heat_capacity_j_kgk(site.t2_k);
        let given_w = capacity_w_k * (site.t2_k - duct_k) * (self.conductance_w_k / capacity_w_k).exp_m1();
        let lost_w = DUCT_TO_CELL_W_K * (duct_k - site.boundary.ambient_temperature_k);
        *rate = (given_w - lost_w) / DUCT_J_K;
    }
}

effect! {
    struct Clearance "X_clearance";
    name: "clearance that grows with heat",
    description: "a clearance that grows as the compressor housing gets hotter than 320 K",
    equation: "eta (1 - k (Tc - 320 K)/100 K)",
    source: "withheld from the diagnosis",
    submodel: CompressorGas, also_shows_in: [];
    /// Loss of efficiency per 100 K, ratio.
    loss_ratio = "k" ["1"] -0.5 .. 0.5, neutral 0.0, step 0.06;
    |cause, rig| rig.hook(cause)?
}

impl Hooks for Clearance {
    fn efficiency(&self, site: &Site<'_>, efficiency: f64) -> f64 {
        efficiency * (1.0 - self.loss_ratio * (site.state.tc_k - 320.0) / 100.0)
    }
}

effect! {
    struct BackPlate "X_back_plate";
    name: "heat through the back plate",
    description: "heat from the bearing side through the back plate into the gas behind the wheel",
    equation: "T2' rises by G (Tt - T2')/(m cp), taken from the turbine housing",
    source: "withheld from the diagnosis",
    submodel: CompressorGas, also_shows_in: [];
    /// Conductance from the bearing side to the gas, W/K.
    conductance_w_k = "G" ["W/K"] 0.0 .. 5.0, neutral 0.0, step 0.5;
    |cause, rig| rig.hook(cause)?
}

impl Hooks for BackPlate {
    fn gas_after_k(&self, site: &Site<'_>, t2_prime_k: f64) -> f64 {
        // As eq. 3, so that the gas never passes the metal's temperature.
        let transfer_units = self.conductance_w_k / (site.flow_kg_s * air::heat_capacity_j_kgk(t2_prime_k));
        (t2_prime_k + transfer_units * site.state.tt_k) / (1.0 + transfer_units)
    }

    fn heat_to_turbine_w(&self, site: &Site<'_>) -> f64 {
        // Behind the plate already: T2' after the hook above.
        self.conductance_w_k * (site.t2_prime_k - site.state.tt_k)
    }
}

effect! {
    struct SlowPressureLine "X_slow_pressure_line";
    name: "slow pressure line",
    description: "a slow pressure line to the P2 sensor",
    equation: "dP2_read/dt = (P2 - P2_read)/tau",
    source: "withheld from the diagnosis",
    submodel: P2Sensor, also_shows_in: [];
    /// Time constant of the line, s.
    lag_s = "tau" ["s"] 0.0 .. 60.0, neutral 0.0, step 4.0;
    |cause, rig| rig.instruments.path_mut(Channel::P2).lag_s += cause.lag_s
}

effect! {
    struct MountConduction "X_mount_conduction";
    name: "conduction to the mount",
    description: "the compressor housing conducts to a mount at 20 degC",
    equation: "G (293.15 K - Tc) to the compressor housing",
    source: "withheld from the diagnosis",
    submodel: CompressorHousing, also_shows_in: [];
    /// Conductance to the mount, W/K.
    conductance_w_k = "G" ["W/K"] 0.0 .. 20.0, neutral 0.0, step 1.5;
    |cause, rig| rig.hook(cause)?
}

impl Hooks for MountConduction {
    fn heat_to_compressor_w(&self, site: &Site<'_>) -> f64 {
        self.conductance_w_k * (293.15 - site.state.tc_k)
    }
}

effect! {
    struct CoulombFriction "X_coulomb_friction";
    name: "rubbing shaft",
    description: "the shaft rubs with a constant torque",
    equation: "-M on the shaft",
    source: "withheld from the diagnosis",
    submodel: Shaft, also_shows_in: [];
    /// Torque, N m.
    torque_nm = "M" ["N m"] 0.0 .. 0.2, neutral 0.0, step 0.012;
    |cause, rig| rig.hook(cause)?
}

impl Hooks for CoulombFriction {
    fn shaft_torque_nm(&self, _site: &Site<'_>) -> f64 {
        -self.torque_nm
    }
}

effect! {
    struct FlowDependentHtc "X_flow_dependent_htc";
    name: "other exponent of convection",
    description: "the exponent of the flow in the convection is other than the correlation's",
    equation: "h (m/0.06 kg/s)^e",
    source: "withheld from the diagnosis",
    submodel: CompressorGas, also_shows_in: [];
    /// Excess of the exponent.
    exponent = "e" ["1"] -1.0 .. 1.0, neutral 0.0, step 0.25;
    |cause, rig| rig.hook(cause)?
}

impl Hooks for FlowDependentHtc {
    fn h_w_m2k(&self, site: &Site<'_>, h_w_m2k: f64) -> f64 {
        h_w_m2k * (site.flow_kg_s / 0.06).powf(self.exponent)
    }
}

effect! {
    struct SlowHousingProbe "X_slow_housing_probe";
    name: "slow housing probe",
    description: "a slow probe in the compressor housing",
    equation: "dTc_read/dt = (Tc - Tc_read)/tau",
    source: "withheld from the diagnosis",
    submodel: TcProbe, also_shows_in: [];
    /// Time constant of the probe, s.
    lag_s = "tau" ["s"] 0.0 .. 120.0, neutral 0.0, step 12.0;
    |cause, rig| rig.instruments.path_mut(Channel::Tc).lag_s += cause.lag_s
}
