//! Configuration of identification: method, window, geometry, declared uncertainty, thresholds.

use crate::step_outcome::error::IdentifyError;
use mapper_core::{
    Channel, InletConvection, JointSettings, Method, ModelTolerances, Recording, ReferenceState,
    ResultRemark, RigActuators, SettleBands, WindowRule,
};
pub use mapper_core::{DeclaredUncertainty, NoiseColour};
use mapper_numerics::coloured_noise::ColouredNoise;
use mapper_physics::gas::air::Air;
use mapper_physics::gas::mixture::Gas;
use mapper_physics::gas::pressure_tap::static_to_total_pa;
use mapper_physics::machine::params::{BearingParams, Params, TurbineParams};
use mapper_physics::rig::sensor_fault::ExactReadings;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Thresholds of every campaign.
const USUAL_THRESHOLDS: Thresholds = Thresholds {
    // Bound: the standard deviation of the residual is then known to a sixth, 1 / sqrt(2 n).
    fewest_samples: 20,
    // Judgement: more lost samples indicate a defect of the logger.
    lost_samples_ratio: 0.05,
    // Judgement: two points of efficiency; users of a map notice more.
    sigma_eta: 0.02,
    // Bound: efficiencies of compressors range over 0.6, so such an error carries no information.
    unusable_sigma_eta: 0.2,
    // Bound: five times the noise of a thermocouple, 0.1 K; a smaller change hardly determines two parameters.
    dt2_k: 0.5,
    // Bound: a quarter of the error above which a point is doubtful.
    flow_drift_eta: 0.005,
    // Bound: by chance, 20 samples exceed it once in 900 fits (chi-square with 20 degrees of freedom).
    residual_over_noise_ratio: 1.5,
    // Judgement: slow residuals of less than 2 % of the change of T2 are usual model errors.
    structure_ratio: 0.02,
    // Bound: several correlation times of sensor noise.
    steady_mean_s: 10.0,
    // Judgement: five times the noise of a slope over a minute.
    steady_drift_k_min: 0.5,
    // Bound: short compared with the housings' time constants, longer than the correlation time of sensor noise.
    end_mean_s: 2.0,
};

/// Settings of an identification.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct IdentifyConfig {
    /// Conventional or dynamic.
    pub method: Method,
    /// Part of each step that the dynamic method uses.
    pub window: WindowRule,
    /// Criterion for a settled operating point.
    pub settle_bands: SettleBands,
    /// Assumed share of the internal area before compression, alpha_A, 0..1.
    pub alpha_area_ratio: f64,
    /// Uncertainty of the assumed share, one standard deviation: part of the intervals of the dynamic method, which cannot determine the
    /// share. 0 trusts the assumption.
    pub alpha_area_sigma_ratio: f64,
    /// Internal area of the compressor housing A_c, m2, > 0.
    pub internal_area_m2: f64,
    /// Relative uncertainty of that area, one standard deviation: part of the intervals of h, since a recording determines h times the area.
    pub internal_area_sigma_ratio: f64,
    /// Declared law of h before the wheel.
    pub inlet_convection: InletConvection,
    /// Diameter of the inlet pipe, m, > 0: characteristic length of the convection law before the wheel.
    pub inlet_diameter_m: f64,
    /// Diameter of the outlet pipe, m, > 0: characteristic length of the convection law, and position of the T2 probe.
    pub outlet_diameter_m: f64,
    /// Declared diameter of the T2 probe's tip, m, >= 0; 0 is a probe without inertia.
    pub probe_diameter_m: f64,
    /// The compressor housing, for its heat balance.
    pub housing: Housing,
    /// Model parameters with a prior that the joint method searches for.
    pub joint: JointSettings,
    /// Reference state of corrected quantities, dry air.
    pub reference: ReferenceState,
    /// The compressed air.
    pub air: Air,
    /// Diameter of the compressor wheel at its exit, m; `None` if it is not declared.
    #[serde(default)]
    pub wheel_diameter_m: Option<f64>,
    /// The gas of the turbine.
    pub turbine_gas: Gas,
    /// The turbine as declared: housing and wheel.
    pub turbine: TurbineParams,
    /// Inertia of the shaft, kg m2, > 0.
    pub shaft_inertia_kgm2: f64,
    /// One standard deviation of the humidity of `air`, kg/kg: part of the intervals of the joint method.
    pub humidity_sigma_kg_kg: f64,
    /// Readings of an isothermal zero: gain errors count from there.
    pub exact_at: ExactReadings,
    /// Declared actuators; `None`: their motion is not judged.
    #[serde(default)]
    pub actuators: Option<RigActuators>,
    /// Whether openings are areas relative to the nominal one, as in the program's own recordings; otherwise any number of a stand.
    pub opening_is_area: bool,
    /// Error that all absolute pressures share, one standard deviation, Pa: of the barometer to which gauge pressures are added, and what an
    /// isothermal zero cannot show.
    pub barometer_sigma_pa: f64,
    /// Reading of the cell's barometer on the day of the run, Pa; `None` if none is declared. A zero is compared with it.
    pub barometer_pa: Option<f64>,
    /// Error that all thermometers share, one standard deviation, K: what an isothermal zero cannot show; 0 without a zero, whose offsets are
    /// independent.
    pub thermometer_sigma_k: f64,
    /// Share by which Tc may read towards the cell, one standard deviation above 0: by the mounting of its thermocouple. 0 trusts the contact.
    pub housing_contact_sigma_ratio: f64,
    /// Type of the P1 tap.
    pub inlet_tap: PressureTap,
    /// Type of the P2 tap.
    pub outlet_tap: PressureTap,
    /// Type of the P3 tap.
    pub turbine_inlet_tap: PressureTap,
    /// Declared uncertainty of the sensors, SI units. Missing channels count as exact.
    pub declared: BTreeMap<Channel, DeclaredUncertainty>,
    /// Their offsets before an isothermal zero, one standard deviation; empty without one.
    pub offsets_before_zero: BTreeMap<Channel, f64>,
    /// Time correlation of sensor noise.
    pub noise_colour: NoiseColour,
    /// Sizes of what is efficiency for the method but may be something else.
    pub allowance: Allowance,
    /// Limits above which a point is doubtful.
    pub thresholds: Thresholds,
}

impl Default for IdentifyConfig {
    /// The dynamic method on the nominal machine (Appendix A of the paper), total-pressure taps, no declared uncertainty.
    fn default() -> Self {
        let machine = Params::default().compressor;
        IdentifyConfig {
            method: Method::Dynamic,
            window: WindowRule::default(),
            settle_bands: SettleBands::default(),
            alpha_area_ratio: 0.0,
            alpha_area_sigma_ratio: 0.0,
            internal_area_m2: machine.internal_area_m2,
            internal_area_sigma_ratio: 0.0,
            inlet_convection: InletConvection::Shared,
            inlet_diameter_m: machine.inlet_diameter_m,
            outlet_diameter_m: machine.outlet_diameter_m,
            probe_diameter_m: 0.0,
            housing: Housing::of(&Params::default()),
            joint: JointSettings::default(),
            reference: ReferenceState::SAE,
            air: Air::PAPER,
            wheel_diameter_m: None,
            turbine_gas: Gas::CLOSED_FORM_AIR,
            turbine: Params::default().turbine,
            shaft_inertia_kgm2: Params::default().shaft_inertia_kgm2,
            humidity_sigma_kg_kg: 0.0,
            exact_at: ExactReadings::default(),
            actuators: None,
            opening_is_area: false,
            barometer_sigma_pa: 0.0,
            barometer_pa: None,
            thermometer_sigma_k: 0.0,
            housing_contact_sigma_ratio: 0.0,
            inlet_tap: PressureTap::Total,
            outlet_tap: PressureTap::Total,
            turbine_inlet_tap: PressureTap::Total,
            declared: BTreeMap::new(),
            offsets_before_zero: BTreeMap::new(),
            noise_colour: NoiseColour::default(),
            allowance: Allowance::default(),
            thresholds: Thresholds::default(),
        }
    }
}

impl IdentifyConfig {
    /// Checks that all numbers are in range.
    pub(crate) fn check(&self) -> Result<(), IdentifyError> {
        let share = |name, value: f64| (name, value, (0.0..=1.0).contains(&value), "a share from 0 to 1");
        let positive = |name, value: f64, expected| (name, value, value.is_finite() && value > 0.0, expected);
        let colour = self.noise_colour;
        let mut checks = vec![
            share("alpha_area_ratio", self.alpha_area_ratio),
            share("alpha_area_sigma_ratio", self.alpha_area_sigma_ratio),
            share("internal_area_sigma_ratio", self.internal_area_sigma_ratio),
            share("recirculation_ratio", self.allowance.recirculation_ratio),
            share("t2_recovery_ratio", self.allowance.t2_recovery_ratio),
            positive("internal_area_m2", self.internal_area_m2, "a positive area, m2"),
            positive("time_constant_s", colour.time_constant_s, "a positive time, s"),
            share("first_order_share_ratio", colour.first_order_share_ratio),
        ];
        for tap in [self.inlet_tap, self.outlet_tap, self.turbine_inlet_tap] {
            if let PressureTap::Static { pipe_diameter_m } = tap {
                checks.push(positive("pipe_diameter_m", pipe_diameter_m, "a positive diameter, m"));
            }
        }
        if let WindowRule::Fixed { start_s, end_s } = self.window {
            checks.push(("start_s", start_s, start_s >= 0.0, "0 s or more after the jump"));
            checks.push(("end_s", end_s, end_s > start_s, "later than the window's start"));
        }
        match checks.into_iter().find(|(_, _, usable, _)| !usable) {
            Some((name, value, _, expected)) => Err(IdentifyError::Config { name, value, expected }),
            None => Ok(()),
        }
    }

    /// Declared play of the back-pressure valve, opening.
    pub(crate) fn valve_play_ratio(&self) -> f64 {
        self.actuators.map_or(0.0, |actuators| actuators.valve_play_ratio)
    }

    /// Corrected flow, kg/s: the flow of dry air in the reference state at the same Mach numbers.
    pub(crate) fn corrected_flow_kg_s(&self, flow_kg_s: f64, t1_k: f64, p1_pa: f64) -> f64 {
        self.reference.corrected_flow_kg_s(flow_kg_s * self.air.dry_flow_ratio(), t1_k, p1_pa)
    }

    pub(crate) fn sensor(&self, channel: Channel) -> DeclaredUncertainty {
        self.declared.get(&channel).copied().unwrap_or_default()
    }

    /// The declared noise in the form that the numerics use.
    pub(crate) fn noise(&self) -> ColouredNoise {
        ColouredNoise::new(self.noise_colour.first_order_share_ratio, self.noise_colour.time_constant_s)
    }
}

/// The compressor housing as declared: what its heat balance needs besides the gas.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Housing {
    /// Mass, kg, > 0.
    pub mass_kg: f64,
    /// Standard deviation of ln of the heat capacity.
    pub ln_capacity_sigma: f64,
    /// External area, m2.
    pub external_area_m2: f64,
    /// External emissivity, 0..1, ratio to a black body.
    pub emissivity_ratio: f64,
    /// Bearing housing and oil.
    pub bearing: BearingParams,
}

/// Standard deviation of ln of the heat capacity of a housing with a declared mass. Bound: pipes, clamps and insulation that warm up with it.
const DECLARED_CAPACITY_SIGMA: f64 = 0.3;
/// The same without a declaration. Bound: from a third to three times that of the nominal machine at this internal area.
const UNDECLARED_CAPACITY_SIGMA: f64 = 1.0;

/// Exponent of the mass of similar housings over their area. Source: volume over area.
const MASS_BY_AREA: f64 = 1.5;

impl Housing {
    /// The housing of a declared machine.
    pub fn of(params: &Params) -> Self {
        Housing {
            mass_kg: params.compressor.housing_mass_kg,
            ln_capacity_sigma: DECLARED_CAPACITY_SIGMA,
            external_area_m2: params.compressor.external_area_m2,
            emissivity_ratio: params.compressor.emissivity_ratio,
            bearing: params.bearing,
        }
    }

    /// The housing of a machine of which only the internal area is known: the nominal machine at another size.
    pub fn of_internal_area(internal_area_m2: f64) -> Self {
        let nominal = Params::default();
        let area_ratio = internal_area_m2 / nominal.compressor.internal_area_m2;
        let declared = Housing::of(&nominal);
        Housing {
            mass_kg: declared.mass_kg * area_ratio.powf(MASS_BY_AREA),
            ln_capacity_sigma: UNDECLARED_CAPACITY_SIGMA,
            external_area_m2: declared.external_area_m2 * area_ratio,
            ..declared
        }
    }
}

/// Sizes of what is efficiency for the method but may be something else, one standard deviation each.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Allowance {
    /// Share of the delivered flow that recirculates.
    pub recirculation_ratio: f64,
    /// Share of the dynamic temperature that the T2 probe may miss.
    pub t2_recovery_ratio: f64,
    /// Conductance from the bearing housing to the gas behind the wheel, W/K.
    pub heat_behind_wheel_w_k: f64,
}

impl From<&ModelTolerances> for Allowance {
    fn from(tolerances: &ModelTolerances) -> Self {
        let &ModelTolerances { recirculation_ratio, t2_recovery_ratio, heat_behind_wheel_w_k, .. } =
            tolerances;
        Allowance { recirculation_ratio, t2_recovery_ratio, heat_behind_wheel_w_k }
    }
}

impl Default for Allowance {
    fn default() -> Self {
        Allowance::from(&ModelTolerances::default())
    }
}

/// The pressure that a tap measures.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PressureTap {
    /// Total pressure (or the channel was already converted).
    #[default]
    Total,
    /// Static pressure at the wall of a pipe.
    Static {
        /// Inner diameter of the pipe at the tap, m, > 0.
        pipe_diameter_m: f64,
    },
}

impl PressureTap {
    /// Total pressure at the tap.
    pub(crate) fn total_pa(self, read_pa: f64, flow_kg_s: f64, total_temperature_k: f64) -> f64 {
        match self {
            PressureTap::Total => read_pa,
            PressureTap::Static { pipe_diameter_m } => {
                static_to_total_pa(read_pa, flow_kg_s, total_temperature_k, pipe_diameter_m)
            }
        }
    }
}

/// Limits for doubtful and unusable points.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Thresholds {
    /// Minimum number of complete samples in the window; fewer make the point unusable.
    pub fewest_samples: usize,
    /// Maximum share of lost samples in the window without a doubt.
    pub lost_samples_ratio: f64,
    /// Standard error of eta (fraction) above which the gradient counts as too small.
    pub sigma_eta: f64,
    /// Standard error of eta (fraction) above which the point is unusable.
    pub unusable_sigma_eta: f64,
    /// Minimum change of T2 over the window without a doubt, K.
    pub dt2_k: f64,
    /// Estimated error of eta (fraction) due to a changing flow in the window, above which the point is doubtful.
    pub flow_drift_eta: f64,
    /// Ratio of residual to declared noise above which the fit is poor.
    pub residual_over_noise_ratio: f64,
    /// Ratio of the slow residual (10 s means) to the change of T2 above which the fit is poor.
    pub structure_ratio: f64,
    /// Averaging time at the end of the step for `steady` and the balances, s.
    pub steady_mean_s: f64,
    /// `steady`: drift of T2 or Tc above which the step has not settled, K/min.
    pub steady_drift_k_min: f64,
    /// Averaging time for the state of the point, at the end of the step, s.
    pub end_mean_s: f64,
}

impl Default for Thresholds {
    fn default() -> Self {
        USUAL_THRESHOLDS
    }
}

/// Channels that every point needs: its position on the map, and the temperature rise.
const EVERY: [Channel; 6] =
    [Channel::ShaftSpeed, Channel::CompressorFlow, Channel::P1, Channel::T1, Channel::P2, Channel::T2];

/// Channels that a method needs.
pub fn needs(method: Method) -> Vec<Channel> {
    let housing = (method != Method::Steady).then_some(Channel::Tc);
    EVERY.into_iter().chain(housing).collect()
}

/// Channels that a method needs and the recording does not have.
pub fn missing(recording: &Recording, method: Method) -> Vec<Channel> {
    needs(method).into_iter().filter(|channel| recording.require(*channel).is_err()).collect()
}

/// The default method for a recording, and why it differs from `usual`. Without a housing temperature no heat-transfer model applies, so only
/// the apparent efficiency remains.
pub fn method_for(recording: &Recording, usual: Method) -> (Method, Option<ResultRemark>) {
    let lost = missing(recording, usual);
    if lost.is_empty() || usual == Method::Steady || !missing(recording, Method::Steady).is_empty() {
        return (usual, None);
    }
    (Method::Steady, Some(ResultRemark::ConventionalMapping { usual, missing: lost }))
}
