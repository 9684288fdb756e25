//! The stand as measured, and whether two recordings are of the same machine.

use crate::averages::Table;
use crate::model_inputs::lagged_command::{Path, Response, Search, estimate_response, valve_areas_m2};
use mapper_core::unit_factors::{PA_PER_KPA, PERCENT};
use mapper_core::{Channel, Recording, RigActuators, StepMarker, is_same_command};
use mapper_numerics::least_squares::{DifferenceStep, Model, Normal, Until, descend, step_bounds_within};
use mapper_numerics::root::bisect;
use mapper_numerics::statistics::{NORMAL_975, mean, student_quantile};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use std::collections::BTreeMap;

/// Reduction of the cost above which a limited rate is accepted. Bound: three standard deviations; the interval covers what is missed.
const MIN_COST_REDUCTION: f64 = 10.0;
/// Rates of the coarse search, in median jumps per second. Bound: from a motion over half a minute to a lag alone; a rate shows only up to the
/// jump over the lag, which may be little more.
const RATES: [f64; 19] = [
    0.03, 0.042, 0.057, 0.078, 0.11, 0.15, 0.2, 0.27, 0.37, 0.5, 0.68, 0.92, 1.3, 1.7, 2.4, 3.2, 4.4, 6.0,
    8.0,
];
/// Time before a jump that is compared, s. Bound: a level that has settled.
const BEFORE_S: f64 = 3.0;
/// Size of a change of the command relative to the largest, from which it is a jump. Bound: smaller ones add little.
const JUMP_SHARE: f64 = 0.3;
/// Resolution of the slowest rate, in its logarithm. Bound: half a per cent is far below the width of its interval.
const LN_RATE_RESOLUTION: f64 = 5e-3;
/// Range of rates that are searched for the slowest possible one, in largest jumps per second. Bound: slower ones are no jumps.
const SLOWEST_RATE: f64 = 1e-3;
/// Longest distance over which the residuals are correlated, samples. Bound: noise of sensors is correlated over a few seconds.
const MAX_CORRELATED: usize = 50;
/// Share of a step at its end in which a valve has settled. Bound: the rest is several lags.
const SETTLED_SHARE: f64 = 0.4;
/// Resolution of play and dead band, opening. Bound: noise of the flow over ten seconds.
const RESOLUTION: f64 = 5e-4;
/// Largest play that is searched, opening. Bound: a drive with more is broken.
const MAX_PLAY: f64 = 0.1;
/// Largest dead band that is searched, opening. Bound: more than the small steps of a commissioning together.
const MAX_DEAD_BAND: f64 = 0.03;
/// Share of a distribution below the upper end of its 95 % interval. Source: definition.
const UPPER_SHARE: f64 = 0.975;

/// A value with the ends of its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Fitted {
    /// The value; infinite for a rate that does not limit the motion.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end; infinite for a rate that does not limit the motion.
    pub high: f64,
}

impl Fitted {
    fn of_time(value: f64, half_width: f64) -> Self {
        let (low, high) = ((value - half_width).max(0.0), (value + half_width).max(0.0));
        Fitted { value: value.max(0.0), low, high }
    }

    /// Whether the interval contains a value.
    pub fn contains(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }
}

/// A measured value of an actuator, by its keys in `rig.actuators`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MeasuredValue {
    /// The actuator.
    pub actuator: &'static str,
    /// The key.
    pub key: &'static str,
    /// Its unit in campaigns.
    pub unit: &'static str,
    /// What the campaign declares or assumes, in this unit.
    pub declared: f64,
    /// What was measured, in this unit.
    pub measured: Fitted,
}

impl MeasuredValue {
    /// Whether the declared value lies within the measured interval.
    pub fn agrees(&self) -> bool {
        self.measured.contains(self.declared)
    }

    /// The value to declare: the declared one if it agrees, otherwise the measured one, or the lowest possible rate if none limits the motion.
    pub fn to_declare(&self) -> f64 {
        match self.measured {
            _ if self.agrees() => self.declared,
            Fitted { value, low, .. } if value.is_infinite() => low,
            Fitted { value, .. } => value,
        }
    }
}

/// Measures the actuators in the recording of a commissioning; `pipe`: nominal P1, Pa, and volume before the valve, m3. What the recording does not
/// show is left out. A lag of a sensor counts as one of its actuator.
pub fn measure_actuators(
    recording: &Recording,
    declared: &RigActuators,
    pipe: (f64, f64),
) -> Vec<MeasuredValue> {
    let Some(table) = Table::new(recording) else { return Vec::new() };
    let motion = |reading: Channel, command: Channel| {
        Jumps::new(&table, table.column(reading)?, recording, command)?.fit(Response::lag(0.0))
    };
    let mut values = Vec::new();
    let mut add = |actuator, key, unit, per_unit: f64, declared: f64, Fitted { value, low, high }: Fitted| {
        let measured = Fitted { value: value / per_unit, low: low / per_unit, high: high / per_unit };
        values.push(MeasuredValue { actuator, key, unit, declared: declared / per_unit, measured });
    };
    if let Some([lag_s, rate, dead_time_s]) = motion(Channel::P3, Channel::P3Command) {
        let (actuator, p3) = ("turbine_inlet_pressure", declared.p3);
        add(actuator, "lag", "s", 1.0, p3.lag_s, lag_s);
        add(actuator, "rate", "kPa/s", PA_PER_KPA, p3.rate_per_s, rate);
        add(actuator, "dead_time", "s", 1.0, p3.dead_time_s, dead_time_s);
    }
    if let Some(([lag_s, rate, _], play, dead_band)) = fit_valve(&table, recording, pipe) {
        let per_cent = 1.0 / PERCENT;
        add("valve", "lag", "s", 1.0, declared.valve.lag_s, lag_s);
        add("valve", "rate", "1/s", 1.0, declared.valve.rate_per_s, rate);
        add("valve", "play", "%", per_cent, declared.valve_play_ratio, play);
        add("valve", "dead_band", "%", per_cent, declared.valve_dead_band_ratio, dead_band);
    }
    if let Some([lag_s, rate, _]) = motion(Channel::T3, Channel::T3Command) {
        let (actuator, t3) = ("turbine_inlet_temperature", declared.t3);
        add(actuator, "lag", "s", 1.0, t3.lag_s, lag_s);
        add(actuator, "rate", "K/s", 1.0, t3.rate_per_s, rate);
    }
    values
}

/// Lag, s, largest rate, unit of the actuator per second, and dead time, s.
type Motion = [Fitted; 3];

/// Motion, play and dead band of the valve, from its area by flow and pressures. `None` without jumps, flow, P2 or T2.
fn fit_valve(table: &Table, recording: &Recording, pipe: (f64, f64)) -> Option<(Motion, Fitted, Fitted)> {
    let areas_m2 = valve_areas_m2(table, pipe)?;
    let commands = commands(recording, Channel::ValveCommand)?;
    let (play, dead_band, area_m2) = Settled::new(table, &areas_m2, recording, &commands)?.fit()?;
    let openings: Vec<f64> = areas_m2.iter().map(|area| area / area_m2).collect();
    let drive = Response { play: play.value, dead_band: dead_band.value, ..Response::lag(0.0) };
    let motion = Jumps::new(table, &openings, recording, Channel::ValveCommand)?.fit(drive)?;
    Some((motion, play, dead_band))
}

/// The commands of all steps, s and values: each is later than the last sample before it shows.
fn commands(recording: &Recording, channel: Channel) -> Option<Vec<(f64, f64)>> {
    let (first, last) = (recording.steps.first()?, recording.steps.last()?);
    let (t_s, values) = recording.series.get(&channel)?.slice(first.start_s, last.end_s);
    let mut commands = vec![(*t_s.first()?, *values.first()?)];
    for (times, pair) in t_s.windows(2).zip(values.windows(2)) {
        if !is_same_command(pair[0], pair[1]) {
            commands.push((times[0], pair[1]));
        }
    }
    commands.iter().all(|(_, value)| value.is_finite()).then_some(commands)
}

/// The jumps of a command with the readings that follow it.
struct Jumps<'a> {
    table: &'a Table,
    values: &'a [f64],
    commands: Vec<(f64, f64)>,
    starts_s: Vec<f64>,
    sizes: Vec<f64>,
    /// Time after a jump that is compared, s.
    after_s: f64,
}

/// The free parameters of a response: lag, s, dead time, s, which noise may make negative, and the logarithm of the rate if it is limited.
fn response_at(parameters: &DVector<f64>, drive: Response) -> Response {
    let slew_per_s = parameters.get(2).map_or(drive.slew_per_s, |ln_rate| ln_rate.exp());
    Response { lag_s: parameters[0].max(0.0), dead_time_s: parameters[1], slew_per_s, ..drive }
}

/// A fit with its parameters, cost and variance of a sample, correlation included.
struct Converged {
    parameters: DVector<f64>,
    covariance: DMatrix<f64>,
    cost: f64,
    variance: f64,
}

impl<'a> Jumps<'a> {
    fn new(table: &'a Table, values: &'a [f64], recording: &Recording, command: Channel) -> Option<Self> {
        let commands = commands(recording, command)?;
        let steps = &recording.steps;
        let last_of = |step: &StepMarker| {
            let before = commands.partition_point(|(t_s, _)| *t_s < step.end_s);
            before.checked_sub(1).map_or(f64::NAN, |index| commands[index].1)
        };
        let sizes: Vec<f64> =
            steps.windows(2).map(|pair| (last_of(&pair[1]) - last_of(&pair[0])).abs()).collect();
        let least = JUMP_SHARE * sizes.iter().copied().fold(0.0, f64::max);
        let jumps = steps.iter().skip(1).zip(&sizes).filter(|(_, size)| **size >= least && least > 0.0);
        let (jumping, sizes): (Vec<&StepMarker>, Vec<f64>) = jumps.map(|(step, size)| (step, *size)).unzip();
        let lengths_s = jumping.iter().map(|step| step.end_s - step.start_s);
        let after_s = lengths_s.min_by(f64::total_cmp)?;
        let starts_s = jumping.iter().map(|step| step.start_s).collect();
        Some(Jumps { table, values, commands, starts_s, sizes, after_s })
    }

    fn predict(&self, response: Response) -> impl Fn(f64) -> f64 + use<> {
        let before = self.commands.first().map_or(f64::NAN, |(_, value)| *value);
        let path = Path::new(self.commands.iter().copied(), response, before);
        move |t_s| path.output(t_s)
    }

    /// The residuals around each jump, with a free level.
    fn residuals(&self, response: Response) -> DVector<f64> {
        let predicted = self.predict(response);
        let mut all = Vec::new();
        for start_s in &self.starts_s {
            let range = self.table.range(start_s - BEFORE_S, start_s + self.after_s);
            let finite = range.filter(|i| self.values[*i].is_finite());
            let of_jump: Vec<f64> = finite.map(|i| self.values[i] - predicted(self.table.t_s[i])).collect();
            let level = mean(&of_jump).unwrap_or(0.0);
            all.extend(of_jump.into_iter().map(|residual| residual - level));
        }
        DVector::from_vec(all)
    }

    /// The best parameters near `start`, in the order of [`response_at`].
    fn converge(&self, start: DVector<f64>, drive: Response) -> Option<Converged> {
        let residuals = self.residuals(response_at(&start, drive));
        let free = residuals.len().checked_sub(start.len() + self.starts_s.len())?.max(1) as f64;
        // In standard deviations of what the start leaves, as the stopping rule expects.
        let unit = (residuals.norm_squared() / free).sqrt().max(f64::MIN_POSITIVE);
        let mut fit = ResponseFit { jumps: self, drive, unit };
        let end = descend(&mut fit, start, residuals / unit, Until::default());
        let cost = unit * unit * end.point.norm_squared();
        let variance = cost / free * correlation(&end.point);
        let covariance = end.normal.covariance_from(0)? * (variance / (unit * unit));
        Some(Converged { parameters: end.unknowns, covariance, cost, variance })
    }

    fn fit(&self, drive: Response) -> Option<Motion> {
        let search = Search {
            around_s: (BEFORE_S, self.after_s),
            min_cost_reduction: MIN_COST_REDUCTION,
            rates: &RATES,
        };
        let with_drive = |response: Response| {
            self.predict(Response { play: drive.play, dead_band: drive.dead_band, ..response })
        };
        let sought = (self.sizes.clone(), search);
        let start = estimate_response(self.table, self.values, &self.starts_s, sought, with_drive)?;
        let free = self.converge(DVector::from_vec(vec![start.lag_s, start.dead_time_s]), drive)?;
        let limited = start.slew_per_s.is_finite().then(|| {
            let ln_rate = start.slew_per_s.ln();
            self.converge(DVector::from_vec(vec![start.lag_s, start.dead_time_s, ln_rate]), drive)
        });
        // What the model leaves is correlated, and must not count as a rate.
        let is_shown = |limited: &Converged| free.cost - limited.cost > MIN_COST_REDUCTION * limited.variance;
        let best = limited.flatten().filter(is_shown).unwrap_or(free);
        // A command takes effect between two samples.
        let half_width = |index: usize| {
            (NORMAL_975 * best.covariance[(index, index)].sqrt()).hypot(0.5 * self.table.interval_s)
        };
        let mut lag_s = Fitted::of_time(best.parameters[0], half_width(0));
        let rate_per_s = match best.parameters.get(2) {
            Some(ln_rate) => {
                let factor = (NORMAL_975 * best.covariance[(2, 2)].sqrt()).exp();
                let value = ln_rate.exp();
                Fitted { value, low: value / factor, high: value * factor }
            }
            None => {
                let (low, slow) = self.slowest_rate(&best, drive)?;
                lag_s.low = lag_s.low.min(slow);
                Fitted { value: f64::INFINITY, low, high: f64::INFINITY }
            }
        };
        Some([lag_s, rate_per_s, Fitted::of_time(best.parameters[1], half_width(1))])
    }

    /// The slowest rate that the readings do not exclude, and the lag with it, s.
    fn slowest_rate(&self, best: &Converged, drive: Response) -> Option<(f64, f64)> {
        let size = self.sizes.iter().copied().fold(0.0, f64::max);
        let at = |ln_rate: f64| {
            self.converge(best.parameters.clone(), Response { slew_per_s: ln_rate.exp(), ..drive })
        };
        let most = best.cost + NORMAL_975 * NORMAL_975 * best.variance;
        let is_excluded = |ln_rate: f64| at(ln_rate).is_none_or(|fit| fit.cost > most);
        let fastest = (size / best.parameters[0].max(self.table.interval_s)).ln();
        let (_, ln_rate) = bisect((SLOWEST_RATE * size).ln(), fastest, LN_RATE_RESOLUTION, is_excluded);
        Some((ln_rate.exp(), at(ln_rate)?.parameters[0]))
    }
}

struct ResponseFit<'j, 'a> {
    jumps: &'j Jumps<'a>,
    drive: Response,
    /// Unit of the residuals, in that of the readings.
    unit: f64,
}

impl Model for ResponseFit<'_, '_> {
    type Point = DVector<f64>;

    fn at(&self, unknowns: &DVector<f64>) -> Option<DVector<f64>> {
        Some(self.jumps.residuals(response_at(unknowns, self.drive)) / self.unit)
    }

    fn cost(&self, _: &DVector<f64>, residuals: &DVector<f64>) -> f64 {
        residuals.norm_squared()
    }

    fn normal(&mut self, unknowns: &DVector<f64>, residuals: &DVector<f64>, reach: DifferenceStep) -> Normal {
        let slope = |index: usize| {
            let mut moved = unknowns.clone();
            moved[index] += reach.distance();
            let there = self.jumps.residuals(response_at(&moved, self.drive)) / self.unit;
            (there - residuals) / reach.distance()
        };
        let slopes = DMatrix::from_columns(&(0..unknowns.len()).map(slope).collect::<Vec<_>>());
        Normal { matrix: slopes.tr_mul(&slopes), gradient: -slopes.tr_mul(residuals) }
    }

    fn step_bounds(&self, unknowns: &DVector<f64>) -> Vec<(f64, f64)> {
        let low = |index: usize| if index == 0 { 0.0 } else { f64::NEG_INFINITY };
        let bounds = unknowns.iter().enumerate();
        bounds.map(|(index, at)| step_bounds_within(low(index), f64::INFINITY, *at)).collect()
    }
}

/// Factor by which the correlation of the residuals increases the variance of what is fitted to them.
fn correlation(residuals: &DVector<f64>) -> f64 {
    let total = residuals.norm_squared();
    let at = |distance: usize| {
        let pairs = residuals.iter().zip(residuals.iter().skip(distance));
        pairs.map(|(a, b)| a * b).sum::<f64>() / total
    };
    1.0 + 2.0 * (1..MAX_CORRELATED.min(residuals.len())).map(at).take_while(|share| *share > 0.0).sum::<f64>()
}

/// The positions in which a valve settles at the ends of the steps.
struct Settled<'a> {
    commands: &'a [(f64, f64)],
    /// Time, s, and area, m2, of each.
    levels: Vec<(f64, f64)>,
}

impl<'a> Settled<'a> {
    fn new(
        table: &Table,
        areas_m2: &[f64],
        recording: &Recording,
        commands: &'a [(f64, f64)],
    ) -> Option<Self> {
        // Before the first jump the side from which the valve came is unknown.
        let first = commands.first()?.1;
        let (moved_s, _) = commands.iter().find(|(_, opening)| (opening - first).abs() > MAX_PLAY)?;
        let steps = recording.steps.iter().filter(|step| step.end_s > *moved_s);
        let settled = |step: &StepMarker| {
            let start_s = step.end_s - SETTLED_SHARE * (step.end_s - step.start_s);
            let range = table.range(start_s, step.end_s);
            Some((
                0.5 * (start_s + step.end_s),
                mean(areas_m2[range].iter().filter(|area| area.is_finite()))?,
            ))
        };
        let levels: Vec<_> = steps.filter_map(settled).collect();
        (levels.len() > 5).then_some(Settled { commands, levels })
    }

    /// Sum of squared residuals, and the area at an opening of 1, which may drift with time.
    fn cost(&self, play: f64, dead_band: f64) -> Option<(f64, f64)> {
        let before = self.commands.first()?.1;
        let drive = Response { play, dead_band, ..Response::lag(0.0) };
        let path = Path::new(self.commands.iter().copied(), drive, before);
        let middle_s = mean(self.levels.iter().map(|(t_s, _)| *t_s))?;
        let (mut aa, mut ab, mut bb, mut ay, mut by, mut yy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        for (t_s, y) in &self.levels {
            let (a, b) = (path.output(*t_s), path.output(*t_s) * (t_s - middle_s));
            (aa, ab, bb) = (aa + a * a, ab + a * b, bb + b * b);
            (ay, by, yy) = (ay + a * y, by + b * y, yy + y * y);
        }
        let determinant = aa * bb - ab * ab;
        let (area_m2, drift) = ((ay * bb - by * ab) / determinant, (by * aa - ay * ab) / determinant);
        Some((yy - area_m2 * ay - drift * by, area_m2)).filter(|(cost, _)| cost.is_finite())
    }

    /// Play, dead band and area at an opening of 1.
    fn fit(&self) -> Option<(Fitted, Fitted, f64)> {
        let grid = |most: f64| (0..=(most / RESOLUTION) as usize).map(|i| RESOLUTION * i as f64);
        let mut tried = Vec::new();
        for play in grid(MAX_PLAY) {
            for dead_band in grid(MAX_DEAD_BAND) {
                let (cost, area_m2) = self.cost(play, dead_band)?;
                tried.push((cost, play, dead_band, area_m2));
            }
        }
        let best = tried.iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
        // Play, dead band, area and its drift.
        let free = (self.levels.len() - 4) as f64;
        let t = student_quantile(UPPER_SHARE, free)?;
        let most = best.0 * (1.0 + t * t / free);
        let accepted = || tried.iter().filter(|(cost, ..)| *cost <= most);
        let interval = |of: fn(&(f64, f64, f64, f64)) -> f64| {
            let (low, high) = mapper_numerics::statistics::range(accepted().map(of));
            Fitted { value: of(best), low: (low - RESOLUTION).max(0.0), high: high + RESOLUTION }
        };
        Some((interval(|tried| tried.1), interval(|tried| tried.2), best.3))
    }
}

/// A recording of a different machine from the campaign's.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "the recording was made on another machine: {what} `{recorded}` instead of the campaign's `{expected}`"
)]
pub struct OtherMachine {
    /// The difference: `machine` or `serial number`.
    pub what: &'static str,
    /// Value in the recording.
    pub recorded: String,
    /// Value in the campaign.
    pub expected: String,
}

/// Compares the machine of a recording (keys `machine` and `serial_number`) with the campaign's.
///
/// A missing entry is not a contradiction: recordings by other programs seldom name their machine, and a campaign without a serial number
/// applies to every machine of its name.
pub fn same_machine(
    recorded: &BTreeMap<String, String>,
    machine_name: &str,
    serial_number: Option<&str>,
) -> Result<(), OtherMachine> {
    let pairs =
        [("machine", "machine", Some(machine_name)), ("serial_number", "serial number", serial_number)];
    for (key, what, expected) in pairs {
        let is_named = |text: &&str| !text.is_empty();
        let recorded = recorded.get(key).map(String::as_str).filter(is_named);
        if let (Some(recorded), Some(expected)) = (recorded, expected.filter(is_named))
            && recorded != expected
        {
            let (recorded, expected) = (recorded.to_owned(), expected.to_owned());
            return Err(OtherMachine { what, recorded, expected });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recorded(machine: &str, serial_number: &str) -> BTreeMap<String, String> {
        [("machine", machine), ("serial_number", serial_number)]
            .map(|(key, value)| (key.to_owned(), value.to_owned()))
            .into()
    }

    #[test]
    fn another_name_or_number_is_another_machine() {
        assert_eq!(same_machine(&recorded("turbo_a", "TA-1"), "turbo_a", Some("TA-1")), Ok(()));
        let other = same_machine(&recorded("turbo_b", "TA-1"), "turbo_a", Some("TA-1")).unwrap_err();
        assert_eq!((other.what, other.recorded.as_str()), ("machine", "turbo_b"));
        let other = same_machine(&recorded("turbo_a", "TA-2"), "turbo_a", Some("TA-1")).unwrap_err();
        assert_eq!((other.what, other.expected.as_str()), ("serial number", "TA-1"));
    }

    #[test]
    fn silence_contradicts_nothing() {
        assert_eq!(same_machine(&BTreeMap::new(), "turbo_a", Some("TA-1")), Ok(()));
        assert_eq!(same_machine(&recorded("", ""), "turbo_a", Some("TA-1")), Ok(()));
        assert_eq!(same_machine(&recorded("turbo_a", "TA-2"), "turbo_a", None), Ok(()));
        assert_eq!(same_machine(&recorded("turbo_a", "TA-2"), "turbo_a", Some("")), Ok(()));
    }
}
