//! Statistics of lists of numbers.
//!
//! No function except [`range`] skips values silently. The result is `None` if there are no values, and NaN if one of them is NaN, as in numpy. To ignore
//! gaps, filter them first.

mod bounded_normal;
mod distributions;
mod moments;
mod order;
mod robust;

pub use bounded_normal::BoundedNormal;
pub use distributions::{
    CHI_SQUARE_1_95, DOUBT_SIGMAS, EXCLUDE_SIGMAS, HINT_SIGMAS, MIN_VALUES, NORMAL_95, NORMAL_975, SHARE_025,
    SHARE_975, normal_quantile, share_interval_95, student_quantile,
};
pub use moments::{mean, rms, standard_deviation};
pub use order::{median, median_of_sorted, nearest_rank, quantile, range};
pub use robust::{MEDIAN_SIZE_TO_SIGMA, robust_sigma};
