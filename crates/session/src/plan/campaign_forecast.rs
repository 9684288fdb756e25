//! Verdicts to expect from a campaign before its run, and the changes that make more points good.

use crate::plan::planning::{PlanInputs, plan_of};
use crate::plan::rehearsal::rehearse;
use crate::recording::identification_config::identification;
use crate::rig::drive::soak_s;
use crate::run::preflight::calibration_concerns;
use crate::{Session, SessionError};
use mapper_campaign::campaign::Date;
use mapper_campaign::{Campaign, Concern};
use mapper_core::{
    Advice, CampaignChange, Dwell, Method, OperatingPoint, Plan, PlanRemark, PlanStep, Soak, StepKind,
    UndeclaredForecast, VerdictForecast, WindowRule,
};
use mapper_identify::{MAX_PRIOR_SENSITIVITY_ETA, ZeroSettings};
use mapper_numerics::statistics::rms;
use mapper_physics::laws::housing::{StandstillState, relax};
use mapper_physics::laws::thermocouple::time_constant_s;
use mapper_physics::simulation::model::Model;
use mapper_planner::{PlanRequest, max_steps};
use mapper_report::{Message, guard_trip_text};

/// Assumed temperature difference between cold housings and test cell, K. The zero uses the same value to find the limit that Tc relaxes to.
const WARM_K: f64 = 3.0;
/// Longest soak tried, s.
const LONGEST_SOAK_S: f64 = 86_400.0;
/// Spacing of the soaks tried, s.
const SOAK_STEP_S: f64 = 300.0;

/// Minimum window length in time constants of the T2 probe. The effect of the preceding step is then below 1 %.
const PROBE_TIME_CONSTANTS: f64 = 5.0;

/// Maximum number of points for which all steps are simulated to find concerns. Larger grids are sampled at every n-th point, so that the
/// forecast takes seconds.
const MAX_SIMULATED_POINTS: usize = 200;

/// Effort of the search for the order after a change that is tried: the expected verdicts hardly depend on the order.
const QUICK_EFFORT: f64 = 0.05;

#[derive(Debug)]
pub struct CampaignForecast {
    /// Number of steps; the upper bound if the grid is too large to plan here.
    pub steps: usize,
    pub is_planned: bool,
    /// Rig time from the start of the soak to the end of the cool-down, s; the maximum if the number of steps is an upper bound.
    pub duration_s: f64,
    pub concerns: Vec<Concern>,
    /// Expected verdicts of the points; `None` for a script and for methods other than `joint`.
    pub verdicts: Option<VerdictForecast>,
    pub avoided: Option<PlanRemark>,
    /// Changes after which more points are expected to be good, the cheapest first.
    pub advice: Vec<Advice>,
}

impl Session<'_> {
    /// Simulates the steps of the campaign, or rehearses its script, and looks for settings without a result and outdated calibrations.
    pub fn forecast_campaign(
        &self,
        campaign: &Campaign,
        model: &Model,
        day: Option<Date>,
    ) -> Result<CampaignForecast, SessionError> {
        let every = campaign.points.len().div_ceil(MAX_SIMULATED_POINTS).max(1);
        let plan = match &campaign.sequence {
            None => plan_of_sample(campaign, model, every, 1.0)?,
            Some(source) => rehearse(self, campaign, model, source)?.plan,
        };
        let concerns = [
            soak_concern(campaign),
            settling_concern(campaign, &plan),
            probe_concern(campaign, &plan),
            required_error_concern(campaign, &plan),
            self.guard_concern(campaign, model, &plan)?,
            information_concern(campaign, &plan),
            avoided_concern(&plan),
        ];
        let calibrations = calibration_concerns(campaign, model, day);
        let verdicts = forecast_verdicts(campaign, &plan);
        let advice = match verdicts {
            Some(now) if now.good_low < now.points => {
                advise(campaign, now, |changed| plan_of_sample(changed, model, every, QUICK_EFFORT))?
            }
            _ => Vec::new(),
        };
        let is_planned = every == 1 || campaign.sequence.is_some();
        let (steps, duration_s) = if is_planned {
            (plan.steps.len(), plan.duration_s())
        } else {
            let inputs = PlanInputs::of(campaign)?;
            let steps = max_steps(&inputs.request(campaign, model));
            let dwell_s = plan.steps.first().map_or(0.0, |step| step.dwell_s);
            (steps, plan.warm_up_s + plan.cool_down_s + plan.surge_search_s + steps as f64 * dwell_s)
        };
        Ok(CampaignForecast {
            steps,
            is_planned,
            duration_s: soak_s(campaign) + duration_s,
            concerns: calibrations.into_iter().chain(concerns.into_iter().flatten()).collect(),
            verdicts,
            avoided: plan.avoided_crossing(),
            advice,
        })
    }
}

impl Session<'_> {
    fn guard_concern(
        &self,
        campaign: &Campaign,
        model: &Model,
        plan: &Plan,
    ) -> Result<Option<Concern>, SessionError> {
        // The rehearsal of a script has already passed the guards.
        if campaign.sequence.is_some() {
            return Ok(None);
        }
        let trip = self.forecast_guard_trip(campaign, model, plan)?;
        Ok(trip.map(|remark| {
            let (trip, remedy) = guard_trip_text(&remark);
            Concern::warning(&["limits"], trip, remedy)
        }))
    }
}

fn plan_of_sample(
    campaign: &Campaign,
    model: &Model,
    every: usize,
    effort: f64,
) -> Result<Plan, SessionError> {
    let inputs = PlanInputs::of(campaign)?;
    let mut request = PlanRequest { effort, ..inputs.request(campaign, model) };
    if let Dwell::TimeBudget(budget_s) = request.timing.dwell {
        let share = max_steps(&request) as f64;
        let fixed_s = request.timing.warm_up_s + request.timing.cool_down_s;
        if every > 1 {
            request.timing.dwell = Dwell::Fixed(((budget_s - fixed_s) / share).max(1.0));
        }
    }
    let points: Vec<_> = campaign.points.iter().copied().step_by(every).collect();
    plan_of(campaign, &PlanRequest { points: &points, ..request })
}

struct SoakingHousings<'a> {
    campaign: &'a Campaign,
    soak: Soak,
    settings: ZeroSettings,
}

impl<'a> SoakingHousings<'a> {
    /// `None` without a zero.
    fn of(campaign: &'a Campaign) -> Option<Self> {
        let soak = campaign.zero?;
        Some(SoakingHousings { campaign, soak, settings: ZeroSettings::from(soak) })
    }

    fn difference_k(&self, after_s: f64) -> f64 {
        let ambient_k = self.campaign.boundary.ambient_temperature_k;
        let start = StandstillState { tc_k: ambient_k + WARM_K, tt_k: ambient_k + WARM_K };
        let params = &self.campaign.machine.params;
        relax(params, start, self.soak.oil_temperature_k, ambient_k, after_s).tc_k - ambient_k
    }

    /// Drift of Tc as in the zero, from the first to the last third of its segment, K/min.
    fn drift_k_min(&self, duration_s: f64) -> f64 {
        let third_s = duration_s.min(self.settings.longest_s) / 3.0;
        let middle_k = |from_s: f64| self.difference_k(from_s + 0.5 * third_s);
        (middle_k(duration_s - third_s) - middle_k(duration_s - 3.0 * third_s)) / (2.0 * third_s / 60.0)
    }

    fn is_sufficient(&self, duration_s: f64) -> bool {
        self.drift_k_min(duration_s).abs() <= self.settings.drift_k_min
            && self.difference_k(duration_s) <= 0.5 * WARM_K
    }

    /// The shortest sufficient soak, in steps of five minutes; `None` if a day is not long enough.
    fn shortest_s(&self) -> Option<f64> {
        (1..)
            .map(|i| SOAK_STEP_S * f64::from(i))
            .take_while(|s| *s <= LONGEST_SOAK_S)
            .find(|s| self.is_sufficient(*s))
    }
}

/// The shortest soak of a campaign that its zero accepts, s; `None` without a zero, or if its own is sufficient.
pub(crate) fn longer_soak_s(campaign: &Campaign) -> Option<f64> {
    let housings = SoakingHousings::of(campaign)?;
    housings.shortest_s().filter(|_| !housings.is_sufficient(housings.soak.duration_s))
}

fn soak_concern(campaign: &Campaign) -> Option<Concern> {
    let housings = SoakingHousings::of(campaign)?;
    let duration_s = housings.soak.duration_s;
    if housings.soak.until_settled || housings.is_sufficient(duration_s) {
        return None;
    }
    let remedy = housings.shortest_s().map_or_else(
        || "a soak of a day is not long enough; check that oil and cell have the same temperature, and the masses of the machine".to_owned(),
        |s| format!("soak {:.0} min or longer, or write `soak: auto` if the declared offset of Tc is enough", s / 60.0),
    );
    Some(Concern::warning(
        &["zero", "soak"],
        format!(
            "after a soak of {:.0} min, housings that were {WARM_K} K warmer than the cell are still {:.1} K warmer, and Tc drifts by \
             {:+.2} K/min: Tc keeps its declared offset, and only T1, T2 and the pressures are zeroed",
            duration_s / 60.0,
            housings.difference_k(duration_s),
            housings.drift_k_min(duration_s)
        ),
        remedy,
    ))
}

fn settling_concern(campaign: &Campaign, plan: &Plan) -> Option<Concern> {
    let transient = matches!(campaign.identification.method, Method::Dynamic | Method::Joint);
    let auto = campaign.identification.window == WindowRule::Auto;
    // A script evaluates its own steps.
    if !(transient && auto && campaign.sequence.is_none()) {
        return None;
    }
    let joint = campaign.identification.method == Method::Joint;
    let needed_dwell_s = |step: &PlanStep| needed_dwell_s(step, joint);
    let measured = || plan.steps.iter().filter(|step| step.kind != StepKind::Repeat && step.from.is_some());
    let late_steps: Vec<_> = measured().filter(|step| needed_dwell_s(step) > step.dwell_s).collect();
    let worst = late_steps.iter().max_by(|a, b| needed_dwell_s(a).total_cmp(&needed_dwell_s(b)))?;
    let settles = worst.predicted.settle_s.map_or_else(
        || format!("does not settle within {:.0} s", worst.dwell_s),
        |settle_s| format!("settles {settle_s:.0} s after the jump to it"),
    );
    Some(Concern::warning(
        &["timing", "dwell"],
        format!(
            "{} of {} points will not have settled {:.0} s before the end of their dwell and will be doubtful \
             (`not_stabilised`); {} {settles}",
            late_steps.len(),
            measured().count(),
            settled_time_s(worst.dwell_s, joint),
            worst.to
        ),
        "lengthen `timing.dwell`, or widen `identification.stabilisation`".to_owned(),
    ))
}

/// A jump of a script that crosses the speeds to avoid too slowly; the planner makes no such jump.
fn avoided_concern(plan: &Plan) -> Option<Concern> {
    let remark = plan.avoided_crossing()?;
    let PlanRemark::AvoidedCrossing { inside_s, longest_s, .. } = remark else { return None };
    let remedy = "jump from a point that is further away, or raise `longest` if the machine allows it";
    let concern = || Concern::warning(&["limits", "avoid"], remark.message(), remedy.to_owned());
    (inside_s > longest_s).then(concern)
}

/// Steps with too little information on alpha_A, probe and heating/cooling ratio for any point with verdict good.
fn information_concern(campaign: &Campaign, plan: &Plan) -> Option<Concern> {
    let joint = campaign.identification.method == Method::Joint && campaign.sequence.is_none();
    let unpredicted = joint && plan.figures.rms_error_eta.is_none();
    unpredicted.then(|| {
        Concern::warning(
            &["timing"],
            "the steps contain too little information on alpha_A, probe and heating/cooling ratio; the points will probably be doubtful \
             (`prior_dominated`)"
                .to_owned(),
            "lengthen the dwell, add points, or fix known parameters (`identification.joint`)".to_owned(),
        )
    })
}

fn required_error_concern(campaign: &Campaign, plan: &Plan) -> Option<Concern> {
    let Dwell::RequiredSigmaEta(required) = campaign.timing.dwell else { return None };
    let error_eta = plan.figures.rms_error_eta?;
    (error_eta > required).then(|| {
        Concern::warning(
            &["timing", "required_sigma_eta"],
            format!(
                "with the maximum dwell of {:.0} s, the expected rms error of the efficiency is {:.2} points; {:.2} points are required",
                plan.steps.first().map_or(0.0, |step| step.dwell_s),
                100.0 * error_eta,
                100.0 * required
            ),
            "add a `zero`, or accept a larger error".to_owned(),
        )
    })
}

fn probe_concern(campaign: &Campaign, plan: &Plan) -> Option<Concern> {
    let params = &campaign.machine.params;
    let (diameter_m, pipe_m) = (params.t2_probe_diameter_m, params.compressor.outlet_diameter_m);
    let probe_and_window = |step: &PlanStep| {
        let predicted = &step.predicted;
        let window_s = match campaign.identification.method {
            Method::Dynamic | Method::Joint => {
                let (start_s, end_s) =
                    campaign.identification.window.of_step_s(predicted.settle_s, step.dwell_s);
                end_s - start_s
            }
            Method::Steady | Method::Corrected | Method::Imported => step.dwell_s,
        };
        (time_constant_s(diameter_m, pipe_m, predicted.flow_kg_s, predicted.t2_k), window_s, step.to)
    };
    let share = |(tau_s, window_s, _): &(f64, f64, _)| tau_s / window_s;
    let worst = plan.steps.iter().map(probe_and_window).max_by(|a, b| share(a).total_cmp(&share(b)))?;
    let (tau_s, window_s, at) = worst;
    (PROBE_TIME_CONSTANTS * tau_s > window_s).then(|| {
        Concern::warning(
            &["sensors", "T2", "probe_diameter"],
            format!(
                "the T2 probe of {:.2} mm has a time constant of {tau_s:.1} s at {at}; the window of {window_s:.0} s is shorter than \
                 {PROBE_TIME_CONSTANTS} time constants and dominated by the response to the previous step",
                1e3 * diameter_m
            ),
            "lengthen `timing.dwell`, or use a thinner probe".to_owned(),
        )
    })
}

/// Time at the end of a step, s, that must be settled for a good verdict.
pub(crate) fn settled_time_s(dwell_s: f64, joint: bool) -> f64 {
    if joint { WindowRule::settled_end_s(dwell_s) } else { WindowRule::SHORTEST_S }
}

/// Dwell, s, that a step needs for `window: auto`.
pub(crate) fn needed_dwell_s(step: &PlanStep, joint: bool) -> f64 {
    let earliest_s = if joint { 0.0 } else { WindowRule::EARLIEST_S };
    step.predicted.settle_s.unwrap_or(f64::INFINITY).max(earliest_s) + settled_time_s(step.dwell_s, joint)
}

/// Dwells that are tried, relative to the dwell of the campaign. Longer ones would make the run impractical.
const DWELL_RATIOS: [f64; 6] = [1.25, 1.5, 2.0, 2.5, 3.0, 4.0];
/// Soaks that are tried, s. A cold machine settles in half an hour.
const SOAKS_S: [f64; 2] = [1800.0, 3600.0];
/// Measured over forecast error that rests on the declaration: 0.9 to 1.3 in 13 of 14 campaigns of `benches/advice.py` with a dwell of 12
/// to 18 s; a tenth is added at both ends.
const PRIOR_SENSITIVITY_RATIOS: (f64, f64) = (0.8, 1.4);
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
    let prior_sensitivity_eta = plan.figures.prior_sensitivity_eta.unwrap_or(0.0);
    let is_enough = |prior_sensitivity_ratio: f64| {
        prior_sensitivity_ratio * prior_sensitivity_eta <= MAX_PRIOR_SENSITIVITY_ETA
    };
    let (low, high) = (
        informative && is_enough(PRIOR_SENSITIVITY_RATIOS.1),
        informative || is_enough(PRIOR_SENSITIVITY_RATIOS.0),
    );
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

fn with_change(campaign: &Campaign, change: CampaignChange) -> Campaign {
    let mut changed = campaign.clone();
    match change {
        CampaignChange::DwellS(dwell_s) => changed.timing.dwell = Dwell::Fixed(dwell_s),
        CampaignChange::SoakS(duration_s) => {
            let usual = Soak {
                until_settled: false,
                duration_s,
                oil_temperature_k: campaign.boundary.ambient_temperature_k,
                temperature_sigma_k: Soak::TEMPERATURE_SIGMA_K,
                pressure_sigma_pa: Soak::PRESSURE_SIGMA_PA,
            };
            changed.zero = Some(Soak { duration_s, until_settled: false, ..campaign.zero.unwrap_or(usual) });
        }
    }
    changed
}
