//! Forecast of the verdicts of a campaign before its run, and the cheapest changes that improve them.

use crate::SessionError;
use crate::plan::needed_dwell::needed_dwell_s;
use crate::recording::identification_config::identification;
use crate::rig::drive::soak_s;
use mapper_campaign::Campaign;
use mapper_core::{
    Advice, CampaignChange, Dwell, Method, OperatingPoint, Plan, PlanStep, Soak, StepKind,
    UndeclaredForecast, VerdictForecast, WindowRule,
};
use mapper_identify::MAX_RESTING_ETA;
use mapper_numerics::statistics::rms;

/// Dwells that are tried, relative to the dwell of the campaign. Longer ones would make the run impractical.
const DWELL_RATIOS: [f64; 6] = [1.25, 1.5, 2.0, 2.5, 3.0, 4.0];
/// Soaks that are tried, s. A cold machine settles in half an hour.
const SOAKS_S: [f64; 2] = [1800.0, 3600.0];
/// Measured over forecast error that rests on the declaration: 0.9 to 1.3 in 13 of 14 campaigns of `benches/advice.py` with a dwell of 12
/// to 18 s; a tenth is added at both ends.
const RESTING_RATIOS: (f64, f64) = (0.8, 1.4);
/// Measured over forecast standard error of the efficiencies (rms): 0.87 to 1.63 on 36 machines of `benches/first_campaign.py` (200 to 259)
/// without alpha_A. It depends on the noise. With alpha_A it lies between this forecast and [`UndeclaredForecast`].
const ERROR_RATIOS: (f64, f64) = (0.85, 1.65);
/// Gain of the advice that is listed, relative to the largest. Judgement: a cheap change that makes few points good is not worth a second run.
const MIN_GAIN_RATIO: f64 = 0.5;

/// Expected verdicts of the points of `plan`; `None` if the campaign's method does not identify all steps together.
pub(crate) fn forecast_verdicts(campaign: &Campaign, plan: &Plan) -> Option<VerdictForecast> {
    let settings = &campaign.identification;
    if settings.method != Method::Joint || campaign.sequence.is_some() {
        return None;
    }
    let limit = identification(campaign).thresholds.sigma_eta;
    let informative = plan.figures.rms_error_eta.is_some();
    let settles =
        |step: &PlanStep| settings.window != WindowRule::Auto || needed_dwell_s(step, true) <= step.dwell_s;
    // The first point is visited again at the end; the better visit goes onto the map.
    let best_visits = |sigma_of: fn(&PlanStep) -> f64| {
        let mut best: Vec<(OperatingPoint, f64)> = Vec::new();
        for step in plan.steps.iter().filter(|step| step.kind != StepKind::Repeat) {
            let sigma = if settles(step) { sigma_of(step) } else { f64::INFINITY };
            match best.iter_mut().find(|(point, _)| *point == step.to) {
                Some((_, least)) if step.from.is_some() => *least = least.min(sigma),
                Some(_) => {}
                None => best.push((step.to, sigma)),
            }
        }
        best
    };
    let best = best_visits(|step| step.predicted.reported_sigma_eta.unwrap_or(0.0));
    let good = |error_ratio: f64| best.iter().filter(|(_, sigma)| error_ratio * sigma <= limit).count();
    let of_steps = plan.steps.iter().filter_map(|step| step.predicted.undeclared_sigma_eta);
    let undeclared = rms(of_steps).map(|eta_standard_error| {
        let best = best_visits(|step| step.predicted.undeclared_sigma_eta.unwrap_or(0.0));
        let good = best.iter().filter(|(_, sigma)| *sigma <= limit).count();
        UndeclaredForecast { good, eta_standard_error }
    });
    let resting_eta = plan.figures.resting_eta.unwrap_or(0.0);
    let is_enough = |resting_ratio: f64| resting_ratio * resting_eta <= MAX_RESTING_ETA;
    let (low, high) =
        (informative && is_enough(RESTING_RATIOS.1), informative || is_enough(RESTING_RATIOS.0));
    Some(VerdictForecast {
        points: best.len(),
        good: if informative { good(1.0) } else { 0 },
        good_low: if low { good(ERROR_RATIOS.1) } else { 0 },
        good_high: if high { good(ERROR_RATIOS.0) } else { 0 },
        near_limit: high && !low,
        eta_standard_error: plan.figures.rms_error_reported_eta.filter(|_| informative),
        undeclared: undeclared.filter(|_| informative),
        duration_s: soak_s(campaign) + plan.duration_s(),
    })
}

/// Changes of the campaign after which more points are surely good than `now`, the cheapest first. At most one dwell and one soak are listed:
/// the first that makes all points good, otherwise the one with the most good points; a change that gains much less than the other is omitted.
pub(crate) fn advise(
    campaign: &Campaign,
    now: VerdictForecast,
    plan: impl Fn(&Campaign) -> Result<Plan, SessionError>,
) -> Result<Vec<Advice>, SessionError> {
    let dwells = campaign.timing.dwell.fixed_s().into_iter().flat_map(|dwell_s| {
        // Whole seconds, as campaigns have them.
        DWELL_RATIOS.map(|ratio| CampaignChange::DwellS((ratio * dwell_s).ceil()))
    });
    let soaks = SOAKS_S.into_iter().filter(|s| *s > soak_s(campaign)).map(CampaignChange::SoakS);
    let mut advice: Vec<Advice> = Vec::new();
    for changes in [dwells.collect::<Vec<_>>(), soaks.collect()] {
        let mut best: Option<Advice> = None;
        for change in changes {
            let changed = with_change(campaign, change);
            let Some(forecast) = forecast_verdicts(&changed, &plan(&changed)?) else { continue };
            if sort_key(forecast) > sort_key(best.map_or(now, |best| best.forecast)) {
                best = Some(Advice { change, forecast });
            }
            if forecast.good_low == forecast.points {
                break;
            }
        }
        advice.extend(best);
    }
    let gain = |advice: &Advice| advice.forecast.good_low as f64 - now.good_low as f64;
    let largest = advice.iter().map(gain).fold(0.0, f64::max);
    advice.retain(|advice| gain(advice) > 0.0 && gain(advice) >= MIN_GAIN_RATIO * largest);
    advice.sort_by(|a, b| a.forecast.duration_s.total_cmp(&b.forecast.duration_s));
    Ok(advice)
}

/// Order of forecasts: by points that are surely good, then by those that are expected to be.
fn sort_key(forecast: VerdictForecast) -> (usize, usize) {
    (forecast.good_low, forecast.good)
}

/// The campaign after `change`.
fn with_change(campaign: &Campaign, change: CampaignChange) -> Campaign {
    let mut changed = campaign.clone();
    match change {
        CampaignChange::DwellS(dwell_s) => changed.timing.dwell = Dwell::Fixed(dwell_s),
        CampaignChange::SoakS(duration_s) => {
            let usual = Soak {
                duration_s,
                oil_temperature_k: campaign.boundary.ambient_temperature_k,
                temperature_sigma_k: Soak::TEMPERATURE_SIGMA_K,
                pressure_sigma_pa: Soak::PRESSURE_SIGMA_PA,
            };
            changed.zero = Some(Soak { duration_s, ..campaign.zero.unwrap_or(usual) });
        }
    }
    changed
}
