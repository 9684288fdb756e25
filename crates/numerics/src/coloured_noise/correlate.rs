//! The product with the correlation matrix of a first-order process.

/// Computes `R x` with `R_ij = exp(-|t_i - t_j| / time_constant_s)`, in one pass forwards and one backwards; in the unit of `x`. `t_s`
/// rises and is as long as `x`.
pub fn correlate(t_s: &[f64], x: &[f64], time_constant_s: f64) -> Vec<f64> {
    let decay = |i: usize| ((t_s[i - 1] - t_s[i]) / time_constant_s).exp();
    let mut sums = x.to_vec();
    let mut carried = 0.0;
    for i in 0..x.len() {
        if i > 0 {
            carried = (carried + x[i - 1]) * decay(i);
        }
        sums[i] += carried;
    }
    carried = 0.0;
    for i in (0..x.len()).rev() {
        if i + 1 < x.len() {
            carried = (carried + x[i + 1]) * decay(i + 1);
        }
        sums[i] += carried;
    }
    sums
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_passes_make_the_full_product() {
        let t_s = [0.0, 0.1, 0.4, 1.5, 1.6];
        let x = [1.0, -2.0, 0.5, 3.0, 1.0];
        let found = correlate(&t_s, &x, 0.7);
        for i in 0..5 {
            let full: f64 = (0..5).map(|j| (-(t_s[i] - t_s[j]).abs() / 0.7).exp() * x[j]).sum();
            assert!((found[i] - full).abs() < 1e-12);
        }
        assert!(correlate(&[], &[], 1.0).is_empty());
    }
}
