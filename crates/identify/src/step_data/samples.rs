//! The samples of a window on one time base, total pressures, complete rows only.

use crate::IdentifyConfig;
use crate::step_data::taps;
use mapper_core::{Channel, Recording, Series, Window};
use mapper_numerics::statistics::mean;
use mapper_observe::plausible::is_reading;
use mapper_physics::laws::compression::isentropic_rise_ratio;

/// Longest gap between neighbouring samples of a channel, s: slow loggers have 1 Hz.
pub const LONGEST_BRIDGE_S: f64 = 2.5;

/// Complete rows on the times of T2, as columns of equal length.
#[derive(Debug, Clone, Default)]
pub(crate) struct Samples {
    pub(crate) t_s: Vec<f64>,
    pub(crate) t1_k: Vec<f64>,
    pub(crate) t2_k: Vec<f64>,
    /// NaN if the recording has no housing temperature (steady method).
    pub(crate) tc_k: Vec<f64>,
    pub(crate) p1_pa: Vec<f64>,
    pub(crate) p2_pa: Vec<f64>,
    pub(crate) flow_kg_s: Vec<f64>,
    /// `PR^kappa - 1`.
    pub(crate) rise_ratio: Vec<f64>,
    /// Rows omitted because a value was missing or not physical.
    pub(crate) lost: usize,
}

impl Samples {
    pub(crate) fn len(&self) -> usize {
        self.t_s.len()
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
            let p1_pa = taps::total_pa(config.inlet_tap, p1_pa[i], flow_kg_s, t1_k);
            let p2_pa = taps::total_pa(config.outlet_tap, p2_pa[i], flow_kg_s, t2_k);
            let readings = [
                (Channel::T1, t1_k),
                (Channel::T2, t2_k),
                (Channel::P1, p1_pa),
                (Channel::P2, p2_pa),
                (Channel::CompressorFlow, flow_kg_s),
            ];
            let complete = readings.into_iter().all(|(channel, value)| is_reading(channel, value))
                && flow_kg_s > 0.0
                && (!with_housing || is_reading(Channel::Tc, tc_k));
            let rise_ratio = isentropic_rise_ratio(p2_pa / p1_pa, t1_k, config.air.between(p1_pa, p2_pa));
            if !complete || !rise_ratio.is_finite() {
                samples.lost += 1;
                continue;
            }
            samples.t_s.push(t_s[i]);
            samples.t1_k.push(t1_k);
            samples.t2_k.push(t2_k);
            samples.tc_k.push(tc_k);
            samples.p1_pa.push(p1_pa);
            samples.p2_pa.push(p2_pa);
            samples.flow_kg_s.push(flow_kg_s);
            samples.rise_ratio.push(rise_ratio);
        }
        samples
    }

    /// The rows with a true `keep`, by index.
    pub(crate) fn filtered(&self, keep: impl Fn(usize) -> bool) -> Self {
        let pick = |column: &[f64]| {
            column.iter().enumerate().filter(|(i, _)| keep(*i)).map(|(_, value)| *value).collect()
        };
        Samples {
            t_s: pick(&self.t_s),
            t1_k: pick(&self.t1_k),
            t2_k: pick(&self.t2_k),
            tc_k: pick(&self.tc_k),
            p1_pa: pick(&self.p1_pa),
            p2_pa: pick(&self.p2_pa),
            flow_kg_s: pick(&self.flow_kg_s),
            rise_ratio: pick(&self.rise_ratio),
            lost: self.lost,
        }
    }

    /// Change of a column over the window: mean of its last `seconds` minus that of its first.
    pub(crate) fn change(&self, column: &[f64], seconds: f64) -> Option<f64> {
        let (first_s, last_s) = (*self.t_s.first()?, *self.t_s.last()?);
        let seconds = seconds.min(0.5 * (last_s - first_s));
        let early = self.t_s.partition_point(|t| *t <= first_s + seconds);
        let late = self.t_s.partition_point(|t| *t < last_s - seconds);
        let change = mean(&column[late..])? - mean(&column[..early])?;
        change.is_finite().then_some(change)
    }
}

/// Least-squares slope of a column, 1/s; `None` without two finite samples.
pub(crate) fn slope_per_s(t_s: &[f64], values: &[f64]) -> Option<f64> {
    let usable = || t_s.iter().zip(values).filter(|(_, value)| value.is_finite());
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
