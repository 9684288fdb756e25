//! The model of one side of a log, and the readings that it fits.

use crate::driven::DrivenError;
use mapper_core::{Channel, Recording, SAMPLE_INTERVAL_S, is_reading, named_enum};
use mapper_numerics::statistics::EXCLUDE_SIGMAS;
use mapper_observe::Declared;
use mapper_observe::declared::usual_noise_sigma;
use mapper_physics::rig::effect::{Rig, Submodel};
use std::ops::Range;

named_enum! {
    /// One side of a machine.
    pub enum Side {
        /// Speed, flow, P1, P2 and T1 drive it; T2 and Tc are judged.
        Compressor = "compressor",
        /// Speed, turbine flow, P3, T3 and P4 drive it; T4 and Tt are judged.
        Turbine = "turbine",
    }
}

/// Correlation time of model and sensor errors, s. Bound: a probe's own time constant.
pub(crate) const CORRELATION_S: f64 = 2.0;
/// Correlation time of the housing's error, s. Bound: the time constant of a housing.
pub(crate) const HOUSING_CORRELATION_S: f64 = 60.0;

/// Prior of the model error of a judged channel. It is correlated in time, and its size is fitted.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ModelError {
    /// Median of its standard deviation, K.
    pub(crate) median_k: f64,
    /// Standard deviation of its logarithm; 0 if fixed.
    pub(crate) width: f64,
    /// Correlation time, s.
    pub(crate) correlation_s: f64,
}

/// One side of a machine, driven by its measured neighbours.
pub(crate) trait SideModel: Sync + Sized {
    const SIDE: Side;

    /// The pressure whose changes separate the phases of a log, in addition to the speed.
    const PRESSURE: Channel;

    const CHANNELS: SideChannels<'static>;

    /// Unknown parameters that are fitted with or without a cause.
    const UNKNOWNS: &'static [Parameter];

    /// Model error of each judged channel.
    const MODEL_ERRORS: &'static [ModelError];

    fn of(rows: Rows) -> Self;

    fn rows(&self) -> &Rows;

    /// Predicted readings of a rig with these unknowns, one column per judged channel.
    fn predict(&self, rig: &Rig, unknowns: &[f64]) -> Vec<Vec<f64>>;

    /// Why the effect with this id is not a candidate: an unknown covers it.
    fn covered(effect: &str) -> Option<&'static str>;

    /// Why an effect in this machine part changes no judged channel.
    fn why_silent(&self, submodel: Submodel) -> &'static str;
}

/// A temperature, K, after `elapsed_s` with this heat flow and conductance at its start: the exact exponential, which stays bounded over a gap in the log.
pub(crate) fn relaxed_k(
    from_k: f64,
    heat_w: f64,
    conductance_w_k: f64,
    capacity_j_k: f64,
    elapsed_s: f64,
) -> f64 {
    from_k + heat_w / conductance_w_k * -(-conductance_w_k * elapsed_s / capacity_j_k).exp_m1()
}

/// True values of a driving channel: its readings without lag, gain and offset of the rig's sensor.
pub(crate) fn true_drive(rows: &Rows, rig: &Rig, channel: Channel) -> Vec<f64> {
    let path = rig.instruments.path(channel);
    let read = rows.drive(channel);
    let correct = |value: f64| (value - path.offset) / path.gain_ratio;
    let place = rows.drives.iter().position(|(of, _)| *of == channel);
    match place.and_then(|place| rows.rates.get(place)) {
        // A lagging reading y has the input y + lag dy/dt.
        Some(rates) if path.lag_s > 0.0 => {
            read.iter().zip(rates).map(|(value, rate)| correct(value + path.lag_s * rate)).collect()
        }
        _ => read.iter().map(|value| correct(*value)).collect(),
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Spread {
    Normal,
    /// Normal in the logarithm: the middle is the median, the width one standard deviation of the logarithm.
    LogNormal,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Parameter {
    pub(crate) name: &'static str,
    pub(crate) description: &'static str,
    /// Its unit; empty for a ratio.
    pub(crate) unit: &'static str,
    middle: f64,
    width: f64,
    spread: Spread,
}

type Text = &'static str;

pub(crate) const fn normal(name: Text, unit: Text, middle: f64, width: f64, description: Text) -> Parameter {
    Parameter { name, description, unit, middle, width, spread: Spread::Normal }
}

pub(crate) const fn log_normal(
    name: Text,
    unit: Text,
    middle: f64,
    width: f64,
    description: Text,
) -> Parameter {
    Parameter { name, description, unit, middle, width, spread: Spread::LogNormal }
}

impl Parameter {
    /// Value at this number of prior standard deviations above the middle.
    pub(crate) fn at(&self, standard: f64) -> f64 {
        match self.spread {
            Spread::Normal => self.middle + self.width * standard,
            Spread::LogNormal => self.middle * (self.width * standard).exp(),
        }
    }
}

// Denoises the driving channels.
// A model driven by noisy readings fits better the less it responds to them, so noise would favour causes that reduce the response. Each reading is
// therefore replaced by the straight line through as many neighbours as lie on one within the noise of the sensor, so few are used where a drive changes its slope.

/// Numbers of neighbours tried on each side. Bound: from a line within the correlation time at 10 Hz down to the fewest whose scatter shows a bend.
const NEIGHBOURS: [usize; 5] = [12, 8, 5, 3, 2];
/// Readings lie on a line if their mean squared distance is below this multiple of the variance of the noise. Source: one in twenty sets of six
/// readings fails by chance.
const LINE_RATIO: f64 = 1.5;

/// Rows with denoised drives and the rates of these.
pub(crate) fn denoised(rows: &Rows, declared: &Declared) -> Rows {
    let mut denoised = rows.clone();
    denoised.rates.clear();
    for (channel, column) in &mut denoised.drives {
        let sigma = declared.noise_sigma(*channel);
        let read = rows.drive(*channel);
        let lines = (0..rows.len()).map(|i| denoised_at(&rows.t_s, read, i, sigma));
        let (values, rates) = lines.unzip();
        *column = values;
        denoised.rates.push(rates);
    }
    denoised
}

/// Value and rate of the line through the neighbours of a reading, per second.
fn denoised_at(t_s: &[f64], read: &[f64], i: usize, sigma: f64) -> (f64, f64) {
    for count in NEIGHBOURS {
        let (first, last) = (i.saturating_sub(count), (i + count).min(read.len() - 1));
        // Both sides, or one side only with as many readings.
        let ranges =
            [first..last + 1, i.saturating_sub(2 * count)..i + 1, i..(i + 2 * count).min(read.len() - 1) + 1];
        for range in ranges {
            if range.len() < 4 || t_s[range.end - 1] - t_s[range.start] > 2.0 * CORRELATION_S {
                continue;
            }
            if let Some(line) = line(t_s, read, i, range, sigma) {
                return line;
            }
        }
    }
    let (before, after) = (i.saturating_sub(1), (i + 1).min(read.len() - 1));
    let elapsed_s = t_s[after] - t_s[before];
    (read[i], if elapsed_s > 0.0 { (read[after] - read[before]) / elapsed_s } else { 0.0 })
}

/// Value at `i` of the straight line through a range, and its slope; `None` if the readings do not lie on it.
fn line(t_s: &[f64], read: &[f64], i: usize, range: Range<usize>, sigma: f64) -> Option<(f64, f64)> {
    let n = range.len() as f64;
    let mean = |values: &[f64]| values[range.clone()].iter().sum::<f64>() / n;
    let (t0, v0) = (mean(t_s), mean(read));
    let (tt, tv) = range.clone().fold((0.0, 0.0), |(tt, tv), k| {
        let t = t_s[k] - t0;
        (tt + t * t, tv + t * (read[k] - v0))
    });
    let slope = if tt > 0.0 { tv / tt } else { 0.0 };
    let squares: f64 = range.map(|k| (read[k] - v0 - slope * (t_s[k] - t0)).powi(2)).sum();
    (squares <= LINE_RATIO * (n - 2.0) * sigma * sigma).then(|| (v0 + slope * (t_s[i] - t0), slope))
}

/// Maximum number of rows, evenly spread over a longer log. Bound: five minutes at 10 Hz, enough for every unknown.
const MAX_ROWS: usize = 3_000;

#[derive(Debug, Clone, Copy)]
pub(crate) struct SideChannels<'a> {
    pub(crate) drives: &'a [Channel],
    /// Judged channels. The first is required, and its times define the rows.
    pub(crate) judged: &'a [Channel],
    /// Whether the equations of the side apply at these values of `drives`.
    pub(crate) is_usable: fn(&[f64]) -> bool,
}

/// Minimum pressure ratio of compressor or turbine. Bound: below it the work is so small that temperatures do not show the efficiency.
const MIN_PRESSURE_RATIO: f64 = 1.02;
/// Share of the spacing at which a row counts as the next. Bound: rounding of times.
const SPACING_SHARE: f64 = 0.999;

/// Whether a side does enough work for its temperatures to show its efficiency; the equations divide by the flow.
pub(crate) fn does_work(speed_rpm: f64, flow_kg_s: f64, low_pa: f64, high_pa: f64) -> bool {
    let min_flow_kg_s = EXCLUDE_SIGMAS * usual_noise_sigma(Channel::CompressorFlow);
    high_pa >= MIN_PRESSURE_RATIO * low_pa && flow_kg_s >= min_flow_kg_s && speed_rpm > 0.0
}

/// Complete rows, as columns of equal length. SI units.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Rows {
    /// Time, s, rising.
    pub(crate) t_s: Vec<f64>,
    pub(crate) drives: Vec<(Channel, Vec<f64>)>,
    /// Their rates of change, per second; empty if not requested.
    pub(crate) rates: Vec<Vec<f64>>,
    /// Judged channels, in the requested order; NaN if not measured (never for the first).
    pub(crate) judged: Vec<(Channel, Vec<f64>)>,
    /// Number of times of the first judged channel without a complete row.
    pub(crate) lost: usize,
}

impl Rows {
    pub(crate) fn read(recording: &Recording, channels: SideChannels<'_>) -> Result<Self, DrivenError> {
        let Some(first) = channels.judged.first() else {
            return Ok(Rows::default());
        };
        let judged = recording.require(*first)?;
        let mut series = Vec::with_capacity(channels.drives.len());
        for channel in channels.drives {
            series.push((*channel, recording.require(*channel)?));
        }
        let span_s =
            judged.t_s.last().zip(judged.t_s.first()).map_or(0.0, |(last_s, first_s)| last_s - first_s);
        let spacing_s = SAMPLE_INTERVAL_S.max(span_s / MAX_ROWS as f64);
        let empty = |channels: &[Channel]| channels.iter().map(|channel| (*channel, Vec::new())).collect();
        let mut rows =
            Rows { drives: empty(channels.drives), judged: empty(channels.judged), ..Rows::default() };
        let mut row = Vec::with_capacity(series.len());
        for (t_s, value) in judged.t_s.iter().zip(&judged.values) {
            if rows.t_s.last().is_some_and(|last_s| t_s - last_s < SPACING_SHARE * spacing_s) {
                continue;
            }
            row.clear();
            row.extend(series.iter().map_while(|(channel, series)| {
                // No extrapolation beyond the ends of a channel.
                let inside = series.t_s.first() <= Some(t_s) && series.t_s.last() >= Some(t_s);
                series.interpolate(*t_s).filter(|value| inside && is_reading(*channel, *value))
            }));
            if row.len() < series.len() || !is_reading(*first, *value) || !(channels.is_usable)(&row) {
                rows.lost += 1;
                continue;
            }
            // Spacing over the whole log may give one row too many.
            if rows.t_s.len() > MAX_ROWS {
                break;
            }
            rows.t_s.push(*t_s);
            for ((_, column), value) in rows.drives.iter_mut().zip(&row) {
                column.push(*value);
            }
            for (channel, column) in &mut rows.judged {
                let other = || recording.series.get(channel).and_then(|other| other.interpolate(*t_s));
                let read = if channel == first { Some(*value) } else { other() };
                column.push(read.filter(|k| is_reading(*channel, *k)).unwrap_or(f64::NAN));
            }
        }
        Ok(rows)
    }

    pub(crate) fn len(&self) -> usize {
        self.t_s.len()
    }

    /// Readings of a driving channel; empty for any other.
    pub(crate) fn drive(&self, channel: Channel) -> &[f64] {
        self.drives.iter().find(|(of, _)| *of == channel).map_or(&[], |(_, column)| column)
    }

    /// First reading of a judged channel; `None` if it was not measured.
    pub(crate) fn first_judged(&self, channel: Channel) -> Option<f64> {
        let (_, column) = self.judged.iter().find(|(of, _)| *of == channel)?;
        column.iter().copied().find(|reading| reading.is_finite())
    }

    /// Time from a row to the next one, s; 0 for the last.
    pub(crate) fn elapsed_s(&self, row: usize) -> f64 {
        self.t_s.get(row + 1).map_or(0.0, |next_s| next_s - self.t_s[row])
    }

    /// Every `n`-th row, so that at most `max_rows` remain.
    pub(crate) fn thinned(&self, max_rows: usize) -> Rows {
        let every = self.len().div_ceil(max_rows.max(1)).max(1);
        let thin = |column: &[f64]| column.iter().copied().step_by(every).collect::<Vec<f64>>();
        let each = |columns: &[(Channel, Vec<f64>)]| columns.iter().map(|(c, v)| (*c, thin(v))).collect();
        let rates = self.rates.iter().map(|column| thin(column)).collect();
        Rows {
            t_s: thin(&self.t_s),
            drives: each(&self.drives),
            rates,
            judged: each(&self.judged),
            lost: self.lost,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::{Channel, DeclaredUncertainty};
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// Level, ramp and level with noise of 50: a third of the noise remains on the levels, and the corners stay in place.
    #[test]
    fn noise_goes_and_corners_stay() {
        let sigma = 50.0;
        let t_s: Vec<f64> = (0..200).map(|i| 0.1 * f64::from(i)).collect();
        let truth: Vec<f64> = t_s.iter().map(|t| 5e4 + 4.5e4 * (t - 8.0).clamp(0.0, 2.0)).collect();
        let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(1);
        let mut noise = || -> f64 { StandardNormal.sample(&mut random) };
        let read = truth.iter().map(|v| v + sigma * noise()).collect();
        let rows = Rows {
            t_s,
            drives: vec![(Channel::ShaftSpeed, read)],
            rates: Vec::new(),
            judged: Vec::new(),
            lost: 0,
        };
        let declared = Declared {
            sensors: [(
                Channel::ShaftSpeed,
                DeclaredUncertainty { noise_sigma: sigma, ..Default::default() },
            )]
            .into(),
            noise_colour: Default::default(),
            tolerances: Default::default(),
            nominal: Default::default(),
            common_offsets: Vec::new(),
            actuators: None,
        };
        let denoised = denoised(&rows, &declared);
        let off = |range: Range<usize>| {
            let squares = range.clone().map(|i| (denoised.drives[0].1[i] - truth[i]).powi(2)).sum::<f64>();
            (squares / range.len() as f64).sqrt()
        };
        assert!(off(0..75) < 0.4 * sigma && off(105..200) < 0.4 * sigma, "{} {}", off(0..75), off(105..200));
        assert!(off(75..105) < 1.2 * sigma, "{}", off(75..105));
    }
}

#[cfg(test)]
mod log_rows_tests {
    use super::*;
    use mapper_core::Series;

    /// A day at 10 Hz is read to its end, but thinned to the maximum number of rows; a missing driving channel is an error.
    #[test]
    fn a_long_log_is_thinned() {
        let channels = SideChannels {
            drives: &[Channel::ShaftSpeed, Channel::P2],
            judged: &[Channel::T2],
            is_usable: |row| row[1] > 0.0,
        };
        let t_s: Vec<f64> = (0..864_000).map(|i| 0.1 * f64::from(i)).collect();
        let series = [(Channel::ShaftSpeed, 1e5), (Channel::P2, 2e5), (Channel::T2, 380.0)];
        let series =
            series.map(|(of, value)| (of, Series { t_s: t_s.clone(), values: vec![value; t_s.len()] }));
        let mut recording = Recording { series: series.into(), ..Recording::default() };
        let rows = Rows::read(&recording, channels).unwrap();
        assert!((2_000..=3_001).contains(&rows.len()), "{}", rows.len());
        assert!(rows.t_s.last().unwrap() > &86_000.0);
        recording.series.remove(&Channel::P2);
        assert!(matches!(Rows::read(&recording, channels), Err(DrivenError::Channel(_))));
    }
}
