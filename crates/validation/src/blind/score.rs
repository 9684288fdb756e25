//! Scores diagnoses against the opened answers, and writes the score as text.

use crate::blind::cases::{BlindError, CaseKind, Truth};
use crate::blind::make_cases::{MANIFEST_NAME, Manifest, OUTSIDE_NAME, open, read_json};
use crate::blind::reliability::Share;
use mapper_effects::catalogue;
use mapper_numerics::statistics::{mean, nearest_rank};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

#[derive(Debug, Clone, Default, Deserialize)]
struct Diagnosis {
    verdict: String,
    #[serde(default)]
    locations: Vec<Place>,
    /// A key of the first format, in which no diagnosis is scored.
    #[serde(default, rename = "where", deserialize_with = "of_first_format")]
    _where: (),
    #[serde(default)]
    candidates: Vec<Candidate>,
    #[serde(default)]
    probability_none: Option<f64>,
    #[serde(default)]
    probability_outside: Option<f64>,
    #[serde(default)]
    gap: Option<Gap>,
}

/// Refuses a key of the first format.
fn of_first_format<'de, D: Deserializer<'de>>(_: D) -> Result<(), D::Error> {
    Err(Error::custom(
        "its keys are those of format 1 (`where` and `gap.shrink` are now `locations` and `gap.gap_reduction`); diagnose the recording again",
    ))
}

#[derive(Debug, Clone, Deserialize)]
struct Place {
    submodel: String,
}

#[derive(Debug, Clone, Default, Deserialize)]
struct Candidate {
    effects: BTreeSet<String>,
    #[serde(default)]
    probability: f64,
    #[serde(default)]
    parameters: BTreeMap<String, Estimate>,
    #[serde(default)]
    equivalent: Vec<BTreeSet<String>>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
struct Estimate {
    value: f64,
    low: Option<f64>,
    high: Option<f64>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
struct Gap {
    gap_reduction: Option<f64>,
}

/// The result of one case.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ScoredCase {
    /// Its name.
    pub name: String,
    /// Its kind.
    pub kind: CaseKind,
    /// Its causes.
    pub causes: BTreeSet<String>,
    /// Verdict of the diagnosis; `None` without a diagnosis.
    pub verdict: Option<String>,
    /// The causes in the diagnosis.
    pub named: BTreeSet<String>,
    /// Their probability.
    pub probability: Option<f64>,
    /// Whether the diagnosis is correct.
    pub right: bool,
    /// Length of the weakest cause's signature in addition to the others, in sigmas; `None` without causes or an answer that contains it.
    pub sigma: Option<f64>,
}

/// Ends of the classes of signature length, sigmas.
pub(crate) const CLASSES_SIGMA: [f64; 3] = [12.0, 24.0, f64::INFINITY];

/// Cases with similar signature lengths.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct SigmaClass {
    /// Shortest signature of the class, sigmas.
    pub from_sigma: f64,
    /// Single effects that were named.
    pub single: Share,
    /// Pairs of which both were named.
    pub pair: Share,
    /// Pairs of which at least one was named.
    pub one_of_pair: Share,
    /// Outside causes that were recognised as outside.
    pub outside: Share,
    /// Outside causes that were explained by the catalogue.
    pub falsely_explained: Share,
}

/// The table, as `score.py` prints it.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Score {
    /// Result of each case.
    pub cases: Vec<ScoredCase>,
    /// The cases by the signature length of their weakest cause.
    pub classes: [SigmaClass; CLASSES_SIGMA.len()],
    /// Recordings without effect in which no cause was named.
    pub none: Share,
    /// Recordings without effect in which a cause was named.
    pub none_named: Share,
    /// Single effects that were named, in a set of at most three.
    pub single: Share,
    /// Pairs of which both were named.
    pub pair: Share,
    /// Pairs of which at least one was named.
    pub one_of_pair: Share,
    /// Triples of which all three were named.
    pub triple: Share,
    /// Triples of which at least two were named.
    pub two_of_triple: Share,
    /// Outside causes that were recognised as outside.
    pub outside: Share,
    /// Outside causes that were explained by the catalogue.
    pub falsely_explained: Share,
    /// Effects whose part of the machine was among the first two.
    pub place: Share,
    /// Parameters whose 95 % interval contains the true value.
    pub covered: Share,
    /// Median error of a parameter over its distance from neutral; `None` if none was named.
    pub parameter_error_median: Option<f64>,
    /// Median share of the gap that was removed; `None` if nothing was named.
    pub gap_reduction_median: Option<f64>,
    /// Brier score: mean squared difference between 1 and the probability of the true cause; `None` without cases.
    pub squared_miss_mean: Option<f64>,
    /// Mean number of indistinguishable explanations; `None` without diagnoses.
    pub set_size_mean: Option<f64>,
}

/// Opens the seal and compares NAME.diagnosis.json of each case with its answer. A missing or broken diagnosis is wrong, not an error.
pub fn score(directory: &Path) -> Result<Score, BlindError> {
    let manifest = Manifest::read(&directory.join(MANIFEST_NAME))?;
    let truths = open(directory, &manifest)?;
    Ok(score_truths(&truths, |name| {
        read_json::<Diagnosis>(&directory.join(format!("{name}.diagnosis.json")), "diagnosis").ok()
    }))
}

/// Writes NAME.truth.json of each answer next to its recording, for `score.py`.
pub fn open_answers(directory: &Path) -> Result<usize, BlindError> {
    let manifest = Manifest::read(&directory.join(MANIFEST_NAME))?;
    let truths = open(directory, &manifest)?;
    for truth in &truths {
        // Names come from the answers, which are sealed, but a name must not lead out of the directory.
        if !manifest.cases.contains(&truth.name) || truth.name.contains(['/', '\\']) {
            continue;
        }
        let path = directory.join(format!("{}.truth.json", truth.name));
        let bytes = serde_json::to_vec_pretty(truth).map_err(|source| BlindError::Content {
            path: path.clone(),
            what: "JSON",
            source,
        })?;
        std::fs::write(&path, bytes).map_err(BlindError::file(&path))?;
    }
    Ok(truths.len())
}

fn kind_of(truth: &Truth) -> CaseKind {
    if truth.effects.keys().any(|id| id.starts_with("X_") || id == OUTSIDE_NAME) {
        return CaseKind::Outside;
    }
    match truth.effects.len() {
        0 => CaseKind::None,
        1 => CaseKind::Single,
        2 => CaseKind::Pair,
        _ => CaseKind::Triple,
    }
}

fn score_truths(truths: &[Truth], diagnosis_of: impl Fn(&str) -> Option<Diagnosis>) -> Score {
    let catalogue = catalogue();
    // Neighbours that share a balance may both show the gap.
    let shows_in = |id: &str, submodel: &str| {
        catalogue.iter().any(|effect| effect.info().id == id && effect.info().shows_in(submodel))
    };
    let neutral: BTreeMap<String, f64> = catalogue
        .iter()
        .filter_map(|effect| match effect.info().parameters.as_slice() {
            [only] => Some((effect.info().id.to_string(), only.neutral)),
            _ => None,
        })
        .collect();
    let mut score = Score::default();
    for (class, from_sigma) in score.classes.iter_mut().zip(std::iter::once(&0.0).chain(&CLASSES_SIGMA)) {
        class.from_sigma = *from_sigma;
    }
    let (mut errors, mut reductions, mut squared_misses, mut set_sizes) = (vec![], vec![], vec![], vec![]);
    for truth in truths {
        let causes: BTreeSet<String> = truth.effects.keys().cloned().collect();
        let kind = kind_of(truth);
        let diagnosis = diagnosis_of(&truth.name);
        let compared = diagnosis.as_ref().map(|diagnosis| ComparedDiagnosis::new(kind, &causes, diagnosis));
        let right = compared.as_ref().is_some_and(|compared| compared.right);
        let verdict = diagnosis.as_ref().map(|diagnosis| diagnosis.verdict.as_str());
        let sigma = truth.sigmas.values().copied().reduce(f64::min);
        let mut unclassified = SigmaClass::default();
        let of_class = sigma.and_then(|sigma| CLASSES_SIGMA.iter().position(|end| sigma < *end));
        let class = of_class.map_or(&mut unclassified, |place| &mut score.classes[place]);
        match kind {
            CaseKind::None => {
                score.none.count(right);
                score.none_named.count(compared.as_ref().is_some_and(|compared| !compared.named.is_empty()));
            }
            CaseKind::Single => {
                score.single.count(right);
                class.single.count(right);
            }
            CaseKind::Pair => {
                let names_one =
                    compared.as_ref().is_some_and(|compared| !compared.named.is_disjoint(&causes));
                for (both, at_least) in
                    [(&mut score.pair, &mut score.one_of_pair), (&mut class.pair, &mut class.one_of_pair)]
                {
                    both.count(right);
                    at_least.count(names_one);
                }
            }
            CaseKind::Triple => {
                score.triple.count(right);
                let named =
                    compared.as_ref().map_or(0, |compared| compared.named.intersection(&causes).count());
                score.two_of_triple.count(named >= 2);
            }
            CaseKind::Outside => {
                let is_falsely_explained = verdict == Some("explained");
                for (recognised, explained) in [
                    (&mut score.outside, &mut score.falsely_explained),
                    (&mut class.outside, &mut class.falsely_explained),
                ] {
                    recognised.count(right);
                    explained.count(is_falsely_explained);
                }
            }
        }
        let p_truth = compared.as_ref().map_or(0.0, |compared| compared.p_truth);
        squared_misses.push((1.0 - p_truth.min(1.0)).powi(2));
        if let (Some(diagnosis), Some(compared)) = (&diagnosis, &compared) {
            set_sizes.push(compared.set_size as f64);
            if matches!(kind, CaseKind::Single | CaseKind::Pair | CaseKind::Triple) {
                let first_two = diagnosis.locations.iter().take(2);
                let right = first_two
                    .flat_map(|place| causes.iter().map(|id| shows_in(id, &place.submodel)))
                    .any(|right| right);
                score.place.count(right);
                if compared.named == causes {
                    let estimates = diagnosis.candidates.first().map(|first| &first.parameters);
                    for (id, value) in &truth.effects {
                        let estimate = estimates.and_then(|estimates| estimates.get(id));
                        let (Some(value), Some(neutral), Some(estimate)) =
                            (value.as_f64(), neutral.get(id), estimate)
                        else {
                            continue;
                        };
                        errors.push((estimate.value - value).abs() / (value - neutral).abs());
                        let (low, high) =
                            (estimate.low.unwrap_or(f64::NAN), estimate.high.unwrap_or(f64::NAN));
                        score.covered.count(low <= value && value <= high);
                    }
                    reductions.extend(diagnosis.gap.and_then(|gap| gap.gap_reduction));
                }
            }
        }
        score.cases.push(ScoredCase {
            name: truth.name.clone(),
            kind,
            causes,
            verdict: verdict.map(str::to_owned),
            probability: diagnosis
                .as_ref()
                .and_then(|diagnosis| Some(diagnosis.candidates.first()?.probability)),
            named: compared.map_or_else(BTreeSet::new, |compared| compared.named),
            right,
            sigma,
        });
    }
    // For an even number, the upper of the two middle values, as in `score.py`.
    score.parameter_error_median = nearest_rank(&errors, 0.5);
    score.gap_reduction_median = nearest_rank(&reductions, 0.5);
    score.squared_miss_mean = mean(&squared_misses);
    score.set_size_mean = mean(&set_sizes);
    score
}

struct ComparedDiagnosis {
    named: BTreeSet<String>,
    set_size: usize,
    right: bool,
    p_truth: f64,
}

impl ComparedDiagnosis {
    fn new(kind: CaseKind, causes: &BTreeSet<String>, diagnosis: &Diagnosis) -> Self {
        let verdict = diagnosis.verdict.as_str();
        let first = diagnosis.candidates.first();
        let names = matches!(verdict, "explained" | "partly_explained");
        let named = first.filter(|_| names).map_or_else(BTreeSet::new, |first| first.effects.clone());
        let equivalent = first.map_or(&[][..], |first| &first.equivalent);
        let set_size = 1 + equivalent.len();
        let in_set = named == *causes || equivalent.contains(causes);
        let right = match kind {
            CaseKind::None => verdict == "within_tolerance",
            CaseKind::Outside => matches!(verdict, "unexplained" | "partly_explained"),
            CaseKind::Single | CaseKind::Pair | CaseKind::Triple => {
                verdict != "within_tolerance" && in_set && set_size <= 3
            }
        };
        let p_truth = match kind {
            CaseKind::None => diagnosis.probability_none.unwrap_or(0.0),
            CaseKind::Outside => diagnosis.probability_outside.unwrap_or(0.0),
            CaseKind::Single | CaseKind::Pair | CaseKind::Triple => diagnosis
                .candidates
                .iter()
                .filter(|candidate| candidate.effects == *causes || candidate.equivalent.contains(causes))
                .map(|candidate| candidate.probability)
                .sum(),
        };
        ComparedDiagnosis { named, set_size, right, p_truth }
    }
}

impl Score {
    /// A heading and a row for each class of signature length.
    pub fn class_rows(&self) -> Vec<[String; 6]> {
        let heading =
            ["signature", "single", "both of two", "one of two", "outside, said so", "falsely explained"];
        let ends = CLASSES_SIGMA.iter();
        let rows = self.classes.iter().zip(ends).map(|(class, end)| {
            let range = if end.is_finite() {
                format!("{:.0} to {end:.0} sigma", class.from_sigma)
            } else {
                format!("{:.0} sigma and more", class.from_sigma)
            };
            let share = |share: Share| format!("{}/{}", share.hits, share.trials);
            let shares =
                [class.single, class.pair, class.one_of_pair, class.outside, class.falsely_explained];
            let [single, pair, one, outside, falsely] = shares.map(share);
            [range, single, pair, one, outside, falsely]
        });
        std::iter::once(heading.map(str::to_owned)).chain(rows).collect()
    }

    /// Labels and values of the table, in its order.
    pub fn rows(&self) -> Vec<(&'static str, String)> {
        let number = |value: Option<f64>, decimals: usize| {
            value.map_or_else(|| "-".to_owned(), |value| format!("{value:.decimals$}"))
        };
        let percent = self.parameter_error_median.map(|error| 100.0 * error);
        vec![
            ("no effect, none named", self.none.to_string()),
            ("  an effect named", self.none_named.to_string()),
            ("single effect named", self.single.to_string()),
            ("both of two named", self.pair.to_string()),
            ("  at least one of two", self.one_of_pair.to_string()),
            ("all of three named", self.triple.to_string()),
            ("  at least two of three", self.two_of_triple.to_string()),
            ("outside, said so", self.outside.to_string()),
            ("  falsely explained", self.falsely_explained.to_string()),
            ("place right (first two)", self.place.to_string()),
            ("parameter error, median", format!("{} %", number(percent, 1))),
            ("95 % interval covers truth", self.covered.to_string()),
            ("gap reduction, median", number(self.gap_reduction_median, 3)),
            ("mean squared error of p", number(self.squared_miss_mean, 3)),
            ("set size, mean", number(self.set_size_mean, 2)),
        ]
    }

    /// A line for each case.
    pub fn case_lines(&self) -> String {
        let line = |case: &ScoredCase| {
            format!(
                "{}: {} {}{} -> {} {} {}\n",
                case.name,
                case.kind.name(),
                list(&case.causes),
                case.sigma.map_or_else(String::new, |sigma| format!(" ({sigma:.0} sigma)")),
                case.verdict.as_deref().unwrap_or("no diagnosis"),
                list(&case.named),
                if case.right { "ok" } else { "WRONG" },
            )
        };
        self.cases.iter().map(line).collect()
    }
}

fn list(ids: &BTreeSet<String>) -> String {
    if ids.is_empty() { "-".to_owned() } else { ids.iter().cloned().collect::<Vec<_>>().join(" + ") }
}
