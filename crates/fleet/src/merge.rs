//! Merges parts into the result, which is the same for any number of machines and any order of work.

use crate::files::{Machine, file_name_safe, make_directory};
use crate::part::PartRefusal;
use crate::status::{Status, UnfinishedItem};
use crate::{Fleet, FleetError, Kind, Outcome, Output};
use std::cell::RefCell;
use std::path::{Path, PathBuf};

/// Outcome of a merge.
#[derive(Debug)]
pub struct MergeOutcome {
    /// Progress of the study.
    pub status: Status,
    /// The result's directory and one-line description; `None` if parts are missing and nothing was written.
    pub result: Option<(PathBuf, String)>,
}

impl Fleet {
    /// Merges all parts into `result`; with missing or failed parts only if `partial` is set. Only one part is in memory at a
    /// time. Two concurrent merges write the same bytes.
    ///
    /// # Errors
    /// [`FleetError`] if a file cannot be written, or a part's result has the wrong content for the kind.
    pub fn merge(
        &self,
        kind: &dyn Kind,
        partial: bool,
        machine: &Machine<'_>,
    ) -> Result<MergeOutcome, FleetError> {
        let mut status = self.status();
        if status.unfinished() > 0 && !partial {
            return Ok(MergeOutcome { status, result: None });
        }
        let new = self.directory().join(format!(".result.{}.new", file_name_safe(machine.name)));
        let output = Output::new(make_directory(new.clone())?);
        let damaged: RefCell<Vec<UnfinishedItem>> = RefCell::default();
        let mut parts = self.study.items.iter().map(|item| {
            let result = match self.read_part(item) {
                Some(Ok((part, body))) if part.outcome == Outcome::Done => Ok(body),
                Some(Ok((_, reason))) => Err(reason),
                Some(Err(refusal)) => {
                    let why = Some(refusal.to_string());
                    let (name, hash) = (item.name.clone(), item.hash);
                    damaged.borrow_mut().push(UnfinishedItem { name, hash, why });
                    Err(refusal.to_string())
                }
                None => Err("missing".to_owned()),
            };
            (item.name.clone(), result)
        });
        let description = kind.merge(&self.study.settings, &mut parts, &output);
        drop(parts);
        // Parts whose content was changed; their headers are intact.
        for changed in damaged.into_inner() {
            self.rename_changed_part(&changed);
            if !status.refused.contains(&changed) {
                status.done -= 1;
                status.refused.push(changed);
            }
        }
        let is_complete = partial || status.unfinished() == 0;
        let description = match description {
            Ok(description) if is_complete => description,
            other => {
                let _ = std::fs::remove_dir_all(&new);
                // Damaged parts are reported first, because they may have caused the failure.
                return match other {
                    Err(error) if is_complete => Err(error),
                    _ => Ok(MergeOutcome { status, result: None }),
                };
            }
        };
        let result = self.result();
        let installed = install(&new, &result);
        let _ = std::fs::remove_dir_all(&new);
        installed?;
        Ok(MergeOutcome { status, result: Some((result, description)) })
    }

    /// Renames a part with changed content, which would otherwise count as done because its header is intact.
    fn rename_changed_part(&self, changed: &UnfinishedItem) {
        let part = self.part(&changed.hash);
        let is_changed = changed.why.as_deref() == Some(PartRefusal::Checksum.to_string().as_str());
        if is_changed {
            let _ = std::fs::rename(&part, self.parts().join(format!(".{}.changed", changed.hash)));
        }
    }
}

/// Moves each file to the result's directory and removes the files of an earlier merge.
fn install(new: &Path, result: &Path) -> Result<(), FleetError> {
    make_directory(result.to_owned())?;
    let names = |folder: &Path| -> Result<Vec<_>, FleetError> {
        let entries = std::fs::read_dir(folder).map_err(FleetError::file("read", folder))?;
        let mut names: Vec<_> = entries.flatten().map(|entry| entry.file_name()).collect();
        names.sort();
        Ok(names)
    };
    let files = names(new)?;
    for name in &files {
        let target = result.join(name);
        std::fs::rename(new.join(name), &target).map_err(FleetError::file("write", &target))?;
    }
    for name in names(result)?.into_iter().filter(|name| files.binary_search(name).is_err()) {
        // Another merge may have removed it already.
        let _ = std::fs::remove_file(result.join(name));
    }
    Ok(())
}
