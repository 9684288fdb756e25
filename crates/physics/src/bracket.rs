//! Root of a scalar function within a bracket.

/// Finds where `f` changes sign between `low` and `high` by the ITP-like mix of secant (Illinois) and bisection.
///
/// Returns `None` where the signs at both ends are equal or a value is not finite. Converges to neighbouring floats
/// or `tolerance`, whichever is wider; at most 200 evaluations.
pub fn root_between(low: f64, high: f64, tolerance: f64, mut f: impl FnMut(f64) -> f64) -> Option<f64> {
    let (mut a, mut b) = (low, high);
    let (mut fa, mut fb) = (f(a), f(b));
    if fa == 0.0 {
        return Some(a);
    }
    if fb == 0.0 {
        return Some(b);
    }
    if !(fa.is_finite() && fb.is_finite()) || fa.signum() == fb.signum() {
        return None;
    }
    for iteration in 0..200 {
        let width = b - a;
        if width.abs() <= tolerance.max(4.0 * f64::EPSILON * b.abs()) {
            break;
        }
        let secant = b - fb * width / (fb - fa);
        // Every third step bisects, so that the bracket halves however bent the function is.
        let inside = iteration % 3 != 2 && (secant - a) * (secant - b) < 0.0;
        let x = if inside { secant } else { a + 0.5 * width };
        let fx = f(x);
        if fx == 0.0 {
            return Some(x);
        }
        if !fx.is_finite() {
            return None;
        }
        if fx.signum() == fb.signum() {
            // Illinois: halve the weight of the end that stays.
            fa *= 0.5;
        } else {
            (a, fa) = (b, fb);
        }
        (b, fb) = (x, fx);
    }
    Some(b)
}

#[cfg(test)]
mod tests {
    use super::root_between;

    #[test]
    fn finds_known_roots_and_refuses_brackets_without_one() {
        let root = root_between(0.0, 2.0, 0.0, |x| x * x - 2.0).unwrap();
        assert!((root - 2f64.sqrt()).abs() < 1e-15);
        // Infinite slope at the root.
        let root = root_between(-1.0, 3.0, 0.0, |x: f64| (x - 1.0).cbrt()).unwrap();
        assert!((root - 1.0).abs() < 1e-14);
        assert_eq!(root_between(1.0, 2.0, 0.0, |x| x * x), None);
        assert_eq!(root_between(-1.0, 1.0, 0.0, |_| f64::NAN), None);
    }
}
