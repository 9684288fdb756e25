//! Roots and minima of functions.

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

/// Maximum number of evaluations. Golden section alone halves the interval in fewer than two evaluations, so the limit suffices for full
/// precision. Bound: golden section alone halves the interval in fewer than two evaluations, so the limit suffices for full precision.
const MAX_EVALUATIONS: usize = 200;
/// Golden section. Source: the smaller part of the interval, (3 - sqrt(5)) / 2.
const GOLDEN_SECTION: f64 = 0.381_966_011_250_105_1;
/// Relative distance below which values of a smooth function cannot be distinguished. Bound: the square root of the rounding error.
const RESOLUTION: f64 = 1.5e-8;

/// A minimum of a function.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Minimum {
    /// Argument, in the unit of the interval.
    pub at: f64,
    /// Value of the function.
    pub value: f64,
}

/// The minimum of `f` between `low` and `high` (finite, rising) to within `tolerance`, in the unit of the interval.
///
/// Fits parabolas through the three best points, and uses golden section if they do not help: superlinear for smooth functions, never much
/// slower than golden section. Finds one local minimum; if there may be several, search the interval on a grid first. The ends are never
/// evaluated. Values that are not finite count as larger than all others.
///
/// Source: R. P. Brent, Algorithms for Minimization without Derivatives (1973), chapter 5, procedure `localmin`.
pub fn minimise(low: f64, high: f64, tolerance: f64, mut f: impl FnMut(f64) -> f64) -> Minimum {
    let mut f = |at: f64| Minimum {
        at,
        value: Some(f(at)).filter(|value| value.is_finite()).unwrap_or(f64::INFINITY),
    };
    let (mut a, mut b) = (low, high);
    let mut best = f(a + GOLDEN_SECTION * (b - a));
    // The second best, and the previous second best.
    let (mut second, mut third) = (best, best);
    // The last two steps.
    let (mut step, mut step_before) = (0.0f64, 0.0f64);
    for _ in 1..MAX_EVALUATIONS {
        let middle = 0.5 * (a + b);
        let min_step = RESOLUTION * best.at.abs() + tolerance / 3.0;
        if (best.at - middle).abs() <= 2.0 * min_step - 0.5 * (b - a) {
            break;
        }
        let parabola = if step_before.abs() > min_step { parabola(best, second, third) } else { None };
        let allowed = |step: &f64| {
            let at = best.at + step;
            step.abs() < 0.5 * step_before.abs() && at > a && at < b
        };
        (step, step_before) = match parabola.filter(allowed) {
            Some(found) => {
                // Keep a distance from the ends.
                let at = best.at + found;
                let inside = at - a >= 2.0 * min_step && b - at >= 2.0 * min_step;
                (if inside { found } else { min_step.copysign(middle - best.at) }, step)
            }
            None => {
                let part = if best.at < middle { b - best.at } else { a - best.at };
                (GOLDEN_SECTION * part, part)
            }
        };
        // Keep a distance from the best point: closer values cannot be distinguished.
        let next = f(best.at + if step.abs() >= min_step { step } else { min_step.copysign(step) });
        if next.value <= best.value {
            if next.at < best.at {
                b = best.at
            } else {
                a = best.at
            }
            (third, second, best) = (second, best, next);
            continue;
        }
        if next.at < best.at {
            a = next.at
        } else {
            b = next.at
        }
        if next.value <= second.value || second.at == best.at {
            (third, second) = (second, next);
        } else if next.value <= third.value || third.at == best.at || third.at == second.at {
            third = next;
        }
    }
    best
}

/// Step from `best` to the vertex of the parabola through the three points; `None` if they are on a line.
fn parabola(best: Minimum, second: Minimum, third: Minimum) -> Option<f64> {
    let r = (best.at - second.at) * (best.value - third.value);
    let q = (best.at - third.at) * (best.value - second.value);
    let p = (best.at - third.at) * q - (best.at - second.at) * r;
    let step = -p / (2.0 * (q - r));
    step.is_finite().then_some(step)
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

#[cfg(test)]
mod minimise_tests {
    use super::*;

    #[test]
    fn finds_known_minima() {
        // Closed forms; a parabola's minimum is known to the root of the rounding only.
        let found = minimise(-3.0, 5.0, 1e-9, |x| (x - 1.25) * (x - 1.25) + 0.5);
        assert!((found.at - 1.25).abs() < 1e-7 && (found.value - 0.5).abs() < 1e-14);
        let found = minimise(0.0, 3.0, 1e-9, |x: f64| x - x.ln());
        assert!((found.at - 1.0).abs() < 1e-7);
        let found = minimise(0.0, 2.0, 1e-9, |x: f64| (x - 0.7).abs());
        assert!((found.at - 0.7).abs() < 1e-7);
    }

    /// scipy: `scipy.optimize.minimize_scalar(lambda x: numpy.exp(x) - 4*x + numpy.sin(3*x), bounds=(0, 4), method="bounded",
    /// options={"xatol": 1e-10})`.
    #[test]
    fn agrees_with_scipy() {
        let found = minimise(0.0, 4.0, 1e-9, |x: f64| x.exp() - 4.0 * x + (3.0 * x).sin());
        assert!((found.at - 1.511300677286165).abs() < 1e-7, "{found:?}");
        assert!((found.value - -2.496693715646814).abs() < 1e-13, "{found:?}");
    }

    #[test]
    fn a_minimum_at_an_end_is_approached_to_the_tolerance() {
        let found = minimise(2.0, 5.0, 1e-6, |x| x);
        assert!(found.at - 2.0 < 2e-6 && found.at >= 2.0);
        let found = minimise(2.0, 5.0, 1e-6, |x| -x);
        assert!(5.0 - found.at < 2e-6 && found.at <= 5.0);
    }

    #[test]
    fn smooth_functions_take_few_evaluations_and_broken_ones_end() {
        let mut evaluations = 0;
        minimise(-3.0, 5.0, 1e-8, |x| {
            evaluations += 1;
            (x - 1.25).powi(2)
        });
        // Golden section alone needs ln(8e8)/ln(1.618) = 43.
        assert!(evaluations < 15, "{evaluations}");
        assert!(minimise(0.0, 1.0, 1e-9, |_| f64::NAN).value.is_infinite());
        let found = minimise(0.0, 1.0, 1e-9, |x| if x < 0.5 { f64::NAN } else { x });
        assert!((found.at - 0.5).abs() < 1e-6, "{found:?}");
        minimise(1.0, 1.0, 0.0, |x| x);
    }
}
