//! Combines redundant sensors of a channel into one reading, by a rule common to all users of recordings.
//!
//! The fused reading is a weighted mean, so an isothermal zero can be subtracted from each sensor before the fusion, or from the mean after
//! it. Probes of different diameters are fused without a correction of their lags, which would multiply their noise: to first order the lag
//! of their mean is the mean of their lags, which is sufficient for slow changes.

use crate::averages::resample;
use crate::element_judge::{
    Contradiction, FALSE_ALARMS_RATIO, FaultyElement, FusedChannel, Judgement, comparisons, judge,
};
use mapper_core::{
    Channel, DeclaredUncertainty, Element, FaultKind, NoiseColour, Recording, RedundantSensors, Series,
    is_reading,
};
use mapper_numerics::statistics::{mean, median, median_of_sorted, normal_quantile};
use std::collections::{BTreeMap, BTreeSet};

/// Deviation of a reading from the median of its neighbours, or of an aligned reading from that of at least three sensors, beyond which
/// it is a spike, in standard deviations. Bound: noise never reaches it.
pub const SPIKE_SIGMAS: f64 = 8.0;

/// Judges the redundant sensors of all channels of a recording, and lists the excluded ones. Channels without a declaration, or with another
/// number of declared sensors, are not judged.
pub fn judge_elements(
    recording: &Recording,
    declared: &BTreeMap<Channel, RedundantSensors>,
    colour: NoiseColour,
) -> Vec<FusedChannel> {
    let redundant: Vec<(Channel, &RedundantSensors)> = declared
        .iter()
        .map(|(channel, declared)| (*channel, declared))
        .filter(|(channel, declared)| {
            declared.elements.len() > 1 && element_count(recording, *channel) == declared.elements.len()
        })
        .collect();
    let all: usize = redundant.iter().map(|(_, declared)| comparisons(declared.elements.len())).sum();
    let limit_sigmas =
        normal_quantile(1.0 - 0.5 * FALSE_ALARMS_RATIO / all.max(1) as f64).unwrap_or(f64::INFINITY);
    redundant
        .into_iter()
        .map(|(channel, declared)| {
            let sensors = sensors(recording, channel, declared.elements.len());
            let judgement = judge(channel, &sensors, declared, colour, limit_sigmas);
            fused_channel(channel, &sensors, declared, judgement)
        })
        .collect()
}

/// Number of redundant sensors of a channel in a recording; 0 if the channel has a single reading.
pub fn element_count(recording: &Recording, channel: Channel) -> usize {
    let elements = recording.elements.keys().filter(|element| element.channel == channel);
    elements.map(|element| element.number).max().unwrap_or(0)
}

/// Fuses each of these channels from its sensors in use. Lost readings of a sensor cause no step, because its mean difference from the fused
/// reading is corrected.
pub fn fuse(
    mut recording: Recording,
    declared: &BTreeMap<Channel, RedundantSensors>,
    channels: &[FusedChannel],
) -> Recording {
    for fused in channels {
        let Some(declared) = declared.get(&fused.channel) else { continue };
        let sensors = sensors(&recording, fused.channel, fused.sensors);
        let weights = declared.weights(|index| fused.uses(index + 1));
        let base = recording.series.get(&fused.channel);
        let base = base.or_else(|| sensors.iter().flatten().next().copied()).cloned().unwrap_or_default();
        let Some(values) = fused_values(fused.channel, &sensors, declared, &weights, &base.t_s) else {
            continue;
        };
        recording.series.insert(fused.channel, Series { t_s: base.t_s, values });
    }
    recording
}

fn sensors(recording: &Recording, channel: Channel, count: usize) -> Vec<Option<&Series>> {
    (1..=count).map(|number| recording.elements.get(&Element { channel, number })).collect()
}

fn fused_channel(
    channel: Channel,
    sensors: &[Option<&Series>],
    declared: &RedundantSensors,
    judgement: Judgement,
) -> FusedChannel {
    let uses = |index: usize| judgement.uses(index);
    let name = |index: usize| declared.elements[index].name.clone();
    let mut fused = declared.fused(uses);
    let contradiction = judgement.contradiction.map(|(index, fault)| {
        // Either sensor may be right: the offset covers the farthest one.
        let widened_by = if fault.kind == FaultKind::Offset {
            max_difference(channel, sensors, declared, &uses)
        } else {
            0.0
        };
        fused = DeclaredUncertainty { offset_sigma: fused.offset_sigma.hypot(widened_by), ..fused };
        Contradiction { name: name(index), fault, widened_by }
    });
    let left_out = judgement.left_out.iter().map(|(index, fault, others)| FaultyElement {
        element: Element { channel, number: index + 1 },
        name: name(*index),
        others: *others,
        fault: *fault,
    });
    FusedChannel {
        channel,
        sensors: sensors.len(),
        left_out: left_out.collect(),
        contradiction,
        declared: fused,
        probe_diameter_m: declared.probe_diameter_m(uses),
    }
}

/// Maximum difference between the mean of a sensor in use and the fused mean.
fn max_difference(
    channel: Channel,
    sensors: &[Option<&Series>],
    declared: &RedundantSensors,
    uses: &dyn Fn(usize) -> bool,
) -> f64 {
    let weights = declared.weights(uses);
    let mean_of = |series: &Option<&Series>| {
        let values = series.iter().flat_map(|series| &series.values);
        mean(values.filter(|value| is_reading(channel, **value)))
    };
    let means: Vec<Option<f64>> = sensors.iter().map(mean_of).collect();
    let used = || weights.iter().zip(&means).filter(|(weight, _)| **weight > 0.0);
    let fused: f64 = used().filter_map(|(weight, mean)| Some(weight * (*mean)?)).sum();
    used().filter_map(|(_, mean)| Some(((*mean)? - fused).abs())).fold(0.0, f64::max)
}

/// A sensor in use.
struct Member {
    weight: f64,
    /// Declared error of one reading, one standard deviation.
    sigma: f64,
    /// Readings at the times of the fused channel.
    values: Vec<f64>,
}

/// The fused reading at each time; `None` if no sensor is in use.
fn fused_values(
    channel: Channel,
    sensors: &[Option<&Series>],
    declared: &RedundantSensors,
    weights: &[f64],
    t_s: &[f64],
) -> Option<Vec<f64>> {
    let interval_s = median(t_s.windows(2).map(|pair| pair[1] - pair[0])).unwrap_or(0.0);
    let mut members: Vec<Member> = Vec::new();
    for ((weight, sensor), element) in weights.iter().zip(sensors).zip(&declared.elements) {
        let Some(series) = sensor.filter(|_| *weight > 0.0) else { continue };
        let sigma = element.declared.noise_sigma.hypot(element.declared.offset_sigma);
        members.push(Member { weight: *weight, sigma, values: resample(series, t_s, interval_s) });
    }
    let sum: f64 = members.iter().map(|member| member.weight).sum();
    if sum <= 0.0 {
        return None;
    }
    let complete_mean = |row: usize| {
        let read = |member: &Member| {
            is_reading(channel, member.values[row]).then(|| member.weight * member.values[row] / sum)
        };
        members.iter().map(read).sum::<Option<f64>>()
    };
    // Mean difference of each sensor from the mean of all, over the rows with all readings.
    let mut differences = vec![0.0; members.len()];
    let mut rows = 0.0;
    for (row, mean) in (0..t_s.len()).filter_map(|row| Some((row, complete_mean(row)?))) {
        rows += 1.0;
        for (difference, member) in differences.iter_mut().zip(&members) {
            *difference += member.values[row] - mean;
        }
    }
    differences.iter_mut().for_each(|difference| *difference /= f64::max(rows, 1.0));
    let mut aligned_values: Vec<f64> = Vec::with_capacity(members.len());
    let values = (0..t_s.len()).map(|row| {
        let aligned = |(difference, member): (&f64, &Member)| member.values[row] - difference;
        aligned_values.clear();
        aligned_values.extend(
            differences.iter().zip(&members).map(aligned).filter(|value| is_reading(channel, *value)),
        );
        aligned_values.sort_by(f64::total_cmp);
        let Some(median) = median_of_sorted(&aligned_values) else { return f64::NAN };
        let (mut weighted, mut weight_sum) = (0.0, 0.0);
        for (difference, Member { weight, sigma, values }) in differences.iter().zip(&members) {
            let value = values[row] - difference;
            let is_spike =
                aligned_values.len() > 2 && *sigma > 0.0 && (value - median).abs() > SPIKE_SIGMAS * sigma;
            if is_reading(channel, value) && !is_spike {
                (weighted, weight_sum) = (weighted + weight * value, weight_sum + weight);
            }
        }
        if weight_sum > 0.0 { weighted / weight_sum } else { median }
    });
    Some(values.collect())
}

/// Combines the results for recordings that are compared with each other: a sensor excluded from one is excluded from all, because a change
/// of the set of sensors would look like drift.
pub fn harmonise(
    judged: Vec<Vec<FusedChannel>>,
    declared: &BTreeMap<Channel, RedundantSensors>,
) -> Vec<Vec<FusedChannel>> {
    let mut excluded: BTreeMap<Channel, Vec<FaultyElement>> = BTreeMap::new();
    let mut seen: BTreeSet<Element> = BTreeSet::new();
    for faulty in judged.iter().flatten().flat_map(|fused| &fused.left_out) {
        if seen.insert(faulty.element) {
            excluded.entry(faulty.element.channel).or_default().push(faulty.clone());
        }
    }
    let exclude = |mut fused: FusedChannel| {
        if let (Some(left_out), Some(declared)) = (excluded.get(&fused.channel), declared.get(&fused.channel))
            && left_out.len() < fused.sensors
        {
            fused.left_out.clone_from(left_out);
            let widened_by =
                fused.contradiction.as_ref().map_or(0.0, |contradiction| contradiction.widened_by);
            let uses = |index: usize| fused.uses(index + 1);
            let sensor = declared.fused(uses);
            fused.probe_diameter_m = declared.probe_diameter_m(uses);
            fused.declared =
                DeclaredUncertainty { offset_sigma: sensor.offset_sigma.hypot(widened_by), ..sensor };
        }
        fused
    };
    judged.into_iter().map(|channels| channels.into_iter().map(exclude).collect()).collect()
}
