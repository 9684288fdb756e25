//! Response of P3 and the valve to their commands: a dead time, a first-order lag, a rate limit and play, and their estimation from a recording.

use crate::averages::{TIME_ROUNDING_S, Table};
use mapper_core::{Channel, Recording, RigActuators, Series, StepMarker, is_jump, is_same_command};
use mapper_numerics::root::minimise;
use mapper_numerics::statistics::{mean, median};
use mapper_physics::gas::mixture::Gas;
use mapper_physics::laws::turbine;
use mapper_physics::rig::instruments::ValveMotion;

/// Lags after which a jump is almost complete. Bound: 0.25 % of it is left, exp(-6).
const SETTLING_LAGS: f64 = 6.0;
/// Minimum flow through an orifice of 1 m2, kg/s. Bound: excludes division by zero without a pressure difference.
const MIN_FLUX: f64 = 1e-9;
/// Share of a step at its end in which pressures and flow are settled. Bound: steps are longer than three settling times.
const SETTLED_SHARE: f64 = 0.3;
/// Minimum jump of P3 in noise of a sample. Bound: noise alone never reaches it.
const MIN_P3_JUMP_SIGMAS: f64 = 10.0;
/// Lags that are searched, s. Bound: below a sample interval of any log, to above any actuator.
const LAGS_S: (f64, f64) = (1e-3, 60.0);
/// Relative tolerance of the lag. Bound: far below its error.
const LAG_TOLERANCE: f64 = 1e-6;
/// Factor of the fine search about the best of [`RATES`]. Bound: the distance of two rates.
const RATE_FACTOR: f64 = 1.8;
/// Relative tolerance of the rate. Bound: far below its error.
const RATE_TOLERANCE: f64 = 1e-4;

/// A commanded level from a given time on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Level {
    /// Time of the change, s.
    pub start_s: f64,
    /// Commanded P3, Pa.
    pub p3_pa: f64,
    /// Commanded valve opening.
    pub valve_opening_ratio: f64,
}

/// Response of an actuator to its command.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Response {
    /// Time constant of its first-order lag, s, >= 0; 0 follows immediately.
    pub lag_s: f64,
    /// Maximum rate, unit of the actuator per second, > 0; infinity for none.
    pub slew_per_s: f64,
    /// Time before it begins to move, s, >= 0.
    pub dead_time_s: f64,
    /// Play between drive and output, unit of the actuator, >= 0.
    pub play: f64,
    /// Change of the command below which the drive does not move, unit of the actuator, >= 0.
    pub dead_band: f64,
}

impl Response {
    /// A lag alone.
    pub const fn lag(lag_s: f64) -> Response {
        Response { lag_s, slew_per_s: f64::INFINITY, dead_time_s: 0.0, play: 0.0, dead_band: 0.0 }
    }

    /// The declared motion of a valve; at once if none is declared.
    pub fn of_valve(declared: Option<&RigActuators>) -> Response {
        declared.map_or(Response::lag(0.0), |actuators| Response {
            lag_s: actuators.valve.lag_s,
            slew_per_s: actuators.valve.rate_per_s,
            dead_time_s: actuators.valve.dead_time_s,
            play: actuators.valve_play_ratio,
            dead_band: actuators.valve_dead_band_ratio,
        })
    }

    /// Position of the output, which was at `before`, behind a drive.
    fn output(&self, before: f64, drive: f64) -> f64 {
        let half = 0.5 * self.play;
        drive + (before - drive).clamp(-half, half)
    }

    /// Position `elapsed_s` after the start of a movement from `from` to `to`.
    fn approach(self, from: f64, to: f64, elapsed_s: f64) -> f64 {
        let (jump, elapsed_s) = (to - from, elapsed_s.max(0.0));
        let limited = self.slew_per_s.is_finite();
        let ramp_s = if limited { (jump.abs() / self.slew_per_s - self.lag_s).max(0.0) } else { 0.0 };
        if elapsed_s < ramp_s {
            from + self.slew_per_s * jump.signum() * elapsed_s
        } else if self.lag_s > 0.0 {
            let remaining = if limited { jump.abs().min(self.slew_per_s * self.lag_s) } else { jump.abs() };
            to - remaining * jump.signum() * (-(elapsed_s - ramp_s) / self.lag_s).exp()
        } else {
            to
        }
    }
}

/// Response of P3 and the valve to their commands.
#[derive(Debug, Clone, PartialEq)]
pub struct LaggedCommand {
    levels: Vec<Level>,
    p3_path: Path,
    valve_path: Path,
    /// Response of P3; Pa/s.
    pub p3: Response,
    /// Response of the valve; 1/s.
    pub valve: Response,
}

/// An actuator's motion from command to command.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Path {
    response: Response,
    /// Time of each command, s.
    times_s: Vec<f64>,
    /// The command that the drive follows from then on.
    commands: Vec<f64>,
    /// Positions of drive and output at the start of each level.
    starts: Vec<(f64, f64)>,
}

impl Path {
    /// The motion of an actuator that came from `before` and is at rest at the first of these commands, times in s and values.
    pub(crate) fn new(
        commands: impl IntoIterator<Item = (f64, f64)>,
        response: Response,
        before: f64,
    ) -> Path {
        let (times_s, starts) = (Vec::new(), Vec::new());
        let mut path = Path { response, times_s, commands: Vec::new(), starts };
        for (t_s, command) in commands {
            let held = path.commands.last().copied();
            path.starts.push(match held {
                Some(_) => path.at(path.commands.len() - 1, t_s),
                None => (command, response.output(before, command)),
            });
            let is_held = held.filter(|held| (command - held).abs() < response.dead_band);
            path.commands.push(is_held.unwrap_or(command));
            path.times_s.push(t_s);
        }
        path
    }

    /// Positions of drive and output after a command, at a time without the dead time. The drive moves in one direction, so that the output depends
    /// on its start alone.
    fn at(&self, index: usize, t_s: f64) -> (f64, f64) {
        let (drive, output) = self.starts[index];
        let drive = self.response.approach(drive, self.commands[index], t_s - self.times_s[index]);
        (drive, self.response.output(output, drive))
    }

    /// Output at `t_s`; there is at least one command.
    pub(crate) fn output(&self, t_s: f64) -> f64 {
        let t_s = t_s - self.response.dead_time_s;
        self.at(self.times_s.partition_point(|start_s| *start_s <= t_s).saturating_sub(1), t_s).1
    }
}

/// Opening from which a valve moves to the first one of a recording. Source: safe state of a stand, the valve at its nominal area.
pub const SAFE_OPENING: f64 = 1.0;

impl LaggedCommand {
    /// The response to `levels` (rising in time, at least one) from steady state.
    pub fn new(levels: Vec<Level>, p3: Response, valve: Response) -> Self {
        let first_pa = levels.first().map_or(f64::NAN, |level| level.p3_pa);
        let p3_path = Path::new(levels.iter().map(|level| (level.start_s, level.p3_pa)), p3, first_pa);
        let openings = levels.iter().map(|level| (level.start_s, level.valve_opening_ratio));
        let valve_path = Path::new(openings, valve, SAFE_OPENING);
        LaggedCommand { levels, p3_path, valve_path, p3, valve }
    }

    /// The response to the commands of a recording with at least one step: a level for each command, of which a jump has one, a ramp many, and
    /// a speed-control loop one whenever it corrects P3.
    pub fn of_recording(recording: &Recording, p3: Response, valve: Response) -> Self {
        let levels = recording.steps.iter().flat_map(|step| levels_of_step(recording, step));
        LaggedCommand::new(levels.collect(), p3, valve)
    }

    /// Replaces the responses, and keeps the commands.
    fn with_responses(&self, p3: Response, valve: Response) -> LaggedCommand {
        LaggedCommand::new(self.levels.clone(), p3, valve)
    }

    /// The same with a valve that also moves like this.
    #[must_use]
    pub fn with_valve(&self, by: ValveMotion) -> LaggedCommand {
        let (lag_s, play) = ((self.valve.lag_s + by.lag_s).max(0.0), self.valve.play + by.play_ratio);
        let reached =
            |level: &Level| Level { valve_opening_ratio: by.reached(level.valve_opening_ratio), ..*level };
        let levels = self.levels.iter().map(reached).collect();
        LaggedCommand::new(levels, self.p3, Response { lag_s, play, ..self.valve })
    }

    /// The level commanded at `t_s`.
    pub fn level(&self, t_s: f64) -> usize {
        self.levels.partition_point(|level| level.start_s <= t_s).saturating_sub(1)
    }

    /// P3 at `t_s`, Pa.
    pub fn p3_pa(&self, t_s: f64) -> f64 {
        self.p3_path.output(t_s)
    }

    /// Valve opening at `t_s`.
    pub fn valve_opening_ratio(&self, t_s: f64) -> f64 {
        self.valve_path.output(t_s)
    }

    /// Time after which a jump of P3 is almost complete, s.
    pub fn p3_settles_s(&self, from_pa: f64, to_pa: f64) -> f64 {
        self.p3.dead_time_s + (to_pa - from_pa).abs() / self.p3.slew_per_s + SETTLING_LAGS * self.p3.lag_s
    }

    /// Commanded levels.
    pub fn levels(&self) -> &[Level] {
        &self.levels
    }
}

/// The levels of a step: of a jump, of a ramp, and of the speed-control loop after them.
pub(crate) fn levels_of_step(recording: &Recording, step: &StepMarker) -> Vec<Level> {
    let changes = |channel: Channel, marked: f64| match recording.series.get(&channel) {
        Some(command) => changes_of_command(command, (step.start_s, step.end_s), marked),
        None => vec![(step.start_s, marked)],
    };
    let p3 = changes(Channel::P3Command, step.p3_pa);
    let valve = changes(Channel::ValveCommand, step.valve_opening_ratio);
    let mut times_s: Vec<f64> = p3.iter().chain(&valve).map(|(t_s, _)| *t_s).collect();
    times_s.sort_by(f64::total_cmp);
    times_s.dedup();
    let held = |changes: &[(f64, f64)], t_s: f64| {
        let after = changes.partition_point(|(change_s, _)| *change_s <= t_s);
        changes[after.saturating_sub(1)].1
    };
    let level = |start_s: f64| Level {
        start_s,
        p3_pa: held(&p3, start_s),
        valve_opening_ratio: held(&valve, start_s),
    };
    times_s.into_iter().map(level).collect()
}

/// Times, s, and values of the changes of a command within a step; the first is at its start. `marked` is the step's own command, which counts
/// where none is recorded.
fn changes_of_command(command: &Series, (start_s, end_s): (f64, f64), marked: f64) -> Vec<(f64, f64)> {
    let before = command.held(start_s - TIME_ROUNDING_S).filter(|value| value.is_finite());
    let (t_s, values) = command.slice(start_s, end_s - TIME_ROUNDING_S);
    let mut samples = t_s.iter().copied().zip(values.iter().copied()).filter(|(_, value)| value.is_finite());
    let Some((mut seen_s, mut value)) = samples.next() else { return vec![(start_s, marked)] };
    let is_old = before.is_some_and(|before| is_same_command(before, value));
    let mut changes: Vec<(f64, f64)> = vec![(start_s, value)];
    for (index, (t_s, next)) in samples.enumerate() {
        // The read-back of a constant command varies in its last digits.
        if !is_same_command(next, value) {
            // A change is later than the previous sample; that of the step itself is at its start, also if the first sample precedes it.
            let change_s = if index == 0 && is_old { start_s } else { seen_s };
            if change_s <= start_s {
                changes.clear();
            }
            changes.push((change_s, next));
            value = next;
        }
        seen_s = t_s;
    }
    changes
}

/// Time at which the last command of a step's own change was sent, s: its start for a jump, the end of its ramp otherwise.
pub(crate) fn commanded_s(levels: &[Level], step: &StepMarker) -> f64 {
    let is_sent = |level: &&Level| {
        is_same_command(level.p3_pa, step.p3_pa)
            && is_same_command(level.valve_opening_ratio, step.valve_opening_ratio)
    };
    levels.iter().find(is_sent).map_or(step.start_s, |level| level.start_s)
}

/// Time at which the commands of a step have arrived, s: its start for a jump, the end of its ramps otherwise.
pub fn ramp_end_s(recording: &Recording, step: &StepMarker) -> f64 {
    commanded_s(&levels_of_step(recording, step), step)
}

/// Number of intervals of a coarse search. Bound: neighbouring lags differ by less than a factor of two.
const COARSE_STEPS: usize = 24;
/// Rates of the coarse search, in median jumps per second. Bound: slower rates are no jumps, faster ones a lag alone.
const RATES: [f64; 9] = [0.2, 0.35, 0.6, 1.0, 1.7, 3.0, 5.0, 9.0, 16.0];
/// Undeclared play with which the lag of a valve is sought again, opening. Bound: 1 % moves an output by less than noise, and a drive with more
/// than 10 % is broken.
const UNDECLARED_PLAYS: [f64; 4] = [0.01, 0.025, 0.05, 0.1];
/// Dead times of the coarse search, s. Bound: below half a sample interval no recording shows one; slow air begins to move within seconds.
const DEAD_TIMES_S: [f64; 6] = [0.05, 0.1, 0.2, 0.5, 1.0, 2.0];
/// Factor of the fine search about the best of them. Bound: the distance of two.
const DEAD_TIME_FACTOR: f64 = 2.0;
/// Tolerance of a dead time, s, and of the logarithm of the lag that is sought with it. Bound: a tenth of a sample interval.
const DEAD_TIME_TOLERANCE: f64 = 3e-3;
/// Factor by which a dead time may shorten the lag that stood for both. Bound: a lag far below the dead time does not show.
const LAG_FACTOR: f64 = 20.0;
/// How closely a response is sought.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Search {
    /// Time before and after a jump over which a response is compared, s.
    pub(crate) around_s: (f64, f64),
    /// Reduction of the cost above which a rate limit or a dead time is accepted.
    pub(crate) min_cost_reduction: f64,
    /// Rates of the coarse search, in median jumps per second.
    pub(crate) rates: &'static [f64],
}

const IN_CAMPAIGN: Search =
    Search { around_s: AROUND_S, min_cost_reduction: MIN_COST_REDUCTION, rates: &RATES };

/// Reduction of the sum of squared residuals, relative to their mean square, above which a rate limit or a dead time is accepted. Bound: ten
/// standard deviations of white noise, five of coloured noise over the half second of a ramp. A wrongly accepted one has no effect, because a
/// fast rate or a short dead time is equivalent to a lag alone.
const MIN_COST_REDUCTION: f64 = 100.0;
/// Share of it by the best of [`RATES`] above which a fine search follows. Bound: half of the distance between two rates loses less than 90 % of the reduction.
const COARSE_SHARE: f64 = 0.1;

/// Response of the measured P3 to its command, with a rate limit if the recording supports one; `None` without jumps or P3.
pub fn measured_p3_response(table: &Table, recording: &Recording, noise_sigma: f64) -> Option<Response> {
    let values = table.column(Channel::P3)?;
    let jumps = p3_jumps(recording, noise_sigma);
    let sizes = recording.steps.windows(2).map(|pair| (pair[1].p3_pa - pair[0].p3_pa).abs());
    let commanded = LaggedCommand::of_recording(recording, Response::lag(0.0), Response::lag(0.0));
    estimate_response(table, values, &jumps, (sizes.collect(), IN_CAMPAIGN), |response| {
        let command = commanded.with_responses(response, Response::lag(0.0));
        move |t_s| command.p3_pa(t_s)
    })
}

/// Area of the valve at each sample from flow and pressures, m2; `None` without flow, P2 or T2.
pub fn valve_areas_m2(table: &Table, (nominal_p1_pa, outlet_volume_m3): (f64, f64)) -> Option<Vec<f64>> {
    let flow = table.column(Channel::CompressorFlow)?;
    let (p2, t2) = (table.column(Channel::P2)?, table.column(Channel::T2)?);
    let p1 = table.column(Channel::P1);
    let p2_slope_pa_s = |i: usize| {
        let (before, after) = (i.saturating_sub(1), (i + 1).min(table.t_s.len() - 1));
        let span_s = table.t_s[after] - table.t_s[before];
        if span_s > 0.0 { (p2[after] - p2[before]) / span_s } else { 0.0 }
    };
    let area_m2 = (0..table.t_s.len()).map(|i| {
        let p1_pa = p1.map_or(nominal_p1_pa, |p1| p1[i]);
        let filling_kg_s = outlet_volume_m3 * p2_slope_pa_s(i) / (Gas::AIR_GAS_CONSTANT_J_KGK * t2[i]);
        (flow[i] - filling_kg_s) / turbine::flow_kg_s(1.0, p2[i], t2[i], p1_pa).max(MIN_FLUX)
    });
    Some(area_m2.collect())
}

/// Median of a quantity of the samples at the settled end of a step; `None` without values.
pub(crate) fn settled(table: &Table, step: &StepMarker, values: &[f64]) -> Option<f64> {
    let range = table.range(step.end_s - SETTLED_SHARE * (step.end_s - step.start_s), step.end_s);
    median(values[range].iter().filter(|value| value.is_finite()))
}

/// Opening of the valve at each sample: its area, relative to the median area per commanded opening.
pub(crate) fn valve_openings(
    table: &Table,
    recording: &Recording,
    (nominal_p1_pa, outlet_volume_m3): (f64, f64),
) -> Option<Vec<f64>> {
    let areas_m2 = valve_areas_m2(table, (nominal_p1_pa, outlet_volume_m3))?;
    let per_opening = |step: &StepMarker| Some(settled(table, step, &areas_m2)? / step.valve_opening_ratio);
    let area_m2 = median(recording.steps.iter().filter_map(per_opening).filter(|area_m2| *area_m2 > 0.0))?;
    area_m2.is_finite().then(|| areas_m2.iter().map(|at| at / area_m2).collect())
}

/// Response of the valve to its command, from flow and pressures: orifice flow is proportional to its area, and the volume before it takes a part
/// of the flow while P2 changes (`outlet_volume_m3`; 0 if it is unknown). `None` without jumps of the valve, flow, P2 or T2. A lag of the flow
/// meter counts as one of the valve. Play and dead band are those `declared`.
pub fn measured_valve_response(
    table: &Table,
    recording: &Recording,
    (nominal_p1_pa, outlet_volume_m3): (f64, f64),
    declared: Response,
) -> Option<Response> {
    let openings = valve_openings(table, recording, (nominal_p1_pa, outlet_volume_m3))?;
    let openings_of = |pair: &[StepMarker]| (pair[0].valve_opening_ratio, pair[1].valve_opening_ratio);
    let jumping = || {
        let jumped = |(from, to): (f64, f64)| is_jump(Channel::ValveCommand, from, to);
        recording.steps.windows(2).filter(move |pair| jumped(openings_of(pair)))
    };
    let jumps: Vec<f64> = jumping().map(|pair| pair[1].start_s).collect();
    let sizes: Vec<f64> = jumping().map(openings_of).map(|(from, to)| (to - from).abs()).collect();
    let commanded = LaggedCommand::of_recording(recording, Response::lag(0.0), Response::lag(0.0));
    let predict = |response: Response| {
        let command = commanded.with_responses(Response::lag(0.0), response);
        move |t_s: f64| command.valve_opening_ratio(t_s)
    };
    let with_declared = |response: Response| {
        predict(Response { play: declared.play, dead_band: declared.dead_band, ..response })
    };
    let found = estimate_response(table, &openings, &jumps, (sizes, IN_CAMPAIGN), with_declared)?;
    let found = Response { play: declared.play, dead_band: declared.dead_band, ..found };
    let cost_of = |response: Response| sum_of_squares(table, &openings, &jumps, AROUND_S, predict(response));
    // The play that the recording shows is the diagnosis' to name, but without it the lag would be longer.
    let with_play = |more: f64| {
        let with = |ln_lag: f64| Response { lag_s: ln_lag.exp(), play: declared.play + more, ..found };
        let (low, high) = (found.lag_s / LAG_FACTOR, found.lag_s);
        let best = minimise(low.ln(), high.ln(), DEAD_TIME_TOLERANCE, |ln_lag| cost_of(with(ln_lag)));
        (best.value, best.at.exp())
    };
    let best = UNDECLARED_PLAYS.map(with_play).into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
    let without = cost_of(found);
    let samples = samples_around(table, &jumps, AROUND_S);
    let shown = best.filter(|(cost, _)| without - cost > MIN_COST_REDUCTION * cost / samples);
    Some(Response { lag_s: shown.map_or(found.lag_s, |(_, lag_s)| lag_s), ..found })
}

/// Starts of the steps with a jump of P3.
fn p3_jumps(recording: &Recording, noise_sigma: f64) -> Vec<f64> {
    let jumped = |pair: &&[StepMarker]| {
        let (from_pa, to_pa) = (pair[0].p3_pa, pair[1].p3_pa);
        is_jump(Channel::P3Command, from_pa, to_pa)
            && (to_pa - from_pa).abs() > MIN_P3_JUMP_SIGMAS * noise_sigma.max(1.0)
    };
    recording.steps.windows(2).filter(jumped).map(|pair| pair[1].start_s).collect()
}

/// Time before and after a jump over which a response is compared, s. Bound: a level before, and several lags after.
const AROUND_S: (f64, f64) = (3.0, 12.0);

/// Sum of squared residuals around each jump, with a free level.
fn sum_of_squares(
    table: &Table,
    values: &[f64],
    jumps: &[f64],
    around_s: (f64, f64),
    predicted: impl Fn(f64) -> f64,
) -> f64 {
    let mut total = 0.0;
    for jump_s in jumps {
        let range = table.range(jump_s - around_s.0, jump_s + around_s.1);
        let residuals: Vec<f64> =
            range.filter(|i| values[*i].is_finite()).map(|i| values[i] - predicted(table.t_s[i])).collect();
        let mean = mean(&residuals).unwrap_or(0.0);
        total += residuals.iter().map(|residual| (residual - mean) * (residual - mean)).sum::<f64>();
    }
    total
}

/// Number of samples that [`sum_of_squares`] compares.
fn samples_around(table: &Table, jumps: &[f64], around_s: (f64, f64)) -> f64 {
    let around = |jump_s: &f64| table.range(jump_s - around_s.0, jump_s + around_s.1).len();
    jumps.iter().map(around).sum::<usize>().max(1) as f64
}

/// The lag with minimum cost, and that cost.
fn best_lag(cost: impl Fn(f64) -> f64) -> Option<(f64, f64)> {
    let lag_s = minimise_globally(LAGS_S, LAG_TOLERANCE, &cost)?;
    Some((lag_s, cost(lag_s)))
}

/// Minimum of a positive variable on a logarithmic scale. A coarse search comes first, because the cost may have several minima: responses
/// may not be of first order, and a rate limit may not affect all jumps.
fn minimise_globally((low, high): (f64, f64), tolerance: f64, cost: impl Fn(f64) -> f64) -> Option<f64> {
    let (low, high) = (low.ln(), high.ln());
    let position = |i: usize| low + (high - low) * i as f64 / COARSE_STEPS as f64;
    let costs: Vec<f64> = (0..=COARSE_STEPS).map(|i| cost(position(i).exp())).collect();
    let best = (0..=COARSE_STEPS).min_by(|a, b| costs[*a].total_cmp(&costs[*b]))?;
    let (low, high) = (position(best.saturating_sub(1)), position((best + 1).min(COARSE_STEPS)));
    Some(minimise(low, high, tolerance, |x| cost(x.exp())).at.exp())
}

/// Estimates the response with the least squared residuals around the jumps, whose median size is that of `sizes`.
pub(crate) fn estimate_response<Prediction: Fn(f64) -> f64>(
    table: &Table,
    values: &[f64],
    jumps: &[f64],
    (sizes, search): (Vec<f64>, Search),
    predict: impl Fn(Response) -> Prediction,
) -> Option<Response> {
    let size = median(&sizes).filter(|size| *size > 0.0)?;
    if jumps.is_empty() {
        return None;
    }
    let samples = samples_around(table, jumps, search.around_s);
    let estimate = Estimate {
        cost_of: |response| sum_of_squares(table, values, jumps, search.around_s, predict(response)),
        search,
        size,
        samples,
    };
    let plain = estimate.at(f64::INFINITY, 0.0)?;
    // A dead time before a lag looks like a limited rate, so that the order of the search matters.
    let ways = [estimate.late(estimate.limited(plain)), estimate.limited(estimate.late(plain))];
    ways.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, response)| response)
}

/// The search for a response: each form is accepted if it reduces the cost of the one before by more than chance.
struct Estimate<C: Fn(Response) -> f64> {
    cost_of: C,
    search: Search,
    /// Median size of the jumps.
    size: f64,
    samples: f64,
}

/// A response with its cost.
type Costed = (f64, Response);

impl<C: Fn(Response) -> f64> Estimate<C> {
    fn is_better(&self, cost: f64, than: f64, min_reduction: f64) -> bool {
        than - cost > min_reduction * cost / self.samples
    }

    /// The best lag with this rate and dead time.
    fn at(&self, slew_per_s: f64, dead_time_s: f64) -> Option<Costed> {
        let with = |lag_s: f64| Response { slew_per_s, dead_time_s, ..Response::lag(lag_s) };
        best_lag(|lag_s| (self.cost_of)(with(lag_s))).map(|(lag_s, cost)| (cost, with(lag_s)))
    }

    /// The same with a limited rate, if there is one.
    fn limited(&self, start: Costed) -> Costed {
        let at_rate = |slew_per_s: f64| self.at(slew_per_s, start.1.dead_time_s);
        let coarse = self.search.rates.iter().filter_map(|rate| at_rate(rate * self.size));
        let coarse = coarse.min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, Response { slew_per_s, .. })) = coarse.filter(|(cost, _)| {
            self.is_better(*cost, start.0, COARSE_SHARE * self.search.min_cost_reduction)
        }) else {
            return start;
        };
        let cost = |rate: f64| at_rate(rate).map_or(f64::INFINITY, |(cost, _)| cost);
        let range = (slew_per_s / RATE_FACTOR, slew_per_s * RATE_FACTOR);
        let found = minimise_globally(range, RATE_TOLERANCE, cost).and_then(at_rate);
        found
            .filter(|(cost, _)| self.is_better(*cost, start.0, self.search.min_cost_reduction))
            .unwrap_or(start)
    }

    /// The best lag, at most that of `start`, with this dead time.
    fn with_dead_time(&self, dead_time_s: f64, start: Response) -> Costed {
        let with = |ln_lag: f64| Response { lag_s: ln_lag.exp(), dead_time_s, ..start };
        let (low, high) = (start.lag_s / LAG_FACTOR, start.lag_s);
        let found = minimise(low.ln(), high.ln(), DEAD_TIME_TOLERANCE, |ln_lag| (self.cost_of)(with(ln_lag)));
        (found.value, with(found.at))
    }

    /// The same with a dead time, if there is one.
    fn late(&self, start: Costed) -> Costed {
        let at_time = |dead_time_s: f64| self.with_dead_time(dead_time_s, start.1);
        let coarse = DEAD_TIMES_S.map(at_time).into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, Response { dead_time_s, .. })) = coarse.filter(|(cost, _)| {
            self.is_better(*cost, start.0, COARSE_SHARE * self.search.min_cost_reduction)
        }) else {
            return start;
        };
        let (low, high) = (dead_time_s / DEAD_TIME_FACTOR, dead_time_s * DEAD_TIME_FACTOR);
        let found = minimise(low, high, DEAD_TIME_TOLERANCE, |dead_time_s| at_time(dead_time_s).0);
        let late = at_time(found.at);
        if self.is_better(late.0, start.0, self.search.min_cost_reduction) { late } else { start }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::StepKind;

    fn step(start_s: f64, end_s: f64, p3_pa: f64) -> StepMarker {
        let (index, kind) = (0, StepKind::Point);
        StepMarker { index, kind, start_s, end_s, from: None, to: None, p3_pa, valve_opening_ratio: 0.7 }
    }

    /// Samples every half second; the loop commands at 12 s, seen at 12.5 s.
    fn recording() -> Recording {
        let t_s: Vec<f64> = (0..=40).map(|i| f64::from(i) * 0.5).collect();
        let command = |t: &f64| match *t {
            t if t <= 10.0 => 150e3,
            t if t <= 12.0 => 200e3,
            _ => 201e3,
        };
        let values = t_s.iter().map(command).collect();
        Recording {
            series: [(Channel::P3Command, Series { t_s, values })].into(),
            steps: vec![step(0.0, 10.0, 150e3), step(10.0, 20.0, 200e3)],
            ..Recording::default()
        }
    }

    #[test]
    fn what_a_loop_says_within_a_step_is_a_level_of_its_own() {
        let command = LaggedCommand::of_recording(&recording(), Response::lag(0.3), Response::lag(0.0));
        let levels: Vec<_> = command.levels().iter().map(|level| (level.start_s, level.p3_pa)).collect();
        assert_eq!(levels, [(0.0, 150e3), (10.0, 200e3), (12.0, 201e3)]);
    }

    /// A play of 0.02: the valve stays 0.01 behind its drive on the side from which it came, and only a reversal of more than 0.02 moves it back. Commands
    /// within the dead band do nothing.
    #[test]
    fn a_valve_with_play_stays_behind_its_drive() {
        let commands = [1.0, 2.0, 1.99, 1.5, 1.503, 1.51, 1.53];
        let positions = [1.0, 1.99, 1.99, 1.51, 1.51, 1.51, 1.52];
        let level = |(i, opening): (usize, &f64)| Level {
            start_s: i as f64,
            p3_pa: 2e5,
            valve_opening_ratio: *opening,
        };
        let valve = Response { play: 0.02, dead_band: 0.005, ..Response::lag(0.0) };
        let levels = commands.iter().enumerate().map(level).collect();
        let command = LaggedCommand::new(levels, Response::lag(0.0), valve);
        for (i, position) in positions.into_iter().enumerate() {
            let found = command.valve_opening_ratio(i as f64 + 0.5);
            assert!((found - position).abs() < 1e-12, "{i}: {found} {position}");
        }
    }

    /// Jumps of 100 kPa at 80 kPa/s and a lag of 0.2 s; the valve moves by 0.5 at 0.4 1/s: the fit recovers these values.
    #[test]
    fn a_limited_rate_is_read_off_the_recording_and_a_plain_lag_is_none() {
        let steps: Vec<StepMarker> = (0..6)
            .map(|i| {
                let start_s = 20.0 * f64::from(i);
                let up = f64::from(i % 2);
                StepMarker {
                    valve_opening_ratio: 0.6 + 0.5 * up,
                    ..step(start_s, start_s + 20.0, 150e3 + 100e3 * up)
                }
            })
            .collect();
        let limited = |lag_s: f64, slew_per_s: f64| Response { slew_per_s, ..Response::lag(lag_s) };
        let truth = (limited(0.2, 80e3), limited(0.1, 0.4));
        let read = |p3: Response, valve: Response| {
            let mut recording = Recording { steps: steps.clone(), ..Recording::default() };
            let command = LaggedCommand::of_recording(&recording, p3, valve);
            let t_s: Vec<f64> = (0..1200).map(|i| 0.1 * f64::from(i)).collect();
            let mut put = |channel, value: &dyn Fn(f64) -> f64| {
                let values = t_s.iter().map(|t| value(*t)).collect();
                recording.series.insert(channel, Series { t_s: t_s.clone(), values });
            };
            put(Channel::P3, &|t| command.p3_pa(t));
            put(Channel::P2, &|_| 160e3);
            put(Channel::T2, &|_| 360.0);
            put(Channel::CompressorFlow, &|t| {
                turbine::flow_kg_s(2.4e-4 * command.valve_opening_ratio(t), 160e3, 360.0, 100e3)
            });
            let table = Table::new(&recording).unwrap();
            let p3 = measured_p3_response(&table, &recording, 80.0).unwrap();
            (p3, measured_valve_response(&table, &recording, (100e3, 0.0), Response::lag(0.0)).unwrap())
        };
        let (p3, valve) = read(truth.0, truth.1);
        for (found, truth) in [(p3, truth.0), (valve, truth.1)] {
            assert!((found.lag_s / truth.lag_s - 1.0).abs() < 0.05, "{found:?}");
            assert!((found.slew_per_s / truth.slew_per_s - 1.0).abs() < 0.02, "{found:?}");
        }
        let (p3, valve) = read(Response::lag(0.7), Response::lag(0.3));
        assert!(p3.slew_per_s.is_infinite() && valve.slew_per_s.is_infinite());
        assert!((p3.lag_s - 0.7).abs() < 1e-3 && (valve.lag_s - 0.3).abs() < 1e-3);
        assert_eq!((p3.dead_time_s, valve.dead_time_s), (0.0, 0.0));
        let late = |dead_time_s: f64, lag_s: f64| Response { dead_time_s, ..Response::lag(lag_s) };
        let truth = (late(0.9, 4.0), late(0.15, 0.5));
        let (p3, valve) = read(truth.0, truth.1);
        for (found, truth) in [(p3, truth.0), (valve, truth.1)] {
            assert!((found.lag_s / truth.lag_s - 1.0).abs() < 0.01, "{found:?}");
            assert!((found.dead_time_s - truth.dead_time_s).abs() < 0.01, "{found:?}");
        }
    }
}
