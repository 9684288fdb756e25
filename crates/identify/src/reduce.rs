//! Identifies the points of a table of steady measurements: the apparent efficiency, or the adiabatic efficiency of a machine whose convection is
//! known. A housing temperature that was not measured is that of the heat balance, if T3 was measured.
//!
//! Each source of uncertainty is changed by one standard deviation to both sides, and the efficiency is computed again.

use crate::allowance;
use crate::points::point;
use crate::single_step::budgets;
use crate::single_step::dynamic::{Estimate, judge_assumption};
use crate::single_step::fit::ETA_BOUNDS;
use crate::step_data::end_state::EndState;
use crate::step_outcome::findings::{Findings, wide_interval};
use crate::{IdentifyConfig, IdentifyError};
use mapper_core::{
    Channel, EstimateUncertainty, EtaSignal, IdentifiedPoint, MeasuredPoint, Method, ModelTolerances,
    NoCompression, PointBudgets, ReferenceState, SAMPLE_INTERVAL_S, StepKind, StepMarker, Warning,
};
use mapper_numerics::root::root_between;
use mapper_physics::compressor_map::closed_form_map::OnePointMap;
use mapper_physics::gas::air::Air;
use mapper_physics::laws::compression::apparent_efficiency;
use mapper_physics::machine::params::{BoundaryConditions, Params};
use mapper_physics::simulation::model::{Model, Outputs, State, rad_s_of_rpm};
use mapper_physics::simulation::steady::settle_housings;
use std::sync::Arc;

/// Lower ends of the search for the efficiency, ratios to the apparent one, tried in turn. Bound: where the search starts; an end
/// without a balance is skipped.
const SEARCH_STARTS: [f64; 4] = [0.95, 0.8, 0.6, 0.4];
/// Tolerance of the search. Bound: far below any digit that is shown.
const ETA_TOLERANCE: f64 = 1e-10;

/// A machine whose heat transfer is known.
#[derive(Debug, Clone, Copy)]
pub struct KnownHeat<'a> {
    /// Its parameters: convection, alpha_A, the T2 probe.
    pub params: &'a Params,
    /// Standard uncertainties of its heat transfer and of the conditions around it.
    pub tolerances: ModelTolerances,
    /// Conditions around it that a table may omit: oil, cell, P4.
    pub boundary: &'a BoundaryConditions,
    /// Origin of the law, for people: "declared in a.yaml".
    pub origin: &'a str,
}

/// Points and budgets of steady points, in order. `config.method` says whether their heat is removed, which needs `heat` and a housing
/// temperature or T3 at every point; see [`method_of_table`].
pub fn reduce(
    measured: &[MeasuredPoint],
    heat: Option<KnownHeat<'_>>,
    config: &IdentifyConfig,
) -> Result<Vec<(IdentifiedPoint, PointBudgets)>, IdentifyError> {
    config.check()?;
    let heat = heat.filter(|_| config.method == Method::Corrected);
    Ok(measured.iter().enumerate().map(|(index, measured)| of_point(index, measured, heat, config)).collect())
}

/// Method for the points of a table: heat is removed if the housing temperature, or T3 for its heat balance, was measured at every point.
pub fn method_of_table(measured: &[MeasuredPoint], has_heat: bool) -> Method {
    match has_heat && measured.iter().all(|point| point.tc_k.or(point.turbine.t3_k).is_some()) {
        true => Method::Corrected,
        false => Method::Steady,
    }
}

fn of_point(
    index: usize,
    measured: &MeasuredPoint,
    heat: Option<KnownHeat<'_>>,
    config: &IdentifyConfig,
) -> (IdentifiedPoint, PointBudgets) {
    let air = measured.humidity_kg_kg.map_or(config.air, |humidity| config.air.with_humidity(humidity));
    let config = &IdentifyConfig { air, ..config.clone() };
    let mut findings = Findings::new();
    let state = EndState {
        speed_rpm: measured.speed_rpm,
        flow_kg_s: measured.flow_kg_s,
        t1_k: measured.t1_k,
        p1_pa: measured.p1_pa,
        pressure_ratio: measured.p2_pa / measured.p1_pa,
        bearing_k: measured.turbine.oil_k.or(measured.tc_k),
    };
    let estimate = estimate(measured, heat, config, &mut findings);
    let step = StepMarker {
        index,
        kind: StepKind::Point,
        start_s: 0.0,
        end_s: config.thresholds.steady_mean_s,
        from: None,
        to: None,
        p3_pa: f64::NAN,
        valve_opening_ratio: f64::NAN,
    };
    let point = point(&step, &state, &estimate, findings, config);
    let eta_allowance = point.eta.and_then(|eta| allowance::budget(eta, &state, config));
    let budgets = budgets::of_point(&point, eta_allowance, &estimate, |_| samples(config), config);
    (point, budgets)
}

/// Samples of a mean over the end of a point.
fn samples(config: &IdentifyConfig) -> usize {
    (config.thresholds.steady_mean_s / SAMPLE_INTERVAL_S).round() as usize
}

fn estimate(
    measured: &MeasuredPoint,
    heat: Option<KnownHeat<'_>>,
    config: &IdentifyConfig,
    findings: &mut Findings,
) -> Estimate {
    let mut estimate = Estimate::default();
    let Some(t2_k) = measured.t2_k else {
        findings.refuse(Warning::NoCompression(NoCompression::NoT2));
        return estimate;
    };
    let machine = heat.map(|heat| {
        let (readings, around) = (measured.turbine, heat.boundary);
        let boundary = BoundaryConditions {
            t1_k: measured.t1_k,
            p1_pa: measured.p1_pa,
            t3_k: readings.t3_k.unwrap_or(around.t3_k),
            p3_pa: readings.p3_pa.unwrap_or(around.p3_pa),
            p4_pa: readings.p4_pa.unwrap_or(around.p4_pa),
            oil_temperature_k: readings.oil_k.unwrap_or(around.oil_temperature_k),
            ..*around
        };
        Machine { params: *heat.params, boundary }
    });
    let inputs = Inputs { point: *measured, t2_k, air: config.air, machine };
    let Some(eta) = inputs.efficiency() else {
        findings.refuse(Warning::NoCompression(NoCompression::NoRise {
            rise_k: t2_k - measured.t1_k,
            pressure_ratio: measured.p2_pa / measured.p1_pa,
        }));
        return estimate;
    };
    findings.refuse_impossible(eta);
    let mut uncertainty = EstimateUncertainty::default();
    let (mut rows, mut known_square) = (Vec::new(), 0.0_f64);
    for source in inputs.sources(heat, config) {
        let contribution = inputs.change(&source, eta);
        if matches!(source.input, Input::AlphaArea) {
            judge_assumption(contribution, config, findings);
        } else {
            known_square += contribution * contribution;
        }
        let error = match source.is_shared {
            true => &mut uncertainty.bias_standard_error,
            false => &mut uncertainty.noise_standard_error,
        };
        *error = error.hypot(contribution);
        if source.is_shared {
            estimate.common[0].push(contribution);
        }
        let Source { name, sigma, unit, .. } = source;
        rows.push(budgets::row(name, sigma, unit, contribution / sigma, contribution));
    }
    if known_square.sqrt() > config.thresholds.sigma_eta {
        let signal = EtaSignal::Settled { rise_k: t2_k - measured.t1_k };
        findings.doubt(wide_interval(uncertainty, signal));
    }
    match heat {
        Some(heat) => {
            let at = inputs
                .machine
                .as_ref()
                .and_then(|machine| Some(inputs.outputs(machine, eta, &inputs.housing(machine, eta)?)));
            let h_w_m2k = at.map_or(f64::NAN, |at| at.h_w_m2k);
            let bias_standard_error = heat.tolerances.convection_ratio * h_w_m2k;
            let error = EstimateUncertainty { noise_standard_error: 0.0, bias_standard_error };
            estimate.h_w_m2k = Some((h_w_m2k, Some(error)));
            findings.remark(Warning::FromConvectionLaw { convection_origin: Some(heat.origin.to_owned()) });
        }
        None => findings.remark(Warning::Apparent),
    }
    findings.remark_undeclared(config);
    estimate.eta = Some((eta, Some(uncertainty)));
    estimate.budgets[0] = rows;
    estimate
}

/// Inputs of the efficiency of a point.
#[derive(Debug, Clone, Copy)]
struct Inputs {
    point: MeasuredPoint,
    t2_k: f64,
    air: Air,
    /// The machine, if its heat is removed.
    machine: Option<Machine>,
}

/// A machine and the conditions around it.
#[derive(Debug, Clone, Copy)]
struct Machine {
    params: Params,
    boundary: BoundaryConditions,
}

/// A source of uncertainty.
struct Source {
    name: String,
    sigma: f64,
    unit: &'static str,
    /// Whether all points share the error.
    is_shared: bool,
    input: Input,
}

/// An input with an error.
#[derive(Debug, Clone, Copy)]
enum Input {
    Reading(Channel),
    /// By a ratio.
    Gain(Channel),
    Barometer,
    Humidity,
    /// By a ratio.
    Convection,
    AlphaArea,
    /// By a ratio: conduction to the oil and through the bearing housing.
    Bearing,
    /// By a ratio.
    CellConvection,
    OilTemperature,
    AmbientTemperature,
}

impl Inputs {
    /// The efficiency; `None` if there is none.
    fn efficiency(&self) -> Option<f64> {
        let MeasuredPoint { t1_k, p1_pa, p2_pa, .. } = self.point;
        let apparent = apparent_efficiency(p2_pa / p1_pa, t1_k, self.t2_k, self.air.between(p1_pa, p2_pa));
        let eta = match &self.machine {
            None => apparent,
            Some(machine) => {
                self.adiabatic_efficiency(machine, apparent.clamp(ETA_BOUNDS.0, ETA_BOUNDS.1))?
            }
        };
        (eta.is_finite() && eta > 0.0 && p2_pa > p1_pa).then_some(eta)
    }

    /// The efficiency with the housing of the measurement, or with that of the heat balance, which depends on it.
    fn adiabatic_efficiency(&self, machine: &Machine, apparent: f64) -> Option<f64> {
        let excess_k = |eta: f64| {
            let housing = self.housing(machine, eta);
            housing.map_or(f64::NAN, |at| self.outputs(machine, eta, &at).t2_probe_target_k - self.t2_k)
        };
        // No balance holds far below the apparent efficiency, where the compressor takes more than the turbine can give.
        let lowest = match self.point.tc_k {
            Some(_) => vec![ETA_BOUNDS.0],
            None => SEARCH_STARTS.map(|share| (share * apparent).max(ETA_BOUNDS.0)).to_vec(),
        };
        lowest.into_iter().find_map(|lowest| root_between(lowest, ETA_BOUNDS.1, ETA_TOLERANCE, excess_k))
    }

    /// The state of the machine with settled housings; `None` if they do not settle.
    fn housing(&self, machine: &Machine, eta: f64) -> Option<State> {
        let MeasuredPoint { speed_rpm, p2_pa, tc_k, turbine, .. } = self.point;
        let at = |tc_k: f64| State::new(rad_s_of_rpm(speed_rpm), p2_pa, tc_k, tc_k, self.t2_k);
        tc_k.map(at).or_else(|| {
            let (model, boundary) = self.model(machine, eta);
            settle_housings(&model, &boundary, speed_rpm, p2_pa, turbine.p3_pa.is_some())
        })
    }

    /// The machine at this point with an efficiency.
    fn outputs(&self, machine: &Machine, eta: f64, housing: &State) -> Outputs {
        let (model, boundary) = self.model(machine, eta);
        model.prepare(&boundary).evaluate(housing)
    }

    fn model(&self, machine: &Machine, eta: f64) -> (Model, BoundaryConditions) {
        let mut params = machine.params;
        let compressor = &mut params.compressor;
        (compressor.humidity_kg_kg, compressor.efficiency) = (self.air.humidity_kg_kg(), self.air.efficiency);
        (compressor.flow_scale_ratio, compressor.efficiency_scale_ratio) = (1.0, 1.0);
        let map = OnePointMap {
            // At the state of the inlet itself corrected flow equals measured flow. The wheel also pumps the recirculated flow.
            reference: ReferenceState { t_ref_k: self.point.t1_k, p_ref_pa: self.point.p1_pa },
            flow_corrected_kg_s: self.point.flow_kg_s
                * self.air.dry_flow_ratio()
                * (1.0 + compressor.recirculation_ratio),
            efficiency: eta,
        };
        let boundary =
            BoundaryConditions { t1_k: self.point.t1_k, p1_pa: self.point.p1_pa, ..machine.boundary };
        (Model::new(params, Arc::new(map)), boundary)
    }

    /// Change of the efficiency by one standard deviation of a source: mean of both sides, if both have an efficiency.
    fn change(&self, source: &Source, eta: f64) -> f64 {
        let moved = |by: f64| self.moved(source.input, by).efficiency();
        // A share below 0 has no meaning: change it towards the middle, as all methods do.
        let alpha = self.machine.map(|machine| machine.params.compressor.alpha_area_ratio);
        let (above, below) = match source.input {
            Input::AlphaArea if alpha.is_some_and(|alpha| alpha > 0.5) => (None, moved(-source.sigma)),
            Input::AlphaArea => (moved(source.sigma), None),
            _ => (moved(source.sigma), moved(-source.sigma)),
        };
        match (above, below) {
            (Some(above), Some(below)) => 0.5 * (above - below),
            (Some(above), None) => above - eta,
            (None, Some(below)) => eta - below,
            // No efficiency on either side: the error has no bound but the search range.
            (None, None) => ETA_BOUNDS.1,
        }
    }

    fn sources(&self, heat: Option<KnownHeat<'_>>, config: &IdentifyConfig) -> Vec<Source> {
        let mut sources = Vec::new();
        let mut push = |name: String, sigma: f64, unit: &'static str, is_shared: bool, input: Input| {
            if sigma > 0.0 {
                sources.push(Source { name, sigma, unit, is_shared, input });
            }
        };
        let averaging =
            config.noise().variance_of_mean(samples(config), config.thresholds.steady_mean_s).sqrt();
        let is_balance = heat.is_some() && self.point.tc_k.is_none();
        let mut channels = vec![Channel::T1, Channel::T2, Channel::P1, Channel::P2];
        channels.extend(heat.is_some().then_some(Channel::CompressorFlow));
        channels.extend(heat.is_some().then_some(if is_balance { Channel::T3 } else { Channel::Tc }));
        for channel in channels {
            let declared = config.sensor(channel);
            let unit = channel.unit();
            push(format!("offset of {channel}"), declared.offset_sigma, unit, true, Input::Reading(channel));
            push(format!("gain of {channel}"), declared.gain_sigma_ratio, "1", true, Input::Gain(channel));
            let noise = averaging * declared.noise_sigma;
            push(format!("noise of {channel}"), noise, unit, false, Input::Reading(channel));
        }
        push("barometer".to_owned(), config.barometer_sigma_pa, "Pa", true, Input::Barometer);
        if self.point.humidity_kg_kg.is_none() {
            push("humidity".to_owned(), config.humidity_sigma_kg_kg, "kg/kg", true, Input::Humidity);
        }
        if let Some(heat) = heat {
            let tolerances = heat.tolerances;
            push("convection law".to_owned(), tolerances.convection_ratio, "1", true, Input::Convection);
            push("alpha_A".to_owned(), config.alpha_area_sigma_ratio, "1", true, Input::AlphaArea);
            for (name, sigma, unit, moved) in [
                ("conduction to the oil", tolerances.oil_conductance_ratio, "1", Input::Bearing),
                ("convection to the cell", tolerances.external_convection_ratio, "1", Input::CellConvection),
                ("oil temperature", tolerances.oil_temperature_k, "K", Input::OilTemperature),
                ("ambient temperature", tolerances.ambient_temperature_k, "K", Input::AmbientTemperature),
            ] {
                if is_balance {
                    push(name.to_owned(), sigma, unit, true, moved);
                }
            }
        }
        sources
    }

    fn moved(&self, input: Input, by: f64) -> Inputs {
        let mut moved = *self;
        let reading = match input {
            Input::Reading(channel) | Input::Gain(channel) => moved.reading(channel),
            _ => None,
        };
        match (input, reading) {
            (Input::Reading(_), Some(reading)) => *reading += by,
            (Input::Gain(channel), Some(reading)) => *reading += by * channel.gain_distance(*reading),
            (Input::Barometer, _) => {
                moved.point.p1_pa += by;
                moved.point.p2_pa += by;
            }
            (Input::Humidity, _) => moved.air = moved.air.with_humidity(moved.air.humidity_kg_kg() + by),
            (input, _) => {
                if let Some(machine) = &mut moved.machine {
                    machine.move_by(input, by);
                }
            }
        }
        moved
    }

    fn reading(&mut self, channel: Channel) -> Option<&mut f64> {
        match channel {
            Channel::T1 => Some(&mut self.point.t1_k),
            Channel::T2 => Some(&mut self.t2_k),
            Channel::P1 => Some(&mut self.point.p1_pa),
            Channel::P2 => Some(&mut self.point.p2_pa),
            Channel::CompressorFlow => Some(&mut self.point.flow_kg_s),
            Channel::Tc => self.point.tc_k.as_mut(),
            Channel::T3 => self.machine.as_mut().map(|machine| &mut machine.boundary.t3_k),
            _ => None,
        }
    }
}

impl Machine {
    fn move_by(&mut self, input: Input, by: f64) {
        let Machine { params, boundary } = self;
        match input {
            // One law of both housings.
            Input::Convection => {
                params.compressor.nusselt_coefficient *= 1.0 + by;
                params.turbine.nusselt_coefficient *= 1.0 + by;
            }
            Input::AlphaArea => params.compressor.alpha_area_ratio += by,
            Input::Bearing => {
                params.bearing.conductivity_w_mk *= 1.0 + by;
                params.bearing.oil_conductance_w_k *= 1.0 + by;
            }
            Input::CellConvection => params.external_convection_ratio *= 1.0 + by,
            Input::OilTemperature => boundary.oil_temperature_k += by,
            Input::AmbientTemperature => boundary.ambient_temperature_k += by,
            Input::Reading(_) | Input::Gain(_) | Input::Barometer | Input::Humidity => {}
        }
    }
}
