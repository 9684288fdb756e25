//! Compiles the sources of an FMU for this computer with its own C compiler.

use crate::errors::fmu_error::FmuExportError;
use crate::{SessionError, recording::files};
use mapper_fmu::FmuFile;
use std::path::Path;
use std::process::Command;

/// Largest library accepted into an archive, bytes.
const LIBRARY_MAX_BYTES: u64 = 64 << 20;

/// FMI platform name of this computer and its library extension; `None` if FMI has no such name.
const PLATFORM: Option<(&str, &str)> = if cfg!(all(target_os = "linux", target_arch = "x86_64")) {
    Some(("linux64", "so"))
} else if cfg!(all(target_os = "macos", target_arch = "x86_64")) {
    Some(("darwin64", "dylib"))
} else {
    None
};

/// Adds the compiled library to the files of an FMU and returns its folder. The compiler is `$CC`, or `cc` by default.
pub(crate) fn with_binary(fmu: &mut Vec<FmuFile>, identifier: &str) -> Result<String, SessionError> {
    let compiler =
        std::env::var("CC").ok().filter(|name| !name.is_empty()).unwrap_or_else(|| "cc".to_owned());
    let failed = |why: String| FmuExportError::Compiler { compiler: compiler.clone(), why };
    let Some((platform, ending)) = PLATFORM else {
        return Err(FmuExportError::Platform.into());
    };
    let scratch =
        tempfile::tempdir().map_err(SessionError::file("create", Path::new("a temporary directory")))?;
    let mut sources = Vec::new();
    for file in fmu.iter() {
        let Some(name) = file.path.strip_prefix("sources/") else { continue };
        let path = scratch.path().join(name);
        files::write_new(&path, &file.bytes)?;
        if name.ends_with(".c") {
            sources.push(path);
        }
    }
    let library = scratch.path().join(format!("{identifier}.{ending}"));
    let output = Command::new(&compiler)
        .args([
            "-std=c99",
            "-O2",
            "-shared",
            "-fPIC",
            "-fvisibility=hidden",
            "-DFMI2_Export=__attribute__((visibility(\"default\")))",
        ])
        .arg("-o")
        .arg(&library)
        .args(&sources)
        .arg("-lm")
        .output()
        .map_err(|error| failed(error.to_string()))?;
    if !output.status.success() {
        let stderr = String::from_utf8_lossy(&output.stderr);
        return Err(failed(stderr.chars().take(2000).collect()).into());
    }
    let bytes = files::read_at_most(&library, LIBRARY_MAX_BYTES)?;
    let folder = format!("binaries/{platform}");
    fmu.push(FmuFile { path: format!("{folder}/{identifier}.{ending}"), bytes });
    Ok(folder)
}
