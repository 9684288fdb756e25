//! The nightly campaign: which campaigns are run by which methods with which seeds, and where the history is.

use crate::deserialise;
use crate::load::{FILE_SIZE_LIMIT, read_limited};
use serde::Deserialize;
use std::path::{Path, PathBuf};

/// Most runs that one nightly campaign may ask for.
const RUNS_LIMIT: usize = 10_000;
/// Nights that make a band where the file does not say.
const DEFAULT_NIGHTS: usize = 14;

/// Why there is no nightly campaign.
#[derive(Debug, thiserror::Error)]
pub enum NightlyError {
    /// The file cannot be read.
    #[error("failed to read the nightly campaign {}: {source}", .path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file is not what it should be.
    #[error("{}: {source}", .path.display())]
    Mistake {
        /// The file.
        path: PathBuf,
        /// What is wrong, and what to do.
        source: NightlyMistake,
    },
}

/// A mistake in a nightly campaign.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NightlyMistake {
    /// Not text.
    #[error("this is not UTF-8 from byte {valid_bytes} on; save it as UTF-8")]
    NotText {
        /// Bytes before the first that is not.
        valid_bytes: usize,
    },
    /// A key or a value that the file cannot have; the message names its place.
    #[error("{reason}")]
    Form {
        /// What the reader of the file said.
        reason: String,
    },
    /// No name.
    #[error("`nightly` is empty; give the nightly campaign a name")]
    NoName,
    /// A band over no night.
    #[error("`band.nights` is 0; a band needs at least 1 night, 14 are usual")]
    NoNights,
    /// Nothing to run, or more than a night holds.
    #[error("it asks for {runs} runs; 1 to {RUNS_LIMIT} can be made")]
    Runs {
        /// Number of runs asked for.
        runs: usize,
    },
    /// A method or a seed that a group names twice.
    #[error("`runs[{index}]` ({}) names {what} twice", .campaign.display())]
    Twice {
        /// The group, from 0.
        index: usize,
        /// Its campaign.
        campaign: PathBuf,
        /// What it names twice.
        what: &'static str,
    },
    /// A campaign in two groups.
    #[error(
        "the campaign {} stands in `runs` twice; name it once with all its methods and seeds",
        .campaign.display()
    )]
    CampaignTwice {
        /// The campaign.
        campaign: PathBuf,
    },
}

/// What is run every night.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Nightly {
    /// Name; nights of other names are never compared.
    pub name: String,
    /// The history's file, relative to the working directory as written.
    pub history: PathBuf,
    /// Nights that make the band, >= 1.
    pub nights: usize,
    /// Campaigns with methods and seeds.
    pub groups: Vec<NightlyGroup>,
}

/// One campaign with all its methods and seeds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NightlyGroup {
    /// The campaign file, resolved from the nightly file's directory.
    pub campaign: PathBuf,
    /// Methods, as the key `method` of a campaign writes them; empty: the campaign's own.
    pub methods: Vec<String>,
    /// Seeds; empty: the campaign's own.
    pub seeds: Vec<u64>,
}

impl NightlyGroup {
    /// Number of runs.
    pub fn runs(&self) -> usize {
        self.methods.len().max(1).saturating_mul(self.seeds.len().max(1))
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct NightlyFile {
    nightly: String,
    #[serde(default)]
    history: Option<PathBuf>,
    #[serde(default)]
    band: Option<BandFile>,
    runs: Vec<GroupFile>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct BandFile {
    nights: usize,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct GroupFile {
    campaign: PathBuf,
    #[serde(default)]
    methods: Vec<String>,
    #[serde(default)]
    seeds: Vec<u64>,
}

/// Reads a nightly campaign. The campaigns it names are not read.
///
/// # Errors
/// [`NightlyError`] where the file cannot be read, has unknown or missing keys, or asks for no run, the same run twice,
/// or more than 10 000.
pub fn load_nightly(path: &Path) -> Result<Nightly, NightlyError> {
    let read = |source| NightlyError::Read { path: path.to_owned(), source };
    let mistake = |source| NightlyError::Mistake { path: path.to_owned(), source };
    let bytes = read_limited(path, FILE_SIZE_LIMIT).map_err(read)?;
    let text = String::from_utf8(bytes).map_err(|error| {
        mistake(NightlyMistake::NotText { valid_bytes: error.utf8_error().valid_up_to() })
    })?;
    let file: NightlyFile =
        deserialise::any(&text).map_err(|error| mistake(NightlyMistake::Form { reason: error.message }))?;
    if file.nightly.trim().is_empty() {
        return Err(mistake(NightlyMistake::NoName));
    }
    let nights = file.band.map_or(DEFAULT_NIGHTS, |band| band.nights);
    if nights == 0 {
        return Err(mistake(NightlyMistake::NoNights));
    }
    let folder = path.parent().unwrap_or(Path::new(""));
    let groups: Vec<NightlyGroup> = file
        .runs
        .into_iter()
        .map(|group| NightlyGroup {
            campaign: folder.join(group.campaign),
            methods: group.methods,
            seeds: group.seeds,
        })
        .collect();
    let runs = groups.iter().fold(0_usize, |runs, group| runs.saturating_add(group.runs()));
    if !(1..=RUNS_LIMIT).contains(&runs) {
        return Err(mistake(NightlyMistake::Runs { runs }));
    }
    for (index, group) in groups.iter().enumerate() {
        let campaign = group.campaign.clone();
        let twice = |what| mistake(NightlyMistake::Twice { index, campaign, what });
        if has_duplicate(&group.methods) {
            return Err(twice("a method"));
        }
        if has_duplicate(&group.seeds) {
            return Err(twice("a seed"));
        }
        if groups[..index].iter().any(|other| other.campaign == group.campaign) {
            return Err(mistake(NightlyMistake::CampaignTwice { campaign: group.campaign.clone() }));
        }
    }
    let history = file.history.unwrap_or_else(|| PathBuf::from("runs/history.db"));
    Ok(Nightly { name: file.nightly, history, nights, groups })
}

fn has_duplicate<T: Ord>(values: &[T]) -> bool {
    let distinct: std::collections::BTreeSet<&T> = values.iter().collect();
    distinct.len() != values.len()
}
