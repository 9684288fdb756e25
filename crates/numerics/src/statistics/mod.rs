//! Statistics of lists of numbers.
//!
//! All functions take slices and iterators, and none skips values silently. Without values the result is `None`; a NaN among the values
//! makes the result NaN, as in numpy. To ignore gaps, filter them first.

mod bounded_normal;
mod distributions;
mod moments;
mod order;
mod robust;

pub use bounded_normal::BoundedNormal;
pub use distributions::{
    CHI_SQUARE_1_95, DOUBT_SIGMAS, EXCLUDE_SIGMAS, HINT_SIGMAS, MIN_VALUES, NORMAL_95, NORMAL_975,
    normal_quantile, share_interval_95, student_quantile,
};
pub use moments::{mean, rms, standard_deviation};
pub use order::{median, median_of_sorted, nearest_rank, quantile};
pub use robust::{MEDIAN_SIZE_TO_SIGMA, robust_sigma};
