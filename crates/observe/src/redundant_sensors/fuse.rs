//! Combines several sensors of a channel into one reading, by a rule common to all users of recordings.
//!
//! The fused reading is a weighted mean, so each sensor's isothermal zero can be subtracted before it, or that of the mean after it. Probes of
//! several diameters are fused without correction: to first order their mean lags by the mean of the lags, which is sufficient for slow
//! changes. Correcting each to the gas would multiply its noise.

use crate::averages::time_table::on_base;
use crate::plausible::is_reading;
use crate::redundant_sensors::element_fault::{Contradiction, Fault, FaultyElement, FusedChannel};
use crate::redundant_sensors::element_judge::{FALSE_ALARMS_RATIO, Judgement, comparisons, judge};
use mapper_core::{Channel, DeclaredUncertainty, Element, NoiseColour, Recording, RedundantSensors, Series};
use mapper_numerics::statistics::{mean, median, normal_quantile};
use std::collections::{BTreeMap, BTreeSet};

/// Maximum deviation of an aligned reading from the median of three or more, in declared errors, before it is skipped.
const SPIKE_SIGMAS: f64 = 8.0;

/// Judges the several sensors of all channels of a recording, and lists those left out. Channels without a declaration, or with another number
/// of declared sensors, are left as recorded.
pub fn judge_elements(
    recording: &Recording,
    declared: &BTreeMap<Channel, RedundantSensors>,
    colour: NoiseColour,
) -> Vec<FusedChannel> {
    let several: Vec<(Channel, &RedundantSensors)> = declared
        .iter()
        .map(|(channel, declared)| (*channel, declared))
        .filter(|(channel, declared)| {
            declared.elements.len() > 1 && element_count(recording, *channel) == declared.elements.len()
        })
        .collect();
    let all: usize = several.iter().map(|(_, declared)| comparisons(declared.elements.len())).sum();
    let limit_sigmas =
        normal_quantile(1.0 - 0.5 * FALSE_ALARMS_RATIO / all.max(1) as f64).unwrap_or(f64::INFINITY);
    several
        .into_iter()
        .map(|(channel, declared)| {
            let sensors = sensors(recording, channel, declared.elements.len());
            let judgement = judge(channel, &sensors, declared, colour, limit_sigmas);
            fused_channel(channel, &sensors, declared, judgement)
        })
        .collect()
}

/// The number of sensors of a channel in a recording: that of the last one; 0 if it has only one reading.
pub fn element_count(recording: &Recording, channel: Channel) -> usize {
    let of = recording.elements.keys().filter(|element| element.channel == channel);
    of.map(|element| element.number).max().unwrap_or(0)
}

/// The recording with each of these channels fused from its sensors in use. Lost readings of one sensor cause no step, because the typical
/// difference of each from the mean of all is known.
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
    let mut together = declared.fused(uses);
    let contradiction = judgement.contradiction.map(|(index, fault)| {
        // Either may be right: the standard deviation includes the farthest one.
        let widened_by = if matches!(fault, Fault::Off { .. }) {
            farthest(channel, sensors, declared, &uses)
        } else {
            0.0
        };
        together = DeclaredUncertainty { offset_sigma: together.offset_sigma.hypot(widened_by), ..together };
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
        declared: together,
        probe_diameter_m: declared.probe_diameter_m(uses),
    }
}

/// Maximum difference between the mean of a sensor in use and the fused mean.
fn farthest(
    channel: Channel,
    sensors: &[Option<&Series>],
    declared: &RedundantSensors,
    uses: &dyn Fn(usize) -> bool,
) -> f64 {
    let weights = declared.weights(uses);
    let usual = |series: &Option<&Series>| {
        let values = series.iter().flat_map(|series| &series.values);
        mean(values.filter(|value| is_reading(channel, **value)))
    };
    let means: Vec<Option<f64>> = sensors.iter().map(usual).collect();
    let used = || weights.iter().zip(&means).filter(|(weight, _)| **weight > 0.0);
    let fused: f64 = used().filter_map(|(weight, mean)| Some(weight * (*mean)?)).sum();
    used().filter_map(|(_, mean)| Some(((*mean)? - fused).abs())).fold(0.0, f64::max)
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
    let mut members: Vec<(f64, f64, Vec<f64>)> = Vec::new();
    for ((weight, sensor), element) in weights.iter().zip(sensors).zip(&declared.elements) {
        let Some(series) = sensor.filter(|_| *weight > 0.0) else { continue };
        let sigma = element.declared.noise_sigma.hypot(element.declared.offset_sigma);
        members.push((*weight, sigma, on_base(series, t_s, interval_s)));
    }
    let sum: f64 = members.iter().map(|(weight, ..)| weight).sum();
    if sum <= 0.0 {
        return None;
    }
    let complete = |row: usize| {
        let read = |(weight, _, values): &(f64, f64, Vec<f64>)| {
            is_reading(channel, values[row]).then(|| weight * values[row] / sum)
        };
        members.iter().map(read).sum::<Option<f64>>()
    };
    // Difference of each sensor from the mean of all, over the rows with all readings.
    let mut distances = vec![0.0; members.len()];
    let mut rows = 0.0;
    let together: Vec<Option<f64>> = (0..t_s.len()).map(complete).collect();
    for (row, all) in together.iter().enumerate().filter_map(|(row, all)| Some((row, (*all)?))) {
        rows += 1.0;
        for (distance, (.., values)) in distances.iter_mut().zip(&members) {
            *distance += values[row] - all;
        }
    }
    distances.iter_mut().for_each(|distance| *distance /= f64::max(rows, 1.0));
    let mut near: Vec<f64> = Vec::with_capacity(members.len());
    let values = (0..t_s.len()).map(|row| {
        near.clear();
        let aligned = |(distance, (.., values)): (&f64, &(f64, f64, Vec<f64>))| values[row] - distance;
        near.extend(distances.iter().zip(&members).map(aligned).filter(|value| is_reading(channel, *value)));
        near.sort_by(f64::total_cmp);
        let Some(last) = near.len().checked_sub(1) else { return f64::NAN };
        let middle = 0.5 * (near[last / 2] + near[last - last / 2]);
        let (mut weighted, mut weight_sum) = (0.0, 0.0);
        for (distance, (weight, sigma, values)) in distances.iter().zip(&members) {
            let value = values[row] - distance;
            let spike = near.len() > 2 && *sigma > 0.0 && (value - middle).abs() > SPIKE_SIGMAS * sigma;
            if is_reading(channel, value) && !spike {
                (weighted, weight_sum) = (weighted + weight * value, weight_sum + weight);
            }
        }
        if weight_sum > 0.0 { weighted / weight_sum } else { middle }
    });
    Some(values.collect())
}

/// Combines the results for recordings that are compared with each other: a sensor left out of one is left out of all, because a change of the
/// set of sensors would look like drift.
pub fn alike(
    judged: Vec<Vec<FusedChannel>>,
    declared: &BTreeMap<Channel, RedundantSensors>,
) -> Vec<Vec<FusedChannel>> {
    let mut out: BTreeMap<Channel, Vec<FaultyElement>> = BTreeMap::new();
    let mut seen: BTreeSet<Element> = BTreeSet::new();
    for faulty in judged.iter().flatten().flat_map(|fused| &fused.left_out) {
        if seen.insert(faulty.element) {
            out.entry(faulty.element.channel).or_default().push(faulty.clone());
        }
    }
    let of_all = |mut fused: FusedChannel| {
        if let (Some(left_out), Some(declared)) = (out.get(&fused.channel), declared.get(&fused.channel))
            && left_out.len() < fused.sensors
        {
            fused.left_out.clone_from(left_out);
            let widened_by = fused.contradiction.as_ref().map_or(0.0, |found| found.widened_by);
            let uses = |index: usize| fused.uses(index + 1);
            let together = declared.fused(uses);
            fused.probe_diameter_m = declared.probe_diameter_m(uses);
            fused.declared =
                DeclaredUncertainty { offset_sigma: together.offset_sigma.hypot(widened_by), ..together };
        }
        fused
    };
    judged.into_iter().map(|channels| channels.into_iter().map(of_all).collect()).collect()
}
