//! The verdict of a diagnosis, made once: from what the effect library explains, and from the drift.

use crate::drift::DriftReport;
use crate::gap::causes::probabilities::Posterior;
use crate::gap::causes::select::MIN_GAP_REDUCTION;
use crate::gap::library_fits::LibraryFits;
use crate::gap::preconditions::is_of_sensors;
use crate::gap::report::{Gap, Verdict};

/// How much of the gap the effect library explains.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Explained {
    /// There is no gap beyond tolerance.
    NothingToExplain,
    /// A cause leaves only noise.
    All,
    /// A cause removes most of the gap.
    Most,
    /// No cause removes most of the gap.
    Little,
}

/// How much of the gap the library explains. A named cause with a probable cause outside the library explains most of it if it removes at least
/// [`MIN_GAP_REDUCTION`] of the misfit, of its smooth part, and of the gap on held-out steps.
pub(crate) fn explained(library: &LibraryFits, posterior: &Posterior, gap: &Gap) -> Explained {
    match (posterior.probabilities.named, posterior.probabilities.unmodelled > 0.5) {
        (false, false) => return Explained::NothingToExplain,
        (false, true) => return Explained::Little,
        (true, false) => return Explained::All,
        (true, true) => {}
    }
    let (null, best) = (&library.null, library.best());
    let values = null.residual.len() as f64;
    let removed = 1.0 - (best.cost - values).max(0.0) / (null.cost - values).max(1.0);
    let [smooth_before, smooth_after] =
        [&library.adequacy_of(null), &library.adequacy].map(|adequacy| adequacy.smooth_excess);
    let smooth = 1.0 - smooth_after.max(0.0) / smooth_before.max(1.0);
    let removes_most = [removed, smooth, gap.gap_reduction].iter().all(|share| *share > MIN_GAP_REDUCTION);
    if removes_most { Explained::Most } else { Explained::Little }
}

/// After drift subtraction, unmodelled causes below this probability are ignored. The uncertainty of the drift's time history is not in any
/// tolerance, and its residual resembles a small unmodelled cause. Judgement: as sure as a correction must be
/// (`NEEDED_PROBABILITY`).
const SURELY_OUTSIDE: f64 = 0.9;

/// The verdict. No cause is named for a machine that drifts.
pub(crate) fn verdict(
    explained: Explained,
    probability_outside: f64,
    drift: Option<&DriftReport>,
) -> Verdict {
    let sensors_drift = drift.is_some_and(is_of_sensors);
    let machine_drifts = drift.is_some() && !sensors_drift;
    match explained {
        Explained::NothingToExplain => Verdict::WithinTolerance,
        Explained::All | Explained::Most if machine_drifts => Verdict::Unexplained,
        Explained::All => Verdict::Explained,
        Explained::Most => Verdict::PartlyExplained,
        Explained::Little if sensors_drift && probability_outside < SURELY_OUTSIDE => {
            Verdict::WithinTolerance
        }
        Explained::Little => Verdict::Unexplained,
    }
}
