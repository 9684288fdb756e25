//! The fits of the effect library to a recording: the search, the closest causes refitted, and causes that begin later.

use crate::gap::best_fit::fit::{Adequacy, Effort, Fit, MAX_SIGMAS, adequacy};
use crate::gap::best_fit::normal::Selection;
use crate::gap::causes::additions::Calibration;
use crate::gap::causes::place::{Gain, places};
use crate::gap::causes::probabilities::{Posterior, posterior};
use crate::gap::causes::select::{
    MAX_EVIDENCE_DEFICIT, MIN_GAP_REDUCTION, Search, close, ranked, refit, search, search_onsets, supported,
};
use crate::gap::gap_reduction::Folds;
use crate::gap::preconditions::GapError;
use crate::gap::report::{Gap, MAX_REFITTED, Place, Verdict};
use crate::gap::residuals::study::{Study, members};
use crate::gap::residuals::whiten::Linearised;

#[derive(Debug)]
pub(crate) struct LibraryFits {
    pub(crate) study: Study,
    pub(crate) linearised: Linearised,
    /// Linearised at the best fit, if the nominal model is far from it.
    at_best: Option<Linearised>,
    pub(crate) folds: Folds,
    pub(crate) null: Fit,
    pub(crate) fits: Vec<Fit>,
    /// All fits of the search, best first.
    searched: Vec<Fit>,
    pub(crate) adequacy: Adequacy,
}

/// Effort of the last fits, by which causes are compared. Bound: effort; a decrease of 0.1 does not change an order of causes.
const FINAL: Effort =
    Effort { iterations: 5, enough: 0.1, max_sigmas: MAX_SIGMAS, max_sigmas_of_rig: MAX_SIGMAS, exact: true };

impl LibraryFits {
    pub(crate) fn new(
        study: Study,
        linearised: Linearised,
        calibration: &Calibration,
        progress: &dyn Fn(f64, &str),
    ) -> Result<LibraryFits, GapError> {
        let folds = Folds::of(&study);
        let everywhere = Selection::all(&study);
        let selection = &everywhere;
        let nominal =
            Search { study: &study, linearised: &linearised, selection, calibration, onsets: false };
        let found = search(nominal, progress)?;
        progress(0.65, "closest causes");
        let (at_search, members_there) = found.relinearised.unzip();
        let searched = Search { linearised: at_search.as_ref().unwrap_or(&linearised), ..nominal };
        let fits = refit(&searched, &closest(&found.fits), FINAL);
        let moved =
            fits.first().zip(members_there).filter(|(best, there)| members(&best.hypothesis) != *there);
        let at_best = moved.and_then(|(best, _)| linearised.at(&study, &best.hypothesis).ok());
        let fits = match &at_best {
            Some(at_best) => compared_at_best(&Search { linearised: at_best, ..nominal }, fits),
            None => fits,
        };
        let at_best = at_best.or(at_search);
        let best = Search { linearised: at_best.as_ref().unwrap_or(&linearised), ..nominal };
        let fits = supported(&best, fits);
        let adequacy = adequacy(&study, &linearised, fits.first().unwrap_or(&found.null));
        let fitted = LibraryFits {
            at_best,
            folds,
            null: found.null,
            fits,
            searched: found.fits,
            adequacy,
            study,
            linearised,
        };
        Ok(fitted.with_onsets(calibration, selection, progress))
    }

    /// If the best fit is not adequate: also causes that begin with a step or grow from it.
    fn with_onsets(
        mut self,
        calibration: &Calibration,
        selection: &Selection,
        progress: &dyn Fn(f64, &str),
    ) -> LibraryFits {
        if calibration.outside(self.adequacy.features()) <= 0.5 || self.folds.steps.len() < 2 {
            return self;
        }
        progress(0.8, "causes that begin");
        self.study.add_onsets();
        let linearised = self.at_best.as_ref().unwrap_or(&self.linearised);
        let at = Search { study: &self.study, linearised, selection, calibration, onsets: true };
        search_onsets(at, &self.null, &mut self.fits);
        self.fits.truncate(MAX_REFITTED);
        self.fits = supported(&at, self.fits);
        self.adequacy = adequacy(&self.study, &self.linearised, self.fits.first().unwrap_or(&self.null));
        self
    }

    pub(crate) fn posterior(&self, calibration: &Calibration) -> Posterior {
        posterior(&self.study, calibration, &self.null, &self.fits, &self.adequacy)
    }

    /// The most probable cause; the tolerances alone if there is none.
    pub(crate) fn best(&self) -> &Fit {
        self.fits.first().unwrap_or(&self.null)
    }

    /// The causes with which a closure term is tried: the best one, and the best single effect, because several imitate what is outside.
    pub(crate) fn bases(&self) -> impl Iterator<Item = &Fit> {
        let single = |fit: &&Fit| fit.hypothesis.effects.len() == 1;
        let best = self.fits.first().filter(|best| !single(best));
        best.into_iter().chain(self.fits.iter().chain(&self.searched).find(single))
    }

    pub(crate) fn at_best(&self) -> &Linearised {
        self.at_best.as_ref().unwrap_or(&self.linearised)
    }

    /// Locations of the gap by the causes of the library: by those that the data do not distinguish if a cause is named, else by all.
    pub(crate) fn locations(&self, calibration: &Calibration, posterior: &Posterior) -> Vec<Place> {
        let LibraryFits { study, linearised, null, .. } = self;
        let gain = |fit| Gain { fit, gain: null.cost - fit.cost };
        let mut gains: Vec<Gain<'_>> = self.fits.iter().map(gain).collect();
        for fit in &self.searched {
            if gains.iter().all(|other| members(&other.fit.hypothesis) != members(&fit.hypothesis)) {
                gains.push(gain(fit));
            }
        }
        let is_alike = |place: &usize, gain: &Gain<'_>| std::ptr::eq(&self.fits[*place], gain.fit);
        let rank = |gain: &Gain<'_>| posterior.alike.iter().position(|place| is_alike(place, gain));
        gains.sort_by_key(|gain| rank(gain).unwrap_or(usize::MAX));
        let named = posterior.probabilities.named.then_some(posterior.alike.len());
        places((study, calibration), linearised, null, &gains, named)
    }
}

/// The fits of the search that are compared: the best, and their members alone, since a pair is only compared fairly if these are refitted, too.
fn closest(fits: &[Fit]) -> Vec<&Fit> {
    let Some(best) = fits.first() else { return Vec::new() };
    let is_close =
        |(place, fit): &(usize, &Fit)| *place < 3 || best.score - fit.score <= MAX_EVIDENCE_DEFICIT;
    let mut closest: Vec<&Fit> =
        fits.iter().take(MAX_REFITTED).enumerate().filter(is_close).map(|(_, fit)| fit).collect();
    for effect in members(&best.hypothesis) {
        let alone = fits.iter().find(|fit| members(&fit.hypothesis) == [effect]);
        closest.extend(alone.filter(|fit| !closest.iter().any(|other| std::ptr::eq(*other, *fit))));
    }
    closest
}

/// Refits close candidates with the linearisation at the best fit, not at the nominal point.
fn compared_at_best(at_best: &Search<'_>, fits: Vec<Fit>) -> Vec<Fit> {
    let (closest, others) = fits.split_at(close(&fits[..fits.len().min(4)], MAX_EVIDENCE_DEFICIT).len());
    let again = refit(at_best, &closest.iter().collect::<Vec<_>>(), FINAL);
    ranked(at_best, again.iter().chain(closest).chain(others))
}

/// How much of the gap the library explains. A named cause with a probable cause outside the library explains most of it if it removes at least
/// [`MIN_GAP_REDUCTION`] of the misfit, of its smooth part, and of the gap on held-out steps.
pub(crate) fn explained(library: &LibraryFits, posterior: &Posterior, gap: &Gap) -> Verdict {
    match (posterior.probabilities.named, posterior.probabilities.unmodelled > 0.5) {
        (false, false) => return Verdict::WithinTolerance,
        (false, true) => return Verdict::Unexplained,
        (true, false) => return Verdict::Explained,
        (true, true) => {}
    }
    let (null, best) = (&library.null, library.best());
    let values = null.residual.len() as f64;
    let removed = 1.0 - (best.cost - values).max(0.0) / (null.cost - values).max(1.0);
    let [smooth_before, smooth_after] =
        [&adequacy(&library.study, &library.linearised, null), &library.adequacy]
            .map(|adequacy| adequacy.smooth_excess);
    let smooth = 1.0 - smooth_after.max(0.0) / smooth_before.max(1.0);
    let removes_most = [removed, smooth, gap.gap_reduction].iter().all(|share| *share > MIN_GAP_REDUCTION);
    if removes_most { Verdict::PartlyExplained } else { Verdict::Unexplained }
}
