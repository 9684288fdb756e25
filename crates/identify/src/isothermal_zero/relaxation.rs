//! Extrapolates a relaxing reading to its limit: a stopped housing reaches the cell's temperature within an hour, a soak is shorter.

/// Time constants of stopped turbocharger housings, s. Bound: 1 to 2 kg of aluminium at 1 to 2 W/K. Longer ones, which the readings
/// cannot exclude, would bias the limit.
const TIME_CONSTANTS_S: [f64; 5] = [400.0, 550.0, 700.0, 900.0, 1200.0];
/// Prior standard deviation of the initial distance from the limit, K. Bound: ten times the non-uniformity of a finished soak.
const START_SIGMA_K: f64 = 3.0;

/// Distance of a typical housing from its limit after `t_s` of soak, K: a kelvin at the beginning, with the middle time constant. A housing
/// that settled long ago determines no time constant and needs none; the limit of this one is the least certain.
pub(crate) fn usual_k(t_s: f64) -> f64 {
    (-t_s / TIME_CONSTANTS_S[TIME_CONSTANTS_S.len() / 2]).exp()
}

/// The limit of `values` (at `t_s`, each with the standard error `sigma`) under `limit + start exp(-t/tau)`, and its standard error. Limit and
/// start are found by least squares for each time constant, and averaged with the posterior weights of the time constants. `None` for fewer
/// than six values.
pub(crate) fn limit(t_s: &[f64], values: &[f64], sigma: f64) -> Option<(f64, f64)> {
    let first_s = *t_s.first()?;
    if values.len() < 6 || values.len() != t_s.len() || sigma.is_nan() || sigma <= 0.0 {
        return None;
    }
    // Relative to the first value, so that sums of squares keep their digits.
    let origin = *values.first()?;
    let weight = sigma.powi(-2);
    let fits: Vec<(f64, f64, f64)> = TIME_CONSTANTS_S
        .iter()
        .map(|tau_s| {
            let (mut n, mut e1, mut e2, mut y1, mut ey) = (0.0, 0.0, START_SIGMA_K.powi(-2), 0.0, 0.0);
            let mut y2 = 0.0;
            for (t, value) in t_s.iter().zip(values) {
                let (e, y) = ((-(t - first_s) / tau_s).exp(), value - origin);
                n += weight;
                e1 += weight * e;
                e2 += weight * e * e;
                y1 += weight * y;
                ey += weight * e * y;
                y2 += weight * y * y;
            }
            let determinant = n * e2 - e1 * e1;
            let (limit, start) = ((e2 * y1 - e1 * ey) / determinant, (n * ey - e1 * y1) / determinant);
            let square = y2 - limit * y1 - start * ey;
            (limit, e2 / determinant, -0.5 * (square + determinant.ln()))
        })
        .collect();
    let best = fits.iter().map(|(.., log)| *log).fold(f64::NEG_INFINITY, f64::max);
    let total: f64 = fits.iter().map(|(.., log)| (log - best).exp()).sum();
    let share = |log: f64| (log - best).exp() / total;
    let mean: f64 = fits.iter().map(|(limit, _, log)| share(*log) * limit).sum();
    let variance: f64 =
        fits.iter().map(|(limit, own, log)| share(*log) * (own + (limit - mean).powi(2))).sum();
    (mean.is_finite() && variance.is_finite()).then_some((origin + mean, variance.sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64;

    /// 0.5 K above the cell at the beginning, 0.09 K at the end: the mean of the last half would be wrong by 0.14 K.
    #[test]
    fn the_limit_is_found_and_its_error_is_that_of_many_draws() {
        let t_s: Vec<f64> = (0..40).map(|i| 30.0 * f64::from(i)).collect();
        let mut random = Pcg64::seed_from_u64(1);
        let (mut squares, mut claimed) = (0.0, 0.0);
        for _ in 0..200 {
            let mut noise = || -> f64 { StandardNormal.sample(&mut random) };
            let values: Vec<f64> =
                t_s.iter().map(|t| 298.15 + 0.5 * (-t / 680.0).exp() + 0.03 * noise()).collect();
            let (found, sigma) = limit(&t_s, &values, 0.03).unwrap();
            squares += (found - 298.15).powi(2) / 200.0;
            claimed += sigma * sigma / 200.0;
        }
        // Half the error of the mean; such data determine the time constant to a factor of two.
        assert!(squares.sqrt() < 0.07, "{} K rms", squares.sqrt());
        // 200 draws determine their standard deviation to 5 %; the weights of five time constants are only an approximate posterior.
        let ratio = (squares / claimed).sqrt();
        assert!((0.75..1.25).contains(&ratio), "errors are {ratio} of what is claimed");
    }

    /// The forecast standard error of a typical housing equals that of random draws: after half an hour it is four times that after an hour.
    #[test]
    fn the_error_of_a_usual_housing_is_that_of_readings_without_noise() {
        let mut random = Pcg64::seed_from_u64(2);
        let sigma_k = 0.03;
        let mut forecasts = Vec::new();
        for soak_s in [1800.0, 3600.0] {
            let blocks = (2.0 / 3.0 * soak_s / 30.0) as usize;
            let t_s: Vec<f64> = (0..blocks).map(|i| soak_s / 3.0 + 30.0 * (i as f64 + 0.5)).collect();
            let still: Vec<f64> = t_s.iter().map(|t_s| usual_k(*t_s)).collect();
            let (_, forecast) = limit(&t_s, &still, sigma_k).unwrap();
            let claimed = (0..100).map(|_| {
                let mut noise = || -> f64 { StandardNormal.sample(&mut random) };
                let values: Vec<f64> = still.iter().map(|value| value + sigma_k * noise()).collect();
                limit(&t_s, &values, sigma_k).unwrap().1
            });
            let claimed = claimed.sum::<f64>() / 100.0;
            // Each draw gives the time constants different weights.
            assert!((0.8..1.25).contains(&(claimed / forecast)), "{soak_s} s: {claimed} K of {forecast} K");
            forecasts.push(forecast);
        }
        assert!((3.0..6.0).contains(&(forecasts[0] / forecasts[1])), "{forecasts:?}");
    }

    #[test]
    fn a_reading_that_rests_is_its_own_limit() {
        let t_s: Vec<f64> = (0..40).map(|i| 30.0 * f64::from(i)).collect();
        let (found, sigma) = limit(&t_s, &[301.5; 40], 0.01).unwrap();
        assert!((found - 301.5).abs() < 1e-9 && sigma < 0.02, "{found} +/- {sigma} K");
        assert_eq!(limit(&t_s[..5], &[301.5; 5], 0.01), None);
    }
}
