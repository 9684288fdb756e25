//! Several sensors on one channel: their declared properties, and the rule that combines them into one reading.

use crate::{Channel, DeclaredUncertainty, Dimension, UnknownChannel};
use serde::{Deserialize, Serialize};

/// Maximum number of sensors on one channel. Bound: no rig has as many.
pub const MAX_ELEMENTS: usize = 16;

/// During a run, a reading is skipped if its deviation from the median of all sensors exceeds this limit, in standard deviations of
/// noise and offset together. Bound: a sound sensor never deviates as far. Identification excludes sensors on the basis of the whole recording instead.
const LIVE_LIMIT_SIGMAS: f64 = 8.0;

/// Exponent of a probe's lag with its diameter. Source: `tau ~ d^2/Nu`, and Nu (eq. 11) about as `d^0.5` at the Reynolds numbers of
/// a tip of one to four millimetres in an outlet pipe.
const LAG_EXPONENT: f64 = 1.5;

/// One of several sensors of a channel, written `T2/3`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Element {
    /// Channel.
    pub channel: Channel,
    /// Number, from 1.
    pub number: usize,
}

impl Element {
    /// Name of its field in a recording, unit included: `T2_3_k`.
    pub fn field(self) -> String {
        let unit = match self.channel.info().dimension {
            Dimension::RotationalSpeed => "rpm",
            Dimension::MassFlow => "kg_s",
            Dimension::Pressure => "pa",
            Dimension::Temperature => "k",
            Dimension::Ratio => "ratio",
        };
        format!("{}_{}_{unit}", self.channel, self.number)
    }
}

impl std::fmt::Display for Element {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}/{}", self.channel, self.number)
    }
}

impl From<Element> for String {
    fn from(element: Element) -> String {
        element.to_string()
    }
}

/// A text that is not the name of a sensor.
#[derive(Debug, Clone, thiserror::Error, PartialEq, Eq)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum UnknownElement {
    #[error("`{0}` is not a channel and the number of one of its sensors, such as `T2/3`")]
    NotElement(String),
    #[error(transparent)]
    Channel(#[from] UnknownChannel),
}

impl TryFrom<String> for Element {
    type Error = UnknownElement;

    fn try_from(text: String) -> Result<Element, UnknownElement> {
        let parts = text.rsplit_once('/').and_then(|(channel, number)| Some((channel, number.parse().ok()?)));
        let Some((channel, number @ 1..)) = parts else { return Err(UnknownElement::NotElement(text)) };
        Ok(Element { channel: channel.parse()?, number })
    }
}

/// Declared properties of one of the sensors of a channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DeclaredElement {
    /// Display name; `T2/3` if none is given.
    pub name: String,
    /// Own noise, offset and gain error, independent of those of the others.
    pub declared: DeclaredUncertainty,
    /// Diameter of the probe's tip, m; 0 is a probe without inertia.
    pub probe_diameter_m: f64,
}

/// Two or more sensors of one channel.
///
/// The combined reading is `sum w_i x_i` with `w_i ~ 1/(noise_i^2 + offset_i^2)`: the weights of minimum variance for independent
/// errors. If only gains are declared, the weights are `1/gain_i^2`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RedundantSensors {
    /// The sensors in the order of their numbers.
    pub elements: Vec<DeclaredElement>,
    /// Offset that all sensors share (one calibration bath, one position in the flow), in the channel's unit, one standard
    /// deviation, >= 0. It does not average out.
    pub common_offset_sigma: f64,
}

impl RedundantSensors {
    /// `count` identical sensors of a channel, without names of their own.
    pub fn alike(channel: Channel, count: usize, declared: DeclaredUncertainty) -> Self {
        let element = |number| DeclaredElement {
            name: Element { channel, number }.to_string(),
            declared,
            probe_diameter_m: 0.0,
        };
        RedundantSensors { elements: (1..=count).map(element).collect(), common_offset_sigma: 0.0 }
    }

    /// Weights of the sensors: their sum is 1, and sensors for which `in_use` (by index from 0) is false have 0.
    pub fn weights(&self, in_use: impl Fn(usize) -> bool) -> Vec<f64> {
        let only_gains = self
            .elements
            .iter()
            .all(|element| element.declared.offset_sigma == 0.0 && element.declared.gain_sigma_ratio > 0.0);
        let variance = |declared: &DeclaredUncertainty| {
            if only_gains {
                declared.gain_sigma_ratio.powi(2)
            } else {
                declared.noise_sigma.powi(2) + declared.offset_sigma.powi(2)
            }
        };
        let variances: Vec<Option<f64>> = self
            .elements
            .iter()
            .enumerate()
            .map(|(index, element)| in_use(index).then(|| variance(&element.declared)))
            .collect();
        // Sensors without a declared error share the whole weight.
        let exact = variances.iter().flatten().any(|variance| *variance <= 0.0);
        let raw = variances.iter().map(|variance| match variance {
            Some(variance) if exact => f64::from(u8::from(*variance <= 0.0)),
            Some(variance) => 1.0 / variance,
            None => 0.0,
        });
        let raw: Vec<f64> = raw.collect();
        let sum: f64 = raw.iter().sum();
        raw.into_iter().map(|weight| if sum > 0.0 { weight / sum } else { 0.0 }).collect()
    }

    /// Uncertainty of the combined reading of the sensors in use: individual errors average out, the common offset does not.
    pub fn fused(&self, in_use: impl Fn(usize) -> bool) -> DeclaredUncertainty {
        let weights = self.weights(in_use);
        let average = |value: fn(&DeclaredUncertainty) -> f64| {
            let share =
                |(weight, element): (&f64, &DeclaredElement)| (weight * value(&element.declared)).powi(2);
            weights.iter().zip(&self.elements).map(share).sum::<f64>().sqrt()
        };
        DeclaredUncertainty {
            noise_sigma: average(|declared| declared.noise_sigma),
            offset_sigma: average(|declared| declared.offset_sigma).hypot(self.common_offset_sigma),
            gain_sigma_ratio: average(|declared| declared.gain_sigma_ratio),
        }
    }

    /// Diameter, m, of the single probe with the same lag as the combined reading of the sensors in use. To first order in the lag,
    /// a mean of lagged readings lags by the mean of their lags.
    pub fn probe_diameter_m(&self, in_use: impl Fn(usize) -> bool) -> f64 {
        let weights = self.weights(in_use);
        let lags = weights.iter().zip(&self.elements);
        let mean: f64 =
            lags.map(|(weight, element)| weight * element.probe_diameter_m.powf(LAG_EXPONENT)).sum();
        mean.powf(LAG_EXPONENT.recip())
    }

    /// The reading of the channel at one instant, for guards and settle bands while the rig runs: the weighted mean
    /// without outliers. `readings` in the order of the sensors; NaN if none is finite.
    pub fn live(&self, channel: Channel, readings: &[f64]) -> f64 {
        let mut sorted: Vec<f64> = readings.iter().copied().filter(|reading| reading.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
        let middle = 0.5 * (sorted[last / 2] + sorted[last - last / 2]);
        let has_reading = |index: usize| readings.get(index).is_some_and(|reading| reading.is_finite());
        let is_near = |index: usize| {
            let declared = &self.elements[index].declared;
            let sigma = declared.noise_sigma.hypot(declared.fixed_sigma(channel, middle));
            has_reading(index)
                && (sigma <= 0.0 || (readings[index] - middle).abs() <= LIVE_LIMIT_SIGMAS * sigma)
        };
        // Two contradicting sensors are both far from their median; both are used.
        let any_near = (0..self.elements.len()).any(is_near);
        let weights = self.weights(|index| if any_near { is_near(index) } else { has_reading(index) });
        let used = weights.iter().zip(readings).filter(|(weight, _)| **weight > 0.0);
        used.map(|(weight, reading)| weight * reading).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn declared(noise_sigma: f64, offset_sigma: f64) -> DeclaredUncertainty {
        DeclaredUncertainty { noise_sigma, offset_sigma, gain_sigma_ratio: 0.0 }
    }

    #[test]
    fn four_alike_halve_what_is_their_own_and_nothing_of_what_is_common() {
        let mut four = RedundantSensors::alike(Channel::T2, 4, declared(0.1, 0.24));
        four.common_offset_sigma = 0.16;
        let fused = four.fused(|_| true);
        assert!((fused.noise_sigma - 0.05).abs() < 1e-12);
        // 0.12 and 0.16 in quadrature.
        assert!((fused.offset_sigma - 0.2).abs() < 1e-12);
        let three = four.fused(|index| index != 2);
        assert!((three.noise_sigma - 0.1 / 3f64.sqrt()).abs() < 1e-12);
        assert_eq!(four.elements[2].name, "T2/3");
        let second = Element { channel: Channel::CompressorFlow, number: 2 };
        assert_eq!(second.field(), "m_c_2_kg_s");
        assert_eq!(
            serde_json::from_str::<Element>(&serde_json::to_string(&second).unwrap()).unwrap(),
            second
        );
        for wrong in ["T2", "T2/0", "T2/x", "T9/1", "/1"] {
            assert!(Element::try_from(wrong.to_owned()).is_err(), "{wrong}");
        }
    }

    /// No other weights with the sum 1 give a smaller variance: neighbouring ones do not.
    #[test]
    fn the_weights_are_those_of_least_variance() {
        let mut unlike = RedundantSensors::alike(Channel::P2, 3, declared(60.0, 100.0));
        unlike.elements[1].declared = declared(20.0, 300.0);
        unlike.elements[2].declared = declared(200.0, 50.0);
        let variance = |weights: &[f64]| -> f64 {
            let of = |(weight, element): (&f64, &DeclaredElement)| {
                weight
                    * weight
                    * (element.declared.noise_sigma.powi(2) + element.declared.offset_sigma.powi(2))
            };
            weights.iter().zip(&unlike.elements).map(of).sum()
        };
        let best = unlike.weights(|_| true);
        assert!((best.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        for (from, to) in [(0, 1), (1, 2), (2, 0), (1, 0), (2, 1), (0, 2)] {
            let mut other = best.clone();
            other[from] -= 0.01;
            other[to] += 0.01;
            assert!(variance(&other) > variance(&best));
        }
    }

    #[test]
    fn one_wild_or_lost_reading_does_not_move_the_live_value() {
        let four = RedundantSensors::alike(Channel::T2, 4, declared(0.1, 0.25));
        assert!((four.live(Channel::T2, &[350.0, 350.2, 349.9, 350.1]) - 350.05).abs() < 1e-9);
        for wild in [f64::NAN, 0.0, 900.0, f64::INFINITY] {
            assert!((four.live(Channel::T2, &[350.0, wild, 350.2, 350.1]) - 350.1).abs() < 1e-9, "{wild}");
        }
        assert!(four.live(Channel::T2, &[f64::NAN; 4]).is_nan());
        // If two contradict each other, neither is known to be wrong.
        let two = RedundantSensors::alike(Channel::P2, 2, declared(60.0, 100.0));
        assert_eq!(two.live(Channel::P1, &[150e3, 160e3]), 155e3);
        let exact = RedundantSensors::alike(Channel::P2, 2, declared(0.0, 0.0));
        assert_eq!(exact.live(Channel::P1, &[150e3, 160e3]), 155e3);
    }

    #[test]
    fn the_effective_probe_lies_between_those_it_stands_for() {
        let mut probes = RedundantSensors::alike(Channel::T2, 2, declared(0.1, 0.25));
        assert_eq!(probes.probe_diameter_m(|_| true), 0.0);
        (probes.elements[0].probe_diameter_m, probes.elements[1].probe_diameter_m) = (1e-3, 2e-3);
        let fused_m = probes.probe_diameter_m(|_| true);
        assert!((1.5e-3..2e-3).contains(&fused_m), "{fused_m} m");
        assert!((probes.probe_diameter_m(|index| index == 0) - 1e-3).abs() < 1e-15);
    }
}
