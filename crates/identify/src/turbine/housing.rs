//! Heat from the gas to the turbine housing before the wheel, by the heat balance of the housing over all steps together.
//!
//! `C dTt/dt = q - G_b (Tt - T_b(Tt, Tc, T_oil)) - loss to the cell`, one mass, with the measured Tt. `q = h A (T3' - Tt)`, h by the declared law of
//! Nusselt. Factors on h, capacity, losses and conduction and the exponent of the law are fitted to the rate of Tt in blocks of each step. The
//! scatter that the balance leaves counts as its error. A second mass behind the probe is not distinguished: its heat is the balance's error.

use crate::IdentifyConfig;
use mapper_core::{
    Channel, Recording, Series, StepMarker, TurbineHousing, confidence_interval_95, is_reading,
};
use mapper_numerics::least_squares::{DifferenceStep, Model, Normal, Until, descend};
use mapper_numerics::statistics::{mean, robust_sigma};
use mapper_physics::gas::air::viscosity_pa_s;
use mapper_physics::laws::convection::coefficient_w_m2k;
use mapper_physics::laws::housing::{
    bearing_conductance_w_k, bearing_k, external_heat_w, friction_heat_w, turbine_capacity_of_mass_j_k,
};
use mapper_physics::machine::params::rad_s_of_rpm;
use nalgebra::{DMatrix, DVector};

/// Length of a block, s. Bound: several seconds, in which the rate of Tt stands above its noise, and at most a quarter of a short dwell.
const BLOCK_S: f64 = 8.0;
/// Minimum number of readings of a block. Bound: a slope and its scatter.
const MIN_READINGS: usize = 4;
/// Smallest noise of Tt, K. Bound: thermocouples are read to a tenth of a kelvin.
const LEAST_NOISE_K: f64 = 0.03;
/// Standard deviations of the unknowns: ln of the factor on h, exponent of the law, ln of the factors on capacity, loss to the cell and
/// conduction to the bearing. Source: published turbines of automotive size lie within two of them; turbulent exponents are 0.6 to 0.8.
const SIGMAS: [f64; 5] = [0.4, 0.1, 0.3, 0.8, 0.8];
/// Number of unknowns.
const UNKNOWNS: usize = SIGMAS.len();
/// Repeated estimates of the scatter. Bound: each reduces its error to about a tenth.
const ROUNDS: usize = 3;
/// Largest value of an unknown, in standard deviations. Bound: nothing is farther from its declaration.
const MAX_SIGMAS: f64 = 5.0;
/// Standard deviation of the heat without a measured housing temperature, ratio. Bound: that of h, with a housing between insulated and bare.
const UNMEASURED_RATIO: f64 = 0.5;
/// Halvings of the range of the housing temperature. Bound: far below the error of the heat.
const ROOT_ITERATIONS: usize = 40;

/// Means of the readings that the balance needs.
#[derive(Debug, Clone, Copy)]
pub(crate) struct HousingState {
    pub(crate) flow_kg_s: f64,
    pub(crate) t3_k: f64,
    /// NaN if it is not measured.
    pub(crate) tt_k: f64,
    /// Compressor housing; NaN if it is not measured.
    pub(crate) tc_k: f64,
    /// NaN if it is not measured.
    pub(crate) oil_k: f64,
    pub(crate) ambient_k: f64,
    /// NaN if it is not measured.
    pub(crate) speed_rpm: f64,
}

struct Block {
    state: HousingState,
    /// Rate of Tt, K/s, and its standard error.
    rate_k_s: f64,
    rate_sigma_k_s: f64,
}

/// The fitted balance.
pub(crate) struct HousingBalance<'a> {
    config: &'a IdentifyConfig,
    reynolds_reference: f64,
    unknowns: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl<'a> HousingBalance<'a> {
    /// Fits the balance to the steps; with the declared values where Tt is not measured.
    pub(crate) fn of(recording: &Recording, config: &'a IdentifyConfig) -> Self {
        let blocks: Vec<Block> =
            recording.steps.iter().flat_map(|step| blocks_of(recording, step, config)).collect();
        let ln_reynolds = blocks.iter().map(|block| reynolds(&block.state, config).ln());
        let mut balance = HousingBalance {
            config,
            reynolds_reference: mean(ln_reynolds.collect::<Vec<_>>()).unwrap_or(0.0).exp(),
            unknowns: DVector::zeros(UNKNOWNS),
            covariance: DMatrix::identity(UNKNOWNS, UNKNOWNS),
        };
        // What the balance leaves is the same for all blocks of a step.
        let blocks_per_step = blocks.len() as f64 / recording.steps.len().max(1) as f64;
        let mut scatter_k_s = 0.0;
        for _ in 0..ROUNDS {
            let Some((unknowns, covariance)) = balance.fitted(&blocks, scatter_k_s) else { break };
            (balance.unknowns, balance.covariance) = (unknowns, covariance);
            let residuals = blocks.iter().map(|block| balance.residual_k_s(block, &balance.unknowns));
            let noise = mean(blocks.iter().map(|block| block.rate_sigma_k_s).collect::<Vec<_>>());
            let left = robust_sigma(residuals).zip(noise).map(|(all, noise)| all * all - noise * noise);
            scatter_k_s = (left.unwrap_or(0.0).max(0.0) * blocks_per_step).sqrt();
        }
        balance
    }

    /// The fitted numbers; `None` if Tt was not measured.
    pub(crate) fn housing(&self) -> Option<TurbineHousing> {
        if self.reynolds_reference <= 1.0 {
            return None;
        }
        let turbine = &self.config.turbine;
        let error = |i: usize| SIGMAS[i] * self.covariance[(i, i)].sqrt();
        let with_interval = |i: usize, number: &dyn Fn(f64) -> f64| {
            let value = SIGMAS[i] * self.unknowns[i];
            let (low, high) = confidence_interval_95(value, error(i));
            [value, low, high].map(number)
        };
        let declared = turbine.nusselt_coefficient * self.reynolds_reference.powf(turbine.nusselt_exponent);
        let correlation = |i: usize, j: usize| {
            self.covariance[(i, j)] / (self.covariance[(i, i)] * self.covariance[(j, j)]).sqrt()
        };
        Some(TurbineHousing {
            reynolds: self.reynolds_reference,
            nusselt: with_interval(0, &|ln| declared * ln.exp()),
            exponent: with_interval(1, &|change| turbine.nusselt_exponent + change),
            capacity_ratio: with_interval(2, &f64::exp),
            external_heat_ratio: with_interval(3, &f64::exp),
            bearing_conductance_ratio: with_interval(4, &f64::exp),
            correlations: (0..UNKNOWNS).map(|i| (0..UNKNOWNS).map(|j| correlation(i, j)).collect()).collect(),
        })
    }

    /// Heat to the housing, W, and its standard error.
    pub(crate) fn heat_w(&self, state: &HousingState) -> (f64, f64) {
        if !state.tt_k.is_finite() {
            let heat_w = self.gas_w(&HousingState { tt_k: self.settled_k(state), ..*state }, &self.unknowns);
            return (heat_w, UNMEASURED_RATIO * heat_w.abs());
        }
        let here = self.gas_w(state, &self.unknowns);
        let step = DifferenceStep::Fine.distance();
        let slopes = DVector::from_fn(UNKNOWNS, |i, _| {
            let mut moved = self.unknowns.clone();
            moved[i] += step;
            (self.gas_w(state, &moved) - here) / step
        });
        (here, slopes.dot(&(&self.covariance * &slopes)).max(0.0).sqrt())
    }

    /// Temperature of a housing that has settled, K.
    fn settled_k(&self, state: &HousingState) -> f64 {
        let (mut low, mut high) = (state.ambient_k.min(state.t3_k), state.t3_k);
        for _ in 0..ROOT_ITERATIONS {
            let middle = HousingState { tt_k: 0.5 * (low + high), ..*state };
            let gains = self.gas_w(&middle, &self.unknowns) > self.lost_w(&middle, &self.unknowns);
            if gains { low = middle.tt_k } else { high = middle.tt_k }
        }
        0.5 * (low + high)
    }

    fn gas_w(&self, state: &HousingState, unknowns: &DVector<f64>) -> f64 {
        let turbine = &self.config.turbine;
        let factor = SIGMAS[0] * unknowns[0]
            + SIGMAS[1] * unknowns[1] * (reynolds(state, self.config) / self.reynolds_reference).ln();
        let h_w_m2k = coefficient_w_m2k(
            turbine.nusselt_coefficient,
            turbine.nusselt_exponent,
            turbine.inlet_diameter_m,
            state.flow_kg_s,
            state.t3_k,
            state.tt_k,
        ) * factor.exp();
        let capacity_w_k = state.flow_kg_s * self.config.turbine_gas.heat_capacity_j_kgk(state.t3_k);
        let transfer_units = h_w_m2k * turbine.internal_area_m2 / capacity_w_k;
        capacity_w_k * transfer_units / (1.0 + transfer_units) * (state.t3_k - state.tt_k)
    }

    fn lost_w(&self, state: &HousingState, unknowns: &DVector<f64>) -> f64 {
        let (turbine, bearing) = (&self.config.turbine, &self.config.housing.bearing);
        let external_w = external_heat_w(
            turbine.external_area_m2,
            turbine.emissivity_ratio,
            1.0,
            state.tt_k,
            state.ambient_k,
        );
        let conductance_w_k = bearing_conductance_w_k(bearing);
        let tc_k = if state.tc_k.is_finite() { state.tc_k } else { state.ambient_k };
        let (oil_w_k, oil_k) =
            if state.oil_k.is_finite() { (bearing.oil_conductance_w_k, state.oil_k) } else { (0.0, tc_k) };
        let known = state.oil_k.is_finite() && state.speed_rpm.is_finite();
        let friction_w = if known { friction_heat_w(bearing, rad_s_of_rpm(state.speed_rpm)) } else { 0.0 };
        let node_k = bearing_k(conductance_w_k, oil_w_k, friction_w, tc_k, state.tt_k, oil_k);
        external_w * (SIGMAS[3] * unknowns[3]).exp()
            + conductance_w_k * (state.tt_k - node_k) * (SIGMAS[4] * unknowns[4]).exp()
    }

    fn capacity_j_k(&self, tt_k: f64) -> f64 {
        turbine_capacity_of_mass_j_k(self.config.turbine.housing_mass_kg, tt_k)
    }

    /// Of the rate: residuals in watts would become small with all heats.
    fn residual_k_s(&self, block: &Block, unknowns: &DVector<f64>) -> f64 {
        let capacity_j_k = self.capacity_j_k(block.state.tt_k) * (SIGMAS[2] * unknowns[2]).exp();
        let net_w = self.gas_w(&block.state, unknowns) - self.lost_w(&block.state, unknowns);
        block.rate_k_s - net_w / capacity_j_k
    }

    fn fitted(&self, blocks: &[Block], scatter_k_s: f64) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let sigmas_k_s = blocks.iter().map(|block| block.rate_sigma_k_s.hypot(scatter_k_s)).collect();
        let mut fit = BalanceFit { balance: self, blocks, sigmas_k_s };
        let point = fit.at(&self.unknowns)?;
        let end = descend(&mut fit, self.unknowns.clone(), point, Until::default());
        Some((end.unknowns, end.normal.covariance_from(0)?))
    }
}

/// Whitened residuals of all blocks over the unknowns, which are in units of their prior.
struct BalanceFit<'a, 'c> {
    balance: &'a HousingBalance<'c>,
    blocks: &'a [Block],
    sigmas_k_s: Vec<f64>,
}

impl Model for BalanceFit<'_, '_> {
    type Point = DVector<f64>;

    fn at(&self, unknowns: &DVector<f64>) -> Option<DVector<f64>> {
        let of_blocks = self.blocks.iter().zip(&self.sigmas_k_s);
        let residuals = of_blocks.map(|(block, sigma)| self.balance.residual_k_s(block, unknowns) / sigma);
        let residuals = DVector::from_iterator(self.blocks.len(), residuals);
        (!residuals.is_empty() && residuals.iter().all(|value| value.is_finite())).then_some(residuals)
    }

    fn cost(&self, unknowns: &DVector<f64>, point: &DVector<f64>) -> f64 {
        point.norm_squared() + unknowns.norm_squared()
    }

    fn normal(&mut self, unknowns: &DVector<f64>, point: &DVector<f64>, reach: DifferenceStep) -> Normal {
        let step = reach.distance();
        let columns: Vec<DVector<f64>> = (0..UNKNOWNS)
            .map(|i| {
                let mut moved = unknowns.clone();
                moved[i] += step;
                self.at(&moved).map_or_else(|| DVector::zeros(point.len()), |moved| (moved - point) / step)
            })
            .collect();
        let slopes = DMatrix::from_columns(&columns);
        Normal {
            matrix: slopes.tr_mul(&slopes) + DMatrix::identity(UNKNOWNS, UNKNOWNS),
            gradient: -(slopes.tr_mul(point) + unknowns),
        }
    }

    fn step_bounds(&self, unknowns: &DVector<f64>) -> Vec<(f64, f64)> {
        unknowns.iter().map(|value| (-MAX_SIGMAS - value, MAX_SIGMAS - value)).collect()
    }
}

fn reynolds(state: &HousingState, config: &IdentifyConfig) -> f64 {
    let radius_m = 0.5 * config.turbine.inlet_diameter_m;
    2.0 * state.flow_kg_s / (std::f64::consts::PI * radius_m * viscosity_pa_s(state.t3_k))
}

/// The means over a time span; `None` without flow or T3.
pub(crate) fn housing_state(recording: &Recording, span_s: (f64, f64)) -> Option<HousingState> {
    let level = |channel: Channel| {
        let values = recording.series.get(&channel)?.slice(span_s.0, span_s.1).1;
        mean(values.iter().filter(|value| is_reading(channel, **value)))
    };
    let or_nan = |channel: Channel| level(channel).unwrap_or(f64::NAN);
    Some(HousingState {
        flow_kg_s: level(Channel::TurbineFlow).filter(|flow| *flow > 0.0)?,
        t3_k: level(Channel::T3)?,
        tt_k: or_nan(Channel::Tt),
        tc_k: or_nan(Channel::Tc),
        oil_k: or_nan(Channel::TOil),
        ambient_k: level(Channel::TAmb).or_else(|| level(Channel::T1))?,
        speed_rpm: or_nan(Channel::ShaftSpeed),
    })
}

fn blocks_of(recording: &Recording, step: &StepMarker, config: &IdentifyConfig) -> Vec<Block> {
    let Some(tt) = recording.series.get(&Channel::Tt) else { return Vec::new() };
    let count = ((step.end_s - step.start_s) / BLOCK_S).floor().max(1.0);
    let length_s = (step.end_s - step.start_s) / count;
    let starts_s = (0..count as usize).map(|place| step.start_s + place as f64 * length_s);
    starts_s.filter_map(|start_s| block_of(recording, tt, (start_s, start_s + length_s), config)).collect()
}

fn block_of(
    recording: &Recording,
    tt: &Series,
    span_s: (f64, f64),
    config: &IdentifyConfig,
) -> Option<Block> {
    let state = housing_state(recording, span_s)?;
    let (t_s, values) = tt.slice(span_s.0, span_s.1);
    let line = Line::through(t_s, values, |value| is_reading(Channel::Tt, value))?;
    // The part of the noise that lasts longer than a sample interval averages out less.
    let noise = config.noise().variance_of_mean(line.count, span_s.1 - span_s.0) * line.count as f64;
    let declared_k = config.sensor(Channel::Tt).noise_sigma;
    let sigma_k = line.scatter.max(declared_k).max(LEAST_NOISE_K) * noise.max(1.0).sqrt();
    Some(Block { state, rate_k_s: line.slope, rate_sigma_k_s: sigma_k / line.spread })
}

pub(crate) struct Line {
    /// Unit of the readings per second.
    pub(crate) slope: f64,
    /// Root of the sum of squares of the distances in time from their mean, s.
    spread: f64,
    scatter: f64,
    count: usize,
}

impl Line {
    /// By least squares; `None` if there are too few.
    pub(crate) fn through(t_s: &[f64], values: &[f64], is_usable: impl Fn(f64) -> bool) -> Option<Line> {
        let usable: Vec<(f64, f64)> =
            t_s.iter().copied().zip(values.iter().copied()).filter(|(_, value)| is_usable(*value)).collect();
        if usable.len() < MIN_READINGS {
            return None;
        }
        let count = usable.len() as f64;
        let middle_s = usable.iter().map(|(t_s, _)| t_s).sum::<f64>() / count;
        let level = usable.iter().map(|(_, value)| value).sum::<f64>() / count;
        let squares: f64 = usable.iter().map(|(t_s, _)| (t_s - middle_s).powi(2)).sum();
        let product: f64 = usable.iter().map(|(t_s, value)| (t_s - middle_s) * (value - level)).sum();
        let slope = product / squares;
        let left: f64 =
            usable.iter().map(|(t_s, value)| (value - level - slope * (t_s - middle_s)).powi(2)).sum();
        (squares > 0.0).then(|| Line {
            slope,
            spread: squares.sqrt(),
            scatter: (left / (count - 2.0)).sqrt(),
            count: usable.len(),
        })
    }
}
