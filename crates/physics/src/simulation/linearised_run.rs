//! A run on a frozen grid with its derivatives, from which the runs of similar models follow: each costs one evaluation of its model a
//! step instead of an integration.
//!
//! The difference of two runs obeys d' = J d + g: J is the Jacobian of the first model at its states, and g what J does not explain of the difference of
//! the two models' rates. TR-BDF2 integrates it (Bank et al., IEEE Transactions on Electron Devices 32:1992, 1985): it is L-stable, as the
//! outlet volume requires, and its matrices are the same for all other models. g is evaluated at the expected state of the other run, so
//! that the method also follows differences that are not small; its error is some per mille of a difference, a few per cent next to the
//! surge line.

use crate::machine::params::MAX_STATES;
use crate::simulation::driven::{
    DriveError, FrozenGrid, GRID_TOLERANCE, drive_steps, is_physical, last_of_step_s,
};
use crate::simulation::model::{Model, Outputs, PreparedModel, State};
use crate::simulation::simulate::STATE_SIZES;
use crate::simulation::steady::Inputs;
use nalgebra::{SMatrix, SVector};
use std::f64::consts::SQRT_2;

type Matrix = SMatrix<f64, MAX_STATES, MAX_STATES>;
type Vector = SVector<f64, MAX_STATES>;

/// Length of the trapezoidal part of a step, at which both parts have the same coefficient.
const PART: f64 = 2.0 - SQRT_2;
/// Relative distance of a difference quotient: the square root of the rounding error.
const DISTANCE: f64 = 1.5e-8;
/// Difference of rates, in typical states per second, above which a step does not begin as the one before ended, because inputs or model have
/// jumped: 0.1 rpm/s.
const JUMP_S: f64 = 1e-6;

/// A run with its derivatives, and those of `M` quantities that are read from it.
#[derive(Debug)]
pub struct LinearisedRun<const M: usize> {
    structure: Structure,
    start: State,
    steps: Vec<LinearStep<M>>,
}

/// How far the state of another run is from that of a [`LinearisedRun`].
#[derive(Debug, Clone, Copy)]
pub struct Distance(Vector);

/// The states that a model has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Structure {
    states: usize,
    inner_wall: bool,
    ideal_probe: bool,
}

impl Structure {
    fn of(model: &Model) -> Structure {
        let inner_wall = model.has_inner_wall();
        let states = match model.hooks.extra_states() {
            0 => 5 + usize::from(inner_wall),
            extra => 6 + extra,
        };
        Structure { states, inner_wall, ideal_probe: model.params.t2_probe_diameter_m == 0.0 }
    }
}

#[derive(Debug)]
struct LinearStep<const M: usize> {
    times_s: [f64; 2],
    /// `None` if the step begins as the one before ended, because neither inputs nor model have jumped.
    start: Option<Evaluated<M>>,
    end: Evaluated<M>,
    /// Difference at the end due to that at the start, and due to g at both ends.
    from_before: Matrix,
    from_rates: [Matrix; 2],
}

/// The model in one state.
#[derive(Debug)]
struct Evaluated<const M: usize> {
    state: State,
    rates: Vector,
    jacobian: Matrix,
    read_jacobian: SMatrix<f64, M, MAX_STATES>,
}

fn rates_and_read<const M: usize>(
    prepared: &PreparedModel<'_>,
    state: &State,
    read: &impl Fn(&PreparedModel<'_>, &State, &Outputs) -> [f64; M],
) -> (Vector, [f64; M]) {
    let outputs = prepared.evaluate(state);
    (Vector::from(prepared.derivatives::<MAX_STATES>(state, &outputs)), read(prepared, state, &outputs))
}

impl<const M: usize> Evaluated<M> {
    fn at(
        prepared: &PreparedModel<'_>,
        state: State,
        states: usize,
        read: &impl Fn(&PreparedModel<'_>, &State, &Outputs) -> [f64; M],
    ) -> Self {
        let (rates, own_read) = rates_and_read(prepared, &state, read);
        let (mut jacobian, mut read_jacobian) = (Matrix::zeros(), SMatrix::<f64, M, MAX_STATES>::zeros());
        let y: [f64; MAX_STATES] = state.to_array();
        for column in 0..states {
            let mut shifted = y;
            shifted[column] += DISTANCE * y[column].abs().max(1e-3);
            let step = shifted[column] - y[column];
            let (there, read_there) = rates_and_read(prepared, &State::from_array(&shifted), read);
            jacobian.set_column(column, &((there - rates) / step));
            let change = SVector::<f64, M>::from_fn(|i, _| (read_there[i] - own_read[i]) / step);
            read_jacobian.set_column(column, &change);
        }
        Evaluated { state, rates, jacobian, read_jacobian }
    }

    /// What another model's rates at a distance from the state have that the Jacobian does not explain, and what is read there.
    fn compare(
        &self,
        other: &PreparedModel<'_>,
        distance: &Vector,
        read: &impl Fn(&PreparedModel<'_>, &State, &Outputs) -> [f64; M],
    ) -> (Vector, [f64; M]) {
        let there = Vector::from(self.state.to_array::<MAX_STATES>()) + distance;
        let (rates, read) = rates_and_read(other, &State::from_array(&there.into()), read);
        (rates - self.rates - self.jacobian * distance, read)
    }
}

impl<const M: usize> LinearStep<M> {
    /// `None` if the matrices of the method are singular.
    fn new(
        times_s: [f64; 2],
        start: Option<Evaluated<M>>,
        before: Option<&LinearStep<M>>,
        end: Evaluated<M>,
    ) -> Option<Self> {
        let (first, last) = (start.as_ref().or(before.map(|before| &before.end))?.jacobian, end.jacobian);
        let identity = Matrix::identity();
        // Both parts solve with 1 - c h J; c = PART / 2 = (1 - PART) / (2 - PART).
        let solve_s = 0.5 * PART * (times_s[1] - times_s[0]);
        let middle = first * (1.0 - PART) + last * PART;
        let at_middle = (identity - middle * solve_s).try_inverse()?;
        let at_end = (identity - last * solve_s).try_inverse()?;
        let weight = 1.0 / (PART * (2.0 - PART));
        let of_middle = at_end * at_middle * weight;
        let of_start = at_end * (weight * (1.0 - PART) * (1.0 - PART));
        Some(LinearStep {
            times_s,
            start,
            end,
            from_before: of_middle * (identity + first * solve_s) - of_start,
            // g is linear over the step.
            from_rates: [
                of_middle * (solve_s * (2.0 - PART)),
                of_middle * (solve_s * PART) + at_end * solve_s,
            ],
        })
    }
}

impl<const M: usize> LinearisedRun<M> {
    /// A run of no steps yet, from `start`.
    pub fn new(model: &Model, start: State) -> Self {
        LinearisedRun { structure: Structure::of(model), start, steps: Vec::new() }
    }

    /// Whether runs of `model` follow from this one: it has the same states.
    pub fn fits(&self, model: &Model) -> bool {
        self.structure == Structure::of(model)
    }

    /// Drives the model over the grid, as [`drive`](crate::simulation::driven::drive) does, and keeps the derivatives. Returns the state at the end;
    /// `None` if the model cannot follow, or has other states than the run.
    pub fn drive(
        &mut self,
        model: &Model,
        inputs: &impl Inputs,
        start: State,
        grid: &FrozenGrid,
        read: impl Fn(&PreparedModel<'_>, &State, &Outputs) -> [f64; M],
    ) -> Option<State> {
        let states = self.structure.states;
        let mut is_complete = self.fits(model);
        let end = drive_steps(GRID_TOLERANCE, model, inputs, start, grid, |system, step| {
            let [start_s, end_s] = step.times_s;
            let before = self.steps.last();
            let prepared = system.prepare_for(start_s);
            let (rates, _) = rates_and_read(prepared, &step.start, &read);
            let jumps = before.is_none_or(|before| {
                let change = rates - before.end.rates;
                change.iter().zip(STATE_SIZES).any(|(change, size)| change.abs() > JUMP_S * size)
            });
            let start = jumps.then(|| Evaluated::at(prepared, step.start, states, &read));
            let end = Evaluated::at(system.prepare_for(end_s), (step.state_at)(end_s), states, &read);
            let step = LinearStep::new(step.times_s, start, before, end);
            is_complete &= step.is_some();
            self.steps.extend(step);
        });
        end.ok().filter(|_| is_complete)
    }

    /// How far another start is from that of the run.
    pub fn distance_of_start(&self, other: &State) -> Distance {
        let vector = |state: &State| Vector::from(state.to_array::<MAX_STATES>());
        Distance(vector(other) - vector(&self.start))
    }

    /// Follows another model over the steps between `from_s` and `to_s`, from a distance at their start, which becomes that at their end.
    /// `on_sample` receives what is read at each of `times_s`, which are ends of steps.
    pub fn drive_other(
        &self,
        (model, inputs): (&Model, &impl Inputs),
        (from_s, to_s): (f64, f64),
        distance: &mut Distance,
        times_s: &[f64],
        read: impl Fn(&PreparedModel<'_>, &State, &Outputs) -> [f64; M],
        mut on_sample: impl FnMut([f64; M]),
    ) -> Result<(), DriveError> {
        let prepare = |t_s: f64| model.prepare_at(inputs.time_s(t_s), &inputs.at(t_s));
        let Distance(distance) = distance;
        let (mut next, mut at_last_end) = (0, None);
        for (place, step) in self.steps.iter().enumerate() {
            let [start_s, end_s] = step.times_s;
            if start_s < from_s || end_s > to_s {
                continue;
            }
            let at_start = match (at_last_end, &step.start) {
                (Some(g), None) => g,
                (_, start) => {
                    let start = start.as_ref().unwrap_or(&self.steps[place.saturating_sub(1)].end);
                    start.compare(&prepare(start_s), distance, &read).0
                }
            };
            let at_end = prepare(last_of_step_s(start_s, end_s));
            let (g, read_at_end) = step.end.compare(&at_end, distance, &read);
            let moved = step.from_before * *distance + step.from_rates[0] * at_start + step.from_rates[1] * g
                - *distance;
            *distance += moved;
            let there = Vector::from(step.end.state.to_array::<MAX_STATES>()) + *distance;
            if !is_physical(&there.into()) || !there.iter().all(|value| value.is_finite()) {
                return Err(DriveError { t_s: start_s });
            }
            at_last_end = Some(g);
            let read_moved = step.end.read_jacobian * moved;
            while times_s.get(next).is_some_and(|t| *t <= end_s) {
                on_sample(std::array::from_fn(|i| read_at_end[i] + read_moved[i]));
                next += 1;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::params::BoundaryConditions;
    use crate::simulation::driven::drive;
    use crate::simulation::steady::hold_speed;

    fn read(_: &PreparedModel<'_>, state: &State, outputs: &Outputs) -> [f64; 5] {
        [state.shaft_speed_rad_s, state.p2_pa, state.tc_k, outputs.t2_k, outputs.flow_kg_s]
    }

    struct Case<'a> {
        model: &'a Model,
        inputs: BoundaryConditions,
        start: State,
    }

    impl Case<'_> {
        fn integrate(&self, grid: &FrozenGrid, times_s: &[f64]) -> Vec<[f64; 5]> {
            let mut samples = Vec::new();
            drive(self.model, &self.inputs, self.start, grid, times_s, |_, prepared, state, outputs| {
                samples.push(read(prepared, state, outputs));
            })
            .unwrap();
            samples
        }
    }

    /// Largest error of each quantity of the other run, as a share of its largest difference from the first.
    fn errors(first: &Case<'_>, other: &Case<'_>) -> [f64; 5] {
        let times_s: Vec<f64> = (1..=240).map(|i| 0.5 * f64::from(i)).collect();
        let grid = FrozenGrid::new(0.0, 120.0, &[0.0], &times_s);
        let mut run = LinearisedRun::new(first.model, first.start);
        run.drive(first.model, &first.inputs, first.start, &grid, read).unwrap();
        let mut distance = run.distance_of_start(&other.start);
        let mut followed = Vec::new();
        let (machine, span_s) = ((other.model, &other.inputs), (0.0, 120.0));
        run.drive_other(machine, span_s, &mut distance, &times_s, read, |sample| followed.push(sample))
            .unwrap();
        let (before, after) = (first.integrate(&grid, &times_s), other.integrate(&grid, &times_s));
        let largest = |a: &[[f64; 5]], b: &[[f64; 5]], quantity: usize| {
            a.iter().zip(b).map(|(a, b)| (a[quantity] - b[quantity]).abs()).fold(0.0, f64::max)
        };
        std::array::from_fn(|i| largest(&followed, &after, i) / largest(&before, &after, i))
    }

    /// A jump of P3 by another machine, with another inlet temperature and another start.
    #[test]
    fn the_run_of_a_similar_model_equals_its_integration() {
        let model = Model::nominal();
        let boundary = BoundaryConditions { valve_opening_ratio: 0.8, ..BoundaryConditions::default() };
        let start = hold_speed(&model, 110e3, &boundary).unwrap().state;
        let inputs = hold_speed(&model, 70e3, &boundary).unwrap().boundary;
        let small = 1e-5;
        let mut other = model.clone();
        other.params.compressor.nusselt_coefficient *= 1.0 + small;
        other.params.compressor.efficiency_scale_ratio *= 1.0 - small;
        other.params.outlet.valve_area_m2 *= 1.0 + small;
        let case = Case { model: &model, inputs, start };
        let other = Case {
            model: &other,
            inputs: BoundaryConditions { t1_k: inputs.t1_k * (1.0 + small), ..inputs },
            start: State { tc_k: start.tc_k * (1.0 + small), ..start },
        };
        // A second-order method with steps of a quarter of the time since the jump.
        assert!(errors(&case, &other).iter().all(|error| *error < 0.01), "{:?}", errors(&case, &other));
    }

    /// The speed rises along the surge line, on one side of which the flow has an infinite slope, with a map that is 3 % wider.
    #[test]
    fn a_difference_along_the_surge_line_is_followed() {
        let model = Model::nominal();
        let at = BoundaryConditions { valve_opening_ratio: 0.5, ..BoundaryConditions::default() };
        let start = hold_speed(&model, 50e3, &at).unwrap().state;
        let inputs = hold_speed(&model, 150e3, &at).unwrap().boundary;
        let mut other = model.clone();
        other.params.compressor.flow_scale_ratio *= 1.03;
        let (case, other) = (Case { model: &model, inputs, start }, Case { model: &other, inputs, start });
        assert!(errors(&case, &other).iter().all(|error| *error < 0.05), "{:?}", errors(&case, &other));
    }
}
