//! Where drivers are: beside this program, then in the directories of `PATH`.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

/// What the file name of a driver begins with; the rest is the name that campaigns write.
pub const PREFIX: &str = "mapper-backend-";

/// Directories that drivers are looked for in, first one first.
#[derive(Debug, Clone, Default)]
pub struct Places(pub Vec<PathBuf>);

/// A driver that is there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Found {
    /// Name in campaigns.
    pub name: String,
    /// The program.
    pub program: PathBuf,
}

impl Places {
    /// The directory of `program`, and those of a variable like `PATH`.
    pub fn new(program: Option<&Path>, path: Option<&OsStr>) -> Places {
        let beside = program.and_then(Path::parent).map(Path::to_owned);
        let on_path = path.map(|path| std::env::split_paths(path).collect::<Vec<_>>()).unwrap_or_default();
        let mut places: Vec<PathBuf> = Vec::new();
        // A relative entry, the empty one in particular, would be whatever directory somebody stands in.
        for place in beside.into_iter().chain(on_path).filter(|place| place.is_absolute()) {
            if !places.contains(&place) {
                places.push(place);
            }
        }
        Places(places)
    }

    /// The program that drives rigs for `backend: NAME`.
    pub fn find(&self, name: &str) -> Option<PathBuf> {
        let file = file_name(name)?;
        self.0.iter().map(|place| place.join(&file)).find(|program| is_program(program))
    }

    /// All drivers, by name; the one that would be used where there are several.
    pub fn all(&self) -> Vec<Found> {
        let mut found: Vec<Found> = Vec::new();
        for place in &self.0 {
            for entry in place.read_dir().into_iter().flatten().flatten() {
                let file = entry.file_name();
                let Some(name) = file.to_str().and_then(|file| file.strip_prefix(PREFIX)) else { continue };
                let name = name.strip_suffix(std::env::consts::EXE_SUFFIX).unwrap_or(name);
                let there = found.iter().any(|found| found.name == name);
                if !there && file_name(name).is_some_and(|whole| *whole == *file) && is_program(&entry.path())
                {
                    found.push(Found { name: name.to_owned(), program: entry.path() });
                }
            }
        }
        found.sort_by(|a, b| a.name.cmp(&b.name));
        found
    }
}

/// The file name of a driver; `None` for what is not a name. It comes from a campaign: it names no other directory.
pub(crate) fn file_name(name: &str) -> Option<String> {
    let right = |letter: char| letter.is_ascii_lowercase() || letter.is_ascii_digit() || letter == '_';
    let is_name = !name.is_empty() && name.len() <= 64 && name.chars().all(right);
    is_name.then(|| format!("{PREFIX}{name}{}", std::env::consts::EXE_SUFFIX))
}

#[cfg(unix)]
fn is_program(path: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt;
    path.metadata().is_ok_and(|file| file.is_file() && file.permissions().mode() & 0o111 != 0)
}

#[cfg(not(unix))]
fn is_program(path: &Path) -> bool {
    path.is_file()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_a_name_and_no_path() {
        assert!(file_name("opc_ua2").is_some());
        for name in ["", "../x", "a/b", "A", "a.exe", "a b", "a\0", &"a".repeat(65)] {
            assert_eq!(file_name(name), None, "{name:?}");
        }
    }

    #[test]
    fn relative_directories_are_not_looked_in() {
        let path = std::env::join_paths(["", "here", "/usr/bin", "/usr/bin"]).unwrap();
        let places = Places::new(Some(Path::new("/opt/mapper/mapper")), Some(&path));
        assert_eq!(places.0, [Path::new("/opt/mapper"), Path::new("/usr/bin")]);
    }
}
