//! Sensors of the virtual lab: declared errors drawn once, noise, second-order lag, several elements for one channel.

use mapper_core::{Channel, DeclaredUncertainty, Element, ElementColumn, RedundantSensors};
use mapper_physics::laws::thermocouple;
use mapper_physics::rig::instruments::{ChannelFollower, ChannelPath};
use mapper_physics::simulation::model::Outputs;
use mapper_recording::logs::{difference, kind_of};
use mapper_yaml::units::Kind;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

/// White and first-order parts of the declared standard deviation, in quadrature.
const WHITE_SHARE: f64 = 0.8;
const COLOURED_SHARE: f64 = 0.6;
const COLOURED_TIME_CONSTANT_S: f64 = 2.0;

/// Rule for sensor errors from declared uncertainties.
pub(crate) struct Draws {
    pub(crate) seed: u64,
    /// Noise over declared noise.
    pub(crate) noise_ratio: f64,
    /// Whether offsets and gains are drawn; they are 0 otherwise.
    pub(crate) drawn: bool,
}

impl Draws {
    /// Errors of the sensor with this random stream.
    pub(crate) fn errors(
        &self,
        channel: Channel,
        declared: &DeclaredUncertainty,
        stream: u64,
    ) -> SensorErrors {
        let (offset, gain) = self.of(stream);
        SensorErrors {
            white_sigma: self.noise_ratio * WHITE_SHARE * declared.noise_sigma,
            coloured_sigma: self.noise_ratio * COLOURED_SHARE * declared.noise_sigma,
            coloured_time_constant_s: COLOURED_TIME_CONSTANT_S,
            offset: offset * declared.offset_sigma,
            gain_ratio: gain * declared.gain_sigma_ratio,
            exact_reading: -channel.gain_distance(0.0),
        }
    }

    /// Standard normal numbers for offset and gain of a stream.
    pub(crate) fn of(&self, stream: u64) -> (f64, f64) {
        if self.drawn { draw(self.seed, stream) } else { (0.0, 0.0) }
    }
}

/// Draws two standard normal numbers of a stream, for offset and gain.
pub(crate) fn draw(seed: u64, stream: u64) -> (f64, f64) {
    // A stream separate from the noise of the sensor, which has other multipliers of the same seed.
    let mixed = seed.wrapping_mul(0xA24B_AED4_963E_E407) ^ (stream + 1).wrapping_mul(0x9FB2_1C65_1E98_DF25);
    let mut random = Pcg64::seed_from_u64(mixed);
    (StandardNormal.sample(&mut random), StandardNormal.sample(&mut random))
}

pub(crate) fn offset_kind(channel: Channel) -> Kind {
    difference(kind_of(channel))
}

/// True properties of a redundant sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LabElement {
    /// Errors.
    pub errors: SensorErrors,
    /// Diameter of its tip, m, if it differs from the machine's T2 probe; for T2 only.
    pub probe_diameter_m: Option<f64>,
    /// Time constant of its own lag, s; 0 without lag.
    pub lag_s: f64,
    /// Run time at which the reading freezes, s; infinite for a fault-free sensor.
    pub stuck_after_s: f64,
}

/// The sensors of one channel.
#[derive(Debug, Clone, PartialEq)]
pub struct LabElements {
    /// Declared sensors, which the rig combines into one reading.
    pub declared: RedundantSensors,
    /// True sensors.
    pub elements: Vec<LabElement>,
}

/// Offset of the random streams of redundant sensors, above those of the channels.
const STREAMS_OF_CHANNELS: u64 = 1000;

/// The stream of random numbers of a redundant sensor.
pub(crate) fn stream(element: Element) -> u64 {
    element.channel as u64 + STREAMS_OF_CHANNELS * element.number as u64
}

/// The sensors of one channel while the lab runs.
#[derive(Debug)]
pub(crate) struct ElementBank {
    pub(crate) channel: Channel,
    declared: RedundantSensors,
    members: Vec<Member>,
    readings: Vec<f64>,
}

#[derive(Debug)]
struct Member {
    properties: LabElement,
    sensor: Sensor,
    follower: ChannelFollower,
    tip: Option<Tip>,
    last: f64,
}

/// A probe tip that follows the gas: time, gas and tip temperature of the last sample.
#[derive(Debug, Clone, Copy)]
struct Tip {
    t_s: f64,
    gas_k: f64,
    tip_k: f64,
}

impl ElementBank {
    pub(crate) fn new(channel: Channel, elements: &LabElements, sample_s: f64, seed: u64) -> Self {
        let member = |(index, element): (usize, &LabElement)| Member {
            properties: *element,
            sensor: Sensor::new(
                element.errors,
                sample_s,
                seed,
                stream(Element { channel, number: index + 1 }),
            ),
            follower: ChannelFollower::new(ChannelPath { lag_s: element.lag_s, ..ChannelPath::default() }),
            tip: None,
            last: f64::NAN,
        };
        ElementBank {
            channel,
            declared: elements.declared.clone(),
            members: elements.elements.iter().enumerate().map(member).collect(),
            readings: vec![f64::NAN; elements.elements.len()],
        }
    }

    pub(crate) fn columns(&self) -> impl Iterator<Item = ElementColumn> + '_ {
        (1..=self.members.len()).map(|number| ElementColumn {
            element: Element { channel: self.channel, number },
            values: Vec::new(),
        })
    }

    /// Reading of each sensor for `truth`, and the rig's combined reading. `outputs`: of a running machine; `drifted` adds drift to a reading.
    pub(crate) fn read(
        &mut self,
        t_s: f64,
        truth: f64,
        outputs: Option<&Outputs>,
        pipe_diameter_m: f64,
        drifted: impl Fn(f64) -> f64,
    ) -> (&[f64], f64) {
        for (member, reading) in self.members.iter_mut().zip(&mut self.readings) {
            let quantity = truth + member.offset_from_probe_k(t_s, outputs, pipe_diameter_m);
            let read = drifted(member.sensor.read(member.follower.read(t_s, quantity)));
            if t_s < member.properties.stuck_after_s || member.last.is_nan() {
                member.last = read;
            }
            *reading = member.last;
        }
        (&self.readings, self.declared.live(self.channel, &self.readings))
    }
}

impl Member {
    /// Temperature of its tip minus that of the machine's probe, K; 0 except for T2 probes of another diameter.
    fn offset_from_probe_k(&mut self, t_s: f64, outputs: Option<&Outputs>, pipe_diameter_m: f64) -> f64 {
        let Some((diameter_m, outputs)) = self.properties.probe_diameter_m.zip(outputs) else {
            // At rest all tips have the same temperature.
            self.tip = None;
            return 0.0;
        };
        let gas_k = outputs.t2_probe_target_k;
        let tau_s =
            thermocouple::time_constant_s(diameter_m, pipe_diameter_m, outputs.flow_kg_s, outputs.t2_k);
        let tip_k = match self.tip {
            Some(before) if tau_s > 0.0 && tau_s.is_finite() && t_s > before.t_s => {
                // Exact for gas that changes linearly between samples.
                let dt_s = t_s - before.t_s;
                let slope_k_s = (gas_k - before.gas_k) / dt_s;
                let follows_k = gas_k - slope_k_s * tau_s;
                follows_k + (before.tip_k - (before.gas_k - slope_k_s * tau_s)) * (-dt_s / tau_s).exp()
            }
            _ => gas_k,
        };
        self.tip = Some(Tip { t_s, gas_k, tip_k });
        tip_k - outputs.t2_probe_k
    }
}

/// Response: `y'' = w^2 (x - y) - 2 zeta w y'`, `w = 2 pi f`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SecondOrder {
    /// Natural frequency, Hz, > 0.
    pub frequency_hz: f64,
    /// Damping ratio, > 0; below 1 it overshoots.
    pub damping_ratio: f64,
}

/// Computes the response from sample to sample; starts settled at its first value.
#[derive(Debug, Clone)]
pub(crate) struct SecondOrderFollower {
    sensor: SecondOrder,
    last: Option<Sample>,
}

#[derive(Debug, Clone, Copy)]
struct Sample {
    t_s: f64,
    input: f64,
    output: f64,
    rate_per_s: f64,
}

/// Integration step as a share of 1/w: fourth order, so an error of 1e-6 of a jump.
const STEP_RATIO: f64 = 0.1;
/// Maximum number of steps between two samples; beyond it the sensor is far faster than the sampling.
const MAX_STEPS: f64 = 2000.0;

impl SecondOrderFollower {
    pub(crate) fn new(sensor: SecondOrder) -> Self {
        SecondOrderFollower { sensor, last: None }
    }

    /// The output at `t_s`, which must increase from call to call; between samples the input is taken as linear.
    pub(crate) fn read(&mut self, t_s: f64, input: f64) -> f64 {
        let current = match self.last {
            Some(last) if t_s > last.t_s => self.advance(last, t_s, input),
            _ => Sample { t_s, input, output: input, rate_per_s: 0.0 },
        };
        self.last = Some(current);
        current.output
    }

    fn advance(&self, last: Sample, t_s: f64, input: f64) -> Sample {
        let SecondOrder { frequency_hz, damping_ratio } = self.sensor;
        let w = 2.0 * std::f64::consts::PI * frequency_hz;
        let span_s = t_s - last.t_s;
        let steps = (span_s * w * damping_ratio.max(1.0) / STEP_RATIO).ceil().max(1.0);
        if steps > MAX_STEPS {
            return Sample { t_s, input, output: input, rate_per_s: 0.0 };
        }
        let dt_s = span_s / steps;
        let slope = (input - last.input) / span_s;
        let rates = |at_s: f64, [y, v]: [f64; 2]| {
            [v, w * w * (last.input + slope * at_s - y) - 2.0 * damping_ratio * w * v]
        };
        let advanced = |y: [f64; 2], k: [f64; 2], h_s: f64| [y[0] + h_s * k[0], y[1] + h_s * k[1]];
        let mut y = [last.output, last.rate_per_s];
        for step in 0..steps as u64 {
            let at_s = step as f64 * dt_s;
            let k1 = rates(at_s, y);
            let k2 = rates(at_s + 0.5 * dt_s, advanced(y, k1, 0.5 * dt_s));
            let k3 = rates(at_s + 0.5 * dt_s, advanced(y, k2, 0.5 * dt_s));
            let k4 = rates(at_s + dt_s, advanced(y, k3, dt_s));
            y = std::array::from_fn(|i| y[i] + dt_s / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]));
        }
        Sample { t_s, input, output: y[0], rate_per_s: y[1] }
    }
}

/// Errors of one sensor, in the unit of its channel.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SensorErrors {
    /// Standard deviation of white noise.
    pub white_sigma: f64,
    /// Standard deviation of first-order coloured noise.
    pub coloured_sigma: f64,
    /// Time constant of the coloured noise, s.
    pub coloured_time_constant_s: f64,
    /// Fixed offset.
    pub offset: f64,
    /// Fixed gain error, ratio.
    pub gain_ratio: f64,
    /// Value at which the gain error vanishes, in the channel's unit.
    pub exact_reading: f64,
}

/// A sensor with its own random stream, so that its noise does not depend on other sensors.
#[derive(Debug, Clone)]
pub struct Sensor {
    errors: SensorErrors,
    random: Pcg64,
    coloured: f64,
    /// Memory of the coloured noise from one sample to the next.
    memory_ratio: f64,
}

impl Sensor {
    /// A sensor sampled every `sample_s`; `stream` distinguishes the sensors of one seed.
    pub fn new(errors: SensorErrors, sample_s: f64, seed: u64, stream: u64) -> Self {
        // Two different odd multipliers spread (seed, stream) over the generator's state.
        let mixed = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ stream.wrapping_mul(0xD1B5_4A32_D192_ED03);
        let mut random = Pcg64::seed_from_u64(mixed);
        let memory_ratio = if errors.coloured_time_constant_s > 0.0 {
            (-sample_s / errors.coloured_time_constant_s).exp()
        } else {
            0.0
        };
        // Start in the stationary state of the coloured noise.
        let first: f64 = StandardNormal.sample(&mut random);
        Sensor { errors, random, coloured: errors.coloured_sigma * first, memory_ratio }
    }

    /// The reading of `truth`; advances the noise by one sample.
    pub fn read(&mut self, truth: f64) -> f64 {
        let white: f64 = StandardNormal.sample(&mut self.random);
        let kick: f64 = StandardNormal.sample(&mut self.random);
        let reading = truth
            + self.errors.gain_ratio * (truth - self.errors.exact_reading)
            + self.errors.offset
            + self.errors.white_sigma * white
            + self.coloured;
        let fresh_ratio = (1.0 - self.memory_ratio * self.memory_ratio).sqrt();
        self.coloured = self.memory_ratio * self.coloured + self.errors.coloured_sigma * fresh_ratio * kick;
        reading
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The output lags a ramp by 2 zeta/w, and an underdamped sensor overshoots a step by exp(-pi zeta/sqrt(1 - zeta^2))
    /// (any textbook on second-order systems).
    #[test]
    fn ramps_are_late_and_steps_overshoot_as_the_text_book_says() {
        let of = SecondOrder { frequency_hz: 0.5, damping_ratio: 0.6 };
        let mut follower = SecondOrderFollower::new(of);
        let read: Vec<f64> =
            (0..=300).map(|i| follower.read(f64::from(i) * 0.1, f64::from(i) * 0.1)).collect();
        let w = std::f64::consts::PI;
        assert!((30.0 - read[300] - 2.0 * 0.6 / w).abs() < 1e-6, "{}", read[300]);
        let mut follower = SecondOrderFollower::new(of);
        follower.read(0.0, 0.0);
        let most = (1..2000).map(|i| follower.read(f64::from(i) * 1e-3, 1.0)).fold(0.0, f64::max);
        let expected = 1.0 + (-std::f64::consts::PI * 0.6 / (1.0f64 - 0.36).sqrt()).exp();
        assert!((most - expected).abs() < 1e-3, "{most} against {expected}");
    }

    #[test]
    fn noise_has_the_declared_size_and_memory() {
        let errors = SensorErrors {
            white_sigma: 0.8,
            coloured_sigma: 0.6,
            coloured_time_constant_s: 2.0,
            offset: 5.0,
            ..SensorErrors::default()
        };
        let mut sensor = Sensor::new(errors, 0.1, 7, 3);
        let readings: Vec<f64> = (0..200_000).map(|_| sensor.read(100.0)).collect();
        let n = readings.len() as f64;
        let mean = readings.iter().sum::<f64>() / n;
        let covariance = |lag: usize| {
            readings.iter().zip(&readings[lag..]).map(|(a, b)| (a - mean) * (b - mean)).sum::<f64>() / n
        };
        // 200 000 samples contain some 5 000 independent ones of the coloured part: a standard error of 1 %.
        assert!((mean - 105.0).abs() < 0.03, "{mean}");
        assert!((covariance(0) - 1.0).abs() < 0.04, "{}", covariance(0));
        // After one second the white part is uncorrelated and exp(-1/2) of the coloured variance remains.
        assert!((covariance(10) - 0.36 * (-0.5f64).exp()).abs() < 0.03, "{}", covariance(10));
    }

    #[test]
    fn a_seed_is_repeatable_and_streams_differ() {
        let errors = SensorErrors { white_sigma: 1.0, ..SensorErrors::default() };
        let draw = |seed, stream| Sensor::new(errors, 0.1, seed, stream).read(0.0);
        assert_eq!(draw(1, 2), draw(1, 2));
        assert_ne!(draw(1, 2), draw(1, 3));
        assert_ne!(draw(1, 2), draw(2, 2));
    }
}
