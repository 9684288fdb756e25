//! Diagnosis report, machine-readable.

use crate::gap::baseline::Baseline;
use crate::gap::experiment::{AlsoChanged, Experiment, GapWarning, OffsetAtRest};
use mapper_core::unit_factors::{CM2_PER_M2, G_PER_KG, MM_PER_M, PERCENT};
use mapper_core::{nan_where_null, probability_text, with_unit};
use mapper_physics::laws::turbine::at_150_krpm;
use mapper_physics::rig::effect::EffectParameter;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Overall verdict.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Everything is within the declared tolerances.
    WithinTolerance,
    /// An effect or pair of the effect library leaves only noise.
    Explained,
    /// An effect or pair removes most of the gap, but the residual exceeds tolerance.
    PartlyExplained,
    /// No effect or pair removes most of the gap.
    Unexplained,
}

impl Verdict {
    /// Whether a cause of the library is named.
    pub fn names_a_cause(self) -> bool {
        matches!(self, Verdict::Explained | Verdict::PartlyExplained)
    }
}

/// A diagnosis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Diagnosis {
    /// Overall verdict.
    pub verdict: Verdict,
    /// Set if a baseline was given: the diagnosis then covers only changes since that recording.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub baseline: Option<Baseline>,
    /// Locations of the gap, largest first.
    pub locations: Vec<Place>,
    /// Causes, best first.
    pub candidates: Vec<Candidate>,
    /// Tolerances that end beyond three sigmas of their prior in the reported fit, furthest first: suspects.
    pub suspects: Vec<BeyondPrior>,
    /// Parts of the machine whose causes fit this recording equally well; empty if the named cause is the only one.
    pub inseparable: Vec<String>,
    /// Probability that nothing is beyond tolerance.
    pub probability_none: f64,
    /// Probability of causes of the effect library that are not among the candidates.
    pub probability_unlisted: f64,
    /// Probability of a cause outside the effect library, alone or with effects of it; candidates with a closure term are included.
    pub probability_outside: f64,
    /// Closure terms for the gap that the effect library does not explain, best first; empty if none is proposed.
    pub closure_terms: Vec<ClosureTerm>,
    /// The closure term that each balance would need if it were the only one, most probable first; empty without a search.
    pub closure_terms_by_balance: Vec<BalanceClosure>,
    /// The gap before and after the best cause.
    pub gap: Gap,
    /// What the cause, or the closure term that is more probable than not, does to the map; `None` without one.
    pub map_effect: Option<MapEffect>,
    /// Suggested next step; `None` if the diagnosis is settled.
    pub next: Option<Next>,
    /// Experiments that distinguish the open causes, best per minute first; `next` is the first of them.
    pub experiments: Vec<Suggestion>,
    /// If no cause is named: the smallest detectable size of each effect.
    pub smallest_seen: Vec<SmallestSeen>,
    /// Assumptions for missing campaign declarations; one sentence each.
    pub assumed: Vec<String>,
    /// Sensor offsets beyond tolerance, found at rest and already subtracted.
    pub offsets_at_rest: Vec<OffsetAtRest>,
    /// Whether improbable causes are listed, too.
    #[serde(skip)]
    pub lists_all: bool,
    /// Limits of the diagnosis.
    #[serde(serialize_with = "mapper_core::json_messages::serialize")]
    pub warnings: Vec<GapWarning>,
}

/// A location of the gap.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Place {
    /// Part of the model.
    pub submodel: String,
    /// Channel with the largest share.
    pub channel: String,
    /// Phase of the step with the largest share.
    pub phase: String,
    /// Region of the map with the largest share.
    pub region: String,
    /// Share of the whole gap's energy, 0..1.
    pub share: f64,
    /// Size in declared standard deviations.
    pub sigma: f64,
    /// Root mean square in the channel's unit.
    pub size: f64,
    /// Unit of `size`.
    pub unit: String,
}

/// A parameter with its 95 % interval.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// Best value.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Unit.
    pub unit: String,
    /// Value without the effect.
    pub neutral: f64,
    /// The best value as text.
    pub size: String,
}

/// Onset of a cause.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Onset {
    /// Index of the step, from 0; files use its number, from 1.
    #[serde(with = "mapper_core::test_plan::step_number")]
    pub step: usize,
    /// Start of the step, s of the recording.
    pub t_s: f64,
    /// Whether the cause grows from there to the end; otherwise it acts in full from there on.
    pub grows: bool,
}

/// Smallest detectable size of an effect.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SmallestSeen {
    /// Id of the effect.
    pub effect: String,
    /// Display name.
    pub name: String,
    /// The parameter that sets its size.
    pub parameter: String,
    /// The value that would be named in 95 of 100 recordings like this one; `None` if no value in its range would.
    pub value: Option<f64>,
    /// Unit.
    pub unit: String,
    /// The value as text.
    pub size: Option<String>,
}

/// A term that closes a balance outside the effect library.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClosureTerm {
    /// Part of the model where it acts.
    pub submodel: String,
    /// The term as a sentence, with its numbers.
    pub sentence: String,
    /// Its coefficients.
    pub terms: Vec<ClosureCoefficient>,
    /// Probability of this term among all terms tried and none.
    pub probability: f64,
    /// Share of the gap removed on held-out steps, where no channel gets worse.
    pub gap_reduction: f64,
    /// Number of these held-out steps.
    pub held_out_steps: usize,
    /// Library effects fitted together with the term; empty if it was found alone.
    pub with_effects: Vec<String>,
    /// Closure terms that the recording cannot distinguish from this one, as sentences.
    pub equivalent: Vec<String>,
    /// Name of the effect file written for it.
    pub rhai: Option<String>,
    /// Content of that file; `None` if a script cannot express the term.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub script: Option<String>,
}

/// One number of a closure term with its 95 % interval.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClosureCoefficient {
    pub term: String,
    /// Best value.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    pub unit: String,
}

/// The closure term that one balance would need, assuming that it is the only one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BalanceClosure {
    /// Part of the model.
    pub submodel: String,
    /// The missing quantity.
    pub quantity: String,
    pub unit: String,
    /// Logarithm of its evidence relative to none.
    pub evidence: f64,
    /// At the end of each step: value and the ends of its 95 % interval.
    pub steps: Vec<[f64; 3]>,
}

/// A cause: one or more effects.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Candidate {
    /// Ids of its effects.
    pub effects: Vec<String>,
    /// Display names.
    pub names: Vec<String>,
    /// Calibrated probability of these effects, with or without others too weak to detect.
    pub probability: f64,
    /// Probability of each effect, whatever the others.
    #[serde(default)]
    pub each: Vec<f64>,
    /// Parameters; `inner_node.phi` if an effect has several.
    pub parameters: BTreeMap<String, Estimate>,
    /// Onsets of effects that begin with a step, by id.
    pub onsets: BTreeMap<String, Onset>,
    /// Causes that the data cannot distinguish from this one.
    pub equivalent: Vec<Vec<String>>,
}

impl Candidate {
    /// Id of a closure term among the effects of a cause.
    pub const CLOSURE: &str = "closure_term";

    /// The same with a closure term as one more member.
    pub(crate) fn with_closure(mut self, sentence: &str, probability: f64) -> Candidate {
        self.effects.push(Candidate::CLOSURE.to_owned());
        self.names.push(sentence.to_owned());
        self.each.push(probability);
        self
    }

    /// Whether a closure term is a member.
    pub fn has_closure(&self) -> bool {
        self.effects.last().is_some_and(|effect| effect == Candidate::CLOSURE)
    }

    /// The sentence of its closure term.
    pub(crate) fn closure(&self) -> Option<&String> {
        self.names.last().filter(|_| self.has_closure())
    }
}

/// Root mean square residual of a channel over the steps, each predicted by a fit to other steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ChannelGap {
    /// Nominal model, nothing fitted.
    pub nominal: f64,
    /// Nominal model, tolerances fitted.
    pub before: f64,
    /// With the best cause.
    pub after: f64,
    /// Its unit.
    pub unit: String,
}

/// Efficiency and heat transfer at the end of a step for three models, at the same speed, pressures and metal temperatures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PointGap {
    /// Shaft speed, rpm.
    pub speed_rpm: f64,
    /// Valve opening.
    pub valve: f64,
    /// Efficiency of the nominal model.
    #[serde(deserialize_with = "nan_where_null")]
    pub eta_nominal: f64,
    /// Efficiency with the tolerances of the best cause's fit, but without the cause.
    #[serde(deserialize_with = "nan_where_null")]
    pub eta_before: f64,
    /// Efficiency with the best cause.
    #[serde(deserialize_with = "nan_where_null")]
    pub eta_after: f64,
    /// Residual of T2 - T1 at the end of the step, from a fit to other steps, as an error of the efficiency: what an outside cause may do.
    #[serde(deserialize_with = "nan_where_null")]
    pub eta_residual: f64,
    /// Heat-transfer coefficient of the nominal model, W/(m2 K).
    #[serde(deserialize_with = "nan_where_null")]
    pub h_nominal_w_m2k: f64,
    /// Heat-transfer coefficient with the tolerances of the best cause's fit, but without the cause, W/(m2 K).
    #[serde(deserialize_with = "nan_where_null")]
    pub h_before_w_m2k: f64,
    /// Heat-transfer coefficient with the best cause, W/(m2 K).
    #[serde(deserialize_with = "nan_where_null")]
    pub h_after_w_m2k: f64,
}

/// The largest error that a cause makes in an efficiency identified from one step by itself.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MapEffect {
    /// Index of the step, from 0; files use its number, from 1.
    #[serde(with = "mapper_core::test_plan::step_number")]
    pub step: usize,
    /// Shaft speed, rpm.
    pub speed_rpm: f64,
    /// Valve opening.
    pub valve: f64,
    /// Efficiency as recorded minus that without the cause, fraction.
    pub eta_error: f64,
    /// Half of its 95 % interval, from the size of the cause.
    pub half_interval: f64,
}

/// A tolerance or offset outside its prior.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BeyondPrior {
    /// Name.
    pub what: String,
    /// Absolute deviation in declared sigmas, above 3.
    pub sigmas: f64,
    /// Deviation, in the unit of the changed quantity; ratios for gains and scales.
    pub value: f64,
}

/// The gap, with each step predicted by a fit to other steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Gap {
    /// Mean of `(|r|^2 - n)/n` over the steps for the nominal model.
    pub nominal: f64,
    /// The same with tolerances fitted.
    pub before: f64,
    /// The same with the best cause.
    pub after: f64,
    /// Gap reduction as a share; 0 if a channel gets worse.
    pub gap_reduction: f64,
    /// 95 % interval of this share for similar steps: lower end.
    pub gap_reduction_low: f64,
    /// Upper end.
    pub gap_reduction_high: f64,
    /// Number of steps with a misfit beyond noise after the tolerance fit: the sample size of the interval.
    pub steps_with_gap: usize,
    /// Index of the step with the largest share of the gap, from 0; files use its number, from 1.
    #[serde(with = "mapper_core::test_plan::step_number")]
    pub largest_step: Option<usize>,
    /// Its share of the gap.
    pub largest_share: f64,
    /// The tolerance furthest outside its prior without a cause; `None` if all are within three sigmas.
    pub beyond_prior: Option<BeyondPrior>,
    /// Channels that the cause makes worse.
    pub worse: Vec<String>,
    /// Indices of the steps held out in one of the folds; empty if there are too few steps. Files use numbers, from 1.
    #[serde(with = "mapper_core::test_plan::step_number")]
    pub held_out_steps: Vec<usize>,
    /// Folds: indices of the steps held out together, from 0; files use numbers, from 1.
    #[serde(with = "mapper_core::test_plan::step_number")]
    pub folds: Vec<Vec<usize>>,
    /// Each channel.
    pub channels: BTreeMap<String, ChannelGap>,
    /// Each operating point.
    pub points: Vec<PointGap>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct JumpPoint {
    pub speed_rpm: f64,
    /// Valve opening.
    pub valve: f64,
}

/// Suggested next step.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Next {
    /// The jump that best distinguishes the remaining candidates.
    Jump {
        /// Start.
        from: JumpPoint,
        /// Target.
        to: JumpPoint,
        /// Expected probability of the true candidate afterwards.
        expected_probability: f64,
        /// Duration, min.
        minutes: f64,
        /// T3 before and after, K, if the step changes it.
        #[serde(skip_serializing_if = "Option::is_none")]
        t3_k: Option<[f64; 2]>,
        /// Oil temperature before and after, K, if the step changes it.
        #[serde(skip_serializing_if = "Option::is_none")]
        oil_temperature_k: Option<[f64; 2]>,
    },
    /// A soak before the next run.
    Soak {
        /// Time at rest, min.
        soak_minutes: f64,
        /// Expected probability of the true candidate afterwards.
        expected_probability: f64,
    },
    /// A sensor that would distinguish them.
    Sensor {
        /// Name.
        sensor: String,
        /// Reason.
        reason: String,
    },
}

/// Kind of experiment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Change of speed, at any opening.
    Jump,
    /// Change of opening at one speed.
    ValveStep,
    /// Change of turbine inlet temperature at one point.
    T3Step,
    /// Change of oil temperature at one point.
    OilStep,
    /// A jump with an additional channel measured.
    Sensor,
    /// A soak before the run, in which the sensors are compared with each other.
    Soak,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Kind; 6] =
        [Kind::Jump, Kind::ValveStep, Kind::T3Step, Kind::OilStep, Kind::Sensor, Kind::Soak];

    /// Kind of an experiment.
    pub fn of(experiment: &Experiment) -> Kind {
        match experiment.also {
            AlsoChanged::T3 { .. } => Kind::T3Step,
            AlsoChanged::Oil { .. } => Kind::OilStep,
            AlsoChanged::Sensor(_) => Kind::Sensor,
            AlsoChanged::Soak(_) => Kind::Soak,
            AlsoChanged::Nothing if experiment.is_valve_step() => Kind::ValveStep,
            AlsoChanged::Nothing => Kind::Jump,
        }
    }
}

/// An experiment with its expected result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Suggestion {
    /// Kind.
    pub kind: Kind,
    /// Start, settled; standstill for a soak.
    pub from: JumpPoint,
    /// Target.
    pub to: JumpPoint,
    /// T3 before and after, K, if the step changes it.
    pub t3_k: Option<[f64; 2]>,
    /// Oil temperature before and after, K, if the step changes it.
    pub oil_temperature_k: Option<[f64; 2]>,
    /// Additionally measured channel.
    pub sensor: Option<String>,
    /// Duration, min; for a sensor it includes half an hour of mounting.
    pub minutes: f64,
    /// Probability that the true cause ends with 95 % of the probability of all open causes.
    pub probability_settled: f64,
    /// Expected share of the true cause afterwards.
    pub expected_probability: f64,
    /// Expected reduction of the entropy of the open causes, bit.
    pub entropy_drop_bit: f64,
    /// Entropy of the open causes before, bit.
    pub entropy_bit: f64,
    /// Sequence lines that run it; campaign lines for a soak.
    pub script: Vec<String>,
}

impl Suggestion {
    pub(crate) fn as_next(&self) -> Next {
        if let Some(sensor) = &self.sensor {
            return Next::Sensor {
                sensor: format!("a sensor for {sensor}"),
                reason: format!(
                    "with it one jump answers {:.0} % of what is open between the first candidates",
                    PERCENT * self.entropy_drop_bit / self.entropy_bit.max(f64::MIN_POSITIVE)
                ),
            };
        }
        if self.kind == Kind::Soak {
            return Next::Soak {
                soak_minutes: self.minutes,
                expected_probability: self.expected_probability,
            };
        }
        Next::Jump {
            from: self.from,
            to: self.to,
            expected_probability: self.expected_probability,
            minutes: self.minutes,
            t3_k: self.t3_k,
            oil_temperature_k: self.oil_temperature_k,
        }
    }
}

/// Probability below which a cause other than the first is not listed. Bound: it would be shown as "<0.5 %".
pub(crate) const EXCLUDED: f64 = 0.005;
/// Probability below which a cause other than the first is listed only on request. Bound: one in twenty is what an interval excludes.
const LISTED: f64 = 0.05;
/// Maximum number of candidates that are evaluated with refits: fits of the search, and experiments. Bound: effort.
pub(crate) const MAX_REFITTED: usize = 7;
/// Maximum number of alternatives to the first cause, and of experiments of one kind. Bound: a longer list does not help.
pub(crate) const MAX_EQUIVALENT: usize = 2;

impl Diagnosis {
    /// Causes to list: the first if it explains the gap, and others that are not improbable.
    pub fn listed(&self) -> impl Iterator<Item = &Candidate> {
        let explains = |place| place == 0 && self.verdict == Verdict::Explained;
        let candidates = self.candidates.iter().enumerate();
        let listed = move |(place, c): &(usize, &Candidate)| {
            explains(*place) || self.lists_all || c.probability >= LISTED
        };
        candidates.filter(listed).map(|(_, c)| c)
    }

    /// The closure term that is more probable than not; `None` if there is none.
    pub fn probable_closure_term(&self) -> Option<&ClosureTerm> {
        self.closure_terms.first().filter(|term| term.probability > 0.5)
    }

    /// Whether a cause outside the library is more probable than not, and no closure term describes it: it may change any point.
    pub fn is_outside_without_closure(&self) -> bool {
        let is_open = matches!(self.verdict, Verdict::PartlyExplained | Verdict::Unexplained);
        is_open && self.probability_outside > 0.5 && self.probable_closure_term().is_none()
    }

    /// Why the named cause is not the best explanation of the recording; `None` if it is.
    pub fn doubt(&self) -> Option<String> {
        if let Some(term) = self.probable_closure_term() {
            return Some(format!(
                "a closure term explains the recording better ({}): {}; add it as an effect to the next diagnosis",
                probability_text(term.probability),
                term.sentence
            ));
        }
        let others: Vec<String> = self
            .candidates
            .first()
            .into_iter()
            .flat_map(|first| &first.equivalent)
            .map(|set| set.join(" + "))
            .collect();
        match self.verdict {
            Verdict::PartlyExplained | Verdict::Unexplained => Some(format!(
                "a cause outside the effect library is the most probable ({}), and its effect is not included",
                probability_text(self.probability_outside)
            )),
            Verdict::Explained if !others.is_empty() => {
                Some(format!("the recording does not distinguish the cause from {}", others.join(", ")))
            }
            Verdict::Explained | Verdict::WithinTolerance => None,
        }
    }
}

/// A parameter value as text: "+5 %" for a factor of 1.05, "370 W at 150 krpm" for friction.
pub(crate) fn size_in_words(parameter: &EffectParameter, value: f64) -> String {
    match parameter.unit.as_ref() {
        "1" if parameter.neutral == 1.0 => {
            format!("{}{} %", sign(value - 1.0), figures(PERCENT * (value - 1.0).abs()))
        }
        "1" => format!("{} %", figures(PERCENT * value)),
        "m" => format!("{} mm", figures(MM_PER_M * value)),
        "kg/kg" => format!("{} g/kg", figures(G_PER_KG * value)),
        "m2" => format!("{} cm2 of black surface", figures(CM2_PER_M2 * value)),
        "W s2/rad2" => at_150_krpm(value),
        unit => with_unit(figures(value), unit),
    }
}

fn sign(value: f64) -> &'static str {
    if value < 0.0 { "-" } else { "+" }
}

/// Three figures, without trailing zeros.
fn figures(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let decimals = (2 - value.abs().log10().floor() as i32).max(0);
    let text = format!("{value:.*}", decimals as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_by_hand() {
        let parameter = |unit: &'static str, neutral: f64| EffectParameter {
            name: "x".into(),
            unit: unit.into(),
            low: 0.0,
            high: 2.0,
            neutral,
            typical_step: 0.1,
        };
        for (unit, neutral, value, expected) in [
            ("1", 1.0, 1.05, "+5 %"),
            ("1", 1.0, 0.9367, "-6.33 %"),
            ("1", 0.0, 0.12, "12 %"),
            ("m", 0.0, 1.5e-3, "1.5 mm"),
            ("W s2/rad2", 0.0, 1.49e-6, "370 W at 150 krpm"),
            ("m2", 0.0, 4e-3, "40 cm2 of black surface"),
            ("kg/kg", 0.0, 0.012, "12 g/kg"),
            ("Pa", 0.0, -310.0, "-310 Pa"),
        ] {
            assert_eq!(size_in_words(&parameter(unit, neutral), value), expected);
        }
    }
}
