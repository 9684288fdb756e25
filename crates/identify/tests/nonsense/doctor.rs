//! Ways to doctor a recording: each function is one fault of a channel, a clock or a list of steps.

use mapper_core::{Channel, Recording, Series};

/// Start and end of the recording, s.
fn span_s(recording: &Recording) -> (f64, f64) {
    let steps = &recording.steps;
    (steps[0].start_s, steps[steps.len() - 1].end_s)
}

fn series(recording: &mut Recording, channel: Channel) -> &mut Series {
    recording.series.get_mut(&channel).unwrap()
}

/// Replaces each value: `becomes` gets its share of the run (0 at the start, 1 at the end) and the value.
pub fn each(recording: &mut Recording, channel: Channel, becomes: impl Fn(f64, f64) -> f64) {
    let (start_s, end_s) = span_s(recording);
    let Series { t_s, values } = series(recording, channel);
    for (t_s, value) in t_s.iter().zip(values) {
        *value = becomes((t_s - start_s) / (end_s - start_s), *value);
    }
}

pub fn gain(recording: &mut Recording, channel: Channel, factor: f64) {
    each(recording, channel, |_, value| factor * value);
}

/// An offset in the unit of the channel.
pub fn offset(recording: &mut Recording, channel: Channel, by: f64) {
    each(recording, channel, |_, value| value + by);
}

/// A drift that reaches `by` at the run's end, unit of the channel.
pub fn creep(recording: &mut Recording, channel: Channel, by: f64) {
    each(recording, channel, |share, value| value + share * by);
}

pub fn constant(recording: &mut Recording, channel: Channel, value: f64) {
    each(recording, channel, |_, _| value);
}

/// Holds the value at `from` (share of the run) until `to`.
pub fn frozen(recording: &mut Recording, channel: Channel, from: f64, to: f64) {
    let (start_s, end_s) = span_s(recording);
    let at_s = |share: f64| start_s + share * (end_s - start_s);
    let held = series(recording, channel).interpolate(at_s(from)).unwrap();
    each(recording, channel, |share, value| if (from..=to).contains(&share) { held } else { value });
}

/// Holds the value at which the step at `position` begins until its end.
pub fn frozen_step(recording: &mut Recording, channel: Channel, position: usize) {
    let step = recording.steps[position];
    let series = series(recording, channel);
    let held = series.held(step.start_s).unwrap();
    for (t_s, value) in series.t_s.iter().zip(&mut series.values) {
        if (step.start_s..step.end_s).contains(t_s) {
            *value = held;
        }
    }
}

/// Limits readings to the given share of the span of its values.
pub fn clipped(recording: &mut Recording, channel: Channel, share: f64) {
    let values = &series(recording, channel).values;
    let (low, high) =
        values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
    let limit = low + share * (high - low);
    each(recording, channel, |_, value| value.min(limit));
}

pub fn swapped(recording: &mut Recording, one: Channel, other: Channel) {
    let first = series(recording, one).clone();
    let second = std::mem::replace(series(recording, other), first);
    *series(recording, one) = second;
}

/// Delays the channel by `by_s`.
pub fn late(recording: &mut Recording, channel: Channel, by_s: f64) {
    let before = series(recording, channel).clone();
    let after = series(recording, channel);
    for (t_s, value) in after.t_s.iter().zip(&mut after.values) {
        *value = before.interpolate(t_s - by_s).unwrap();
    }
}

/// Every hundredth sample has an error of `by`, at irregular places and in both directions.
pub fn spikes(recording: &mut Recording, channel: Channel, by: f64) {
    for (i, value) in series(recording, channel).values.iter_mut().enumerate() {
        // Knuth's multiplicative hash: irregular, and the same each time.
        let hash = (i as u32).wrapping_mul(2_654_435_761) >> 16;
        if hash.is_multiple_of(100) {
            *value += if hash.is_multiple_of(200) { by } else { -by };
        }
    }
}

/// Adds white noise of this standard deviation (Box and Muller on a multiplicative hash: the same each time).
pub fn noise(recording: &mut Recording, channel: Channel, sigma: f64) {
    let uniform = |i: u64| {
        let mixed = (i + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        (((mixed ^ (mixed >> 32)) >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    };
    for (i, value) in series(recording, channel).values.iter_mut().enumerate() {
        let (u, v) = (uniform(2 * i as u64), uniform(2 * i as u64 + 1));
        *value += sigma * (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos();
    }
}

/// Keeps one sample of `keep`, in all channels.
pub fn thinned(recording: &mut Recording, keep: usize) {
    for series in recording.series.values_mut() {
        series.t_s = series.t_s.iter().step_by(keep).copied().collect();
        series.values = series.values.iter().step_by(keep).copied().collect();
    }
}

/// Reverses the values in time.
pub fn backwards(recording: &mut Recording, channel: Option<Channel>) {
    for (name, series) in &mut recording.series {
        if channel.is_none_or(|channel| channel == *name) {
            series.values.reverse();
        }
    }
}
