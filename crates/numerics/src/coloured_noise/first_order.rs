//! Correlation and means of a first-order process.

/// Length in time constants below which the series of the mean's variance replaces the formula, which subtracts nearly equal numbers. Bound:
/// the series is accurate to 1e-14 there.
const SERIES_BELOW: f64 = 0.02;
/// Length below which the factor of the covariance is 1. Bound: the next term of its series is x^2 / 12.
pub(super) const CONSTANT_BELOW: f64 = 1e-4;

/// Correlation of two values of the process `apart_s` apart; 0 for a process without memory.
pub fn memory(apart_s: f64, time_constant_s: f64) -> f64 {
    if time_constant_s > 0.0 { (-apart_s.abs() / time_constant_s).exp() } else { 0.0 }
}

/// Variance of the process's mean over `length_s`, in the unit of `variance`. `variance` is that of a single value.
///
/// `variance * 2 (x - 1 + exp(-x)) / x^2` with `x` the length in time constants: the integral of the correlation over the
/// square of the length.
pub fn variance_of_mean(variance: f64, length_s: f64, time_constant_s: f64) -> f64 {
    if length_s <= 0.0 {
        return variance;
    }
    let x = length_s / time_constant_s;
    if time_constant_s <= 0.0 || x.is_infinite() {
        return 0.0;
    }
    if x < SERIES_BELOW {
        let series = [-2.0 / 5040.0, 2.0 / 720.0, -2.0 / 120.0, 2.0 / 24.0, -2.0 / 6.0, 1.0];
        return variance * series.into_iter().fold(0.0, |sum, term| sum * x + term);
    }
    variance * 2.0 * (x - 1.0 + (-x).exp()) / (x * x)
}

/// Factor of the covariance of the process's means over two blocks of `length_s` each: blocks `k` apart (at least 1) have the
/// covariance `block_covariance * memory(k * length_s)`.
///
/// `variance * (2 cosh(x) - 2) / x^2` with `x` the length in time constants. In the unit of `variance`; it grows
/// without bound with the length, as the memory falls. For a time constant of 0 it is infinite.
pub fn block_covariance(variance: f64, length_s: f64, time_constant_s: f64) -> f64 {
    let x = length_s / time_constant_s;
    if x < CONSTANT_BELOW {
        return variance;
    }
    variance * (2.0 * x.cosh() - 2.0) / (x * x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The double integral by scipy, half of it by symmetry: `2*scipy.integrate.dblquad(lambda t, s: numpy.exp(-(s-t)/2), 0, L,
    /// 0, lambda s: s, epsabs=1e-15, epsrel=1e-13)[0]/L**2` for L = 0.02, 1, 30 s.
    #[test]
    fn the_variance_of_a_mean_is_the_double_integral() {
        for (length_s, expected) in SCIPY {
            let found = variance_of_mean(1.0, length_s, 2.0);
            assert!((found / expected - 1.0).abs() < 1e-9, "{length_s} s: {found} for {expected}");
        }
    }

    const SCIPY: [(f64, f64); 3] =
        [(0.02, 0.9966749833610715), (1.0, 0.8522452777010673), (30.0, 0.1244444471635762)];

    #[test]
    fn it_goes_from_the_variance_itself_to_nothing() {
        assert_eq!(variance_of_mean(3.0, 0.0, 2.0), 3.0);
        assert_eq!(variance_of_mean(3.0, 1.0, 0.0), 0.0);
        assert_eq!(variance_of_mean(3.0, f64::INFINITY, 2.0), 0.0);
        // Series and formula meet where the one follows the other; the formula has 1e-12 there.
        let (below, above) = (variance_of_mean(1.0, 0.02 - 1e-13, 1.0), variance_of_mean(1.0, 0.02, 1.0));
        assert!((below - above).abs() < 2e-12, "{below} {above}");
    }

    /// The variance of the mean over two blocks is that over the whole.
    #[test]
    fn two_blocks_make_one_of_twice_the_length() {
        for length_s in [0.1, 1.0, 4.0] {
            let own = variance_of_mean(1.0, length_s, 2.0);
            let mixed = block_covariance(1.0, length_s, 2.0) * memory(length_s, 2.0);
            let whole = variance_of_mean(1.0, 2.0 * length_s, 2.0);
            assert!((0.5 * (own + mixed) - whole).abs() < 1e-12, "{length_s}");
        }
    }

    #[test]
    fn memory_is_even_and_falls() {
        assert_eq!(memory(0.0, 2.0), 1.0);
        assert!((memory(-2.0, 2.0) - std::f64::consts::E.recip()).abs() < 1e-15);
        assert_eq!(memory(2.0, 2.0), memory(-2.0, 2.0));
        assert_eq!(memory(0.0, 0.0), 0.0);
    }
}
