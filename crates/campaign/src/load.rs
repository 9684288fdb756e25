//! From a text, or a file, to a campaign or all its mistakes.

use crate::campaign::{Campaign, CampaignFile};
use crate::checking::scalar_text;
use crate::consistency;
use crate::deserialise;
use crate::finding::{FindingKind, Findings, Notes, Source};
use crate::reach::{self, Unreachable};
use crate::structure;
use crate::tree::{self, Node, Step, path_text};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// Largest campaign file that is read, bytes.
pub const FILE_SIZE_LIMIT: usize = 1 << 20;

/// Largest map file that is read, bytes.
pub const MAP_SIZE_LIMIT: usize = 16 << 20;

/// Why there is no campaign.
#[derive(Debug, thiserror::Error)]
pub enum CampaignError {
    /// The file cannot be read.
    #[error("failed to read the campaign {}: {source}", .path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The file has mistakes.
    #[error("{0}")]
    Mistakes(Box<Findings>),
}

/// Reads and checks a campaign file and the files it names.
///
/// # Errors
/// [`CampaignError::Read`] where the file cannot be read, [`CampaignError::Mistakes`] with all its mistakes.
pub fn load(path: &Path) -> Result<Campaign, CampaignError> {
    let bytes = read_limited(path, FILE_SIZE_LIMIT)
        .map_err(|source| CampaignError::Read { path: path.to_owned(), source })?;
    let mistakes = |findings| CampaignError::Mistakes(Box::new(findings));
    let text = match String::from_utf8(bytes) {
        Ok(text) => text,
        Err(error) => {
            let at = error.utf8_error().valid_up_to();
            let source = Source::new(path, &String::from_utf8_lossy(error.as_bytes()));
            let message = "this is not UTF-8".to_owned();
            let remedy = "save the file as UTF-8".to_owned();
            return Err(mistakes(single(source, FindingKind::Syntax, at, message, remedy)));
        }
    };
    check(&text, path, &read_text).map_err(mistakes)
}

/// Checks a campaign's text. `origin` names it in messages and is where relative paths start; `files` reads the
/// files it names.
///
/// Points are judged by the steady states of the nominal model; see [`check_with`] for another judge.
///
/// # Errors
/// All mistakes of the text in one go.
pub fn check(
    text: &str,
    origin: &Path,
    files: &dyn Fn(&Path) -> io::Result<String>,
) -> Result<Campaign, Findings> {
    check_with(text, origin, files, &|campaign| {
        // A map that cannot be read is a finding already.
        reach::nominal_model(campaign)
            .map(|model| reach::unreachable_points(campaign, &model))
            .unwrap_or_default()
    })
}

/// As [`check`], with the caller's own judgement of which points can be reached.
///
/// # Errors
/// All mistakes of the text in one go; points are judged only where there are no others.
pub fn check_with(
    text: &str,
    origin: &Path,
    files: &dyn Fn(&Path) -> io::Result<String>,
    unreachable: &dyn Fn(&Campaign) -> Vec<Unreachable>,
) -> Result<Campaign, Findings> {
    if text.len() > FILE_SIZE_LIMIT {
        let source = Source::new(origin, "");
        let message =
            format!("the file has {} bytes, more than the {FILE_SIZE_LIMIT} that are read", text.len());
        let remedy = "a campaign needs a few thousand; is this the right file?".to_owned();
        return Err(single(source, FindingKind::TooLarge, 0, message, remedy));
    }
    let source = Source::new(origin, text);
    let mut notes = Notes::default();
    if let Some(root) = tree::read(&source, &mut notes) {
        structure::check(&source, &root, &mut notes);
        if !notes.is_full() {
            consistency::check(&source, &root, files, &mut notes);
        }
        if notes.is_empty()
            && let Some(campaign) = finish(&source, &root, files, unreachable, &mut notes)
        {
            return Ok(campaign);
        }
    }
    Err(Findings::new(source, notes))
}

/// A mistake in the settings of a backend, which only the backend can judge, at its place in the campaign's text.
///
/// `setting` is the path below the backend's name, e.g. `machine.alpha_area`; a path that the text does not have
/// points at what there is of it.
pub fn backend_mistake(text: &str, origin: &Path, backend: &str, setting: &str, message: &str) -> Findings {
    let source = Source::new(origin, text);
    let mut notes = Notes::default();
    let root = tree::read(&source, &mut notes);
    let mut steps = tree::steps!["backend", backend].to_vec();
    steps.extend(setting.split('.').filter(|key| !key.is_empty()).map(Step::from));
    let span = root.map_or(0..0, |root| root.place(&steps));
    let remedy = "the settings of each backend are listed in docs/tour.md".to_owned();
    let kind = FindingKind::WrongValue;
    notes.push(source.finding(kind, path_text(&steps), span, message.to_owned(), remedy));
    Findings::new(source, notes)
}

/// A format of the map that nobody writes, at its place in the campaign's text. `known`: the names that can be written.
pub fn format_mistake(text: &str, origin: &Path, format: &str, known: &[&str]) -> Findings {
    let source = Source::new(origin, text);
    let mut notes = Notes::default();
    let list = tree::steps!["outputs", "formats"];
    let root = tree::read(&source, &mut notes);
    let written = root.as_ref().and_then(|root| root.get(&list)).map(|list| list.items()).unwrap_or_default();
    let named = |node: &Node| scalar_text(node) == Some(format);
    let mut steps = list.to_vec();
    steps.extend(written.iter().position(named).map(Step::from));
    let span = root.as_ref().map_or(0..0, |root| root.place(&steps));
    let message = format!("`{format}` is not a format that a map can be written in");
    let remedy = format!("choose from {}", known.join(", "));
    notes.push(source.finding(FindingKind::WrongValue, path_text(&steps), span, message, remedy));
    Findings::new(source, notes)
}

/// Deserialises a text without known mistakes. `None` with at least one finding.
fn finish(
    source: &Source,
    root: &Node,
    files: &dyn Fn(&Path) -> io::Result<String>,
    unreachable: &dyn Fn(&Campaign) -> Vec<Unreachable>,
    notes: &mut Notes,
) -> Option<Campaign> {
    let file: CampaignFile = match deserialise::any(source.text()) {
        Ok(file) => file,
        Err(error) => {
            let at = source.byte_of_char(error.character.unwrap_or_default());
            let remedy = "put the value into quotes, or write it more plainly".to_owned();
            let kind = FindingKind::WrongValue;
            notes.push(source.finding(kind, String::new(), at..at, error.message, remedy));
            return None;
        }
    };
    let (campaign, point_paths) = match file.campaign(&source.origin, files) {
        Ok(built) => built,
        Err(error) => {
            // Both were there a moment ago; the map is the usual one.
            let map = tree::steps!["machine", "map", "file"];
            let sequence = tree::steps!["sequence"];
            let steps: &[tree::Step] = if root.get(&map).is_some() { &map } else { &sequence };
            let message = format!("a file of the campaign cannot be read any more: {error}");
            let remedy = "write its path relative to the campaign file".to_owned();
            let kind = FindingKind::MissingFile;
            notes.push(source.finding(kind, path_text(steps), root.place(steps), message, remedy));
            return None;
        }
    };
    for Unreachable { point, reason, remedy } in unreachable(&campaign) {
        let steps = point_paths.get(point).map(Vec::as_slice).unwrap_or_default();
        let kind = FindingKind::Unreachable;
        notes.push(source.finding(kind, path_text(steps), root.place(steps), reason, remedy));
    }
    notes.is_empty().then_some(campaign)
}

fn single(source: Source, kind: FindingKind, at: usize, message: String, remedy: String) -> Findings {
    let mut notes = Notes::default();
    notes.push(source.finding(kind, String::new(), at..at, message, remedy));
    Findings::new(source, notes)
}

fn read_text(path: &Path) -> io::Result<String> {
    String::from_utf8(read_limited(path, MAP_SIZE_LIMIT)?)
        .map_err(|_| io::Error::new(io::ErrorKind::InvalidData, "it is not UTF-8"))
}

/// Reads a file without ever holding much more than `limit` bytes, whatever the file claims to be.
pub(crate) fn read_limited(path: &Path, limit: usize) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path)?;
    file.take(limit as u64 + 1).read_to_end(&mut bytes)?;
    if bytes.len() > limit {
        return Err(io::Error::new(
            io::ErrorKind::FileTooLarge,
            format!("it is larger than the {limit} bytes that are read"),
        ));
    }
    Ok(bytes)
}
