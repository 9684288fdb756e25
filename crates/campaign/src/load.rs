//! Reads a campaign from a text or a file, or reports all its mistakes; the JSON schema of the file.

use crate::campaign::{Campaign, CampaignFile};
use crate::checks::map_misfit::{Concern, UnreachablePoint};
use crate::checks::{map_misfit, unusual_settings};
use crate::resolved::limit_is_wrong;
use crate::{machine_sizes, resolved};
use mapper_maps::table::file_text;
use mapper_yaml::{Document, FindingKind, Findings, Notes, Schema, Source, Step, Tree, steps};
use serde_json::Value;
use std::collections::BTreeSet;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// Name of a campaign file in messages.
pub(crate) static DOCUMENT: Document = Document { name: "campaign", example: "campaigns/turbo_a.yaml" };

/// Maximum size of a campaign file, bytes.
pub const MAX_FILE_BYTES: usize = 1 << 20;

/// Maximum size of a map file, bytes.
pub const MAX_MAP_BYTES: usize = 16 << 20;

/// Errors of loading a campaign.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum CampaignError {
    #[error("failed to read the campaign {}: {source}", .path.display())]
    Read { path: PathBuf, source: io::Error },
    #[error("{0}")]
    Mistakes(Box<Findings>),
}

/// Reads and checks a campaign file and the files it names.
pub fn load(path: &Path) -> Result<Campaign, CampaignError> {
    let mistakes = |findings| CampaignError::Mistakes(Box::new(findings));
    let text = mapper_yaml::open(&DOCUMENT, path, MAX_FILE_BYTES)
        .map_err(|source| CampaignError::Read { path: path.to_owned(), source })?
        .map_err(mistakes)?;
    check(&text, path, &read_named_file).map_err(mistakes)
}

/// Checks a campaign's text. `origin` names it in messages and is the base of relative paths; `files` reads the
/// files it names.
///
/// The steady states of the nominal model determine which points can be reached; see [`check_with`] for another criterion.
pub fn check(
    text: &str,
    origin: &Path,
    files: &dyn Fn(&Path) -> io::Result<String>,
) -> Result<Campaign, Findings> {
    check_with(text, origin, files, &|campaign| {
        // An unreadable map is already reported.
        map_misfit::nominal_model(campaign)
            .map(|model| map_misfit::unreachable_points(campaign, &model))
            .unwrap_or_default()
    })
}

/// Like [`check`], with another criterion for reachable points. Points are checked only if there are no other mistakes.
pub fn check_with(
    text: &str,
    origin: &Path,
    files: &dyn Fn(&Path) -> io::Result<String>,
    unreachable: &dyn Fn(&Campaign) -> Vec<UnreachablePoint>,
) -> Result<Campaign, Findings> {
    if text.len() > MAX_FILE_BYTES {
        let source = Source::new(&DOCUMENT, origin, "");
        let message = format!("the file has {} bytes, more than the maximum of {MAX_FILE_BYTES}", text.len());
        let remedy = "a campaign has a few thousand; check that this is the right file".to_owned();
        return Err(Findings::single(source, FindingKind::TooLarge, 0, message, remedy));
    }
    let (tree, mut notes) = read(text, origin)?;
    if let Some(finding) = tree.find_other_kind("campaign", &SCHEMA.keys()) {
        notes.push(finding);
        return Err(tree.findings(notes));
    }
    SCHEMA.check(&tree, &mut notes);
    if !notes.is_full() {
        map_misfit::check_consistency(&tree, files, &mut notes);
    }
    let campaign = notes.is_empty().then(|| deserialise(&tree, files, unreachable, &mut notes)).flatten();
    campaign.ok_or_else(|| tree.findings(notes))
}

fn read(text: &str, origin: &Path) -> Result<(Tree, Notes), Findings> {
    mapper_yaml::read(Source::new(&DOCUMENT, origin, text))
}

/// What `add` notes on a text; the mistakes of the text itself if it cannot be read.
fn findings(text: &str, origin: &Path, add: impl FnOnce(&mut Tree, &mut Notes)) -> Findings {
    match read(text, origin) {
        Ok((mut tree, mut notes)) => {
            add(&mut tree, &mut notes);
            tree.findings(notes)
        }
        Err(findings) => findings,
    }
}

/// Reports a mistake in the settings of a backend, which only the backend can judge, at its place in the campaign's text.
///
/// `at`: keys down to the backend's name, e.g. `backend.virtual_lab`; `setting`: the path below it, e.g. `machine.alpha_area`. A
/// missing path is replaced by its nearest existing parent. Asterisks replace a `hidden` value, since terminals are logged.
pub fn backend_mistake(
    text: &str,
    origin: &Path,
    at: &str,
    setting: &str,
    message: &str,
    hidden: bool,
) -> Findings {
    let keys = at.split('.').chain(setting.split('.'));
    let steps: Vec<Step> = keys.filter(|key| !key.is_empty()).map(Step::from).collect();
    findings(text, origin, |tree, notes| {
        if hidden {
            tree.hide(&steps);
        }
        let remedy = "docs/reference/virtual_lab.md lists the settings of the virtual lab, docs/how-to/rig.md those of drivers";
        notes.push(tree.finding(FindingKind::WrongValue, &steps, message, remedy));
    })
}

/// An unknown format of the map, at its place in the campaign's text. `known`: the supported names.
pub fn format_mistake(text: &str, origin: &Path, format: &str, known: &[&str]) -> Findings {
    findings(text, origin, |tree, notes| {
        let mut steps = steps!["outputs", "formats"].to_vec();
        let index = tree.items(&steps).iter().position(|written| written == format);
        steps.extend(index.map(Step::from));
        let message = format!("`{format}` is not a format for writing maps");
        let remedy = format!("choose from {}", known.join(", "));
        notes.push(tree.finding(FindingKind::WrongValue, &steps, message, remedy));
    })
}

/// Unusual settings in a campaign without mistakes, each at its place in the text. `more`: findings of other crates.
pub fn warnings(text: &str, origin: &Path, campaign: &Campaign, more: Vec<Concern>) -> Findings {
    findings(text, origin, |tree, notes| {
        let paths = match campaign.lines.as_slice() {
            [] => {
                tree.deserialise().map(|file: CampaignFile| file.grid.points(&[], 0.0).1).unwrap_or_default()
            }
            _ => resolved::places(campaign),
        };
        let own = unusual_settings::find_concerns(campaign, &paths).into_iter();
        let own = own.filter(|concern| !concern.is_error);
        own.chain(more).for_each(|concern| note(tree, notes, FindingKind::Unusual, concern));
    })
}

/// Mistakes of a campaign that another crate found, each at its place in the text.
pub fn mistakes(text: &str, origin: &Path, concerns: Vec<Concern>) -> Findings {
    findings(text, origin, |tree, notes| {
        concerns.into_iter().for_each(|concern| note(tree, notes, FindingKind::Implausible, concern));
    })
}

fn note(tree: &Tree, notes: &mut Notes, kind: FindingKind, concern: Concern) {
    let Concern { at, message, remedy, .. } = concern;
    notes.push(tree.finding(kind, &at, message, remedy));
}

/// Deserialises a text without known mistakes; `None` if there are findings.
fn deserialise(
    tree: &Tree,
    files: &dyn Fn(&Path) -> io::Result<String>,
    unreachable: &dyn Fn(&Campaign) -> Vec<UnreachablePoint>,
    notes: &mut Notes,
) -> Option<Campaign> {
    let file: CampaignFile = tree.deserialise().map_err(|finding| notes.push(finding)).ok()?;
    let (mut campaign, mut point_paths) = match file.campaign(&tree.source().origin, files) {
        Ok(built) => built,
        Err(error) => {
            // A file became unreadable after the check: the map if the campaign names one.
            let map = steps!["machine", "map", "file"];
            let sequence = steps!["sequence"];
            let steps: &[Step] = if tree.get(&map).is_some() { &map } else { &sequence };
            let message = format!("a file of the campaign can no longer be read: {error}");
            let remedy = "write its path relative to the campaign file";
            notes.push(tree.finding(FindingKind::MissingFile, steps, message, remedy));
            return None;
        }
    };
    campaign.machine.assumed = machine_sizes::find_assumed_sizes(tree, &campaign.machine.params);
    let wheel = steps!["machine", "geometry", "compressor", "wheel_diameter"];
    campaign.machine.wheel_is_declared = tree.get(&wheel).is_some();
    let concerns = unusual_settings::find_concerns(&campaign, &point_paths).into_iter();
    let errors = concerns.filter(|concern| concern.is_error);
    errors.for_each(|concern| note(tree, notes, FindingKind::Implausible, concern));
    if notes.is_empty()
        && !campaign.lines.is_empty()
        && let Ok(model) = map_misfit::nominal_model(&campaign)
    {
        match resolved::resolve(&mut campaign, &model) {
            Ok(()) => point_paths = resolved::places(&campaign),
            Err(concerns) => {
                for concern in concerns {
                    note(tree, notes, FindingKind::Unreachable, concern);
                }
            }
        }
    }
    if !notes.is_empty() {
        return None;
    }
    let mut unreachable = unreachable(&campaign);
    report_wrong_limits(tree, notes, &mut unreachable, campaign.points.len());
    let mut speeds_to_avoid = Vec::new();
    for UnreachablePoint { point, reason, remedy, limit } in unreachable {
        let steps = point_paths.get(point).map(Vec::as_slice).unwrap_or_default();
        // A speed to avoid is one mistake at all its openings.
        if limit == Some(&["avoid"]) {
            if speeds_to_avoid.contains(&steps) {
                continue;
            }
            speeds_to_avoid.push(steps);
        }
        notes.push(tree.finding(FindingKind::Unreachable, steps, reason, remedy));
    }
    notes.is_empty().then_some(campaign)
}

/// Reports each limit that puts many points out of reach once, and takes these points off the list.
fn report_wrong_limits(
    tree: &Tree,
    notes: &mut Notes,
    unreachable: &mut Vec<UnreachablePoint>,
    points: usize,
) {
    let limits: BTreeSet<_> = unreachable.iter().filter_map(|point| point.limit).collect();
    for limit in limits {
        let (of_limit, others): (Vec<_>, Vec<_>) =
            unreachable.iter().cloned().partition(|point| point.limit == Some(limit));
        let [first, _, ..] = of_limit.as_slice() else { continue };
        if limit_is_wrong(of_limit.len(), points) {
            let steps: Vec<Step> =
                std::iter::once(&"limits").chain(limit).map(|key| Step::from(*key)).collect();
            let message = format!("{} of {points} points are out of reach: {}", of_limit.len(), first.reason);
            let remedy = "correct the limit and its unit, or the points";
            notes.push(tree.finding(FindingKind::Unreachable, &steps, message, remedy));
            *unreachable = others;
        }
    }
}

/// A file that a campaign names, as text: of a workbook its first visible sheet with numbers, of a compressed file its content.
pub fn read_named_file(path: &Path) -> io::Result<String> {
    match String::from_utf8(mapper_yaml::read_limited(path, MAX_MAP_BYTES)?) {
        Ok(text) => Ok(without_mark(text)),
        Err(error) => file_text(error.as_bytes())
            .map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error.to_string())),
    }
}

/// A file that a campaign names, or a campaign itself, as text.
pub fn read_text(path: &Path) -> io::Result<String> {
    String::from_utf8(mapper_yaml::read_limited(path, MAX_MAP_BYTES)?)
        .map(without_mark)
        .map_err(|_| io::Error::new(io::ErrorKind::InvalidData, "it is not UTF-8"))
}

/// Text without the byte order mark that editors on Windows put before it.
fn without_mark(text: String) -> String {
    text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text)
}

/// JSON schema (draft 2020-12) of a campaign file, for editors and other tools.
///
/// Quantities are strings; `x-quantity` names their kind, `x-min`, `x-max` and `x-above` their range.
pub fn json_schema() -> Value {
    mapper_yaml::json_schema_of::<CampaignFile>()
}

/// The schema, compiled once, for validation.
static SCHEMA: LazyLock<Schema> = LazyLock::new(Schema::of::<CampaignFile>);

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Map;

    fn visit(value: &Value, check: &mut impl FnMut(&Map<String, Value>)) {
        match value {
            Value::Object(object) => {
                check(object);
                object.values().for_each(|child| visit(child, check));
            }
            Value::Array(items) => items.iter().for_each(|child| visit(child, check)),
            _ => {}
        }
    }

    #[test]
    fn every_key_is_described_and_every_mapping_is_closed() {
        let schema = json_schema();
        visit(&schema, &mut |object| {
            let Some(Value::Object(properties)) = object.get("properties") else { return };
            assert_eq!(object.get("additionalProperties"), Some(&Value::Bool(false)), "{object:?}");
            for (key, property) in properties {
                let date =
                    property.get("pattern").is_some_and(|p| p.as_str().unwrap().starts_with("^[0-9]{4}"));
                assert!(
                    date || property.get("description").is_some(),
                    "{key} has no description: {property}"
                );
            }
        });
    }

    #[test]
    fn every_quantity_and_range_is_readable() {
        visit(&json_schema(), &mut |object| {
            let ranges = ["x-min", "x-max", "x-above"];
            let Some(key) = object.get("x-quantity") else {
                assert!(!ranges.iter().any(|range| object.contains_key(*range)), "{object:?}");
                return;
            };
            let kind = crate::units::Kind::from_key(key.as_str().unwrap()).unwrap();
            for range in ranges.iter().filter_map(|range| object.get(*range)) {
                crate::units::parse(kind, range.as_str().unwrap()).unwrap();
            }
            for example in object["examples"].as_array().unwrap() {
                crate::units::parse(kind, example.as_str().unwrap()).unwrap();
            }
        });
    }

    #[test]
    fn nothing_but_the_backends_own_settings_may_be_null() {
        visit(&json_schema(), &mut |object| {
            assert!(!object.get("type").is_some_and(|name| name.to_string().contains("null")), "{object:?}");
        });
    }

    /// YAML 1.1 reads these words as true and false, and its programs write those instead.
    #[test]
    fn every_on_and_off_may_be_true_and_false() {
        visit(&json_schema(), &mut |object| {
            for (word, flag) in [("off", false), ("no", false), ("on", true), ("yes", true)] {
                let names = object.get("enum").and_then(Value::as_array).into_iter().flatten();
                let constant = object.get("const") == Some(&Value::from(word));
                if constant || names.clone().any(|name| name == word) {
                    assert!(names.clone().any(|name| *name == Value::Bool(flag)), "{object:?}");
                }
            }
        });
    }

    #[test]
    fn a_validator_without_the_own_keyword_accepts_turbo_a_and_sees_mistakes() {
        // Validates as an editor does.
        let validator = jsonschema::validator_for(&json_schema()).unwrap();
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../campaigns/turbo_a.yaml");
        let text = std::fs::read_to_string(path).unwrap();
        let source = Source::new(&crate::load::DOCUMENT, Path::new(path), &text);
        let mut value = mapper_yaml::read(source).unwrap().0.value().clone();
        assert!(validator.is_valid(&value), "{:?}", validator.validate(&value));
        for (key, text, right) in
            [("dwell", "120 kg", false), ("dwell", "2 min", true), ("dwel", "2 min", false)]
        {
            value["timing"][key] = text.into();
            assert_eq!(validator.is_valid(&value), right, "{key}: {text}");
        }
    }
}
