//! Steady states, and the inputs of a simulation.

use crate::machine::params::{BoundaryConditions, MAX_EXTRA};
use crate::simulation::model::{BoundaryError, Model, Outputs, State, rad_s_of_rpm};
use mapper_numerics::root::root_between;
use nalgebra::{SMatrix, SVector};

/// Unknown temperatures: both housings, the inner wall, and the extra states of effects.
const HEAT_NODES: usize = 3 + MAX_EXTRA;
type Temperatures = SVector<f64, HEAT_NODES>;

/// A steady state with all outputs of the model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SteadyState {
    /// Boundary conditions, with the P3 that holds the speed.
    pub boundary: BoundaryConditions,
    /// The state; the probe's tip has the gas temperature.
    pub state: State,
    /// Outputs at the state.
    pub outputs: Outputs,
}

impl SteadyState {
    /// Corrected flow over the surge flow at equal corrected speed, minus one; negative beyond the surge line.
    pub fn surge_margin_ratio(&self, model: &Model) -> f64 {
        let speed_rpm = self.state.shaft_speed_rpm();
        let corrected_rpm = model.map.reference().corrected_speed_rpm(speed_rpm, self.boundary.t1_k);
        self.outputs.flow_corrected_kg_s / model.map.surge_point(corrected_rpm).0 - 1.0
    }
}

/// Reason for a missing steady state.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum SteadyError {
    #[error(transparent)]
    Boundary(#[from] BoundaryError),
    #[error(
        "at {speed_rpm:.0} rpm the flows of compressor and valve (opening {valve_opening_ratio}) are equal at no outlet pressure"
    )]
    NoFlowBalance { speed_rpm: f64, valve_opening_ratio: f64 },
    #[error(
        "no turbine inlet pressure between {lowest_pa:.0} and {highest_pa:.0} Pa gives the {power_w:.0} W that the compressor needs at {speed_rpm:.0} rpm, valve opening {valve_opening_ratio}"
    )]
    NoPowerBalance { speed_rpm: f64, valve_opening_ratio: f64, power_w: f64, lowest_pa: f64, highest_pa: f64 },
    #[error(
        "the housing temperatures at {speed_rpm:.0} rpm, valve opening {valve_opening_ratio}, do not settle"
    )]
    NoHeatBalance { speed_rpm: f64, valve_opening_ratio: f64 },
}

/// Highest pressure tried, relative to P4.
const MAX_EXPANSION_RATIO: f64 = 20.0;
/// Largest residual heat flow of a housing, W: far below 1e-6 of any shaft power.
const HEAT_TOLERANCE_W: f64 = 1e-9;

/// Finds the steady state at `speed_rpm` under `boundary`. Ignores `p3_pa` and computes it.
///
/// Nested solution: outlet pressure from the flow balance, P3 from the power balance, temperatures by Newton's method.
pub fn hold_speed(
    model: &Model,
    speed_rpm: f64,
    boundary: &BoundaryConditions,
) -> Result<SteadyState, SteadyError> {
    let mut boundary = *boundary;
    boundary.p3_pa = boundary.p4_pa * 1.5;
    boundary.check()?;
    if !(speed_rpm.is_finite() && speed_rpm > 0.0) {
        return Err(BoundaryError::NotPhysical { name: "shaft speed", value: speed_rpm, unit: "rpm" }.into());
    }
    let no_heat_balance =
        SteadyError::NoHeatBalance { speed_rpm, valve_opening_ratio: boundary.valve_opening_ratio };
    let balance = |temperatures: Temperatures| {
        let (boundary, state) = steady_gas_path(model, speed_rpm, &boundary, temperatures)?;
        Ok((heat_flows_w(model, &boundary, &state), (boundary, state)))
    };
    let (boundary, mut state) = settle(model, &boundary, no_heat_balance, balance)?;
    let prepared = model.prepare(&boundary);
    state.t2_tip_k = prepared.evaluate(&state).t2_probe_target_k;
    let outputs = prepared.evaluate(&state);
    Ok(SteadyState { boundary, state, outputs })
}

/// Finds the equilibrium of the housings at a known speed and outlet pressure. If P3 is not known, it is the pressure that holds the speed.
/// `None` if there is no equilibrium.
pub fn settle_housings(
    model: &Model,
    boundary: &BoundaryConditions,
    shaft_speed_rpm: f64,
    p2_pa: f64,
    p3_is_known: bool,
) -> Option<State> {
    let balance = |temperatures: Temperatures| {
        let state = State {
            inner_k: temperatures[2],
            ..State::new(
                rad_s_of_rpm(shaft_speed_rpm),
                p2_pa,
                temperatures[0],
                temperatures[1],
                boundary.t1_k,
            )
        };
        let outputs = model.prepare(boundary).evaluate(&state);
        let p3_pa = if p3_is_known {
            boundary.p3_pa
        } else {
            holding_p3_pa(model, boundary, &state, &outputs).ok_or(())?
        };
        let boundary = BoundaryConditions { p3_pa, ..*boundary };
        Ok((heat_flows_w(model, &boundary, &state), state))
    };
    settle(model, boundary, (), balance).ok()
}

fn heat_flows_w(model: &Model, boundary: &BoundaryConditions, state: &State) -> Temperatures {
    let prepared = model.prepare(boundary);
    let outputs = prepared.evaluate(state);
    Temperatures::from([
        prepared.compressor_housing_balance_w(state, &outputs),
        prepared.turbine_housing_balance_w(state, &outputs),
        prepared.inner_wall_balance_w(&outputs),
        // Rates of hidden temperatures, as heat flows of a node of 1 kJ/K.
        1e3 * outputs.added.extra_rates_k_s[0],
        1e3 * outputs.added.extra_rates_k_s[1],
    ])
}

/// Solves for the temperatures of all nodes by Newton's method; `balance` gives their heat flows and the result for these temperatures.
fn settle<T, E>(
    model: &Model,
    boundary: &BoundaryConditions,
    no_heat_balance: E,
    balance: impl Fn(Temperatures) -> Result<(Temperatures, T), E>,
) -> Result<T, E> {
    let extra_states = model.hooks.extra_states();
    let is_free = [true, true, model.has_inner_wall(), extra_states > 0, extra_states > 1];
    let first_k = boundary.t1_k + 30.0;
    let turbine_k = 0.5 * (boundary.t3_k + boundary.ambient_temperature_k);
    let mut temperatures = Temperatures::from([first_k, turbine_k, first_k, first_k, first_k]);
    let (mut heat_w, mut result) = balance(temperatures)?;
    for _ in 0..60 {
        if heat_w.amax() < HEAT_TOLERANCE_W {
            return Ok(result);
        }
        // Forward differences of the balances, which are smooth in the temperatures.
        let step_k = 1e-4;
        let mut slopes = SMatrix::<f64, HEAT_NODES, HEAT_NODES>::identity();
        for node in (0..HEAT_NODES).filter(|node| is_free[*node]) {
            let mut shifted = temperatures;
            shifted[node] += step_k;
            let (shifted_heat_w, _) = balance(shifted)?;
            slopes.set_column(node, &((shifted_heat_w - heat_w) / step_k));
        }
        let Some(step) = slopes.lu().solve(&-heat_w).filter(|step| step.iter().all(|step| step.is_finite()))
        else {
            return Err(no_heat_balance);
        };
        let (old_heat_w, old_temperatures) = (heat_w, temperatures);
        let mut fraction = (80.0 / step.amax()).min(1.0);
        loop {
            temperatures =
                (old_temperatures + step * fraction).map(|temperature| temperature.clamp(200.0, 1500.0));
            (heat_w, result) = balance(temperatures)?;
            if heat_w.norm() < old_heat_w.norm() || fraction < 1e-3 {
                break;
            }
            fraction *= 0.5;
        }
        if temperatures == old_temperatures {
            // The balances are within rounding.
            return if heat_w.amax() < 1e-6 { Ok(result) } else { Err(no_heat_balance) };
        }
    }
    Err(no_heat_balance)
}

/// Solves P2 from the flow balance and P3 from the power balance, at given speed and housing temperatures.
fn steady_gas_path(
    model: &Model,
    speed_rpm: f64,
    boundary: &BoundaryConditions,
    temperatures: Temperatures,
) -> Result<(BoundaryConditions, State), SteadyError> {
    let valve_opening_ratio = boundary.valve_opening_ratio;
    let mut boundary = *boundary;
    let tt_k = temperatures[1];
    let at = |p2_pa: f64| State {
        inner_k: temperatures[2],
        extra_k: [temperatures[3], temperatures[4]],
        ..State::new(rad_s_of_rpm(speed_rpm), p2_pa, temperatures[0], tt_k, boundary.t1_k)
    };
    let prepared = model.prepare(&boundary);
    let corrected_rpm = model.map.reference().corrected_speed_rpm(speed_rpm, boundary.t1_k);
    let (_, surge_pr) = model.map.surge_point(corrected_rpm);
    // Far enough beyond the surge line that the flow is zero.
    let highest_pa = boundary.p1_pa * (1.0 + 2.0 * (surge_pr - 1.0).max(1e-3));
    let p2_pa = root_between(boundary.p1_pa, highest_pa, 0.0, |p2_pa| {
        let outputs = prepared.evaluate(&at(p2_pa));
        outputs.flow_kg_s - outputs.valve_flow_kg_s + outputs.added.outlet_flow_kg_s
    })
    .ok_or(SteadyError::NoFlowBalance { speed_rpm, valve_opening_ratio })?;
    let state = at(p2_pa);
    let outputs = prepared.evaluate(&state);
    boundary.p3_pa = holding_p3_pa(model, &boundary, &state, &outputs).ok_or_else(|| {
        let (lowest_pa, highest_pa) = turbine_pressures_pa(&boundary);
        let power_w = shaft_load_w(&outputs);
        SteadyError::NoPowerBalance { speed_rpm, valve_opening_ratio, power_w, lowest_pa, highest_pa }
    })?;
    Ok((boundary, state))
}

/// Power demand of compressor and bearings, W.
fn shaft_load_w(outputs: &Outputs) -> f64 {
    outputs.compressor_power_w + outputs.friction_power_w - outputs.added.shaft_power_w
}

fn turbine_pressures_pa(boundary: &BoundaryConditions) -> (f64, f64) {
    (boundary.p4_pa * (1.0 + 1e-6), boundary.p4_pa * MAX_EXPANSION_RATIO)
}

/// The turbine inlet pressure that holds the speed, Pa.
fn holding_p3_pa(
    model: &Model,
    boundary: &BoundaryConditions,
    state: &State,
    outputs: &Outputs,
) -> Option<f64> {
    let (lowest_pa, highest_pa) = turbine_pressures_pa(boundary);
    root_between(lowest_pa, highest_pa, 0.0, |p3_pa| {
        let turbine = crate::laws::turbine::TurbineInlet::new(
            &model.params.turbine,
            &BoundaryConditions { p3_pa, ..*boundary },
        );
        turbine.at(state.tt_k, state.shaft_speed_rad_s).power_w - shaft_load_w(outputs)
    })
}

/// Range of speeds that [`settle_under`] searches, rpm.
const SETTLE_SPEEDS_RPM: (f64, f64) = (5_000.0, 400_000.0);

/// Finds the steady state that the machine reaches from low speed under `boundary`, `p3_pa` included.
///
/// It is the lowest speed that needs this P3, found on a geometric grid of 5 % and refined to rounding.
pub fn settle_under(model: &Model, boundary: &BoundaryConditions) -> Result<SteadyState, SteadyError> {
    boundary.check()?;
    let excess_pa = |speed_rpm: f64| {
        hold_speed(model, speed_rpm, boundary)
            .map_or(f64::NAN, |steady| steady.boundary.p3_pa - boundary.p3_pa)
    };
    let mut low_rpm = SETTLE_SPEEDS_RPM.0;
    while low_rpm < SETTLE_SPEEDS_RPM.1 {
        let high_rpm = low_rpm * 1.05;
        if excess_pa(high_rpm) >= 0.0 {
            let speed_rpm = root_between(low_rpm, high_rpm, 0.0, excess_pa).unwrap_or(low_rpm);
            return hold_speed(model, speed_rpm, boundary);
        }
        low_rpm = high_rpm;
    }
    Err(SteadyError::NoPowerBalance {
        speed_rpm: SETTLE_SPEEDS_RPM.1,
        valve_opening_ratio: boundary.valve_opening_ratio,
        power_w: f64::NAN,
        lowest_pa: boundary.p4_pa,
        highest_pa: boundary.p3_pa,
    })
}

/// Boundary conditions as a function of time, smooth between its kinks.
pub trait Inputs {
    /// Boundary conditions at `t_s`.
    fn at(&self, t_s: f64) -> BoundaryConditions;

    /// Time passed to hooks at `t_s`, s; NaN without a time, as in a steady state.
    fn time_s(&self, t_s: f64) -> f64 {
        t_s
    }

    /// The next time after `t_s` at which a value or a slope jumps; infinity if there is none.
    fn next_kink_s(&self, t_s: f64) -> f64;

    /// Whether all inputs are constant from `t_s` to the next kink: the model is then prepared once.
    fn is_constant_after(&self, t_s: f64) -> bool;
}

impl Inputs for BoundaryConditions {
    fn at(&self, _t_s: f64) -> BoundaryConditions {
        *self
    }

    fn time_s(&self, _t_s: f64) -> f64 {
        f64::NAN
    }

    fn next_kink_s(&self, _t_s: f64) -> f64 {
        f64::INFINITY
    }

    fn is_constant_after(&self, _t_s: f64) -> bool {
        true
    }
}

/// Recorded boundary conditions, linear between their times and constant beyond both ends.
#[derive(Debug, Clone, PartialEq)]
pub struct InterpolatedInputs {
    t_s: Vec<f64>,
    rows: Vec<BoundaryConditions>,
}

/// Reason why a table cannot be interpolated.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum InputsError {
    #[error(
        "{times} times and {rows} rows of boundary conditions; their numbers must be equal, and at least one"
    )]
    Lengths { times: usize, rows: usize },
    #[error("the times of boundary conditions must rise; {after_s} s comes after {before_s} s")]
    Order { before_s: f64, after_s: f64 },
}

impl InterpolatedInputs {
    /// Takes strictly rising times, s, and as many rows.
    pub fn new(t_s: Vec<f64>, rows: Vec<BoundaryConditions>) -> Result<Self, InputsError> {
        if t_s.is_empty() || t_s.len() != rows.len() {
            return Err(InputsError::Lengths { times: t_s.len(), rows: rows.len() });
        }
        if let Some(pair) = t_s.windows(2).find(|pair| !matches!(pair, [a, b] if a < b)) {
            return Err(InputsError::Order { before_s: pair[0], after_s: pair[1] });
        }
        Ok(InterpolatedInputs { t_s, rows })
    }
}

impl Inputs for InterpolatedInputs {
    fn at(&self, t_s: f64) -> BoundaryConditions {
        let after = self.t_s.partition_point(|t| *t <= t_s);
        if after == 0 {
            return self.rows[0];
        }
        if after == self.t_s.len() {
            return self.rows[after - 1];
        }
        let (a, b) = (&self.rows[after - 1], &self.rows[after]);
        let share = (t_s - self.t_s[after - 1]) / (self.t_s[after] - self.t_s[after - 1]);
        let interpolate = |x: f64, y: f64| x + (y - x) * share;
        BoundaryConditions {
            t1_k: interpolate(a.t1_k, b.t1_k),
            p1_pa: interpolate(a.p1_pa, b.p1_pa),
            p3_pa: interpolate(a.p3_pa, b.p3_pa),
            t3_k: interpolate(a.t3_k, b.t3_k),
            p4_pa: interpolate(a.p4_pa, b.p4_pa),
            oil_temperature_k: interpolate(a.oil_temperature_k, b.oil_temperature_k),
            ambient_temperature_k: interpolate(a.ambient_temperature_k, b.ambient_temperature_k),
            valve_opening_ratio: interpolate(a.valve_opening_ratio, b.valve_opening_ratio),
        }
    }

    fn next_kink_s(&self, t_s: f64) -> f64 {
        self.t_s.get(self.t_s.partition_point(|t| *t <= t_s)).copied().unwrap_or(f64::INFINITY)
    }

    fn is_constant_after(&self, t_s: f64) -> bool {
        let after = self.t_s.partition_point(|t| *t <= t_s);
        after == 0 || after == self.t_s.len() || self.rows[after - 1] == self.rows[after]
    }
}
