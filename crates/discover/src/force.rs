//! The missing force of each balance: what the recording asks for, as a process that is smooth over the operating points.
//!
//! In each step a force has a level and a part that decays after the jump. Both are Gaussian processes: a common level, a
//! part that is smooth over speed and opening, and a little that is free in each step. How large it is, is found by the
//! evidence.

use crate::balance::Balance;
use crate::columns::{Base, Products};
use crate::evidence::{Posterior, weigh_process};
use crate::expression::Expression;
use crate::term::{Role, Term};
use crate::time_history::{Course, Shape};
use mapper_core::Channel;
use mapper_gap::nuisance::OUTPUTS;
use mapper_gap::study::{PointState, Study};
use mapper_gap::whiten::rows_of_step;
use mapper_numerics::parallel;
use nalgebra::{DMatrix, DVector};

/// Steps whose answers come from one run: a housing forgets in a minute or two what was so many steps before.
pub const APART: usize = 5;

/// Balances whose force needs runs of the model.
const RUN: [Balance; 8] = [
    Balance::CompressorHousing,
    Balance::TurbineHousing,
    Balance::Shaft,
    Balance::Outlet,
    Balance::GasBefore,
    Balance::GasAfter,
    Balance::Work,
    Balance::MapFlow,
];

/// A balance with its missing force.
#[derive(Debug, Clone)]
pub struct Force {
    /// Which.
    pub balance: Balance,
    /// Logarithm of the evidence for it, over that of nothing.
    pub gain: f64,
    /// What it changes in the recording, in the channels' units.
    pub signature: Vec<f64>,
    /// Level at the end of each step, in the balance's unit, and its standard error.
    pub levels: Vec<(f64, f64)>,
}

/// Every balance that has a force in a recording.
pub fn balances(study: &Study) -> Vec<Balance> {
    let recorded = |channel: &Channel| *channel != Channel::P3 && study.table.column(*channel).is_some();
    RUN.into_iter().chain(OUTPUTS.into_iter().filter(recorded).map(Balance::Reading)).collect()
}

/// The missing force of every balance that is `wanted`, each as if it were the only one; best evidence first.
pub fn forces(base: &Base<'_>, counts: &[bool], wanted: &dyn Fn(&Balance) -> bool) -> Vec<Force> {
    let study = base.study;
    let points = study.points(&study.nothing()).unwrap_or_default();
    let balances: Vec<Balance> = balances(study).into_iter().filter(wanted).collect();
    let mut found: Vec<Force> = parallel::map(&balances, |balance| {
        let columns = columns(base, *balance);
        force(base, *balance, &columns, counts, &points)
    })
    .into_iter()
    .flatten()
    .collect();
    found.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    found
}

/// Changes for a plain force in one step each, in the channels' units: levels first, then the parts that decay after each jump.
pub fn columns(base: &Base<'_>, balance: Balance) -> Vec<Vec<f64>> {
    let study = base.study;
    let steps = study.steps.len();
    let mut columns: Vec<Vec<f64>> = Vec::new();
    for shape in [Shape::Level, Shape::Decay] {
        let of_shape = match balance {
            Balance::Reading(channel) => read(study, channel, shape),
            _ => run(base, balance, shape),
        };
        columns.extend(
            (0..steps).filter(|step| shape == Shape::Level || *step > 0).map(|step| of_shape[step].clone()),
        );
    }
    for column in &mut columns {
        column.iter_mut().for_each(|value| *value *= balance.plain_size());
    }
    columns
}

/// What a sensor reads more needs no run.
fn read(study: &Study, channel: Channel, shape: Shape) -> Vec<Vec<f64>> {
    (0..study.steps.len())
        .map(|step| {
            let mut column = vec![0.0; study.measured.len()];
            for group in study.groups.iter().filter(|g| g.step == step && OUTPUTS[g.output] == channel) {
                for (row, block) in group.rows.clone().zip(&group.blocks) {
                    column[row] = shape.at(study.steps[step].blocks[*block].since_jump_s.max(0.0));
                }
            }
            column
        })
        .collect()
}

/// Changes for a unit of force, from runs in which several steps far apart have it.
fn run(base: &Base<'_>, balance: Balance, shape: Shape) -> Vec<Vec<f64>> {
    let study = base.study;
    let steps = study.steps.len();
    let span = |step: usize| {
        let begin_s = if step == 0 { f64::NEG_INFINITY } else { study.steps[step].marker.start_s };
        let end_s = study.steps.get(step + 1).map_or(f64::INFINITY, |next| next.marker.start_s);
        (begin_s, end_s)
    };
    let members = |colour: usize| (colour..steps).step_by(APART);
    let terms: Vec<Term> = (0..APART.min(steps))
        .map(|colour| {
            let course = Course { shape, spans_s: members(colour).map(span).collect() };
            Term {
                acts_on: vec![(balance, Expression::InTime(course))],
                unit: balance.unit(),
                step: balance.plain_size(),
                words: String::new(),
                role: Role::Other,
                positive: false,
            }
        })
        .collect();
    let mut columns = vec![vec![0.0; study.measured.len()]; steps];
    for (colour, change) in base.raw_changes(&terms).into_iter().enumerate() {
        let Some(change) = change else { continue };
        for member in members(colour) {
            for step in member..(member + APART).min(steps) {
                for row in rows_of_step(study, step) {
                    columns[member][row] = change[row] / balance.plain_size();
                }
            }
        }
    }
    columns
}

fn force(
    base: &Base<'_>,
    balance: Balance,
    columns: &[Vec<f64>],
    counts: &[bool],
    points: &[PointState],
) -> Option<Force> {
    let whitened: Vec<Vec<f64>> = columns
        .iter()
        .map(|column| {
            let mut column = column.clone();
            base.linearised.whiten(base.study, &mut column);
            column
        })
        .collect();
    let projected = Products::new(base, &whitened).projected(counts)?;
    let k = columns.len();
    let products = projected.view((0, 0), (k, k)).into_owned();
    let right = DVector::from_fn(k, |i, _| projected[(i, k)]);
    let study = base.study;
    let shape = covariance(study, points);
    // How large it is, by the evidence, over the sizes that a force can have.
    let mut best: Option<Posterior> = None;
    for exponent in -4..=6 {
        let scale = 2f64.powi(exponent);
        let posterior = weigh_process(&products, &right, &(&shape * (scale * scale)));
        if let Some(posterior) = posterior
            && best.as_ref().is_none_or(|best| posterior.gain > best.gain)
        {
            best = Some(posterior);
        }
    }
    let best = best?;
    let size = balance.plain_size();
    let levels = (0..study.steps.len())
        .map(|step| (size * best.mean[step], size * best.covariance[(step, step)].max(0.0).sqrt()))
        .collect();
    let mut signature = vec![0.0; study.measured.len()];
    for (column, mean) in columns.iter().zip(best.mean.iter()) {
        for (sum, change) in signature.iter_mut().zip(column) {
            *sum += mean * change;
        }
    }
    Some(Force { balance, gain: best.gain, signature, levels })
}

/// Over so much of the speed, rpm, and of the opening a force is much the same.
const SMOOTH_RPM: f64 = 35e3;
const SMOOTH_OPENING: f64 = 0.3;
/// Variance of the common level, of the part that is smooth over the map, and of what is free in each step.
const COMMON: f64 = 0.5;
const SMOOTH: f64 = 0.5;
const FREE: f64 = 0.02;

/// Prior covariance of levels and decaying parts for a force of plain size.
pub fn covariance(study: &Study, points: &[PointState]) -> DMatrix<f64> {
    let steps = study.steps.len();
    let at = |step: usize| {
        let speed_rpm = points.get(step).map_or(0.0, |point| point.speed_rpm);
        (speed_rpm / SMOOTH_RPM, study.steps[step].marker.valve_opening_ratio / SMOOTH_OPENING)
    };
    let near = |a: (f64, f64), b: (f64, f64)| (-0.5 * ((a.0 - b.0).powi(2) + (a.1 - b.1).powi(2))).exp();
    // A part that decays after a jump is much the same for jumps of the same size.
    let jump = |step: usize| {
        let (before, after) = (at(step - 1), at(step));
        (after.0 - before.0, after.1 - before.1)
    };
    DMatrix::from_fn(2 * steps - 1, 2 * steps - 1, |i, j| {
        let free = if i == j { FREE } else { 0.0 };
        match (i < steps, j < steps) {
            (true, true) => COMMON + SMOOTH * near(at(i), at(j)) + free,
            (false, false) => 0.5 * SMOOTH * near(jump(i - steps + 1), jump(j - steps + 1)) + free,
            _ => 0.0,
        }
    })
}
