//! When a step has told enough: what more time there would tell of all points, against what the time tells elsewhere.
//!
//! Each second at a point makes all points more certain, by less the longer the machine is there. There is one price, the
//! least that a second has to tell, at which the steps that were made and those that are still to come reach the required error
//! together; a step ends when its seconds tell less. Before the run the price follows from the forecast, and each step that has
//! told more or less than was forecast moves it.

pub(crate) mod left;

use crate::SessionError;
use crate::planning::{identification_after_zero, with_plan_request};
use crate::predicted_method::expected_row;
use mapper_campaign::Campaign;
use mapper_core::{Channel, DwellEnd, Method, Plan, PlanStep, Recording, StepKind, StepMarker};
use mapper_identify::{
    CampaignInformation, ExpectedRow, ExpectedStep, IdentifyConfig, PressureTap, StepInformation,
};
use mapper_numerics::parallel;
use mapper_numerics::statistics::mean;
use mapper_physics::forecast::ForecastRow;
use mapper_physics::model::Model;
use mapper_planner::{
    PlanRequest, REACHED_RATIO, Retimed, SHORTEST_S, forecast_longer, rested_dwell_s, with_dwells,
};
use mapper_runner::{Certainty, DwellBounds};
use std::sync::Arc;

/// How far apart the dwells lie that are tried, s, and most of them for a step.
const APART_S: f64 = 2.0;
/// Last part of a step by which it is judged what its seconds tell, s: over less, noise has the say.
const LAST_S: f64 = 6.0;
const MOST_TRIED: f64 = 60.0;
/// How often dwells and the errors that they are forecast to give are brought together.
const ROUNDS: usize = 6;
/// So close to the required error they are no further.
const CLOSE_RATIO: f64 = 0.01;
/// Halvings of the logarithm of the price, and the prices between which it is sought, fraction^2/s.
const HALVINGS: usize = 40;
const PRICES: (f64, f64) = (1e-16, 1.0);
/// Noise over the declared one with which the shortest and the longest run are forecast.
const LESS_NOISE_RATIO: f64 = 0.8;
const MORE_NOISE_RATIO: f64 = 1.2;
/// More time of which an event tells what it would give, s.
const MORE_S: f64 = 10.0;

/// Where the housing is at the end of a step is read from so much of it, s.
const END_S: f64 = 5.0;

/// A dwell that a step may have.
#[derive(Debug, Clone)]
struct Dwell {
    dwell_s: f64,
    tells: StepInformation,
    /// What each of its last seconds tells, fraction^2/s.
    rate: f64,
}

/// A step of the plan.
#[derive(Debug, Clone)]
struct Planned {
    step: PlanStep,
    rows: Vec<ForecastRow>,
    expected: Vec<ExpectedRow>,
    /// What it told, once it is over; what is skipped told nothing.
    told: Option<Option<StepInformation>>,
}

impl Planned {
    fn of(step: PlanStep, rows: Vec<ForecastRow>) -> Self {
        Planned { step, expected: rows.iter().map(expected_row).collect(), rows, told: None }
    }

    /// The step as forecast, with this dwell.
    fn forecast(&self, dwell_s: f64) -> ExpectedStep<'_> {
        let count = self.expected.partition_point(|row| row.t_s <= dwell_s + 1e-6);
        let (eta, h_w_m2k) = match count.checked_sub(1).and_then(|last| self.rows.get(last)) {
            Some(end) => (end.efficiency, end.h_w_m2k),
            None => (0.0, 0.0),
        };
        ExpectedStep { rows: &self.expected[..count], eta, h_w_m2k }
    }
}

/// The price of a second, and all that it follows from.
#[derive(Debug, Clone)]
pub(crate) struct DwellPrices {
    information: Arc<CampaignInformation>,
    forecast_config: IdentifyConfig,
    steps: Vec<Planned>,
    /// For each step the dwells that it may have; one alone for a step that lasts as planned.
    tables: Vec<Vec<Dwell>>,
    longest_s: f64,
    /// Error of all points, rms, that is to be reached, without what the map's smoothness says, fraction; without one each step
    /// lasts as planned.
    target: Option<f64>,
    price: f64,
    /// Whether steps end by what their readings tell.
    looks_on: bool,
    /// Housing temperature at the end of the last step, K, as it was read.
    tc_k: Option<f64>,
    /// The step under way, and what it told at the looks so far: time, s, and worth.
    now: Option<usize>,
    looks: Vec<(f64, f64)>,
}

/// The plan with dwells that reach the required error at one price of a second, whether its steps end as planned or when enough is
/// known, and with open errors alone; unchanged where no error is required, or nothing can be forecast.
///
/// # Errors
/// [`SessionError`] where the forecast fails.
pub fn retimed(campaign: &Campaign, request: &PlanRequest<'_>, plan: Plan) -> Result<Plan, SessionError> {
    let joint = campaign.identification.method == Method::Joint && campaign.sequence.is_none();
    let Some(required) = campaign.required_sigma_eta.filter(|_| joint) else { return Ok(plan) };
    let reaches = |error: Option<f64>| error.is_some_and(|error| error <= REACHED_RATIO * required);
    let mut now = Retimed { plan: plan.clone(), forbidden: Vec::new() };
    let mut last = None;
    // One dwell for all is a choice that prices have too.
    let mut shortest = Some(now.clone()).filter(|now| reaches(now.plan.figures.open_rms_error_eta));
    for round in 0..ROUNDS {
        let Some(prices) = DwellPrices::about(campaign, request, &now.plan, Some(required))? else { break };
        let priced_s = prices.dwells_s(prices.price);
        // A shorter step leaves less of a gradient to the next, which prices do not see: without meeting them half-way dwells
        // swing between too long and too short.
        let half_way = |(s, step): (&f64, &PlanStep)| (s * step.dwell_s).sqrt().round();
        let dwells_s = match round {
            0 => priced_s,
            _ => priced_s.iter().zip(&now.plan.steps).map(half_way).collect(),
        };
        last = Some(prices);
        now = with_dwells(request, &now.plan, &dwells_s, false)?;
        let figures = &now.plan.figures;
        let shorter = |than: &Retimed| figures.minutes < than.plan.figures.minutes;
        if reaches(figures.open_rms_error_eta) && shortest.as_ref().is_none_or(shorter) {
            shortest = Some(now.clone());
        }
        if figures.open_rms_error_eta.is_some_and(|error| (error / required - 1.0).abs() <= CLOSE_RATIO) {
            break;
        }
    }
    let Retimed { plan: mut retimed, forbidden } = shortest.unwrap_or(now);
    if let Some(why) = forbidden.first() {
        // The order was held against the limits with the dwells that it was made with.
        let mut plan = plan;
        plan.remarks
            .push(format!("all steps last about equally long: with dwells by price a limit forbids {why}"));
        return Ok(plan);
    }
    if wanted(campaign).is_some() {
        retimed.remarks.retain(|remark| !remark.starts_with(ENDS_REMARK));
        let said = last.map(|prices| remark(campaign, &retimed, &prices));
        retimed.remarks.extend(said);
    }
    Ok(retimed)
}

/// How the remark on steps that end by their readings begins.
const ENDS_REMARK: &str = "each step ends when its readings have told enough";

/// The error to be reached, where steps end when it is.
fn wanted(campaign: &Campaign) -> Option<f64> {
    let certain = campaign.timing.ends == DwellEnd::WhenCertain && campaign.sequence.is_none();
    campaign.required_sigma_eta.filter(|_| certain)
}

/// `prices`: about a plan that is much the same.
fn remark(campaign: &Campaign, plan: &Plan, prices: &DwellPrices) -> String {
    let around_s = plan.warm_up_s + plan.cool_down_s;
    let minutes = |steps_s: f64| (around_s + steps_s) / 60.0;
    let steps_s: f64 = plan.steps.iter().map(|step| step.dwell_s).sum();
    let with_noise = |ratio| steps_s * prices.with_noise(ratio) / prices.with_noise(1.0);
    let most_s = plan.steps.iter().map(|step| longest_s(step, campaign)).sum::<f64>();
    format!(
        "{ENDS_REMARK}: forecast {:.0} min, between {:.0} and {:.0} min where noise is a fifth less or \
         more than declared, and never more than {:.0} min",
        minutes(steps_s),
        minutes(with_noise(LESS_NOISE_RATIO)),
        minutes(with_noise(MORE_NOISE_RATIO)),
        minutes(most_s)
    )
}

/// Longest time of a step, s.
fn longest_s(step: &PlanStep, campaign: &Campaign) -> f64 {
    if lasts_as_planned(step) { step.dwell_s } else { campaign.timing.dwell_s.max(step.dwell_s) }
}

/// Repeats compare when they last equally long.
fn lasts_as_planned(step: &PlanStep) -> bool {
    step.kind == StepKind::Repeat
}

impl DwellPrices {
    /// For a plan of a campaign whose steps end when enough is known, or that is planned again while it runs; `None` where neither
    /// is so, or nothing can be forecast.
    ///
    /// # Errors
    /// [`SessionError`] where the forecast fails.
    pub(crate) fn of(campaign: &Campaign, model: &Model, plan: &Plan) -> Result<Option<Self>, SessionError> {
        let looks_on = wanted(campaign).is_some();
        if !looks_on && campaign.replan.is_off() {
            return Ok(None);
        }
        let required = campaign.required_sigma_eta;
        let prices = with_plan_request(campaign, model, |request| {
            DwellPrices::about(campaign, request, plan, required)
        })?;
        Ok(prices.map(|prices| DwellPrices { looks_on, ..prices }))
    }

    pub(crate) fn about(
        campaign: &Campaign,
        request: &PlanRequest<'_>,
        plan: &Plan,
        required: Option<f64>,
    ) -> Result<Option<Self>, SessionError> {
        let longest_s = campaign.timing.dwell_s;
        let config = identification_after_zero(campaign);
        let total = PressureTap::Total;
        let forecast_config = IdentifyConfig { inlet_tap: total, outlet_tap: total, ..config.clone() };
        let rows = forecast_longer(request, plan, longest_s)?;
        let steps: Vec<Planned> =
            plan.steps.iter().zip(rows).map(|(step, rows)| Planned::of(step.clone(), rows)).collect();
        let expected: Vec<ExpectedStep<'_>> =
            steps.iter().map(|planned| planned.forecast(planned.step.dwell_s)).collect();
        let about = CampaignInformation::about(&expected, &forecast_config, &config);
        let Some((information, open)) = about.zip(plan.figures.open_rms_error_eta) else { return Ok(None) };
        let as_planned = parallel::map(&expected, |step| information.of_forecast(step, &forecast_config));
        drop(expected);
        let mut prices = DwellPrices {
            information: Arc::new(information),
            forecast_config,
            steps,
            tables: Vec::new(),
            longest_s,
            target: required,
            price: PRICES.0,
            looks_on: false,
            tc_k: None,
            now: None,
            looks: Vec::new(),
        };
        let told: Vec<Option<&StepInformation>> = as_planned.iter().map(Option::as_ref).collect();
        let Some(linear) = prices.error(&told) else { return Ok(None) };
        // What smoothness says, and the method's own bias, are known of the plan as it stands.
        prices.target = required.map(|required| required * linear / open);
        prices.tables = parallel::map(&prices.steps, |planned| prices.dwells_of(planned));
        prices.settle();
        Ok(Some(prices))
    }

    /// The dwells that a step may have, the shortest in which it comes to rest first.
    fn dwells_of(&self, planned: &Planned) -> Vec<Dwell> {
        let longest_s = self.longest_s;
        let as_planned = lasts_as_planned(&planned.step) || self.target.is_none();
        let shortest_s = if as_planned {
            planned.step.dwell_s
        } else {
            rested_dwell_s(&planned.step, SHORTEST_S.min(longest_s), longest_s)
        };
        // Whole seconds, as all dwells are.
        let apart_s = APART_S.max(((longest_s - shortest_s) / MOST_TRIED).ceil());
        let last_s = if as_planned { shortest_s } else { longest_s };
        let back = (LAST_S / apart_s).ceil().max(1.0) as usize;
        let first_s = shortest_s - back as f64 * apart_s;
        let times_s = (0..).map(|i: u32| first_s + f64::from(i) * apart_s);
        let times_s: Vec<f64> = times_s.take_while(|s| *s <= last_s + 1e-6).collect();
        let whole = planned.forecast(longest_s.max(last_s));
        let tells = self.information.of_forecast_ended(&whole, &times_s, &self.forecast_config);
        let of = |now: usize| {
            let (earlier, tells) = (tells[now - back].as_ref()?, tells[now].clone()?);
            let took_s = times_s[now] - times_s[now - back];
            let rate = (self.information.worth(&tells) - self.information.worth(earlier)) / took_s;
            Some(Dwell { dwell_s: times_s[now], tells, rate })
        };
        (back..times_s.len()).filter_map(of).collect()
    }

    /// Error of the points that are measured, rms, fraction. One entry for each step; `None` tells nothing.
    fn error(&self, told: &[Option<&StepInformation>]) -> Option<f64> {
        let known = self.information.together(told.iter().copied().flatten())?;
        let measured = self.steps.iter().zip(told).filter(|(planned, _)| planned.step.kind.measures());
        let squares: Vec<f64> =
            measured.filter_map(|(_, told)| Some(known.sigma_eta((*told)?).powi(2))).collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    }

    /// The dwells at a price, s.
    fn dwells_s(&self, price: f64) -> Vec<f64> {
        self.times_s(&self.tables, price).collect()
    }

    /// The highest price at which the required error is reached where the steps to come have these dwells to choose from; the
    /// lowest of all where it is not.
    fn highest(&self, tables: &[Vec<Dwell>]) -> f64 {
        let Some(target) = self.target else { return PRICES.0 };
        let reaches =
            |price: f64| self.error(&self.told_at(tables, price)).is_some_and(|error| error <= target);
        let (mut low, mut high) = (PRICES.0.ln(), PRICES.1.ln());
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if reaches(middle.exp()) { low = middle } else { high = middle }
        }
        low.exp()
    }

    /// What each step has told, or is to tell with these dwells at a price.
    fn told_at<'a>(&'a self, tables: &'a [Vec<Dwell>], price: f64) -> Vec<Option<&'a StepInformation>> {
        let of = |(planned, dwells): (&'a Planned, &'a Vec<Dwell>)| match &planned.told {
            Some(told) => told.as_ref(),
            None => chosen(dwells, price).map(|dwell| &dwell.tells),
        };
        self.steps.iter().zip(tables).map(of).collect()
    }

    fn settle(&mut self) {
        self.price = self.highest(&self.tables);
    }

    /// Time of all steps together where noise is so many times the declared one, s.
    fn with_noise(&self, ratio: f64) -> f64 {
        let noisy = |dwell: &Dwell| Dwell {
            dwell_s: dwell.dwell_s,
            tells: dwell.tells.with_noise(ratio),
            rate: dwell.rate / (ratio * ratio),
        };
        let tables: Vec<Vec<Dwell>> =
            self.tables.iter().map(|dwells| dwells.iter().map(noisy).collect()).collect();
        self.times_s(&tables, self.highest(&tables)).sum()
    }

    /// The dwell of each step at a price, s.
    fn times_s(&self, tables: &[Vec<Dwell>], price: f64) -> impl Iterator<Item = f64> {
        let of = move |(dwells, planned): (&Vec<Dwell>, &Planned)| {
            chosen(dwells, price).map_or(planned.step.dwell_s, |dwell| dwell.dwell_s)
        };
        tables.iter().zip(&self.steps).map(of)
    }

    /// Why a step ends, with what is known and what more time would give.
    fn reason(&self, now: usize, tells: &StepInformation, after_s: f64, rate: f64) -> Option<String> {
        let mut told = self.told_at(&self.tables, self.price);
        told[now] = Some(tells);
        let own = self.information.together(told.iter().copied().flatten())?.sigma_eta(tells);
        let error = self.error(&told)?;
        let points = self.steps.iter().filter(|planned| planned.step.kind.measures()).count() as f64;
        let lowers = |rate: f64| 1e2 * MORE_S * rate / (2.0 * points * error);
        Some(format!(
            "{} is left after {after_s:.0} s of at most {:.0} s: its efficiency is known to {:.2} points, all points to {:.2} (rms, steps \
             to come as forecast; open); {MORE_S:.0} s more would take {:.4} points off that, and elsewhere {:.4}",
            self.steps[now].step.to,
            self.longest_s,
            1e2 * own,
            1e2 * error,
            lowers(rate.max(0.0)),
            lowers(self.price)
        ))
    }
}

/// The first dwell whose last seconds tell no more than they cost, or the longest.
fn chosen(dwells: &[Dwell], price: f64) -> Option<&Dwell> {
    dwells.iter().find(|dwell| dwell.rate <= price).or(dwells.last())
}

impl Certainty for DwellPrices {
    fn bounds(&mut self, step: &PlanStep) -> Option<DwellBounds> {
        let open = |planned: &Planned| {
            planned.told.is_none() && planned.step.to == step.to && planned.step.kind == step.kind
        };
        self.now = self.steps.iter().position(open);
        self.looks.clear();
        self.now?;
        (self.looks_on && !lasts_as_planned(step)).then_some(DwellBounds {
            // What seconds tell is a difference between looks.
            first_look_s: (SHORTEST_S.min(self.longest_s) - LAST_S).max(0.0),
            apart_s: APART_S.max(self.longest_s / MOST_TRIED),
            longest_s: self.longest_s,
        })
    }

    fn look(&mut self, readings: &Recording, marker: &StepMarker) -> Option<String> {
        let now = self.now?;
        let planned = self.steps.get(now)?;
        let after_s = marker.end_s - marker.start_s;
        let so_far = self.information.of_readings(readings, &planned.forecast(after_s))?;
        let worth = self.information.worth(&so_far.tells);
        let last = |look: &&(f64, f64)| look.0 <= after_s - LAST_S + 1e-6;
        let before = self.looks.iter().rev().find(last).copied();
        self.looks.push((after_s, worth));
        let (before_s, before) = before?;
        let rate = (worth - before) / (after_s - before_s);
        if !(so_far.rests && after_s >= SHORTEST_S && rate <= self.price) {
            return None;
        }
        self.reason(now, &so_far.tells, after_s, rate)
    }

    fn ended(&mut self, readings: &Recording, marker: &StepMarker) {
        let Some(now) = self.now.take() else { return };
        let planned = &self.steps[now];
        let forecast = planned.forecast(marker.end_s - marker.start_s);
        let told = self.information.of_readings(readings, &forecast).map(|so_far| so_far.tells);
        self.steps[now].told = Some(told);
        let end_s = marker.end_s;
        let tc = readings.series.get(&Channel::Tc).map(|tc_k| tc_k.slice(end_s - END_S, end_s).1);
        self.tc_k = tc.and_then(|tc_k| mean(tc_k.iter().copied())).filter(|tc_k| tc_k.is_finite());
        self.settle();
    }

    fn left_out(&mut self) {
        let Some(now) = self.now.take() else { return };
        self.steps[now].told = Some(None);
        self.settle();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{nominal_model, plan, shipped};

    /// A step's ends are told by one way through its rows: held against a step of each length looked at by itself.
    #[test]
    fn what_a_step_tells_as_it_lasts_is_what_each_shorter_step_tells() {
        let campaign = shipped::campaign(&[
            ("65 krpm, 80 krpm, 95 krpm, 110 krpm, 125 krpm, 140 krpm, 155 krpm]", "110 krpm, 155 krpm]"),
            ("openings: [0.5, 0.7, 1.0, 1.4, 2.0, 2.5]", "openings: [0.5, 1.0, 2.0]"),
            ("seed: 1  ", "repeats: off\nseed: 1  "),
        ]);
        let model = nominal_model(&campaign).unwrap();
        let made = plan(&campaign, &model).unwrap();
        let required = campaign.required_sigma_eta;
        let prices = with_plan_request(&campaign, &model, |request| {
            DwellPrices::about(&campaign, request, &made, required)
        });
        let prices = prices.unwrap().unwrap();
        let (mut seen, mut off) = (0, [0.0f64; 2]);
        for (planned, table) in prices.steps.iter().zip(&prices.tables) {
            let worths = table.iter().map(|dwell| prices.information.worth(&dwell.tells).abs());
            let most = worths.fold(0.0, f64::max);
            for dwell in table {
                let alone = planned.forecast(dwell.dwell_s);
                let alone = prices.information.of_forecast(&alone, &prices.forecast_config).unwrap();
                let [worth, with] = [&alone, &dwell.tells].map(|tells| prices.information.worth(tells));
                let known = prices.information.together(std::iter::once(&alone)).unwrap();
                let (sigma, sigma_with) = (known.sigma_eta(&alone), known.sigma_eta(&dwell.tells));
                off = [off[0].max((with - worth).abs() / most), off[1].max((sigma_with / sigma - 1.0).abs())];
                seen += 1;
            }
        }
        // 0.4 % of what a step is worth and 0.03 % of its standard error, as it stands.
        assert!(seen > 100 && off[0] < 0.01 && off[1] < 1e-3, "{seen} {off:?}");
    }

    /// Dwells that follow prices and prices that follow dwells swing if nothing holds them: with seeds 2, 3 and 6 they ended with
    /// steps of 80, 74 and 84 min, where seed 4 took 51.
    #[test]
    fn the_required_error_is_reached_in_about_the_same_time_whatever_the_seed() {
        let minutes = [2, 3, 4, 6].map(|seed: u64| {
            let campaign = shipped::campaign(&[("seed: 1  ", &format!("seed: {seed}  "))]);
            let plan = plan(&campaign, &nominal_model(&campaign).unwrap()).unwrap();
            let required = campaign.required_sigma_eta.unwrap();
            let error = plan.figures.open_rms_error_eta.unwrap();
            assert!(error <= REACHED_RATIO * required, "seed {seed}: {error} of {required}");
            plan.steps.iter().map(|step| step.dwell_s).sum::<f64>() / 60.0
        });
        let longest = minutes.into_iter().fold(0.0, f64::max);
        let shortest = minutes.into_iter().fold(f64::INFINITY, f64::min);
        // 46 to 53 min over twelve seeds; the orders that are found differ.
        assert!(longest < 1.3 * shortest, "{minutes:?}");
    }
}
