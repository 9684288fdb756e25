//! The statistics of a handful of numbers.
//!
//! All take slices as well as iterators, and one policy holds for all of them: nothing is left out silently. Without values the answer is `None`; a NaN among the values
//! makes the answer NaN, as numpy does. Whoever wants gaps ignored filters them before.

mod bounded_normal;
mod distributions;
mod moments;
mod order;
mod robust;

pub use bounded_normal::BoundedNormal;
pub use distributions::{
    CHI_SQUARE_1_95, DOUBT_SIGMAS, EXCLUDE_SIGMAS, HINT_SIGMAS, NORMAL_95, NORMAL_975, normal_quantile,
    share_interval_95, student_quantile,
};
pub use moments::{mean, rms, standard_deviation};
pub use order::{median, median_of_sorted, nearest_rank, quantile};
pub use robust::{MEDIAN_SIZE_TO_SIGMA, robust_sigma};
