//! The nightly campaign: campaigns with their methods and seeds, and the history.

use crate::load::MAX_FILE_BYTES;
use mapper_yaml::{Document, FindingKind, Findings, Schema, Source, Step, steps};
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Name of the file in messages.
static DOCUMENT: Document = Document { name: "nightly campaign", example: "campaigns/nightly.yaml" };

const MAX_RUNS: usize = 10_000;
const DEFAULT_NIGHTS: usize = 14;

/// Error while loading a nightly campaign.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum NightlyError {
    #[error("failed to read the nightly campaign {}: {source}", .path.display())]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{0}")]
    Mistakes(Box<Findings>),
}

/// The runs of every night.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Nightly {
    /// Name; only nights of the same name are compared.
    pub name: String,
    /// The history's file, relative to the working directory as written.
    pub history: PathBuf,
    /// Number of nights in the band, >= 1.
    pub nights: usize,
    /// Campaigns with methods and seeds.
    pub groups: Vec<NightlyGroup>,
}

/// One campaign with all its methods and seeds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NightlyGroup {
    /// The campaign file, resolved from the nightly file's directory.
    pub campaign: PathBuf,
    /// Methods, in the syntax of the key `method` of a campaign; empty: the campaign's own.
    pub methods: Vec<String>,
    /// Seeds; empty: the campaign's own.
    pub seeds: Vec<u64>,
    /// Number of machines drawn from the campaign's tolerances; `None`: the campaign's own.
    pub drawn_machines: Option<usize>,
}

impl NightlyGroup {
    /// Number of runs.
    pub fn runs(&self) -> usize {
        let machines = self.drawn_machines.unwrap_or(1);
        self.methods.len().max(1).saturating_mul(self.seeds.len().max(1)).saturating_mul(machines)
    }
}

/// Campaigns that are run every night.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct NightlyFile {
    /// Name; only nights of the same name are compared.
    #[schemars(regex(pattern = r"\S"), example = &"turbo_a")]
    nightly: String,
    /// File of the history, relative to the working directory; `runs/history.db` if none is given. Variables such as `${HOME}` are not replaced.
    #[schemars(regex(pattern = r"^[^~$%][^$%]*$"), example = &"runs/history.db")]
    history: Option<PathBuf>,
    /// Settings of the band of earlier nights.
    band: Option<BandFile>,
    /// Campaigns with their methods and seeds.
    #[schemars(extend("examples" = [[{"campaign": "nightly/turbo_a.yaml"}]]))]
    runs: Vec<GroupFile>,
}

/// Settings of the band of earlier nights.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct BandFile {
    /// Number of nights in the band, a whole number from 1; usually 14.
    #[schemars(range(min = 1), example = 14)]
    nights: usize,
}

/// One campaign with its methods and seeds.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct GroupFile {
    /// The campaign file, relative to this file.
    #[schemars(length(min = 1), example = &"nightly/turbo_a.yaml")]
    campaign: PathBuf,
    /// Methods by which each recording is identified; the campaign's own if none is given.
    #[schemars(extend("uniqueItems" = true, "examples" = [["dynamic", "steady"]]))]
    methods: Option<Vec<String>>,
    /// Seeds, whole numbers from 0; the campaign's own if none is given.
    #[schemars(extend("uniqueItems" = true, "examples" = [[1, 2, 3]]))]
    seeds: Option<Vec<u64>>,
    /// Number of machines that are drawn from the campaign's tolerances and run one by one, from 1.
    #[schemars(range(min = 1), example = 200)]
    drawn_machines: Option<usize>,
}

/// Loads a nightly campaign, without the campaign files in it.
pub fn load_nightly(path: &Path) -> Result<Nightly, NightlyError> {
    let mistakes = |findings| NightlyError::Mistakes(Box::new(findings));
    let text = mapper_yaml::open(&DOCUMENT, path, MAX_FILE_BYTES)
        .map_err(|source| NightlyError::Read { path: path.to_owned(), source })?
        .map_err(mistakes)?;
    check(&text, path).map_err(mistakes)
}

fn check(text: &str, path: &Path) -> Result<Nightly, Findings> {
    let (tree, mut notes) = mapper_yaml::read(Source::new(&DOCUMENT, path, text))?;
    let schema = Schema::of::<NightlyFile>();
    if let Some(finding) = tree.find_other_kind("nightly", &schema.keys()) {
        notes.push(finding);
        return Err(tree.findings(notes));
    }
    schema.check(&tree, &mut notes);
    if notes.is_empty() {
        match tree.deserialise().map(|file| resolve(file, path.parent().unwrap_or(Path::new("")))) {
            Ok(Ok(nightly)) => return Ok(nightly),
            Ok(Err(mistakes)) => mistakes.into_iter().for_each(|Mistake { steps, kind, message, remedy }| {
                notes.push(tree.finding(kind, &steps, message, remedy));
            }),
            Err(finding) => notes.push(finding),
        }
    }
    Err(tree.findings(notes))
}

/// A mistake that the schema does not show.
struct Mistake {
    steps: Vec<Step>,
    kind: FindingKind,
    message: String,
    remedy: &'static str,
}

/// Resolves the paths, and checks the rules beyond the schema.
fn resolve(file: NightlyFile, folder: &Path) -> Result<Nightly, Vec<Mistake>> {
    let mut mistakes = Vec::new();
    let mut campaigns = BTreeSet::new();
    for (index, group) in file.runs.iter().enumerate() {
        if !campaigns.insert(&group.campaign) {
            mistakes.push(Mistake {
                steps: steps!["runs", index, "campaign"].to_vec(),
                kind: FindingKind::Duplicate,
                message: format!("the campaign {} appears twice in `runs`", group.campaign.display()),
                remedy: "name it once with all its methods and seeds",
            });
        }
    }
    let groups: Vec<NightlyGroup> = file
        .runs
        .into_iter()
        .map(|group| NightlyGroup {
            campaign: folder.join(group.campaign),
            methods: group.methods.unwrap_or_default(),
            seeds: group.seeds.unwrap_or_default(),
            drawn_machines: group.drawn_machines,
        })
        .collect();
    let runs = groups.iter().fold(0_usize, |runs, group| runs.saturating_add(group.runs()));
    if !(1..=MAX_RUNS).contains(&runs) {
        mistakes.push(Mistake {
            steps: steps!["runs"].to_vec(),
            kind: FindingKind::Range,
            message: format!("{runs} runs are requested; 1 to {MAX_RUNS} are allowed"),
            remedy: "name at least one campaign, and fewer methods or seeds if there are too many runs",
        });
    }
    if !mistakes.is_empty() {
        return Err(mistakes);
    }
    Ok(Nightly {
        name: file.nightly,
        history: file.history.unwrap_or_else(|| PathBuf::from("runs/history.db")),
        nights: file.band.map_or(DEFAULT_NIGHTS, |band| band.nights),
        groups,
    })
}
