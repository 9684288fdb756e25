//! A second-order sensor: a pressure line, a meter with its filter, a probe in its sheath.

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
}
