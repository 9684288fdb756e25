//! The root of a scalar function, and the change of a condition, in an interval.

/// Finds where `f` changes sign between `low` and `high` by a mix of secant (Illinois) and bisection.
///
/// `None` if the signs at both ends are equal or a value is not finite. Converges to neighbouring floats or
/// `tolerance`, whichever is wider, in the unit of `low` and `high`; at most 200 evaluations.
///
/// Source: M. Dowell, P. Jarratt, "A modified regula falsi method for computing the root of an equation", BIT 11 (1971).
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
        // Every third step bisects, so that the bracket shrinks for any shape of the function.
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

/// Returns an interval, at most `tolerance` wide or of neighbouring floats, in which `is_low` changes from true to false. `low` and
/// `high` are finite, and `low < high`.
///
/// Bisection. The condition is assumed to be true at `low` and false at `high`, without evaluation. If it changes more than once, the
/// result contains one of the changes.
pub fn bisect(low: f64, high: f64, tolerance: f64, mut is_low: impl FnMut(f64) -> bool) -> (f64, f64) {
    let (mut low, mut high) = (low, high);
    while high - low > tolerance {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if is_low(middle) { low = middle } else { high = middle }
    }
    (low, high)
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn bisection_ends_between_neighbouring_floats_or_within_the_tolerance() {
        let (low, high) = bisect(0.0, 2.0, 0.0, |x| x * x < 2.0);
        assert!(low < high && low.next_up() == high && low * low < 2.0 && high * high >= 2.0);
        let (low, high) = bisect(0.0, 2.0, 1e-3, |x| x * x < 2.0);
        assert!(high - low <= 1e-3 && low <= 2f64.sqrt() && 2f64.sqrt() <= high);
        // Neither an interval without width nor one without an end to it loops.
        assert_eq!(bisect(1.0, 1.0, 0.0, |_| true), (1.0, 1.0));
        let (low, high) = bisect(0.0, 1.0, f64::NAN, |_| true);
        assert_eq!((low, high), (0.0, 1.0));
    }
}
