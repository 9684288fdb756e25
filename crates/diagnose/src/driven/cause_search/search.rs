//! Searches single effects and pairs that explain the judged channels, with their probabilities.

use crate::driven::cause_search::fit::{Fit, Question};
use crate::driven::cause_search::sides::side::Side;
use crate::gap::best_fit::coordinate::Coordinate;
use crate::gap::causes::calibration::Calibration;
use crate::gap::causes::weigh::prior_of_number;
use crate::gap::next_experiment::best_experiment::SETTLED;
use crate::gap::residuals::study::{Hypothesis, members};
use mapper_inference::search::{Causes, Known, Limits, Offer, extend};
use mapper_numerics::parallel;
use mapper_physics::rig::effect::EffectInfo;

/// Search result.
pub(crate) struct SearchResult {
    /// Fit of the unknowns alone.
    pub(crate) null: Fit,
    /// Singles and pairs, likeliest first.
    pub(crate) fits: Vec<Fit>,
}

/// Prior of an unmodelled cause, relative to library causes: as small as the remainder of the library priors.
pub(crate) const PRIOR_OUTSIDE: f64 = 0.1;

/// Log prior of a cause.
pub(crate) fn prior(calibration: &Calibration, asked: usize, fit: &Fit) -> f64 {
    prior_of_number(calibration, asked, fit.hypothesis.effects.len())
}

/// Evidence of a fit, including its prior.
pub(crate) fn weight(calibration: &Calibration, asked: usize, fit: &Fit) -> f64 {
    fit.score + prior(calibration, asked, fit)
}

/// Search starts for an effect: one and three typical steps from neutral, on each possible side.
fn starts(info: &EffectInfo) -> Vec<Vec<f64>> {
    let at = |share: f64| -> Vec<f64> {
        let value = |p: &mapper_physics::rig::effect::EffectParameter| {
            let coordinate = Coordinate::new(p);
            // For a parameter that spans decades a step is a factor.
            let value = if coordinate.is_logarithmic() {
                coordinate.value(coordinate.of(p.neutral + p.typical_step))
            } else {
                p.neutral + share * p.typical_step
            };
            value.clamp(p.low, p.high)
        };
        info.parameters.iter().map(value).collect()
    };
    let neutral: Vec<f64> = info.parameters.iter().map(|p| p.neutral).collect();
    let mut starts: Vec<Vec<f64>> = Vec::new();
    for share in [1.0, 3.0, -1.0] {
        let start = at(share);
        if start != neutral && !starts.contains(&start) {
            starts.push(start);
        }
    }
    starts
}

/// Judgement: limits the time. Linear gains are scaled by the model error, which a cause reduces, so all effects are tried.
const LIMITS: Limits = Limits { members: 2, starts: 3, fits: 6, slack: f64::INFINITY };

/// Fits the null, each of the effects `asked`, and the most promising pairs.
pub(crate) fn search<S: Side>(
    question: &Question<'_, S>,
    asked: &[usize],
    counts: &[bool],
    calibration: &Calibration,
) -> Option<SearchResult> {
    let search = Search { question, asked, counts, calibration };
    let null = question.fit(&question.nothing(), counts)?;
    let mut known = Known::default();
    known.keep(&search, null.clone());
    let starts_of = |effect: &usize| search.starts(&question.nothing(), *effect);
    known.fit_all(&search, &asked.iter().flat_map(starts_of).collect::<Vec<_>>());
    let best = known.ranked(&search).first().map_or(f64::NEG_INFINITY, |best| best.score);
    if best - null.score > calibration.threshold {
        extend(&search, &mut known, LIMITS);
    }
    Some(SearchResult { null, fits: known.ranked(&search) })
}

struct Search<'a, S> {
    question: &'a Question<'a, S>,
    asked: &'a [usize],
    counts: &'a [bool],
    calibration: &'a Calibration,
}

impl<S: Side> Search<'_, S> {
    fn starts(&self, base: &Hypothesis, effect: usize) -> Vec<Hypothesis> {
        let with = |values: Vec<f64>| {
            let mut start = base.clone();
            start.effects.push((effect, values));
            start
        };
        starts(self.question.effects[effect].info()).into_iter().map(with).collect()
    }
}

impl<S: Side> Causes for Search<'_, S> {
    type Fit = Fit;
    type Start = Hypothesis;

    fn members(&self, fit: &Fit) -> Vec<usize> {
        members(&fit.hypothesis)
    }

    fn family(&self, cause: usize) -> usize {
        cause
    }

    fn ln_odds(&self, fit: &Fit) -> f64 {
        weight(self.calibration, self.asked.len(), fit)
    }

    fn offers(&self, base: &Fit) -> Vec<Offer<Hypothesis>> {
        let Some(linearised) = self.question.beside(base, self.counts) else { return Vec::new() };
        let used = members(&base.hypothesis);
        let others: Vec<usize> = self.asked.iter().copied().filter(|effect| !used.contains(effect)).collect();
        let starts = others
            .iter()
            .flat_map(|cause| self.starts(&base.hypothesis, *cause).into_iter().map(|start| (*cause, start)));
        let starts: Vec<(usize, Hypothesis)> = starts.collect();
        let offered = parallel::map(&starts, |(cause, start)| {
            Some(Offer { cause: *cause, ln_gain: 0.5 * linearised.gain(start)?, start: start.clone() })
        });
        offered.into_iter().flatten().collect()
    }

    fn without(&self, fit: &Fit, cause: usize) -> Hypothesis {
        let mut start = fit.hypothesis.clone();
        start.effects.retain(|(index, _)| *index != cause);
        start
    }

    fn fit(&self, start: &Hypothesis) -> Option<Fit> {
        self.question.fit(start, self.counts)
    }

    fn goes_on(&self, _: &Fit, _: &Fit) -> bool {
        true
    }
}

/// Probabilities from scores.
pub(crate) struct CauseProbabilities {
    /// No cause.
    pub(crate) none: f64,
    /// Unmodelled cause.
    pub(crate) outside: f64,
    /// Causes by index of their fit, likeliest first; a superset of a better cause counts as that cause.
    pub(crate) causes: Vec<(usize, f64)>,
    /// Number of leading causes that cannot be distinguished.
    pub(crate) open: usize,
    /// Whether a cause is more likely than none by more than chance explains.
    pub(crate) named: bool,
}

/// Converts the search result to probabilities.
pub(crate) fn weigh(calibration: &Calibration, asked: usize, found: &SearchResult) -> CauseProbabilities {
    let all: Vec<&Fit> = std::iter::once(&found.null).chain(&found.fits).collect();
    let inside = |fit: &Fit| weight(calibration, asked, fit) + (1.0 - PRIOR_OUTSIDE).ln();
    let beyond = |fit: &Fit| fit.score_outside + prior(calibration, asked, fit) + PRIOR_OUTSIDE.ln();
    let top = all.iter().flat_map(|fit| [inside(fit), beyond(fit)]).fold(f64::NEG_INFINITY, f64::max);
    let share = |ln: f64| ((ln - top) / calibration.temperature).exp();
    let outside: f64 = all.iter().map(|fit| share(beyond(fit))).sum();
    let total = outside + all.iter().map(|fit| share(inside(fit))).sum::<f64>();
    let mut causes: Vec<(usize, f64)> = Vec::new();
    for (place, fit) in found.fits.iter().enumerate() {
        let probability = share(inside(fit)) / total;
        let effects = members(&fit.hypothesis);
        let holds = |other: usize| {
            members(&found.fits[other].hypothesis).iter().all(|effect| effects.contains(effect))
        };
        match causes.iter_mut().find(|(other, _)| holds(*other)) {
            Some((_, sum)) => *sum += probability,
            None => causes.push((place, probability)),
        }
    }
    let named = best_weight(calibration, asked, found) - weight(calibration, asked, &found.null)
        > calibration.threshold;
    let effects = |place: usize| members(&found.fits[place].hypothesis);
    let within =
        |part: usize, whole: usize| effects(part).iter().all(|effect| effects(whole).contains(effect));
    causes.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut open = if named { open_ones(&causes) } else { 0 };
    // If all open causes share one effect, that effect is the cause; the additions are too weak to detect.
    let common = causes[..open]
        .iter()
        .position(|(part, _)| causes[..open].iter().all(|(whole, _)| within(*part, *whole)));
    if let Some(common) = common.filter(|_| open > 1) {
        let together = causes[..open].iter().map(|(_, probability)| probability).sum();
        let cause = (causes[common].0, together);
        causes.splice(..open, [cause]);
        open = 1;
    }
    CauseProbabilities {
        none: share(inside(&found.null)) / total,
        outside: outside / total,
        named,
        open,
        causes,
    }
}

/// Number of leading causes that together reach the settled share of all.
fn open_ones(causes: &[(usize, f64)]) -> usize {
    let all: f64 = causes.iter().map(|(_, probability)| probability).sum();
    let mut sum = 0.0;
    let before = |(_, probability): &&(usize, f64)| {
        let open = sum < SETTLED * all;
        sum += probability;
        open
    };
    causes.iter().take_while(before).count()
}

fn best_weight(calibration: &Calibration, asked: usize, found: &SearchResult) -> f64 {
    found.fits.first().map_or(f64::NEG_INFINITY, |fit| weight(calibration, asked, fit))
}
