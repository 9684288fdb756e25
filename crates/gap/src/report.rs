//! What a diagnosis says, as machines read it.

use crate::baseline_assumptions::Since;
use crate::experiment::{Beside, Experiment};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The word on the whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Nothing beyond what is declared.
    WithinTolerance,
    /// An effect or pair of the catalogue leaves nothing but noise.
    Explained,
    /// An effect or pair removes most, and what is left is more than tolerance.
    PartlyExplained,
    /// Nothing of the catalogue removes most of it.
    Unexplained,
}

/// A diagnosis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Diagnosis {
    /// The word on the whole.
    pub verdict: Verdict,
    /// Where a healthy recording was given: all that is said is of what changed since.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub since: Option<Since>,
    /// Places of the gap, largest first.
    pub r#where: Vec<Place>,
    /// Causes, best first.
    pub candidates: Vec<Candidate>,
    /// Probability that nothing is beyond tolerance.
    pub probability_none: f64,
    /// Probability that the cause is outside the catalogue.
    pub probability_outside: f64,
    /// Laws found for what the catalogue leaves, best first; empty where none is proposed.
    pub laws: Vec<Law>,
    /// What each balance lacks if it alone lacks something, the most probable first; empty where nothing was looked for.
    pub forces: Vec<MissingForce>,
    /// The gap before and after.
    pub gap: Gap,
    /// What to do next; `None` where nothing is left to settle.
    pub next: Option<Next>,
    /// What the stand can do to tell the open causes apart, best first for each minute; `next` is the first of it.
    pub experiments: Vec<Suggestion>,
    /// Where nothing is named: how small each effect would have been seen.
    pub smallest_seen: Vec<SmallestSeen>,
    /// What was assumed because the campaign does not declare it; one sentence each.
    pub assumed: Vec<String>,
    /// Sensors that a soak shows to be off by more than is declared, which was subtracted beforehand; one sentence each.
    pub off_at_rest: Vec<String>,
    /// What could not be used, and what to know before believing the rest; one sentence each.
    pub warnings: Vec<String>,
}

/// A place of the gap.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Place {
    /// Part of the model.
    pub submodel: String,
    /// Channel in which it shows most.
    pub channel: String,
    /// Phase of the step in which it shows most.
    pub phase: String,
    /// Region of the map in which it shows most.
    pub region: String,
    /// Share of the whole gap's energy, 0..1.
    pub share: f64,
    /// Size in standard deviations of what is declared.
    pub sigma: f64,
    /// Root mean square in the channel's unit.
    pub size: f64,
    /// That unit.
    pub unit: String,
}

/// A parameter with its 95 % interval.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Estimate {
    /// Best value.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Unit.
    pub unit: String,
    /// Value at which the effect is not there.
    pub neutral: f64,
    /// The best value in words.
    pub size: String,
}

/// With which step a cause begins.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Onset {
    /// Place of the step, from 0; files have its number, from 1.
    #[serde(serialize_with = "mapper_core::step_number::serialize")]
    pub step: usize,
    /// Its start, s of the recording.
    pub t_s: f64,
    /// Whether the cause grows from there to the end; else it is whole from there on.
    pub grows: bool,
}

/// How small an effect would have been seen.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SmallestSeen {
    /// Id of the effect.
    pub effect: String,
    /// Its name for people.
    pub name: String,
    /// The parameter that says its size.
    pub parameter: String,
    /// The value that would have been named in 95 of 100 recordings like this one; `None` where none within its range would.
    pub value: Option<f64>,
    /// Unit.
    pub unit: String,
    /// The value in words.
    pub size: Option<String>,
}

/// A law that was found for a missing force.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Law {
    /// Part of the model in which it sits.
    pub submodel: String,
    /// What it says, with its numbers.
    pub sentence: String,
    /// Its terms.
    pub terms: Vec<LawTerm>,
    /// Probability that it is this law, among all that were tried and none of them.
    pub probability: f64,
    /// Share of the gap that it removes on steps used neither to find nor to fit it; 0 where a channel gets worse on them.
    pub shrink: f64,
    /// Number of these steps.
    pub held_out_steps: usize,
    /// Each channel on these steps.
    pub channels: BTreeMap<String, ChannelGap>,
    /// Channels that it makes worse on them.
    pub worse: Vec<String>,
    /// Effects of the catalogue beside which it was found; empty where it stands alone.
    pub beside: Vec<String>,
    /// Share of the folds of steps, each left out once, in which the others ask for the same part and for this law's terms or
    /// their like.
    pub stability: f64,
    /// Laws that the recording does not tell from this one, as sentences.
    pub equivalent: Vec<String>,
    /// The effect file that was written for it.
    pub rhai: Option<String>,
    /// What that file holds; `None` where a script cannot say it.
    #[serde(skip)]
    pub script: Option<String>,
}

/// One number of a law with its 95 % interval.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LawTerm {
    /// What it is.
    pub term: String,
    /// Best value.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Unit.
    pub unit: String,
}

/// The force that one balance lacks, if it is the only one that lacks something.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MissingForce {
    /// Part of the model.
    pub submodel: String,
    /// What is missing.
    pub force: String,
    /// Its unit.
    pub unit: String,
    /// Logarithm of the evidence for it, over nothing missing.
    pub evidence: f64,
    /// At the end of each step: value and the ends of its 95 % interval.
    pub steps: Vec<[f64; 3]>,
}

/// A cause: one effect or several together.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Candidate {
    /// Ids of its effects.
    pub effects: Vec<String>,
    /// Their names for people.
    pub names: Vec<String>,
    /// Calibrated probability that it is these effects, with or without others too weak to tell.
    pub probability: f64,
    /// Parameters; `inner_node.phi` where an effect has several.
    pub parameters: BTreeMap<String, Estimate>,
    /// Effects that begin with a step, by id.
    pub onsets: BTreeMap<String, Onset>,
    /// Causes that the data cannot tell apart from this one.
    pub equivalent: Vec<Vec<String>>,
}

/// Root mean square residual of a channel over the steps, each predicted by a fit that did not see it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChannelGap {
    /// With the nominal model as it stands, nothing fitted.
    pub nominal: f64,
    /// With the nominal model, tolerances fitted.
    pub before: f64,
    /// With the best cause.
    pub after: f64,
    /// Unit.
    pub unit: String,
}

/// Efficiency and heat transfer at the end of a step, three times at the same speed, pressures and metal temperatures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PointGap {
    /// Shaft speed, rpm.
    pub speed_rpm: f64,
    /// Valve opening.
    pub valve: f64,
    /// Efficiency by the nominal model as it stands.
    pub eta_nominal: f64,
    /// Efficiency with the tolerances found beside the best cause, without the cause.
    pub eta_before: f64,
    /// Efficiency with the best cause.
    pub eta_after: f64,
    /// Heat-transfer coefficient by the nominal model as it stands, W/(m2 K).
    pub h_nominal_w_m2k: f64,
    /// Heat-transfer coefficient with the tolerances found beside the best cause, without the cause, W/(m2 K).
    pub h_before_w_m2k: f64,
    /// Heat-transfer coefficient with the best cause, W/(m2 K).
    pub h_after_w_m2k: f64,
}

/// A tolerance or offset beyond what is declared.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Strained {
    /// Which.
    pub what: String,
    /// By how much it is off, in sigmas as declared, > 0; 6 at most.
    pub sigmas: f64,
}

/// The gap, each step predicted by a fit that did not see it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Gap {
    /// Mean of `(|r|^2 - n)/n` over the steps, nominal model as it stands.
    pub nominal: f64,
    /// The same with tolerances fitted.
    pub before: f64,
    /// The same with the best cause.
    pub after: f64,
    /// Share removed; 0 where a channel gets worse.
    pub shrink: f64,
    /// 95 % interval of the share in steps like these: lower end.
    pub shrink_low: f64,
    /// Upper end.
    pub shrink_high: f64,
    /// Number of steps whose misfit is beyond noise, tolerances fitted: the witnesses of the interval.
    pub steps_with_gap: usize,
    /// Place of the step that carries most of the gap, from 0; files have its number, from 1.
    #[serde(serialize_with = "mapper_core::step_number::option::serialize")]
    pub largest_step: Option<usize>,
    /// Its share of the gap.
    pub largest_share: f64,
    /// The tolerance that is furthest from what is declared where no cause is assumed; `None` where all are within three sigmas.
    pub strained: Option<Strained>,
    /// Channels that the cause makes worse.
    pub worse: Vec<String>,
    /// Places of the steps that were held out in one of the folds; none where steps are too few. Files have numbers, from 1.
    #[serde(serialize_with = "mapper_core::step_number::list::serialize")]
    pub held_out_steps: Vec<usize>,
    /// The folds: places of the steps that were held out together, from 0; files have numbers, from 1.
    #[serde(serialize_with = "mapper_core::step_number::lists::serialize")]
    pub folds: Vec<Vec<usize>>,
    /// Each channel.
    pub channels: BTreeMap<String, ChannelGap>,
    /// Each operating point.
    pub points: Vec<PointGap>,
}

/// An operating point of a jump.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct JumpPoint {
    /// Shaft speed, rpm.
    pub speed_rpm: f64,
    /// Valve opening.
    pub valve: f64,
}

/// What to do next.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Next {
    /// The jump that separates the remaining candidates best.
    Jump {
        /// Where it starts.
        from: JumpPoint,
        /// Where it goes.
        to: JumpPoint,
        /// Probability expected for the true candidate after it.
        expected_probability: f64,
        /// Its length, min.
        minutes: f64,
        /// T3 before and after, where the step changes it, K.
        #[serde(skip_serializing_if = "Option::is_none")]
        t3_k: Option<[f64; 2]>,
        /// Oil temperature before and after, where the step changes it, K.
        #[serde(skip_serializing_if = "Option::is_none")]
        oil_temperature_k: Option<[f64; 2]>,
    },
    /// A soak before the next run.
    Soak {
        /// Time at rest, min.
        soak_minutes: f64,
        /// Probability expected for the true candidate after it.
        expected_probability: f64,
    },
    /// The sensor that would.
    Sensor {
        /// Which.
        sensor: String,
        /// Why.
        reason: String,
    },
}

/// What kind of experiment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// To another speed, at any opening.
    Jump,
    /// To another opening at one speed.
    ValveStep,
    /// Another turbine inlet temperature at one point.
    T3Step,
    /// Another oil temperature at one point.
    OilStep,
    /// A jump with a channel measured that was not.
    Sensor,
    /// A rest before the run, in which sensors are held against each other.
    Soak,
}

impl Kind {
    /// All of them.
    pub const ALL: [Kind; 6] =
        [Kind::Jump, Kind::ValveStep, Kind::T3Step, Kind::OilStep, Kind::Sensor, Kind::Soak];

    /// That of an experiment.
    pub fn of(experiment: &Experiment) -> Kind {
        match experiment.beside {
            Beside::T3 { .. } => Kind::T3Step,
            Beside::Oil { .. } => Kind::OilStep,
            Beside::Sensor(_) => Kind::Sensor,
            Beside::Soak(_) => Kind::Soak,
            Beside::Nothing if experiment.is_valve_step() => Kind::ValveStep,
            Beside::Nothing => Kind::Jump,
        }
    }
}

/// An experiment and what is expected of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Suggestion {
    /// What kind.
    pub kind: Kind,
    /// Where it starts, settled; standing still for a soak.
    pub from: JumpPoint,
    /// Where it goes.
    pub to: JumpPoint,
    /// T3 before and after, where the step changes it, K.
    pub t3_k: Option<[f64; 2]>,
    /// Oil temperature before and after, where the step changes it, K.
    pub oil_temperature_k: Option<[f64; 2]>,
    /// Channel that is measured as well.
    pub sensor: Option<String>,
    /// Its length, min; for a sensor with half an hour to mount it.
    pub minutes: f64,
    /// Probability that the true one of the open causes has 95 % of what these have afterwards.
    pub probability_settled: f64,
    /// Mean of what it has afterwards.
    pub expected_probability: f64,
    /// By how much the entropy of the open causes is expected to drop, bit.
    pub entropy_drop_bit: f64,
    /// That entropy before, bit.
    pub entropy_bit: f64,
    /// The lines of a sequence that run it; for a soak that of the campaign.
    pub script: Vec<String>,
}

impl Suggestion {
    /// As what to do next.
    pub fn as_next(&self) -> Next {
        if let Some(sensor) = &self.sensor {
            return Next::Sensor {
                sensor: format!("a sensor for {sensor}"),
                reason: format!(
                    "with it one jump answers {:.0} % of what is open between the first candidates",
                    100.0 * self.entropy_drop_bit / self.entropy_bit.max(f64::MIN_POSITIVE)
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

/// The law that is more probable than not; `None` where none is.
pub fn law_found(diagnosis: &Diagnosis) -> Option<&Law> {
    diagnosis.laws.first().filter(|law| law.probability > 0.5)
}
