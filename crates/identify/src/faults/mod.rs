//! Detects faults of sensors and machine from balances that do not close.
//!
//! Each balance is a law with a declared uncertainty: one opening of the valve has one area, and heads go with the speed squared. The housing
//! stores the heat from the gas, and efficiency is a smooth function of the map position. The hypotheses are the catalogue of sensor faults
//! ([`mapper_physics::rig::sensor_fault`]) and a machine of another scale. [`mapper_inference::hypotheses`] finds the most probable set of them.

pub(crate) mod balance_rows;
pub(crate) mod balances;
pub(crate) mod end_readings;
pub(crate) mod found_fault;
pub(crate) mod nominal_rig;
pub(crate) mod possible;
pub(crate) mod valve_check;

use crate::IdentifyConfig;
use crate::faults::balance_rows::Rows;
use crate::faults::balances::efficiency::FittedEfficiencies;
use crate::faults::balances::standstill::{self, Standstill};
use crate::faults::balances::valve::{self, Opening, sides};
use crate::faults::end_readings::{CHANNELS, MAX_CORRELATED_ROWS, Readings, span_s};
use crate::faults::found_fault::{FoundFault, Law, MACHINE, Machine, Suspect};
use crate::faults::nominal_rig::NominalRig;
use crate::reading_checks::ends::{Ends, FailedCheck};
use mapper_core::{Channel, FaultKind, Method, ModelTolerances, Recording, SuspectedFault, Warning};
use mapper_inference::hypotheses::{Explanation, Likelihood, Member, Priors, Unmodelled};
use mapper_inference::mixture::MIN_WEIGHT;
use mapper_inference::posterior::EXCLUDED_ODDS;
use mapper_numerics::statistics::EXCLUDE_SIGMAS;
use mapper_physics::rig::sensor_fault::{ExactReadings, additive};

/// Prior probability of a fault. Judgement: one recording in ten has one; docs/validation/faults.md uses the same value.
const EXPECTED_FAULTS: f64 = 0.1;
/// Deviation of a machine from its declaration, ratio, one standard deviation. Bound: another machine of the same series.
const OTHER_MACHINE_RATIO: f64 = 0.05;
/// The same of convection. Source: correlations of heat transfer in pipes scatter by that much (Incropera, ch. 8.5).
const OTHER_CONVECTION_RATIO: f64 = 0.2;
/// Share of its commands that a valve does not follow, one standard deviation. Bound: 1 stands still.
const STANDS_STILL_RATIO: f64 = 1.0;
/// Play of a worn drive, opening, one standard deviation. Bound: twice that of a new pneumatic positioner.
const OTHER_PLAY: f64 = 0.04;

/// Delay of an actuator, s, one standard deviation. Bound: between the fastest and the slowest air supplies, 0.3 and 15 s.
const OTHER_DELAY_S: f64 = 3.0;

/// The balances of a recording, and what may explain that they do not close.
pub(crate) struct Hypotheses {
    pub(crate) likelihood: Likelihood,
    /// The likelihood of each balance.
    each: Vec<(Law, Likelihood)>,
    pub(crate) priors: Priors,
    /// In the order of the priors.
    pub(crate) suspects: Vec<Suspect>,
}

/// All balances of a recording. `ends`: of the usable steps. `fitted`: efficiencies of the joint fit, if available.
pub(crate) fn hypotheses(
    recording: &Recording,
    ends: &[Option<Ends>],
    fitted: Option<&FittedEfficiencies>,
    config: &IdentifyConfig,
    nominal: Option<&NominalRig<'_>>,
    standstills: &[Standstill],
) -> Option<Hypotheses> {
    let all = all_readings(recording, ends, config.exact_at)?;
    let readings: Vec<Readings> = all.iter().flatten().copied().collect();
    let opening = |((end, readings), side): ((&Option<Ends>, &Option<Readings>), f64)| {
        let end = end.as_ref()?;
        let position = end.valve_opening_ratio - 0.5 * config.valve_play_ratio() * side;
        let step = recording.steps.get(end.position)?.index;
        Some((Opening { step, position, side }, (*readings)?))
    };
    let opened: Vec<(Opening, Readings)> =
        ends.iter().zip(&all).zip(sides(&recording.steps)).filter_map(opening).collect();
    let noise = end_readings::noise(config, recording);
    let reference = config.reference;
    let mut balances: Vec<(Law, Rows)> = Vec::new();
    let mut add = |law: Law, rows: Option<Rows>| balances.extend(rows.map(|rows| (law, rows)));
    add(Law::Valve, valve::valve_rows(&opened, &noise, nominal, config.opening_is_area));
    let outlet_volume_m3 = nominal.map_or(0.0, |nominal| nominal.model.params.outlet.volume_m3);
    for rows in valve::motion_rows(recording, config, outlet_volume_m3) {
        add(Law::Motion, Some(rows));
    }
    add(Law::Head, balances::efficiency::head_rows(&readings, &noise, reference, nominal));
    let used: Vec<bool> = all.iter().map(Option::is_some).collect();
    // Its balance is that of one wall.
    if fitted.is_none_or(|fitted| fitted.has_one_wall) {
        add(Law::Housing, balances::housing::rows(recording, config, &used));
    }
    add(Law::InletTemperature, balances::housing::inlet_rows(recording, &all, config));
    let efficiencies = |fitted| balances::efficiency::rows(fitted, &all, reference, nominal);
    add(Law::Efficiency, fitted.and_then(efficiencies));
    standstills.iter().for_each(|at_rest| add(Law::Rest, Some(at_rest.rows.clone())));
    if let Some(nominal) = nominal {
        let convection = |fitted| balances::housing::convection_rows(fitted, &all, config, nominal);
        add(Law::Convection, fitted.and_then(convection));
        for rows in balances::standstill::condition_rows(recording, &all, config, nominal) {
            add(Law::Conditions, Some(rows));
        }
    }
    Some(Hypotheses::of(&balances, config, nominal))
}

impl Hypotheses {
    pub(crate) fn of(
        balances: &[(Law, Rows)],
        config: &IdentifyConfig,
        nominal: Option<&NominalRig<'_>>,
    ) -> Self {
        let shown = balances.iter().flat_map(|(_, rows)| &rows.by_machine).map(|(machine, _)| *machine);
        let machine = MACHINE.into_iter().chain(shown.filter(|machine| !MACHINE.contains(machine)));
        let suspects: Vec<Suspect> =
            additive().map(|fault| Suspect::Sensor(*fault)).chain(machine.map(Suspect::Machine)).collect();
        let steps = balances.iter().map(|(_, rows)| rows.residual.len()).max().unwrap_or_default();
        let priors = priors(&suspects, steps, config, nominal);
        let parameters = priors.always.len() + priors.hypotheses.len();
        let likelihood = |(law, rows): &(Law, Rows)| {
            let mut likelihood = Likelihood::new(parameters);
            // A balance without a density gives no evidence.
            likelihood.add(&rows.balance(&suspects)).map(|()| (*law, likelihood))
        };
        let each: Vec<(Law, Likelihood)> = balances.iter().filter_map(likelihood).collect();
        let likelihood = Likelihood::together(each.iter().map(|(_, likelihood)| likelihood), None);
        let likelihood = likelihood.unwrap_or_else(|| Likelihood::new(parameters));
        Hypotheses { likelihood, each, priors, suspects }
    }
}

impl Hypotheses {
    /// The most probable explanation by none of the suspects, and the balance whose errors it makes larger; `None` if all balances close.
    fn unmodelled(&self, known: &Explanation) -> Option<(Law, Unmodelled)> {
        let balances: Vec<&Likelihood> = self.each.iter().map(|(_, likelihood)| likelihood).collect();
        // As probable as each of the suspects.
        let ln_prior = (EXPECTED_FAULTS / self.suspects.len() as f64).ln();
        let found = (!known.members.is_empty())
            .then(|| Likelihood::explain_unmodelled(&balances, &self.priors, known, ln_prior));
        found.flatten().map(|found| (self.each[found.balance].0, found))
    }
}

/// Faults that explain why the balances of a recording do not close; empty if they close.
pub(crate) fn find(hypotheses: &Hypotheses, method: Method, standstills: &[Standstill]) -> Vec<FoundFault> {
    let suspect = |index: usize| hypotheses.suspects[index];
    let likelier_than = |member: &Member, limit: f64| -> Vec<Suspect> {
        let others = member.alternatives.iter().take_while(|(_, relative)| *relative > limit);
        others.map(|(index, _)| suspect(*index)).collect()
    };
    let found = |member: &Member| FoundFault {
        suspect: suspect(member.index),
        value: member.value,
        sigma: member.sigma,
        alternatives: likelier_than(member, EXCLUDED_ODDS),
        touches_points: touches_points(suspect(member.index), method)
            || likelier_than(member, MIN_WEIGHT).into_iter().any(|other| touches_points(other, method)),
        at_rest: match suspect(member.index) {
            Suspect::Sensor(fault) => standstill::seen(standstills, &fault, member.value),
            Suspect::Machine(_) | Suspect::Unmodelled(_) => None,
        },
    };
    let explanation = hypotheses.likelihood.explain(&hypotheses.priors).unwrap_or_default();
    let mut faults: Vec<FoundFault> = explanation.members.iter().map(found).collect();
    let Some((law, unmodelled)) = hypotheses.unmodelled(&explanation) else { return faults };
    let others: Vec<FoundFault> = unmodelled.explanation.members.iter().map(found).collect();
    let (none, odds) = (Suspect::Unmodelled(law), unmodelled.ln_odds.exp());
    let is_among = |suspect: &Suspect| others.iter().any(|other| other.suspect == *suspect);
    // It answers for what it replaces: further errors are judged by the fit.
    let replaced: Vec<FoundFault> =
        faults.iter().filter(|fault| !is_among(&fault.suspect)).cloned().collect();
    if odds > 1.0 && !replaced.is_empty() {
        let is_possible = |limit: f64| odds.recip() > limit;
        let touched = is_possible(MIN_WEIGHT) && replaced.iter().any(|fault| fault.touches_points);
        let (ratio, sigma) = unmodelled.error_ratio;
        let alternatives = replaced.iter().map(|fault| fault.suspect).filter(|_| is_possible(EXCLUDED_ODDS));
        let none = FoundFault {
            suspect: none,
            value: ratio - 1.0,
            sigma,
            alternatives: alternatives.collect(),
            touches_points: touches_points(none, method) || touched,
            at_rest: None,
        };
        return std::iter::once(none).chain(others).collect();
    }
    for fault in faults.iter_mut().filter(|fault| odds > MIN_WEIGHT && !is_among(&fault.suspect)) {
        fault.touches_points |= touches_points(none, method);
        fault.alternatives.extend((odds > EXCLUDED_ODDS).then_some(none));
    }
    faults
}

/// Whether a number of a compressor's point depends on it: none depends on valve or turbine, and an apparent efficiency does not depend on the housing.
fn touches_points(suspect: Suspect, method: Method) -> bool {
    let channels = suspect.channels();
    let elsewhere = !channels.is_empty() && channels.iter().all(|channel| !CHANNELS.contains(channel));
    let housing = method == Method::Steady && channels == [Channel::Tc] || elsewhere;
    let is_measured = match suspect {
        Suspect::Sensor(_) => false,
        Suspect::Machine(machine) => match machine {
            Machine::ValveArea | Machine::ValvePlay | Machine::ValveStuck { .. } => true,
            Machine::SlowAir | Machine::SlowValve | Machine::Condition(_) => true,
            Machine::FlowCapacity | Machine::Efficiency | Machine::Convection => false,
        },
        Suspect::Unmodelled(law) => matches!(law, Law::Valve | Law::Motion | Law::Conditions),
    };
    !(housing || is_measured)
}

/// Warnings for all points if there are faults that affect them.
pub(crate) fn failed_check(faults: &[FoundFault], steps: usize) -> Option<FailedCheck> {
    faults.iter().any(|fault| fault.touches_points).then_some(())?;
    let sensors = faults.iter().any(|fault| matches!(fault.suspect, Suspect::Sensor(_)));
    let faults = faults.iter().map(SuspectedFault::from).collect();
    let warning = match sensors {
        true => Warning::ContradictedChannel { faults },
        false => Warning::OffTheNominalMap { faults },
    };
    Some(FailedCheck::new(warning, (0..steps).collect()))
}

/// A remark on faults that do not affect the points.
pub(crate) fn remark(faults: &[FoundFault]) -> Option<Warning> {
    let harmless = !faults.is_empty() && !faults.iter().any(|fault| fault.touches_points);
    harmless.then(|| Warning::OffTheNominalMap { faults: faults.iter().map(SuspectedFault::from).collect() })
}

/// Standard error of each suspect's size from the balances, in its unit.
pub(crate) fn standard_errors(hypotheses: &Hypotheses) -> Vec<(Suspect, f64)> {
    let errors = hypotheses.likelihood.standard_errors(&hypotheses.priors).unwrap_or_default();
    hypotheses.suspects.iter().copied().zip(errors).collect()
}

/// The readings of all steps, by position; at most [`MAX_CORRELATED_ROWS`] of them.
pub(crate) fn all_readings(
    recording: &Recording,
    ends: &[Option<Ends>],
    exact: ExactReadings,
) -> Option<Vec<Option<Readings>>> {
    let (first_s, last_s) = span_s(recording)?;
    let every = ends.len().div_ceil(MAX_CORRELATED_ROWS).max(1);
    let of = |(position, end): (usize, &Option<Ends>)| {
        let used = end.as_ref().filter(|_| position.is_multiple_of(every))?;
        Some(Readings::of(used, first_s, last_s, exact))
    };
    Some(ends.iter().enumerate().map(of).collect())
}

/// Priors of these suspects. `steps`: among which a valve may begin and cease to stand still.
fn priors(
    suspects: &[Suspect],
    steps: usize,
    config: &IdentifyConfig,
    nominal: Option<&NominalRig<'_>>,
) -> Priors {
    let declared = |channel: &Channel| config.sensor(*channel);
    let gain = |channel: &Channel| match (declared(channel).gain_sigma_ratio, nominal) {
        (0.0, Some(nominal)) if *channel == Channel::CompressorFlow => {
            nominal.tolerances.flow_meter_gain_ratio
        }
        (declared, _) => declared,
    };
    let offsets = CHANNELS.iter().map(|channel| declared(channel).offset_sigma);
    let tolerances = nominal.map_or_else(ModelTolerances::default, |nominal| *nominal.tolerances);
    let sigma = |suspect: &Suspect| match suspect {
        Suspect::Sensor(fault) => fault.sigma,
        Suspect::Machine(Machine::Convection) => OTHER_CONVECTION_RATIO,
        // Weather, altitude, another test: more than the tolerance of a condition explains. Each of these has one.
        Suspect::Machine(Machine::Condition(channel)) => {
            EXCLUDE_SIGMAS * standstill::tolerance(*channel, &tolerances).unwrap_or(1.0)
        }
        Suspect::Machine(Machine::ValvePlay) => OTHER_PLAY,
        Suspect::Machine(Machine::SlowAir | Machine::SlowValve) => OTHER_DELAY_S,
        Suspect::Machine(Machine::ValveStuck { .. }) => STANDS_STILL_RATIO,
        Suspect::Machine(Machine::FlowCapacity | Machine::Efficiency | Machine::ValveArea) => {
            OTHER_MACHINE_RATIO
        }
        // It has no parameter.
        Suspect::Unmodelled(_) => 1.0,
    };
    let sigmas: Vec<f64> = suspects.iter().map(sigma).collect();
    let always = offsets.chain(CHANNELS.iter().map(gain)).chain([config.barometer_sigma_pa]).collect();
    let mut priors = Priors::even(always, &sigmas, EXPECTED_FAULTS);
    let mut valve = None;
    for (index, (suspect, hypothesis)) in suspects.iter().zip(&mut priors.hypotheses).enumerate() {
        hypothesis.at_least_zero = match suspect {
            Suspect::Sensor(fault) => fault.kind == FaultKind::TowardsWall,
            Suspect::Machine(machine) => {
                matches!(machine, Machine::ValvePlay | Machine::ValveStuck { .. })
            }
            Suspect::Unmodelled(_) => false,
        };
        if matches!(suspect, Suspect::Machine(Machine::ValveStuck { .. })) {
            // One of all pairs of a first and a last step.
            hypothesis.family = *valve.get_or_insert(index);
            hypothesis.ln_prior -= 2.0 * (steps.max(1) as f64).ln();
        }
    }
    priors
}
