//! Samples of one step: cleaned of bad readings, with the commands that jump.

use crate::IdentifyConfig;
use crate::step_outcome::findings::Findings;
use mapper_core::{
    Channel, Recording, SAME_COMMAND_RATIO, Series, StepMarker, Warning, Window, is_reading, is_same_command,
    repeats,
};
use mapper_numerics::statistics::{MIN_VALUES, mean, median_of_sorted, robust_sigma};
use mapper_observe::fuse::SPIKE_SIGMAS;
use mapper_physics::gas::air::Air;
use mapper_physics::laws::compression::isentropic_rise_ratio;
use mapper_physics::operating_point::forecast::ForecastRow;
use mapper_physics::rig::sensor_fault::repeats_s;

/// Longest gap between neighbouring samples of a channel, s. Bound: slow loggers have 1 Hz.
pub const LONGEST_BRIDGE_S: f64 = 2.5;
/// Length of the blocks over which a residual or reading is averaged if only its trend matters, s. Bound: several correlation times of
/// sensor noise.
pub(crate) const TREND_BLOCK_S: f64 = 10.0;

/// Readings at one instant, total pressures.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Row {
    pub(crate) t_s: f64,
    pub(crate) t1_k: f64,
    pub(crate) t2_k: f64,
    /// NaN if the recording has no housing temperature (steady method).
    pub(crate) tc_k: f64,
    pub(crate) p1_pa: f64,
    pub(crate) p2_pa: f64,
    pub(crate) flow_kg_s: f64,
    /// `PR^kappa - 1`.
    pub(crate) rise_ratio: f64,
}

impl Row {
    /// The channels of a row but that of speed.
    pub(crate) const CHANNELS: [Channel; 6] =
        [Channel::T1, Channel::T2, Channel::Tc, Channel::P1, Channel::P2, Channel::CompressorFlow];

    /// The reading of one of [`Row::CHANNELS`].
    pub(crate) fn read(&self, channel: Channel) -> f64 {
        let mut row = *self;
        row.reading(channel).map_or(f64::NAN, |reading| *reading)
    }

    fn reading(&mut self, channel: Channel) -> Option<&mut f64> {
        Some(match channel {
            Channel::T1 => &mut self.t1_k,
            Channel::T2 => &mut self.t2_k,
            Channel::Tc => &mut self.tc_k,
            Channel::P1 => &mut self.p1_pa,
            Channel::P2 => &mut self.p2_pa,
            Channel::CompressorFlow => &mut self.flow_kg_s,
            _ => return None,
        })
    }

    /// With an error of a channel.
    pub(crate) fn moved(mut self, channel: Channel, by: f64, air: Air) -> Row {
        self.reading(channel).into_iter().for_each(|reading| *reading += by);
        self.compressing(air)
    }

    /// With the temperature rise of isentropic compression between its pressures.
    pub(crate) fn compressing(self, air: Air) -> Row {
        let rise_ratio =
            isentropic_rise_ratio(self.p2_pa / self.p1_pa, self.t1_k, air.between(self.p1_pa, self.p2_pa));
        Row { rise_ratio, ..self }
    }
}

/// A row of a forecast, which has no losses of pressure.
pub(crate) fn forecast_row(row: &ForecastRow, air: Air) -> Row {
    let ForecastRow { t_s, t1_k, t2_k, tc_k, p1_pa, p2_pa, flow_kg_s, .. } = *row;
    Row { t_s, t1_k, t2_k, tc_k, p1_pa, p2_pa, flow_kg_s, rise_ratio: f64::NAN }.compressing(air)
}

/// Complete rows at the times of T2.
#[derive(Debug, Clone, Default)]
pub(crate) struct Samples {
    pub(crate) rows: Vec<Row>,
    /// Rows omitted because a value was missing or not physical.
    pub(crate) lost: usize,
}

impl Samples {
    pub(crate) fn len(&self) -> usize {
        self.rows.len()
    }

    pub(crate) fn times_s(&self) -> Vec<f64> {
        self.rows.iter().map(|row| row.t_s).collect()
    }

    /// Mean of a column; `None` without rows.
    pub(crate) fn mean(&self, of: fn(&Row) -> f64) -> Option<f64> {
        mean(self.rows.iter().map(of))
    }

    /// The rows of `window`. `with_housing`: whether a row needs Tc to be complete.
    pub(crate) fn of(
        recording: &Recording,
        window: Window,
        config: &IdentifyConfig,
        with_housing: bool,
    ) -> Self {
        let mut samples = Samples::default();
        let Some(t2) = recording.series.get(&Channel::T2) else { return samples };
        let range = t2.range(window.start_s, window.end_s);
        let (t_s, t2_k) = (&t2.t_s[range.clone()], &t2.values[range]);
        let column = |channel| aligned(recording.series.get(&channel), t_s);
        let (t1_k, tc_k) = (column(Channel::T1), column(Channel::Tc));
        let (p1_pa, p2_pa) = (column(Channel::P1), column(Channel::P2));
        let flow_kg_s = column(Channel::CompressorFlow);
        for i in 0..t_s.len() {
            let (t1_k, tc_k, flow_kg_s, t2_k) = (t1_k[i], tc_k[i], flow_kg_s[i], t2_k[i]);
            let p1_pa = config.inlet_tap.total_pa(p1_pa[i], flow_kg_s, t1_k);
            let p2_pa = config.outlet_tap.total_pa(p2_pa[i], flow_kg_s, t2_k);
            let rise_ratio = f64::NAN;
            let row = Row { t_s: t_s[i], t1_k, t2_k, tc_k, p1_pa, p2_pa, flow_kg_s, rise_ratio };
            let row = row.compressing(config.air);
            let is_complete = Row::CHANNELS.into_iter().all(|channel| {
                (channel == Channel::Tc && !with_housing) || is_reading(channel, row.read(channel))
            });
            if is_complete && flow_kg_s > 0.0 && row.rise_ratio.is_finite() {
                samples.rows.push(row);
            } else {
                samples.lost += 1;
            }
        }
        samples
    }

    /// Number of samples per independent one: twice the correlation time of the coloured part of the noise. `None` with fewer than two.
    pub(crate) fn correlated(&self, config: &IdentifyConfig) -> Option<f64> {
        let intervals = self.len().checked_sub(1).filter(|intervals| *intervals > 0)?;
        let interval_s = (self.rows.last()?.t_s - self.rows.first()?.t_s) / intervals as f64;
        let colour = config.noise();
        Some(1.0 + 2.0 * colour.first_order_variance_ratio() * colour.time_constant_s / interval_s)
    }

    /// Change of a column over the window: mean of its last `seconds` minus that of its first.
    pub(crate) fn change(&self, of: fn(&Row) -> f64, seconds: f64) -> Option<f64> {
        let (first_s, last_s) = (self.rows.first()?.t_s, self.rows.last()?.t_s);
        let seconds = seconds.min(0.5 * (last_s - first_s));
        let early = self.rows.partition_point(|row| row.t_s <= first_s + seconds);
        let late = self.rows.partition_point(|row| row.t_s < last_s - seconds);
        let change = mean(self.rows[late..].iter().map(of))? - mean(self.rows[..early].iter().map(of))?;
        change.is_finite().then_some(change)
    }
}

/// Least-squares slope of values over times, 1/s; `None` without two finite values.
pub(crate) fn slope_per_s(points: impl Iterator<Item = (f64, f64)> + Clone) -> Option<f64> {
    let usable = || points.clone().filter(|(_, value)| value.is_finite());
    let count = usable().count() as f64;
    let (mean_t, mean) = usable().fold((0.0, 0.0), |(t, v), (a, b)| (t + a / count, v + b / count));
    let (top, bottom) = usable().fold((0.0, 0.0), |(top, bottom), (t, value)| {
        (top + (t - mean_t) * (value - mean), bottom + (t - mean_t) * (t - mean_t))
    });
    (bottom > 0.0).then(|| top / bottom)
}

/// A channel at given times: its own samples if the times agree, otherwise interpolated over short gaps, NaN elsewhere.
fn aligned(series: Option<&Series>, t_s: &[f64]) -> Vec<f64> {
    let (Some(series), Some(first_s), Some(last_s)) = (series, t_s.first(), t_s.last()) else {
        return vec![f64::NAN; t_s.len()];
    };
    let range = series.range(*first_s, *last_s);
    if series.t_s.get(range.clone()) == Some(t_s) {
        return series.values[range].to_vec();
    }
    t_s.iter().map(|t| bridged(series, *t)).collect()
}

fn bridged(series: &Series, t_s: f64) -> f64 {
    let after = series.t_s.partition_point(|t| *t < t_s);
    let Some(&t1_s) = series.t_s.get(after) else { return f64::NAN };
    let v1 = series.values[after];
    if t1_s == t_s {
        return v1;
    }
    let Some(before) = after.checked_sub(1) else { return f64::NAN };
    let (t0_s, v0) = (series.t_s[before], series.values[before]);
    if t1_s - t0_s > LONGEST_BRIDGE_S { f64::NAN } else { v0 + (v1 - v0) * (t_s - t0_s) / (t1_s - t0_s) }
}

/// Smallest spike of P1 that is removed, Pa. Bound: one smaller spike among the hundred samples of a window moves the efficiency by
/// 0.01 points.
const MIN_SPIKE_P1_PA: f64 = 500.0;
/// The same of P2, Pa. Bound: as for P1, at twice the pressure.
const MIN_SPIKE_P2_PA: f64 = 1000.0;
/// The same of the flow, kg/s. Bound: a few per cent of the smallest flows.
const MIN_SPIKE_KG_S: f64 = 2e-3;
/// The same of the temperatures, K. Bound: several times the noise of a thermocouple.
const MIN_SPIKE_K: f64 = 1.0;

fn smallest_spike(channel: Channel) -> f64 {
    match channel {
        Channel::P1 => MIN_SPIKE_P1_PA,
        Channel::P2 => MIN_SPIKE_P2_PA,
        Channel::CompressorFlow => MIN_SPIKE_KG_S,
        _ => MIN_SPIKE_K,
    }
}

/// The samples without spikes; reports removals in `findings`.
pub(crate) fn without_spikes(samples: Samples, findings: &mut Findings) -> Samples {
    // A channel without declared noise is never treated as stuck.
    cleaned(samples, &IdentifyConfig::default(), findings)
}

/// The samples without spikes and without those of a stuck channel; reports removals in `findings`.
pub(crate) fn cleaned(mut samples: Samples, config: &IdentifyConfig, findings: &mut Findings) -> Samples {
    let t_s = samples.times_s();
    let mut kept = vec![true; samples.len()];
    let mut spikes = 0;
    for channel in Row::CHANNELS {
        let smallest = smallest_spike(channel);
        let column: Vec<f64> = samples.rows.iter().map(|row| row.read(channel)).collect();
        for index in spikes_of(&column, smallest) {
            spikes += usize::from(kept[index]);
            kept[index] = false;
        }
        let noisy = config.sensor(channel).noise_sigma > 0.0;
        if !noisy {
            continue;
        }
        let stuck = stuck_of(&t_s, &column, repeats_s(channel));
        if let (Some(first), Some(last)) = (stuck.first(), stuck.last()) {
            findings.doubt(Warning::Stuck { channel, duration_s: t_s[*last] - t_s[*first] });
        }
        stuck.into_iter().for_each(|index| kept[index] = false);
    }
    if spikes > 0 {
        findings.remark(Warning::Outliers { count: spikes });
    }
    let mut kept = kept.into_iter();
    samples.rows.retain(|_| kept.next().unwrap_or(false));
    samples
}

fn spikes_of(column: &[f64], smallest: f64) -> Vec<usize> {
    // The sorted neighbours on either side; from one sample to the next, one enters and one leaves.
    let mut sorted: Vec<f64> = Vec::with_capacity(2 * MIN_VALUES + 2);
    let place = |sorted: &[f64], value: f64| sorted.partition_point(|other| other.total_cmp(&value).is_lt());
    for value in column.iter().take(MIN_VALUES) {
        sorted.insert(place(&sorted, *value), *value);
    }
    let mut off = Vec::with_capacity(column.len());
    for (i, value) in column.iter().enumerate() {
        if let Some(coming) = column.get(i + MIN_VALUES) {
            sorted.insert(place(&sorted, *coming), *coming);
        }
        if let Some(going) = i.checked_sub(MIN_VALUES + 1).and_then(|before| column.get(before)) {
            sorted.remove(place(&sorted, *going));
        }
        off.push(value - median_of_sorted(&sorted).unwrap_or(*value));
    }
    let Some(sigma) = robust_sigma(&off) else { return Vec::new() };
    let limit = (SPIKE_SIGMAS * sigma).max(smallest);
    (0..off.len()).filter(|i| off[*i].abs() > limit).collect()
}

fn stuck_of(t_s: &[f64], column: &[f64], repeats_s: f64) -> Vec<usize> {
    let long = repeats(column).filter(|(first, last)| t_s[*last] - t_s[*first] >= repeats_s);
    long.flat_map(|(first, last)| first..=last).collect()
}

// The commands of a step: whether they begin with a jump, and when they settle.
// A closed loop that holds the speed changes P3 slightly all the time. Such a change is no jump, and the command counts as settled.

/// Time after a jump from which only the housings still change, s. Bound: several settling times of probe and speed.
pub(crate) const FOLLOWED_S: f64 = 20.0;

/// Gap to the previous step above which the previous command is not the starting point, s. Bound: the housings keep their state over a
/// shorter one.
const MAX_GAP_S: f64 = 60.0;

/// Whether a command changes; an unknown one does not.
fn changed(before: f64, after: f64) -> bool {
    before.is_finite() && after.is_finite() && !is_same_command(before, after)
}

/// Whether the step at `position` of `steps` begins with a change of a command.
///
/// The first step does so only if its marker has the previous command.
pub(crate) fn begins_with_jump(steps: &[StepMarker], position: usize) -> bool {
    let Some(step) = steps.get(position) else { return false };
    if let (Some(from), Some(to)) = (step.from, step.to) {
        return from != to;
    }
    let before = position.checked_sub(1).and_then(|before| steps.get(before));
    before.is_some_and(|before| {
        step.start_s - before.end_s <= MAX_GAP_S
            && (changed(before.p3_pa, step.p3_pa)
                || changed(before.valve_opening_ratio, step.valve_opening_ratio))
    })
}

/// Time of the last change of P3 and valve commands within the step (its start if none is recorded), s. Changes of P3 count until it stays
/// within [`SAME_COMMAND_RATIO`] of its last value, as a loop trims it while the housings warm up.
pub(crate) fn settled_s(recording: &Recording, step: &StepMarker) -> f64 {
    let mut settled_s = step.start_s;
    for channel in [Channel::P3Command, Channel::ValveCommand] {
        let Some(series) = recording.series.get(&channel) else { continue };
        let range = series.range(step.start_s, step.end_s);
        // The change at the step's end belongs to the next one.
        let inside = range.filter(|i| series.t_s[*i] < step.end_s);
        let last = inside.clone().next_back().map(|i| series.values[i]);
        let trimmed = |value: f64| {
            channel == Channel::P3Command
                && last.is_some_and(|last| (value - last).abs() <= SAME_COMMAND_RATIO * last.abs())
        };
        for i in inside {
            let before = i.checked_sub(1).map(|before| series.values[before]);
            if before.is_some_and(|before| changed(before, series.values[i]) && !trimmed(before)) {
                settled_s = settled_s.max(series.t_s[i]);
            }
        }
    }
    settled_s
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_channel_is_interpolated_and_a_long_gap_is_not_bridged() {
        let slow = Series { t_s: vec![0.0, 1.0, 2.0, 10.0], values: vec![0.0, 10.0, 20.0, 100.0] };
        let at = aligned(Some(&slow), &[0.0, 0.5, 2.0, 5.0, 10.0, 10.5]);
        assert_eq!(at[..3], [0.0, 5.0, 20.0]);
        assert!(at[3].is_nan() && at[5].is_nan());
        assert_eq!(at[4], 100.0);
    }
}
