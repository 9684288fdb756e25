//! Turns residuals whose noise is white plus first-order into independent ones of unit variance.
//!
//! The innovations of a Kalman filter whose state is the first-order part: the same linear recursion for a residual and
//! for each of its derivatives, and gaps in time cost nothing.

use crate::NoiseColour;

/// Gains of the filter along the rows of a step.
#[derive(Debug, Clone, Default)]
pub(crate) struct Whitening {
    /// Memory from the row before, gain, and one over the innovation's standard deviation.
    gains: Vec<[f64; 3]>,
}

/// Variances of a row's noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct RowNoise {
    pub(crate) white: f64,
    pub(crate) first_order: f64,
}

impl RowNoise {
    /// Noise of the mean of `count` samples over `block_s`, whose samples have standard deviation 1 each.
    ///
    /// Means of a first-order process over blocks of w correlate as `(tau/w)^2 (2 cosh(w/tau) - 2) e^(-k w/tau)`, so this
    /// is the first-order part; what the mean's own variance has less than that is taken from the white part.
    pub(crate) fn of_mean(colour: NoiseColour, count: f64, block_s: f64) -> Self {
        let share = colour.first_order_share_ratio * colour.first_order_share_ratio;
        let x = block_s / colour.time_constant_s;
        let white = (1.0 - share) / count.max(1.0);
        if x < 1e-4 || count < 2.0 {
            return RowNoise { white: white.max(1e-3), first_order: share };
        }
        let first_order = share * (2.0 * x.cosh() - 2.0) / (x * x);
        let own = share * 2.0 * (x - 1.0 + (-x).exp()) / (x * x);
        // Never quite without: a filter that trusts rows without end is no use.
        RowNoise { white: (white + own - first_order).max(0.02 * (white + own)), first_order }
    }
}

impl Whitening {
    /// For rows at `t_s` with the standard deviation `sigma` of a single sample, of whose white part only that of
    /// `white_sigma` is left.
    pub(crate) fn new(
        t_s: impl Iterator<Item = f64>,
        noise: impl Iterator<Item = RowNoise>,
        colour: NoiseColour,
        sigma: f64,
        white_sigma: f64,
    ) -> Self {
        let white_ratio = (white_sigma / sigma).powi(2);
        let mut last_s = f64::NEG_INFINITY;
        let mut spread = 0.0;
        let gains = t_s
            .zip(noise)
            .map(|(t_s, noise)| {
                let memory = ((last_s - t_s) / colour.time_constant_s).exp();
                let first_order = noise.first_order;
                spread = memory * memory * spread + (1.0 - memory * memory) * first_order;
                let innovation = spread + noise.white * white_ratio;
                let gain = spread / innovation;
                spread *= 1.0 - gain;
                last_s = t_s;
                [memory, gain, 1.0 / (sigma * innovation.sqrt())]
            })
            .collect();
        Whitening { gains }
    }

    /// Whitens a column in place.
    pub(crate) fn apply(&self, column: &mut [f64]) {
        let mut state = 0.0;
        for (value, [memory, gain, scale]) in column.iter_mut().zip(&self.gains) {
            state *= memory;
            let innovation = *value - state;
            state += gain * innovation;
            *value = innovation * scale;
        }
    }
}
