//! Judges redundant sensors: which of them reads wrong, and how.
//!
//! Each sensor is compared with the weighted mean of the others in use. The worst sensor beyond its limit is excluded, and the others are
//! judged again, as long as more than half of the sensors remain. Of two sensors the wrong one cannot be identified. A stuck or silent
//! sensor is identified by its own readings.

use mapper_core::{
    COARSE_REPEAT_S, COARSE_REPEAT_SAMPLES, Channel, DeclaredUncertainty, Element, FaultKind, NoiseColour,
    RedundantSensors, Series, is_reading, repeats,
};
use mapper_numerics::coloured_noise::ColouredNoise;
use mapper_numerics::statistics::mean;
use mapper_physics::laws::thermocouple;
use serde::Serialize;
use std::fmt;

/// Fraction of fault-free recordings in which a sensor is excluded for its offset; half of the permitted false alarms. Bound: half of the
/// permitted false alarms, 1 %.
pub(crate) const FALSE_ALARMS_RATIO: f64 = 0.005;
/// Number of parts of the recording that are judged separately. Bound: an offset that starts in the middle has its full size in the last
/// part.
const PARTS: usize = 4;
/// Minimum number of blocks for a decision. Bound: a standard deviation is then known to a quarter.
const MIN_BLOCKS: usize = 10;
/// A sensor is silent if it gives no reading in a larger fraction of the blocks, compared with the sensor that has most. Bound: a sensor
/// with most of the readings is not silent.
const MAX_MISSING_RATIO: f64 = 0.5;
/// Minimum fraction of samples of a live sensor that differ from the previous one. Bound: a coarse digit repeats often.
const MIN_CHANGING_RATIO: f64 = 0.2;
/// Band within which a reading counts as constant, in standard deviations of a block mean; noise exceeds it in 1e-8 of blocks. Bound:
/// noise exceeds it in 1e-8 of blocks.
const CONSTANT_BAND_SIGMAS: f64 = 6.0;
/// Minimum change of the other sensors in the same time, in widths of this band. Bound: their noise makes a quarter of it at most.
const MIN_MOVE_BANDS: f64 = 4.0;
/// Its minimum duration in blocks. Bound: 20 s, after which a slow probe has followed by half of the change.
const MIN_MOVE_BLOCKS: usize = 10;
/// Difference of lags that is always acceptable, s. Bound: at the slopes of a usual window it is smaller than a sensor's offset.
const LAG_TOLERANCE_S: f64 = 0.5;
/// Accuracy of a lag computed from the tip diameter, ratio. Bound: tips are not spheres, and the flow is not known.
const LAG_TOLERANCE_RATIO: f64 = 0.5;
/// Minimum size of a significant lag, in standard errors. Bound: by chance never exceeded.
const MIN_LAG_SIGMAS: f64 = 6.0;
/// Factor on the regression's standard errors, which assume independent residuals; those of blocks are slightly correlated. Bound: they
/// assume independent residuals; those of blocks are slightly correlated.
const STANDARD_ERROR_FACTOR: f64 = 2.0;
/// Minimum ratio of slopes to their noise for the estimate of a lag. Bound: noise in the slopes then biases a lag by 4 %, 1 / 5^2.
const MIN_SLOPE_SIGMAS: f64 = 5.0;
/// Typical outlet pipe, m. Bound: lags of declared diameters are only compared with each other.
const USUAL_PIPE_M: f64 = 0.035;
/// Typical flow, kg/s. Bound: as for the pipe.
const USUAL_FLOW_KG_S: f64 = 0.05;
/// Typical outlet temperature, K. Bound: as for the pipe.
const USUAL_T2_K: f64 = 350.0;

/// Result for the sensors of one channel, by their positions from 0.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Judgement {
    /// Sensors to exclude, with the reason and the number of compared sensors.
    pub(crate) left_out: Vec<(usize, ElementFault, usize)>,
    /// The worst difference among the remaining ones, if the wrong one cannot be identified.
    pub(crate) contradiction: Option<(usize, ElementFault)>,
}

impl Judgement {
    pub(crate) fn uses(&self, index: usize) -> bool {
        !self.left_out.iter().any(|(out, ..)| *out == index)
    }

    fn in_use(&self, count: usize) -> Vec<usize> {
        (0..count).filter(|index| self.uses(*index)).collect()
    }
}

/// Number of offset differences judged in a channel of `sensors` sensors: two sensors have one.
pub(crate) fn comparisons(sensors: usize) -> usize {
    if sensors > 2 { sensors } else { 1 }
}

/// Judges the sensors of a channel. `limit_sigmas` is the maximum offset.
pub(crate) fn judge(
    channel: Channel,
    sensors: &[Option<&Series>],
    declared: &RedundantSensors,
    colour: NoiseColour,
    limit_sigmas: f64,
) -> Judgement {
    let mut judgement = Judgement::default();
    let Some(blocks) = Blocks::new(channel, sensors) else { return judgement };
    let colour = ColouredNoise::new(colour.first_order_share_ratio, colour.time_constant_s);
    let judge = Judge { channel, sensors, declared, blocks: &blocks, colour, limit_sigmas };
    judge.exclude_silent(&mut judgement);
    judge.exclude_stuck(&mut judgement);
    let max_left_out = sensors.len().saturating_sub(1) / 2;
    loop {
        let in_use = judgement.in_use(sensors.len());
        let differences = in_use.iter().filter_map(|index| judge.difference(*index, &in_use));
        let excessive = differences.filter(|difference| difference.severity > 1.0);
        let Some(worst) = excessive.max_by(|a, b| a.severity.total_cmp(&b.severity)) else {
            return judgement;
        };
        if in_use.len() < 3 || judgement.left_out.len() >= max_left_out {
            judgement.contradiction = Some((worst.index, worst.fault));
            return judgement;
        }
        judgement.left_out.push((worst.index, worst.fault, in_use.len() - 1));
    }
}

fn frozen(from_s: f64, reading: f64) -> ElementFault {
    ElementFault { from_s: Some(from_s), ..ElementFault::new(FaultKind::Frozen, reading) }
}

struct Judge<'a> {
    channel: Channel,
    sensors: &'a [Option<&'a Series>],
    declared: &'a RedundantSensors,
    blocks: &'a Blocks,
    colour: ColouredNoise,
    limit_sigmas: f64,
}

/// Difference of a sensor from the others; it is excessive if the severity is above 1.
struct Difference {
    index: usize,
    severity: f64,
    fault: ElementFault,
}

impl Judge<'_> {
    fn exclude_silent(&self, judgement: &mut Judgement) {
        let count_readings = |means: &Vec<f64>| means.iter().filter(|mean| mean.is_finite()).count();
        let counts: Vec<usize> = self.blocks.means.iter().map(count_readings).collect();
        let max_count = counts.iter().copied().max().unwrap_or(0);
        for (index, count) in counts.iter().enumerate() {
            let missing_ratio = 1.0 - *count as f64 / max_count.max(1) as f64;
            if missing_ratio > MAX_MISSING_RATIO {
                judgement.left_out.push((
                    index,
                    ElementFault::new(FaultKind::Silent, missing_ratio),
                    counts.len() - 1,
                ));
            }
        }
    }

    fn exclude_stuck(&self, judgement: &mut Judgement) {
        let in_use = judgement.in_use(self.sensors.len());
        let mut found = Vec::new();
        for index in &in_use {
            let others: Vec<usize> = in_use.iter().copied().filter(|other| other != index).collect();
            if others.is_empty() {
                continue;
            }
            let fault = self.find_frozen(*index, &others).or_else(|| self.find_constant(*index, &others));
            found.extend(fault.map(|fault| (*index, fault, others.len())));
        }
        // If all sensors are constant, the quantity did not change.
        if found.len() < in_use.len() {
            judgement.left_out.extend(found);
        }
    }

    /// Finds a reading that repeats to the last digit while all others change.
    fn find_frozen(&self, index: usize, others: &[usize]) -> Option<ElementFault> {
        let series = self.sensors[index]?;
        // The first of the longest runs.
        let longest = repeats(&series.values).reduce(|a, b| if b.1 - b.0 > a.1 - a.0 { b } else { a })?;
        let (from_s, to_s) = (*series.t_s.get(longest.0)?, *series.t_s.get(longest.1)?);
        let reading = *series.values.get(longest.0)?;
        let changes = |other: &usize| {
            let values = self.sensors[*other].map(|series| series.slice(from_s, to_s).1).unwrap_or_default();
            let change_count = values.windows(2).filter(|pair| pair[0] != pair[1]).count();
            change_count as f64 > MIN_CHANGING_RATIO * values.len() as f64
        };
        let long = to_s - from_s >= COARSE_REPEAT_S && longest.1 - longest.0 >= COARSE_REPEAT_SAMPLES;
        (long && others.iter().all(changes)).then(|| frozen(from_s, reading))
    }

    /// Finds a reading that stays within its noise while the others change far and permanently.
    fn find_constant(&self, index: usize, others: &[usize]) -> Option<ElementFault> {
        let band = CONSTANT_BAND_SIGMAS * self.block_sigma(index).max(f64::MIN_POSITIVE);
        let own = &self.blocks.means[index];
        let reference = self.blocks.weighted(&self.declared.weights(|other| others.contains(&other)));
        let mut start: Option<usize> = None;
        let mut changed_blocks = 0;
        for block in 0..own.len() {
            if !(own[block].is_finite() && reference[block].is_finite()) {
                continue;
            }
            match start {
                Some(first) if (own[block] - own[first]).abs() <= band => {
                    changed_blocks +=
                        usize::from((reference[block] - reference[first]).abs() > MIN_MOVE_BANDS * band);
                    if changed_blocks >= MIN_MOVE_BLOCKS {
                        let from_s = self.blocks.start_s + first as f64 * self.blocks.length_s;
                        return Some(frozen(from_s, own[first]));
                    }
                }
                _ => (start, changed_blocks) = (Some(block), 0),
            }
        }
        None
    }

    fn block_sigma(&self, index: usize) -> f64 {
        let variance = self.colour.variance_of_mean(self.blocks.samples[index], self.blocks.length_s);
        self.declared.elements[index].declared.noise_sigma * variance.sqrt()
    }

    fn difference(&self, index: usize, in_use: &[usize]) -> Option<Difference> {
        let weights = self.declared.weights(|other| other != index && in_use.contains(&other));
        let reference = self.blocks.weighted(&weights);
        let slope = self.blocks.slope_s(index);
        let own = &self.blocks.means[index];
        let rows: Vec<(f64, f64, f64)> = (0..own.len())
            .map(|block| (own[block] - reference[block], slope[block], reference[block]))
            .filter(|(difference, slope, _)| difference.is_finite() && slope.is_finite())
            .collect();
        if rows.len() < MIN_BLOCKS {
            return None;
        }
        let lag = self.lag(index, &weights, &rows);
        let (by, sigmas) = self.offset(index, &weights, &rows, lag.map_or(0.0, |lag| lag.lag_s));
        let offset = Difference {
            index,
            severity: sigmas / self.limit_sigmas,
            fault: ElementFault { sigmas: Some(sigmas), ..ElementFault::new(FaultKind::Offset, by) },
        };
        let slow = lag.map(|Lag { lag_s, severity }| Difference {
            index,
            severity,
            fault: ElementFault::new(FaultKind::Lag, lag_s),
        });
        Some(slow.filter(|slow| slow.severity > offset.severity).unwrap_or(offset))
    }

    /// Lag of a sensor relative to the others: first-order lags give `x - r = -tau x'` for any gas temperature.
    fn lag(&self, index: usize, weights: &[f64], rows: &[(f64, f64, f64)]) -> Option<Lag> {
        let count = rows.len() as f64;
        let mean_difference = mean(rows.iter().map(|row| row.0))?;
        let mean_slope = mean(rows.iter().map(|row| row.1))?;
        let (mut square, mut product) = (0.0, 0.0);
        for (difference, slope, _) in rows {
            square += (slope - mean_slope).powi(2);
            product += (slope - mean_slope) * (difference - mean_difference);
        }
        let noise = self.block_sigma(index) * std::f64::consts::FRAC_1_SQRT_2 / self.blocks.length_s;
        if square <= 0.0 || (square / count).sqrt() < MIN_SLOPE_SIGMAS * noise {
            return None;
        }
        let lag_s = -product / square;
        let residual = |(difference, slope, _): &(f64, f64, f64)| {
            (difference - mean_difference + lag_s * (slope - mean_slope)).powi(2)
        };
        let variance = rows.iter().map(residual).sum::<f64>() / count;
        let standard_error_s = STANDARD_ERROR_FACTOR * (variance / square).sqrt();
        let declared_s = |index: usize| {
            let diameter_m = self.declared.elements[index].probe_diameter_m;
            thermocouple::time_constant_s(diameter_m, USUAL_PIPE_M, USUAL_FLOW_KG_S, USUAL_T2_K)
        };
        let others_s: f64 =
            weights.iter().enumerate().map(|(other, weight)| weight * declared_s(other)).sum();
        let expected_s = declared_s(index) - others_s;
        let limit_s = LAG_TOLERANCE_S + LAG_TOLERANCE_RATIO * declared_s(index).max(others_s);
        Some(Lag {
            lag_s,
            severity: (lag_s - expected_s).abs() / limit_s.max(MIN_LAG_SIGMAS * standard_error_s),
        })
    }

    /// Largest difference among the parts of the recording, also in its declared standard deviations.
    fn offset(&self, index: usize, weights: &[f64], rows: &[(f64, f64, f64)], lag_s: f64) -> (f64, f64) {
        let parts = PARTS.min(rows.len() / MIN_BLOCKS).max(1);
        let mut worst = (0.0, 0.0);
        for part in rows.chunks(rows.len().div_ceil(parts)) {
            let by =
                mean(part.iter().map(|(difference, slope, _)| difference + lag_s * slope)).unwrap_or(0.0);
            let level = mean(part.iter().map(|row| row.2)).unwrap_or(0.0);
            let length_s = part.len() as f64 * self.blocks.length_s;
            let variance = |other: usize| {
                let declared = &self.declared.elements[other].declared;
                let fixed = declared.fixed_sigma(self.channel, level);
                // For a sensor without a declared offset, use the noise of a sample as its scale.
                let fixed = if fixed > 0.0 { fixed } else { declared.noise_sigma };
                let samples = part.len() * self.blocks.samples[other];
                fixed.powi(2) + declared.noise_sigma.powi(2) * self.colour.variance_of_mean(samples, length_s)
            };
            let others = weights.iter().enumerate().filter(|(_, weight)| **weight > 0.0);
            let sigma =
                (variance(index) + others.map(|(other, w)| w * w * variance(other)).sum::<f64>()).sqrt();
            // Without a declared uncertainty there is no decision.
            let sigmas = if sigma > 0.0 { by.abs() / sigma } else { 0.0 };
            if sigmas > worst.1 {
                worst = (by, sigmas);
            }
        }
        worst
    }
}

#[derive(Clone, Copy)]
struct Lag {
    lag_s: f64,
    severity: f64,
}

/// Length of a block, s. Bound: longer than the correlation time of usual noise, shorter than the lag of a probe that is too large.
const BLOCK_S: f64 = 2.0;
/// Maximum number of blocks of a recording; a longer one has longer blocks. Bound: effort; two days.
const MAX_BLOCKS: f64 = 100_000.0;

/// Block means of each sensor; NaN without a reading.
#[derive(Debug, Clone)]
pub(crate) struct Blocks {
    pub(crate) start_s: f64,
    pub(crate) length_s: f64,
    /// Block means of each sensor.
    pub(crate) means: Vec<Vec<f64>>,
    /// Typical number of samples in a block of each sensor.
    pub(crate) samples: Vec<usize>,
}

impl Blocks {
    /// The blocks of these sensors of a channel; `None` if none of them has a reading.
    pub(crate) fn new(channel: Channel, sensors: &[Option<&Series>]) -> Option<Blocks> {
        let all = || sensors.iter().flatten();
        let start_s = all().filter_map(|series| series.t_s.first().copied()).reduce(f64::min)?;
        let end_s = all().filter_map(|series| series.t_s.last().copied()).reduce(f64::max)?;
        let span_s = (end_s - start_s).max(0.0);
        if !span_s.is_finite() {
            return None;
        }
        let length_s = BLOCK_S.max(span_s / MAX_BLOCKS);
        let block_count = (span_s / length_s) as usize + 1;
        let (mut means, mut samples) = (Vec::new(), Vec::new());
        for series in sensors {
            let mut sums = vec![(0.0, 0usize); block_count];
            for (t_s, value) in series.iter().flat_map(|series| series.t_s.iter().zip(&series.values)) {
                let block = sums.get_mut(((t_s - start_s) / length_s) as usize);
                if let Some((sum, count)) = block.filter(|_| is_reading(channel, *value)) {
                    (*sum, *count) = (*sum + value, *count + 1);
                }
            }
            let all: usize = sums.iter().map(|(_, count)| count).sum();
            let filled = sums.iter().filter(|(_, count)| *count > 0).count().max(1);
            samples.push(all / filled);
            means.push(sums.into_iter().map(|(sum, count)| sum / count as f64).collect());
        }
        Some(Blocks { start_s, length_s, means, samples })
    }

    pub(crate) fn count(&self) -> usize {
        self.means.first().map_or(0, Vec::len)
    }

    /// The weighted mean of the sensors in each block; NaN if one of them is missing.
    pub(crate) fn weighted(&self, weights: &[f64]) -> Vec<f64> {
        let at = |block: usize| {
            let used = weights.iter().zip(&self.means).filter(|(weight, _)| **weight > 0.0);
            used.map(|(weight, means)| weight * means[block]).sum()
        };
        (0..self.count()).map(at).collect()
    }

    /// Rate of change of a sensor's reading at each block, in its unit per second; NaN at both ends and next to gaps.
    pub(crate) fn slope_s(&self, sensor: usize) -> Vec<f64> {
        let means = &self.means[sensor];
        let at = |block: usize| match (block.checked_sub(1), means.get(block + 1)) {
            (Some(before), Some(after)) => (after - means[before]) / (2.0 * self.length_s),
            _ => f64::NAN,
        };
        (0..means.len()).map(at).collect()
    }
}

/// Reason for excluding a redundant sensor, a kind of the catalogue of sensor faults.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ElementFault {
    /// Its kind: offset, lag, frozen or silent.
    pub kind: FaultKind,
    /// Its reading minus that of the others, in the channel's unit; its lag minus that of the others, s; its constant reading; or its fraction of
    /// missing readings.
    pub size: f64,
    /// The offset in declared standard deviations of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigmas: Option<f64>,
    /// Start of the constant reading in run time, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from_s: Option<f64>,
}

impl ElementFault {
    pub(crate) fn new(kind: FaultKind, size: f64) -> ElementFault {
        ElementFault { kind, size, sigmas: None, from_s: None }
    }
}

/// An excluded sensor.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FaultyElement {
    /// Number.
    pub element: Element,
    /// Display name.
    pub name: String,
    /// Number of sensors that it was compared with.
    pub others: usize,
    /// The reason.
    pub fault: ElementFault,
}

impl fmt::Display for FaultyElement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, unit) = (&self.name, self.element.channel.unit());
        let others = match self.others {
            1 => "the other one".to_owned(),
            others => format!("the other {others}"),
        };
        let ElementFault { kind, size, sigmas, from_s } = self.fault;
        match kind {
            FaultKind::Offset => {
                let side = if size < 0.0 { "below" } else { "above" };
                let sigmas = sigmas.unwrap_or(f64::NAN);
                write!(
                    f,
                    "{name} reads {} {unit} {side} {others} ({sigmas:.1} sigma)",
                    ShortNumber(size.abs())
                )?;
            }
            FaultKind::Lag => {
                let later = if size < 0.0 { "earlier" } else { "later" };
                write!(f, "{name} follows changes {:.1} s {later} than {others}", size.abs())?;
            }
            FaultKind::Frozen => {
                let from_s = from_s.unwrap_or(f64::NAN);
                write!(f, "{name} is frozen at {size:.6} {unit} from {from_s:.0} s on, {others} are not")?;
            }
            FaultKind::Silent => write!(f, "{name} gives no reading for {:.0} % of the time", 100.0 * size)?,
            other => write!(f, "{name} has a fault: {other}")?,
        }
        f.write_str(": left out")
    }
}

/// Displays a difference with few digits.
struct ShortNumber(f64);

impl fmt::Display for ShortNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            value if value >= 100.0 => write!(f, "{value:.0}"),
            value if value >= 0.01 => write!(f, "{value:.2}"),
            value => write!(f, "{value:.2e}"),
        }
    }
}

/// Sensors that contradict each other, without a way to identify the wrong one.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Contradiction {
    /// The sensor that differs most from the others in use.
    pub name: String,
    /// The difference.
    pub fault: ElementFault,
    /// Largest distance of a sensor in use from the fused reading, in the channel's unit: it widens the declared offset.
    pub widened_by: f64,
}

/// Result of fusing the redundant sensors of a channel.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FusedChannel {
    /// The channel.
    pub channel: Channel,
    /// Number of its sensors.
    pub sensors: usize,
    /// The excluded sensors.
    pub left_out: Vec<FaultyElement>,
    /// Contradiction between the remaining ones.
    pub contradiction: Option<Contradiction>,
    /// Uncertainty of the fused reading.
    pub declared: DeclaredUncertainty,
    /// Diameter of a single probe, m, with the same lag as the sensors in use together.
    pub probe_diameter_m: f64,
}

impl FusedChannel {
    /// Whether the sensor of this number, from 1, is in use.
    pub fn uses(&self, number: usize) -> bool {
        !self.left_out.iter().any(|faulty| faulty.element.number == number)
    }
}

impl fmt::Display for FusedChannel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unit = self.channel.unit();
        let DeclaredUncertainty { noise_sigma, offset_sigma, gain_sigma_ratio } = self.declared;
        let in_use = self.sensors - self.left_out.len().min(self.sensors);
        write!(
            f,
            "{}: {in_use} of {} sensors, together with noise {} {unit} and offset {} {unit}",
            self.channel,
            self.sensors,
            ShortNumber(noise_sigma),
            ShortNumber(offset_sigma)
        )?;
        if gain_sigma_ratio > 0.0 {
            write!(f, ", gain {:.2} %", 100.0 * gain_sigma_ratio)?;
        }
        for faulty in &self.left_out {
            write!(f, "; {faulty}")?;
        }
        if let Some(Contradiction { name, fault, widened_by }) = &self.contradiction {
            let ElementFault { kind, size, sigmas, .. } = fault;
            let what = match kind {
                FaultKind::Offset => {
                    format!(
                        "reads {size:+.2} {unit} off the others ({:.1} sigma)",
                        sigmas.unwrap_or(f64::NAN)
                    )
                }
                FaultKind::Lag => format!("follows changes {size:+.1} s after the others"),
                _ => "does not follow the others".to_owned(),
            };
            write!(
                f,
                "; {name} {what}, and the wrong one cannot be identified: all are used, and the offset covers them (+/- {} {unit})",
                ShortNumber(*widened_by)
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_says_who_how_far_and_against_whom() {
        let faulty = |fault| {
            let element = Element { channel: Channel::T2, number: 3 };
            FaultyElement { element, name: "T2/3".to_owned(), others: 3, fault }.to_string()
        };
        let off = faulty(ElementFault { sigmas: Some(6.1), ..ElementFault::new(FaultKind::Offset, -1.52) });
        assert_eq!(off, "T2/3 reads 1.52 K below the other 3 (6.1 sigma): left out");
        let slow = faulty(ElementFault::new(FaultKind::Lag, 7.26));
        assert_eq!(slow, "T2/3 follows changes 7.3 s later than the other 3: left out");
    }
}
