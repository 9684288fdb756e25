//! Residual source term of each balance, estimated from the recording as a smooth process over the operating points.
//!
//! In each step the source term has a level and a part that decays after the jump. Both are Gaussian processes: a common level, a part
//! smooth over speed and opening, and a small free part per step. The evidence determines their size.

use crate::closure::columns::{Base, Posterior, Products, weigh_process};
use crate::closure::expression::{DECAY, Expression, Span, Spans};
use crate::closure::term::{Balance, Properties, Role, Term};
use crate::gap::residuals::nuisance::OUTPUTS;
use crate::gap::residuals::prediction::PointState;
use crate::gap::residuals::study::Study;
use crate::gap::residuals::whiten::rows_of_step;
use mapper_core::Channel;
use mapper_inference::hypotheses::{Shape, TimeHistory};
use mapper_numerics::parallel;
use nalgebra::{DMatrix, DVector};

/// Distance between steps that share one run. Bound: a housing forgets an earlier step within a minute or two.
const APART: usize = 5;

/// Balances whose source term needs model runs.
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

#[derive(Debug, Clone)]
pub(crate) struct ResidualSource {
    pub(crate) balance: Balance,
    /// Log evidence relative to none.
    pub(crate) gain: f64,
    /// Change of the recording, in the channels' units.
    pub(crate) signature: Vec<f64>,
    /// Level at the end of each step with its standard error, in the balance's unit.
    pub(crate) levels: Vec<(f64, f64)>,
}

/// All balances that a recording can have a source term in.
pub(crate) fn balances(study: &Study) -> Vec<Balance> {
    let recorded = |channel: &Channel| *channel != Channel::P3 && study.table.column(*channel).is_some();
    RUN.into_iter().chain(OUTPUTS.into_iter().filter(recorded).map(Balance::Reading)).collect()
}

/// Residual source terms of all `wanted` balances, each assumed to be the only one; best evidence first.
pub(crate) fn residual_sources(
    base: &Base<'_>,
    counts: &[bool],
    wanted: &dyn Fn(&Balance) -> bool,
) -> Vec<ResidualSource> {
    let study = base.study;
    let points = study.points(&study.nothing()).unwrap_or_default();
    let balances: Vec<Balance> = balances(study).into_iter().filter(wanted).collect();
    let mut found: Vec<ResidualSource> = parallel::map(&balances, |balance| {
        let columns = columns(base, *balance);
        residual_source(base, *balance, &columns, counts, &points)
    })
    .into_iter()
    .flatten()
    .collect();
    found.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    found
}

/// Changes due to a typical source term in one step each, in the channels' units: levels first, then the decaying parts.
pub(crate) fn columns(base: &Base<'_>, balance: Balance) -> Vec<Vec<f64>> {
    let Properties { plain_size: step, unit, .. } = balance.properties();
    let term = |spans: Spans| Term {
        acts_on: vec![(balance, Expression::InTime(spans))],
        unit,
        step,
        words: String::new(),
        role: Role::Other,
        positive: false,
    };
    let of_shape = |shape: Shape| {
        let columns = match balance {
            Balance::Reading(channel) => read(base.study, channel, shape, step),
            _ => in_each_step(base, shape, term, |terms| base.raw_changes(terms)),
        };
        // Nothing decays in the first step, which has no jump.
        columns.into_iter().skip(usize::from(shape == DECAY))
    };
    of_shape(Shape::Step).chain(of_shape(DECAY)).collect()
}

/// A sensor offset needs no model run.
fn read(study: &Study, channel: Channel, shape: Shape, size: f64) -> Vec<Vec<f64>> {
    let after_jump = TimeHistory { onset: 0.0, shape };
    (0..study.steps.len())
        .map(|step| {
            let mut column = vec![0.0; study.measured.len()];
            for group in study.groups.iter().filter(|g| g.step == step && OUTPUTS[g.output] == channel) {
                for (row, block) in group.rows.clone().zip(&group.blocks) {
                    let since_s = study.steps[step].blocks[*block].since_jump_s.max(0.0);
                    column[row] = size * after_jump.at(since_s);
                }
            }
            column
        })
        .collect()
}

/// For each step the change of the recording by a `term` that acts in this step alone, from runs in which several distant steps have it.
pub(crate) fn in_each_step(
    base: &Base<'_>,
    shape: Shape,
    term: impl Fn(Spans) -> Term,
    changes: impl Fn(&[Term]) -> Vec<Option<Vec<f64>>>,
) -> Vec<Vec<f64>> {
    let study = base.study;
    let steps = study.steps.len();
    let span = |step: usize| {
        let onset = if step == 0 { f64::NEG_INFINITY } else { study.steps[step].marker.start_s };
        let end_s = study.steps.get(step + 1).map_or(f64::INFINITY, |next| next.marker.start_s);
        Span { history: TimeHistory { onset, shape }, end_s }
    };
    let members = |colour: usize| (colour..steps).step_by(APART);
    let spans = |colour: usize| Spans(members(colour).map(span).collect());
    let terms: Vec<Term> = (0..APART.min(steps)).map(|colour| term(spans(colour))).collect();
    let mut columns = vec![vec![0.0; study.measured.len()]; steps];
    for (colour, change) in changes(&terms).into_iter().enumerate() {
        let Some(change) = change else { continue };
        for member in members(colour) {
            for step in member..(member + APART).min(steps) {
                let rows = rows_of_step(study, step);
                columns[member][rows.clone()].copy_from_slice(&change[rows]);
            }
        }
    }
    columns
}

fn residual_source(
    base: &Base<'_>,
    balance: Balance,
    columns: &[Vec<f64>],
    counts: &[bool],
    points: &[PointState],
) -> Option<ResidualSource> {
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
    // The evidence selects the size among the possible ones.
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
    let size = balance.properties().plain_size;
    let levels = (0..study.steps.len())
        .map(|step| (size * best.mean[step], size * best.covariance[(step, step)].max(0.0).sqrt()))
        .collect();
    let mut signature = vec![0.0; study.measured.len()];
    for (column, mean) in columns.iter().zip(best.mean.iter()) {
        for (sum, change) in signature.iter_mut().zip(column) {
            *sum += mean * change;
        }
    }
    Some(ResidualSource { balance, gain: best.gain, signature, levels })
}

/// Correlation length of a source term over speed, as a share of the highest, and over the opening of the valve. Judgement: the flow and heat
/// of a machine change over a third of its map.
const CORRELATION_LENGTH: f64 = 0.3;
/// Variance of the common level, and of the part smooth over the map. Bound: halves of the variance of a source term of typical size, whose
/// scale the evidence determines.
const COMMON: f64 = 0.5;
/// Variance of the free part of each step. Bound: small compared with the smooth part; without it a single step could contradict a source term.
const FREE: f64 = 0.02;

/// Prior covariance of levels and decaying parts for a source term of typical size.
pub(crate) fn covariance(study: &Study, points: &[PointState]) -> DMatrix<f64> {
    let steps = study.steps.len();
    let highest_rpm = points.iter().map(|point| point.speed_rpm).fold(1.0, f64::max);
    let at = |step: usize| {
        let speed_ratio = points.get(step).map_or(0.0, |point| point.speed_rpm / highest_rpm);
        (speed_ratio / CORRELATION_LENGTH, study.steps[step].marker.valve_opening_ratio / CORRELATION_LENGTH)
    };
    let near = |a: (f64, f64), b: (f64, f64)| (-0.5 * ((a.0 - b.0).powi(2) + (a.1 - b.1).powi(2))).exp();
    // The decaying part is similar for jumps of similar size.
    let jump = |step: usize| {
        let (before, after) = (at(step - 1), at(step));
        (after.0 - before.0, after.1 - before.1)
    };
    DMatrix::from_fn(2 * steps - 1, 2 * steps - 1, |i, j| {
        let free = if i == j { FREE } else { 0.0 };
        match (i < steps, j < steps) {
            (true, true) => COMMON + COMMON * near(at(i), at(j)) + free,
            (false, false) => 0.5 * COMMON * near(jump(i - steps + 1), jump(j - steps + 1)) + free,
            _ => 0.0,
        }
    })
}
