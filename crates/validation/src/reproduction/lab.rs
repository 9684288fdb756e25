//! The laboratory of the paper, and the data of its figures.

use mapper_core::{Channel, IdentifiedPoint, OperatingPoint, Recording, StepKind, StepMarker, named_enum};
use mapper_identify::{IdentifyConfig, IdentifyError, StepError, WindowRule, identify_each};
use mapper_numerics::statistics;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::Model;
use mapper_physics::simulation::simulate::{SimulationError, Simulator, Watch};
use mapper_physics::simulation::steady::{Inputs, SteadyError, SteadyState, hold_speed};

/// Jumps of table 1: initial and target speed, rpm.
pub(crate) const JUMPS: [(f64, f64); 4] = [(110e3, 50e3), (50e3, 110e3), (150e3, 90e3), (90e3, 150e3)];
/// Valve openings of each jump, relative to the nominal area: from near surge to near choke.
pub(crate) const OPENINGS: [f64; 5] = [0.5, 0.7, 1.0, 1.4, 2.0];
/// Samples per second.
const RATE_HZ: f64 = 10.0;
/// Local error of the integration, relative: the flow near surge amplifies it up to 300 times.
const RELATIVE_TOLERANCE: f64 = 1e-8;

/// Conductance to the oil and heat of bearing friction at 100 krpm of the machine with the paper's heat, `campaigns/turbo_paper.yaml`, W/K
/// and W. The paper prints neither. Fit to the signs of figures 5 and 11 (a): `cargo test --locked -p mapper-validation the_paper_s_heat`.
const PAPER_HEAT: (f64, f64) = (9.0, 440.0);
/// Diameter of the probes on the paper's rig, m. Source: section 4.2.
pub(crate) const PROBE_M: f64 = 1.5e-3;

pub(crate) fn paper_machine() -> Model {
    let mut machine = Model::nominal();
    let bearing = &mut machine.params.bearing;
    (bearing.oil_conductance_w_k, bearing.friction_heat_w) = PAPER_HEAT;
    machine.params.t2_probe_diameter_m = PROBE_M;
    machine
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Jump {
    pub(crate) from_rpm: f64,
    pub(crate) to_rpm: f64,
    pub(crate) opening: f64,
}

impl Jump {
    /// `110 to 50 krpm`.
    pub(crate) fn name(&self) -> String {
        format!("{:.0} to {:.0} krpm", self.from_rpm / 1e3, self.to_rpm / 1e3)
    }
}

fn table_1() -> Vec<Jump> {
    JUMPS
        .into_iter()
        .flat_map(|(from_rpm, to_rpm)| OPENINGS.map(|opening| Jump { from_rpm, to_rpm, opening }))
        .collect()
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Truth {
    pub(crate) t_s: f64,
    pub(crate) eta: f64,
    pub(crate) h_w_m2k: f64,
    pub(crate) t2_k: f64,
    pub(crate) speed_rpm: f64,
    pub(crate) flow_kg_s: f64,
    pub(crate) pressure_ratio: f64,
    pub(crate) tc_k: f64,
    pub(crate) probe_time_constant_s: f64,
    pub(crate) heats_gas: bool,
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Run {
    pub(crate) jump: Jump,
    pub(crate) recording: Recording,
    pub(crate) truth: Vec<Truth>,
}

/// A jump of P3 that follows its command with a first-order lag; without a lag it is a step.
struct P3Jump {
    to: BoundaryConditions,
    from_pa: f64,
    lag_s: f64,
}

impl Inputs for P3Jump {
    fn at(&self, t_s: f64) -> BoundaryConditions {
        if self.lag_s == 0.0 {
            return self.to;
        }
        let left_ratio = (-t_s.max(0.0) / self.lag_s).exp();
        BoundaryConditions { p3_pa: self.to.p3_pa + left_ratio * (self.from_pa - self.to.p3_pa), ..self.to }
    }

    fn next_kink_s(&self, _t_s: f64) -> f64 {
        f64::INFINITY
    }

    fn is_constant_after(&self, _t_s: f64) -> bool {
        self.lag_s == 0.0
    }
}

/// The settled state at a speed and an opening, under the usual conditions.
pub(crate) fn settled_at(model: &Model, speed_rpm: f64, opening: f64) -> Result<SteadyState, SteadyError> {
    let boundary = BoundaryConditions { valve_opening_ratio: opening, ..BoundaryConditions::default() };
    hold_speed(model, speed_rpm, &boundary)
}

/// Runs a jump for `seconds` from the machine's own steady state to the P3 that holds the to-speed on the nominal one, lagged by `lag_s`.
pub(crate) fn run_lagged(
    machine: &Model,
    jump: Jump,
    seconds: f64,
    lag_s: f64,
) -> Result<Run, ReproduceError> {
    let start = settled_at(machine, jump.from_rpm, jump.opening)?;
    let boundary = settled_at(&Model::nominal(), jump.to_rpm, jump.opening)?.boundary;
    let inputs = P3Jump { to: boundary, from_pa: start.boundary.p3_pa, lag_s };
    let mut simulator = Simulator::new(machine, 0.0, start.state, RELATIVE_TOLERANCE, Watch::default());
    let mut recording = Recording::default();
    let mut truth = Vec::new();
    let count = (seconds * RATE_HZ).round() as u32;
    simulator.run_to(
        seconds,
        &inputs,
        (0..=count).map(|i| f64::from(i) / RATE_HZ),
        |t_s, state, outputs| {
            for (channel, value) in [
                (Channel::ShaftSpeed, state.shaft_speed_rpm()),
                (Channel::CompressorFlow, outputs.flow_kg_s),
                (Channel::P1, boundary.p1_pa),
                (Channel::T1, boundary.t1_k),
                (Channel::P2, state.p2_pa),
                (Channel::T2, outputs.t2_probe_k),
                (Channel::Tc, state.tc_k),
            ] {
                let series = recording.series.entry(channel).or_default();
                series.t_s.push(t_s);
                series.values.push(value);
            }
            let heats_gas = outputs.wall_k > outputs.t2_prime_k;
            let direction_ratio = if heats_gas { machine.params.compressor.hot_metal_h_ratio } else { 1.0 };
            truth.push(Truth {
                t_s,
                eta: outputs.efficiency,
                h_w_m2k: direction_ratio * outputs.h_w_m2k,
                t2_k: outputs.t2_k,
                speed_rpm: state.shaft_speed_rpm(),
                flow_kg_s: outputs.flow_kg_s,
                pressure_ratio: outputs.pressure_ratio,
                tc_k: state.tc_k,
                probe_time_constant_s: outputs.t2_probe_time_constant_s,
                heats_gas,
            });
        },
        |_| {},
    )?;
    let operating_point = |speed_rpm| OperatingPoint { speed_rpm, valve_opening_ratio: jump.opening };
    recording.steps.push(StepMarker {
        index: 0,
        kind: StepKind::Point,
        start_s: 0.0,
        end_s: seconds,
        from: Some(operating_point(jump.from_rpm)),
        to: Some(operating_point(jump.to_rpm)),
        p3_pa: boundary.p3_pa,
        valve_opening_ratio: jump.opening,
    });
    Ok(Run { jump, recording, truth })
}

pub(crate) fn run_all(machine: &Model, seconds: f64) -> Result<Vec<Run>, ReproduceError> {
    table_1().into_iter().map(|jump| run_lagged(machine, jump, seconds, 0.0)).collect()
}

/// The paper's window: 100 s from 10 s after the jump.
pub(crate) const WINDOW: WindowRule = WindowRule::Fixed { start_s: 10.0, end_s: 110.0 };
/// Minimum duration of a run for it, s.
pub(crate) const RUN_S: f64 = 110.0;

pub(crate) fn dynamic_config(alpha_area_ratio: f64) -> IdentifyConfig {
    IdentifyConfig { window: WINDOW, alpha_area_ratio, ..IdentifyConfig::default() }
}

#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Outcome {
    pub(crate) jump: Jump,
    pub(crate) point: IdentifiedPoint,
    /// Mean of the model's efficiency in the window, fraction.
    pub(crate) eta_mean: f64,
    /// The model's efficiency at the window's end, fraction.
    pub(crate) eta_end: f64,
    /// Mean of the model's h in the window, W/(m2 K).
    pub(crate) h_mean_w_m2k: f64,
    /// The model's h at the window's end, W/(m2 K).
    pub(crate) h_end_w_m2k: f64,
}

impl Outcome {
    pub(crate) fn eta_error_points(&self) -> Option<f64> {
        self.point.eta.map(|eta| 100.0 * (eta - self.eta_mean))
    }

    pub(crate) fn eta_end_error_points(&self) -> Option<f64> {
        self.point.eta.map(|eta| 100.0 * (eta - self.eta_end))
    }

    /// Identified h over the mean model h, minus 1, %.
    pub(crate) fn h_error_percent(&self) -> Option<f64> {
        self.point.h_w_m2k.map(|h| 100.0 * (h / self.h_mean_w_m2k - 1.0))
    }

    /// Identified h over the final model h, minus 1, %.
    pub(crate) fn h_end_error_percent(&self) -> Option<f64> {
        self.point.h_w_m2k.map(|h| 100.0 * (h / self.h_end_w_m2k - 1.0))
    }
}

pub(crate) fn identify_run(run: &Run, config: &IdentifyConfig) -> Result<Outcome, ReproduceError> {
    identify_recording(run, &run.recording, config)
}

pub(crate) fn identify_recording(
    run: &Run,
    recording: &Recording,
    config: &IdentifyConfig,
) -> Result<Outcome, ReproduceError> {
    let mut points = identify_each(recording, config)?;
    let point = points.pop().ok_or(ReproduceError::NoStep)??;
    let window = truth_in_window(run, &config.window);
    let mean = |value: fn(&Truth) -> f64| statistics::mean(window.iter().map(value)).unwrap_or(f64::NAN);
    let last = window.last().ok_or(ReproduceError::NoStep)?;
    Ok(Outcome {
        jump: run.jump,
        point,
        eta_mean: mean(|truth| truth.eta),
        eta_end: last.eta,
        h_mean_w_m2k: mean(|truth| truth.h_w_m2k),
        h_end_w_m2k: last.h_w_m2k,
    })
}

pub(crate) fn truth_in_window<'a>(run: &'a Run, window: &WindowRule) -> &'a [Truth] {
    let (start_s, end_s) = match window {
        WindowRule::Fixed { start_s, end_s } => (*start_s, *end_s),
        WindowRule::Auto => (0.0, f64::INFINITY),
    };
    // Sample times are multiples of 0.1 s to rounding.
    let start = run.truth.partition_point(|truth| truth.t_s < start_s - 1e-6);
    let end = run.truth.partition_point(|truth| truth.t_s <= end_s + 1e-6);
    &run.truth[start..end.max(start)]
}

pub(crate) fn identify_runs(runs: &[Run], config: &IdentifyConfig) -> Result<Vec<Outcome>, ReproduceError> {
    runs.iter().map(|run| identify_run(run, config)).collect()
}

pub(crate) fn extremes(values: impl IntoIterator<Item = Option<f64>>) -> Option<(f64, f64)> {
    values.into_iter().flatten().fold(None, |range, value| {
        let (low, high) = range.unwrap_or((value, value));
        Some((low.min(value), high.max(value)))
    })
}

pub(crate) fn worst(values: impl IntoIterator<Item = Option<f64>>) -> f64 {
    values.into_iter().flatten().fold(0.0, |worst, value| worst.max(value.abs()))
}

pub(crate) fn rms(values: impl IntoIterator<Item = Option<f64>>) -> Option<f64> {
    statistics::rms(values.into_iter().flatten())
}

/// One reproduced figure of the paper.
#[derive(Debug, Clone, PartialEq)]
pub struct FigureResult {
    /// Its number in the paper, e.g. `7`.
    pub number: String,
    /// Its subject.
    pub title: String,
    /// The method of the reproduction, in a few sentences.
    pub method: String,
    /// The paper's statements, with the results here.
    pub statements: Vec<Statement>,
    /// The numbers behind the picture.
    pub table: Table,
    /// The picture, an SVG document.
    pub svg: String,
}

impl Statement {
    pub(crate) fn new(paper: &str, here: String, verdict: Verdict) -> Self {
        Statement { paper: paper.to_owned(), here, verdict }
    }
}

named_enum! {
    /// Verdict on a statement of the paper.
    pub enum Verdict {
        /// It holds.
        Holds = "holds",
        /// It holds with an exception, named in `here`.
        Partly = "partly",
        /// It does not hold.
        Differs = "differs",
        /// Only measurements on a rig can decide it.
        NeedsRig = "needs a rig",
    }
}

impl Verdict {
    pub(crate) fn holds_if(condition: bool) -> Self {
        Verdict::of(condition, false)
    }

    pub(crate) fn of(holds: bool, holds_partly: bool) -> Self {
        match (holds, holds_partly) {
            (true, _) => Verdict::Holds,
            (false, true) => Verdict::Partly,
            (false, false) => Verdict::Differs,
        }
    }
}

/// A statement of the paper, and the result here.
#[derive(Debug, Clone, PartialEq)]
pub struct Statement {
    /// The statement.
    pub paper: String,
    /// The result, with units.
    pub here: String,
    /// Whether it holds.
    pub verdict: Verdict,
}

/// A table with formatted cells.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Table {
    /// Column heads, units included.
    pub head: Vec<String>,
    /// Rows, each as long as `head`.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    pub(crate) fn new<const N: usize>(head: [&str; N]) -> Self {
        Table { head: head.map(str::to_owned).to_vec(), rows: Vec::new() }
    }

    pub(crate) fn row<const N: usize>(&mut self, cells: [String; N]) {
        self.rows.push(cells.to_vec());
    }
}

/// Path of this figure's picture, relative to the page of the figures.
pub fn picture_path(result: &FigureResult) -> String {
    format!("reproduction/figure_{}.svg", result.number)
}

/// Why a figure could not be reproduced.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum ReproduceError {
    #[error(transparent)]
    Steady(#[from] SteadyError),
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    #[error(transparent)]
    Step(#[from] StepError),
    #[error("a simulated run has no step or no sample in the window")]
    NoStep,
}

/// `value` with `decimals` digits after the point; `-0.0` is `0.0`, NaN is `-`.
pub(crate) fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return "-".to_owned();
    }
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(digits) if digits.chars().all(|c| c == '0' || c == '.') => digits.to_owned(),
        _ => text,
    }
}

pub(crate) fn signed(value: f64, decimals: usize) -> String {
    let text = fixed(value, decimals);
    let zero = text.chars().all(|c| c == '0' || c == '.' || c == '-');
    if zero || text.starts_with('-') { text } else { format!("+{text}") }
}

pub(crate) fn signed_or_dash(value: Option<f64>, decimals: usize) -> String {
    value.map_or_else(|| "-".to_owned(), |value| signed(value, decimals))
}

/// `low to high` with signs.
pub(crate) fn range(range: Option<(f64, f64)>, decimals: usize) -> String {
    match range {
        Some((low, high)) => format!("{} to {}", signed(low, decimals), signed(high, decimals)),
        None => "none".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_has_no_sign() {
        assert_eq!([fixed(-0.001, 2), signed(0.001, 2), signed(1.5, 1)], ["0.00", "0.00", "+1.5"]);
        assert_eq!([signed(-1.25, 2), fixed(f64::NAN, 2), signed_or_dash(None, 1)], ["-1.25", "-", "-"]);
    }
}
