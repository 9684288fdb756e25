//! The files of an FMU with their paths in the archive.

use crate::description::{SOURCES, description};
use crate::header::{header, with_guid};
use crate::machine::{FmuError, FmuMachine};
use crate::variables::{switches, variables};
use sha2::{Digest, Sha256};
use std::fmt::Write;

/// A file of an FMU.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FmuFile {
    /// Path in the archive, with `/`.
    pub path: String,
    /// Contents.
    pub bytes: Vec<u8>,
}

/// Generates all files of a machine's FMU: the description, then the sources. The GUID is a hash of both, so that equal machines give
/// equal FMUs.
///
/// # Errors
/// [`FmuError::NotFinite`] with the name of the number.
pub fn files(machine: &FmuMachine<'_>) -> Result<Vec<FmuFile>, FmuError> {
    let (variables, switches) = (variables(machine), switches(machine));
    let header = header(machine, &variables, &switches)?;
    let mut hash = Sha256::new();
    hash.update(description(machine, &variables, &switches, "")?);
    hash.update(&header);
    SOURCES.iter().for_each(|(_, text)| hash.update(text));
    let guid = guid(&hash.finalize());
    let description = description(machine, &variables, &switches, &guid)?;
    let source = |name: &str, text: &str| FmuFile { path: format!("sources/{name}"), bytes: text.into() };
    let mut files = vec![FmuFile { path: "modelDescription.xml".to_owned(), bytes: description.into() }];
    files.extend(SOURCES.iter().map(|(name, text)| source(name, text)));
    files.push(source("model_data.h", &with_guid(&header, &guid)));
    Ok(files)
}

/// The first 16 bytes of a hash as `{xxxxxxxx-xxxx-xxxx-xxxx-xxxxxxxxxxxx}`.
fn guid(hash: &[u8]) -> String {
    let mut text = String::from("{");
    for (index, byte) in hash.iter().take(16).enumerate() {
        if [4, 6, 8, 10].contains(&index) {
            text.push('-');
        }
        // Writing to a String cannot fail.
        let _ = write!(text, "{byte:02x}");
    }
    text + "}"
}
