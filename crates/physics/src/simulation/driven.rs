//! The model driven by recorded inputs on a frozen grid of steps.
//!
//! Runs with slightly different parameters share every step, so that their difference is as smooth as the model
//! itself. A fit needs this, and adaptive steps would destroy it. The grid is fine after each jump and coarse while only the metal
//! changes; each step is one of [Rodas5P](crate::simulation::rosenbrock), which is L-stable, so that the outlet volume (milliseconds)
//! does not limit it.

use crate::compressor_map::closed_form_map::CharacteristicPoint;
use crate::machine::params::{BoundaryConditions, MAX_STATES};
use crate::simulation::model::{Model, Outputs, PreparedModel, State};
use crate::simulation::rosenbrock::{Integrator, OdeSystem, Step};
use crate::simulation::simulate::tolerances;
use crate::simulation::steady::Inputs;
use nalgebra::{Const, DimMin};

/// Maximum length of a step: a share of the time since the jump within these limits, s. P2 changes within milliseconds of a jump; later
/// speed and probe settle more and more slowly. Chosen with the tests below: errors stay below a third of the noise of a sample.
const STEP_RATIO: f64 = 0.25;
const STEP_LIMITS_S: (f64, f64) = (0.01, 6.0);

/// Estimated error of a step, relative to the states, above which the grid is too coarse for it: 10 rpm at 100 krpm and 10 Pa at 100 kPa, a
/// third of the noise of a sample at most. Along the surge line the error is a hundred times larger.
pub(crate) const GRID_TOLERANCE: f64 = 1e-4;
/// Tolerance of the approach to a steady state: only the end must be accurate.
const ANY_ERROR: f64 = 1e6;
/// Relative tolerance of the integration if the steps of the grid are too coarse: that of the virtual lab. Maximum number of
/// its steps: a surge cycle lasts a second and takes a hundred steps.
const RESCUE_TOLERANCE: f64 = 1e-5;
const MAX_RESCUE_STEPS: usize = 10_000;

/// Times between which the integration takes one step each.
#[derive(Debug, Clone, PartialEq)]
pub struct FrozenGrid {
    nodes_s: Vec<f64>,
}

impl FrozenGrid {
    /// A grid from `start_s` to `end_s` with nodes at each of `jumps_s` and `times_s` (both rising), and between
    /// these with the step length for the time since the last jump. Results are read only at nodes, where the method is
    /// stiffly accurate.
    pub fn new(start_s: f64, end_s: f64, jumps_s: &[f64], times_s: &[f64]) -> Self {
        let mut stops_s: Vec<f64> = jumps_s.iter().chain(times_s).copied().collect();
        stops_s.retain(|t| *t > start_s && *t < end_s);
        stops_s.push(end_s);
        stops_s.sort_by(f64::total_cmp);
        let mut nodes_s = vec![start_s];
        let before_start = |jump_s: &f64| *jump_s <= start_s;
        let mut jump_s = jumps_s.iter().copied().filter(before_start).fold(f64::NEG_INFINITY, f64::max);
        let mut at_s = start_s;
        for until_s in stops_s {
            while until_s - at_s > 1e-9 {
                let since_s = at_s - jump_s;
                let (shortest_s, longest_s) = STEP_LIMITS_S;
                let limit_s = (STEP_RATIO * since_s).clamp(shortest_s, longest_s);
                // Equal parts, each within the limit.
                let parts = ((until_s - at_s) / limit_s - 1e-6).ceil().max(1.0);
                at_s =
                    if parts <= 1.0 { until_s } else { at_s + ((until_s - at_s) / parts).max(limit_s * 0.5) };
                nodes_s.push(at_s);
            }
            if jumps_s.contains(&until_s) {
                jump_s = until_s;
            }
        }
        FrozenGrid { nodes_s }
    }

    /// The steps between two nodes; none outside the grid.
    pub fn part(&self, from_s: f64, to_s: f64) -> FrozenGrid {
        let inside = |t_s: &&f64| (from_s..=to_s).contains(*t_s);
        FrozenGrid { nodes_s: self.nodes_s.iter().filter(inside).copied().collect() }
    }

    /// Ends of the steps, s.
    pub fn nodes_s(&self) -> &[f64] {
        &self.nodes_s
    }
}

/// A drive that left the valid range of the model.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("the driven model cannot continue at {t_s:.2} s; the inputs or parameters there are beyond it")]
pub struct DriveError {
    /// Time, s.
    pub t_s: f64,
}

/// Drives `model` from `start` over the grid. `on_sample` receives the index of each of `times_s` (rising, within the grid)
/// with the model there.
pub fn drive(
    model: &Model,
    inputs: &impl Inputs,
    start: State,
    grid: &FrozenGrid,
    times_s: &[f64],
    mut on_sample: impl FnMut(usize, &PreparedModel<'_>, &State, &Outputs),
) -> Result<State, DriveError> {
    let start_s = grid.nodes_s.first().copied().unwrap_or(f64::INFINITY);
    let mut next = times_s.partition_point(|t| *t < start_s);
    drive_steps(GRID_TOLERANCE, model, inputs, start, grid, |system, step| {
        while let Some(t_s) = times_s.get(next).filter(|t| **t <= step.times_s[1]) {
            let (prepared, state) = (system.prepare_for(*t_s), (step.state_at)(*t_s));
            on_sample(next, prepared, &state, &prepared.evaluate(&state));
            next += 1;
        }
    })
}

pub(crate) struct DrivenStep<'a> {
    /// Start and end, s.
    pub(crate) times_s: [f64; 2],
    pub(crate) start: State,
    /// State at the end, and between the start and it if one step of the method was sufficient.
    pub(crate) state_at: &'a dyn Fn(f64) -> State,
}

/// Drives `model` from `start` over the grid; `on_step` receives each step.
pub(crate) fn drive_steps<I: Inputs>(
    tolerance_ratio: f64,
    model: &Model,
    inputs: &I,
    start: State,
    grid: &FrozenGrid,
    on_step: impl FnMut(&mut DrivenSystem<'_, I>, DrivenStep<'_>),
) -> Result<State, DriveError> {
    if model.hooks.extra_states() > 0 {
        run::<{ MAX_STATES }, I>(tolerance_ratio, model, inputs, start, grid, on_step)
    } else if model.has_inner_wall() {
        run::<6, I>(tolerance_ratio, model, inputs, start, grid, on_step)
    } else {
        run::<5, I>(tolerance_ratio, model, inputs, start, grid, on_step)
    }
}

/// The steady state of `model` under constant boundary conditions, from a first guess: driven for ten hours.
pub fn settle(model: &Model, boundary: &BoundaryConditions, guess: State) -> Result<State, DriveError> {
    // Growing steps: one far longer than every time constant of an L-stable method ends at the steady state. If the guess is
    // beyond the surge line, the first step is too long for the outlet volume: start again from its own milliseconds.
    let drive_with_steps = |first_s: f64, growth: f64| {
        let mut nodes_s = vec![0.0];
        let mut step_s = first_s;
        let mut at_s = 0.0;
        while at_s < 36_000.0 {
            at_s += step_s;
            step_s *= growth;
            nodes_s.push(at_s);
        }
        drive_steps(ANY_ERROR, model, boundary, guess, &FrozenGrid { nodes_s }, |_, _| {})
    };
    drive_with_steps(0.02, 1.5).or_else(|_| drive_with_steps(1e-4, 1.2))
}

fn run<const N: usize, I: Inputs>(
    tolerance_ratio: f64,
    model: &Model,
    inputs: &I,
    start: State,
    grid: &FrozenGrid,
    mut on_step: impl FnMut(&mut DrivenSystem<'_, I>, DrivenStep<'_>),
) -> Result<State, DriveError>
where
    Const<N>: DimMin<Const<N>, Output = Const<N>>,
{
    let Some(&start_s) = grid.nodes_s.first() else { return Ok(start) };
    let mut integrator = Integrator::<N>::new(start_s, start.to_array(), tolerances(tolerance_ratio));
    for pair in grid.nodes_s.windows(2) {
        let failed = DriveError { t_s: pair[0] };
        // The step uses its own inputs up to its end, even if the inputs jump there.
        let end_s = pair[1];
        let boundary = inputs.at(pair[0]);
        boundary.check().map_err(|_| failed)?;
        let mut system = DrivenSystem {
            model,
            inputs,
            last_s: last_of_step_s(pair[0], end_s),
            boundary_s: pair[0],
            prepared: model.prepare_at(inputs.time_s(pair[0]), &boundary),
            on_map: None,
        };
        // The speed line has a corner on the surge line, with an infinite slope on one side: short steps across it.
        let surge_before = system.surge_position(&integrator.y);
        let (saved, start) = (integrator.clone(), integrator.y);
        let step = integrator.step_on_grid(&mut system, end_s).ok().filter(|(step, _)| is_physical(&step.y1));
        let step = match step {
            Some((step, error)) if error <= 1.0 && !system.crosses_corner(surge_before, &step.y1) => step,
            // The step crosses the corner, runs along a steep part of a speed line, or fails far beyond the surge line.
            _ => {
                integrator = saved;
                step_with_error_control(&mut integrator, &mut system, end_s).ok_or(failed)?
            }
        };
        let state_at = |t_s: f64| State::from_array(&step.at(t_s));
        let (times_s, start) = ([pair[0], end_s], State::from_array(&start));
        on_step(&mut system, DrivenStep { times_s, start, state_at: &state_at });
    }
    Ok(State::from_array(&integrator.y))
}

/// Integrates to `end_s` with error control; `None` if no physically possible state leads there.
fn step_with_error_control<const N: usize>(
    integrator: &mut Integrator<N>,
    system: &mut DrivenSystem<'_, impl Inputs>,
    end_s: f64,
) -> Option<Step<N>>
where
    Const<N>: DimMin<Const<N>, Output = Const<N>>,
{
    let mut controlled = Integrator::new(integrator.t_s, integrator.y, tolerances(RESCUE_TOLERANCE));
    let step = loop {
        let step = controlled.step(system, end_s).ok()?;
        if !is_physical(&step.y1) || controlled.steps() > MAX_RESCUE_STEPS {
            return None;
        }
        if step.t1_s >= end_s {
            break step;
        }
    };
    (integrator.t_s, integrator.y) = (controlled.t_s, controlled.y);
    Some(step)
}

/// Whether the shaft turns and the outlet holds a pressure.
pub(crate) fn is_physical<const N: usize>(y: &[f64; N]) -> bool {
    y[0] > 0.0 && y[1] > 0.0
}

/// Last time at which the inputs of a step act: they may jump at its end.
pub(crate) fn last_of_step_s(start_s: f64, end_s: f64) -> f64 {
    end_s - 1e-9 * (end_s - start_s)
}

/// The model during a step.
pub(crate) struct DrivenSystem<'a, I: Inputs> {
    model: &'a Model,
    inputs: &'a I,
    /// Last time that belongs to the step.
    last_s: f64,
    /// Time for which the model is prepared.
    boundary_s: f64,
    prepared: PreparedModel<'a>,
    /// First state requested at that time, and the map's value there: most slopes are taken over states with the same
    /// speed and pressure.
    on_map: Option<(State, CharacteristicPoint)>,
}

impl<I: Inputs> DrivenSystem<'_, I> {
    fn surge_position<const N: usize>(&mut self, y: &[f64; N]) -> f64 {
        self.on_map(&State::from_array(y)).surge_position_ratio
    }

    /// Whether a step crosses the surge line.
    fn crosses_corner<const N: usize>(&mut self, surge_before: f64, after: &[f64; N]) -> bool {
        (surge_before < 1.0) != (self.surge_position(after) < 1.0)
    }

    pub(crate) fn prepare_for(&mut self, t_s: f64) -> &PreparedModel<'_> {
        let t_s = t_s.min(self.last_s);
        if t_s != self.boundary_s {
            self.prepared = self.model.prepare_at(self.inputs.time_s(t_s), &self.inputs.at(t_s));
            self.boundary_s = t_s;
            self.on_map = None;
        }
        &self.prepared
    }

    fn on_map(&mut self, state: &State) -> CharacteristicPoint {
        let same = |at: &State| at.shaft_speed_rad_s == state.shaft_speed_rad_s && at.p2_pa == state.p2_pa;
        match self.on_map {
            Some((at, known)) if same(&at) => known,
            Some(_) => self.prepared.on_map(state),
            None => {
                let point = self.prepared.on_map(state);
                self.on_map = Some((*state, point));
                point
            }
        }
    }
}

impl<const N: usize, I: Inputs> OdeSystem<N> for DrivenSystem<'_, I> {
    fn rates(&mut self, t_s: f64, y: &[f64; N]) -> [f64; N] {
        self.prepare_for(t_s);
        let state = State::from_array(y);
        let on_map = self.on_map(&state);
        let outputs = self.prepared.evaluate_on_map(&state, on_map);
        self.prepared.derivatives(&state, &outputs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::simulate::{Simulator, Watch};
    use crate::simulation::steady::hold_speed;

    /// A jump of P3 on the frozen grid against the adaptive integrator at a tight tolerance.
    #[test]
    fn the_frozen_grid_follows_the_adaptive_integrator() {
        let model = Model::nominal();
        let boundary = BoundaryConditions { valve_opening_ratio: 0.8, ..BoundaryConditions::default() };
        let start = hold_speed(&model, 110e3, &boundary).unwrap().state;
        let target = hold_speed(&model, 70e3, &boundary).unwrap().boundary;
        let times_s: Vec<f64> = (1..=240).map(|i| 0.5 * f64::from(i)).collect();
        let grid = FrozenGrid::new(0.0, 120.0, &[0.0], &times_s);
        let mut driven = Vec::new();
        drive(&model, &target, start, &grid, &times_s, |_, _, state, outputs| {
            driven.push((*state, outputs.t2_k))
        })
        .unwrap();
        let mut place = 0;
        let mut simulator = Simulator::new(&model, 0.0, start, 1e-8, Watch::default());
        let check = |t_s: f64, state: &State, outputs: &Outputs| {
            let (here, t2_k) = driven[place];
            // A tenth of the noise of one sample on a rig: 3 rpm, 0.01 K.
            assert!((here.shaft_speed_rpm() - state.shaft_speed_rpm()).abs() < 3.0, "N at {t_s} s");
            assert!((here.tc_k - state.tc_k).abs() < 0.01, "Tc at {t_s} s");
            assert!((t2_k - outputs.t2_k).abs() < 0.01, "T2 at {t_s} s");
            place += 1;
        };
        simulator.run_to(120.0, &target, times_s.iter().copied(), check, |_| {}).unwrap();
    }

    /// The valve closes while the speed falls: P2 rises in milliseconds before it falls with the speed.
    #[test]
    fn a_valve_that_closes_is_followed() {
        let model = Model::nominal();
        let at =
            |valve_opening_ratio| BoundaryConditions { valve_opening_ratio, ..BoundaryConditions::default() };
        let start = hold_speed(&model, 110e3, &at(1.0)).unwrap().state;
        let target = hold_speed(&model, 70e3, &at(0.7)).unwrap().boundary;
        let times_s: Vec<f64> = (1..=50).map(|i| 0.1 * f64::from(i)).collect();
        let grid = FrozenGrid::new(0.0, 5.0, &[0.0], &times_s);
        let mut driven = Vec::new();
        drive(&model, &target, start, &grid, &times_s, |_, _, state, _| driven.push(*state)).unwrap();
        let mut place = 0;
        let mut simulator = Simulator::new(&model, 0.0, start, 1e-8, Watch::default());
        let check = |t_s: f64, state: &State, _: &Outputs| {
            let here = driven[place];
            // A third of the noise of one sample on a rig: 10 rpm, 20 Pa.
            let speed_rpm = here.shaft_speed_rpm() - state.shaft_speed_rpm();
            assert!(speed_rpm.abs() < 10.0, "N off by {speed_rpm} rpm at {t_s} s");
            assert!(
                (here.p2_pa - state.p2_pa).abs() < 20.0,
                "P2 off by {} Pa at {t_s} s",
                here.p2_pa - state.p2_pa
            );
            place += 1;
        };
        simulator.run_to(5.0, &target, times_s.iter().copied(), check, |_| {}).unwrap();
    }

    /// P3 rises at a limited rate, as an actuator has it.
    struct Rising {
        from: BoundaryConditions,
        to_pa: f64,
    }

    impl Inputs for Rising {
        fn at(&self, t_s: f64) -> BoundaryConditions {
            BoundaryConditions { p3_pa: (self.from.p3_pa + 200e3 * t_s).min(self.to_pa), ..self.from }
        }

        fn next_kink_s(&self, t_s: f64) -> f64 {
            let end_s = (self.to_pa - self.from.p3_pa) / 200e3;
            if t_s < end_s { end_s } else { f64::INFINITY }
        }

        fn is_constant_after(&self, t_s: f64) -> bool {
            self.next_kink_s(t_s).is_infinite()
        }
    }

    /// Speed rises along the surge line, where flow and with it T2 follow the smallest change of pressure: the outlet's equation bends too much
    /// for steps that are short enough elsewhere.
    #[test]
    fn a_jump_along_the_surge_line_is_followed() {
        let model = Model::nominal();
        let at = BoundaryConditions { valve_opening_ratio: 0.5, ..BoundaryConditions::default() };
        let steady = hold_speed(&model, 50e3, &at).unwrap();
        let (start, from) = (steady.state, steady.boundary);
        let rising = Rising { from, to_pa: hold_speed(&model, 150e3, &at).unwrap().boundary.p3_pa };
        let times_s: Vec<f64> = (1..=50).map(|i| 0.1 * f64::from(i)).collect();
        let grid = FrozenGrid::new(0.0, 5.0, &[0.0], &times_s);
        let mut driven = Vec::new();
        drive(&model, &rising, start, &grid, &times_s, |_, _, state, outputs| {
            driven.push((*state, outputs.t2_k, outputs.flow_kg_s));
        })
        .unwrap();
        let mut place = 0;
        let mut simulator = Simulator::new(&model, 0.0, start, 1e-8, Watch::default());
        let check = |t_s: f64, state: &State, outputs: &Outputs| {
            let (here, t2_k, flow_kg_s) = driven[place];
            // The noise of a sample of a rig's sensors is 30 rpm, 60 Pa, 0.1 K and 0.15 g/s.
            let off = [
                (here.shaft_speed_rpm() - state.shaft_speed_rpm()) / 30.0,
                (here.p2_pa - state.p2_pa) / 60.0,
                (t2_k - outputs.t2_k) / 0.1,
                (flow_kg_s - outputs.flow_kg_s) / 1.5e-4,
            ];
            assert!(off.iter().all(|off| off.abs() < 0.5), "{off:?} of the noise at {t_s} s");
            place += 1;
        };
        simulator.run_to(5.0, &rising, times_s.iter().copied(), check, |_| {}).unwrap();
    }

    /// Speed falls and the valve closes at once, between the last points before surge of two speed lines: the machine surges for seconds.
    #[test]
    fn a_jump_through_surge_is_followed() {
        let model = Model::nominal();
        let at =
            |valve_opening_ratio| BoundaryConditions { valve_opening_ratio, ..BoundaryConditions::default() };
        let start = hold_speed(&model, 120e3, &at(0.411)).unwrap().state;
        let target = hold_speed(&model, 60e3, &at(0.315)).unwrap().boundary;
        let times_s: Vec<f64> = (1..=60).map(|i| 0.5 * f64::from(i)).collect();
        let grid = FrozenGrid::new(0.0, 30.0, &[0.0], &times_s);
        let mut driven = State::new(0.0, 0.0, 0.0, 0.0, 0.0);
        drive(&model, &target, start, &grid, &times_s, |_, _, state, _| driven = *state).unwrap();
        let mut simulator = Simulator::new(&model, 0.0, start, 1e-8, Watch::default());
        let mut there = driven;
        let keep = |_: f64, state: &State, _: &Outputs| there = *state;
        simulator.run_to(30.0, &target, times_s.iter().copied(), keep, |_| {}).unwrap();
        // When a surge cycle ends is chaotic; half a minute later a twentieth of a rig's offsets remains: 0.5 krpm, 0.5 K.
        assert!((driven.shaft_speed_rpm() - there.shaft_speed_rpm()).abs() < 500.0, "{driven:?} {there:?}");
        assert!((driven.tc_k - there.tc_k).abs() < 0.5, "{driven:?} {there:?}");
    }

    #[test]
    fn settling_finds_the_steady_state() {
        let model = Model::nominal();
        // In the middle of a speed line, and next to the surge line.
        for (speed_rpm, valve_opening_ratio) in [(90e3, 0.8), (50e3, 0.5), (150e3, 0.5)] {
            let at = BoundaryConditions { valve_opening_ratio, ..BoundaryConditions::default() };
            let steady = hold_speed(&model, speed_rpm, &at).unwrap();
            let guess =
                State { tc_k: steady.state.tc_k - 30.0, tt_k: steady.state.tt_k + 60.0, ..steady.state };
            let settled = settle(&model, &steady.boundary, guess).unwrap();
            assert!((settled.tc_k - steady.state.tc_k).abs() < 1e-3, "{} K", settled.tc_k);
            assert!((settled.tt_k - steady.state.tt_k).abs() < 1e-3, "{} K", settled.tt_k);
            assert!((settled.p2_pa - steady.state.p2_pa).abs() < 1.0, "{} Pa", settled.p2_pa);
        }
    }

    /// A machine with an inlet temperature that is 20 K too high, from the state at the right temperature, which is then beyond the surge
    /// line.
    #[test]
    fn settling_starts_beyond_the_surge_line_too() {
        let model = Model::nominal();
        let at = BoundaryConditions { valve_opening_ratio: 0.5, ..BoundaryConditions::default() };
        let steady = hold_speed(&model, 90e3, &at).unwrap();
        for t1_k in [at.t1_k - 20.0, at.t1_k + 20.0] {
            let boundary = BoundaryConditions { t1_k, ..steady.boundary };
            let guess = State { p2_pa: 1.05 * steady.state.p2_pa, ..steady.state };
            let settled = settle(&model, &boundary, guess).unwrap();
            let again = settle(&model, &boundary, settled).unwrap();
            assert!((settled.p2_pa - again.p2_pa).abs() < 1.0, "{} Pa", settled.p2_pa - again.p2_pa);
        }
    }

    #[test]
    fn inputs_beyond_the_model_are_an_error_and_no_panic() {
        let model = Model::nominal();
        let steady = hold_speed(&model, 90e3, &BoundaryConditions::default()).unwrap();
        let bad = BoundaryConditions { t3_k: f64::NAN, ..steady.boundary };
        assert!(settle(&model, &bad, steady.state).is_err());
    }
}
