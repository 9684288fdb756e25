//! A candidate effect in rhai: a header with its name and parameters, and functions for its hooks.
//!
//! A script computes with numbers only: arithmetic, comparison and mathematics, but no arrays, maps, files or clock. Its work
//! is limited, so that it ends, with the same result on every machine.

mod engine;
mod header;
mod hooks;

pub use crate::script::engine::HOOK_NAMES;

use engine::Program;
use header::Header;
use hooks::ScriptHooks;
use mapper_core::Channel;
use mapper_physics::rig::effect::{Effect, EffectError, EffectInfo, NamedValues, Rig};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Maximum length of a script, bytes.
const MAX_SCRIPT_BYTES: usize = 64 << 10;
/// Maximum length of a shown line or message, characters.
const MAX_SHOWN_CHARS: usize = 200;

/// A script that is not an effect.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{}{}: {message}{}", path.display(), place(*line), shown(source_line))]
pub struct ScriptEffectError {
    /// The script's file.
    pub path: PathBuf,
    /// Line, from 1; `None` for the whole script.
    pub line: Option<usize>,
    /// The line itself.
    pub source_line: String,
    /// The error and the correct form.
    pub message: String,
}

impl ScriptEffectError {
    fn new(path: &Path, text: &str, line: Option<usize>, message: String) -> Self {
        let source_line = line.and_then(|line| text.lines().nth(line.checked_sub(1)?)).unwrap_or_default();
        let clean = |text: &str| text.chars().filter(|c| !c.is_control()).take(MAX_SHOWN_CHARS).collect();
        ScriptEffectError {
            path: path.to_owned(),
            line,
            source_line: clean(source_line),
            message: clean(&message),
        }
    }
}

fn place(line: Option<usize>) -> String {
    line.map_or_else(String::new, |line| format!(":{line}"))
}

fn shown(source_line: &str) -> String {
    if source_line.is_empty() { String::new() } else { format!("\n  | {source_line}") }
}

/// An effect defined by a script.
#[derive(Debug, Clone)]
pub struct ScriptEffect {
    info: EffectInfo,
    /// Sensor lags, each with the parameter that holds its time constant, s.
    lags: Vec<(Channel, String)>,
    program: Arc<Program>,
}

impl ScriptEffect {
    /// Reads a script; messages contain `path`.
    pub fn new(text: &str, path: &Path) -> Result<Self, ScriptEffectError> {
        let fail = |line: Option<usize>, message: String| ScriptEffectError::new(path, text, line, message);
        if text.len() > MAX_SCRIPT_BYTES {
            return Err(fail(None, format!("{} bytes are more than {MAX_SCRIPT_BYTES}", text.len())));
        }
        let Header { info, lags } = header::read(text).map_err(|(line, message)| fail(line, message))?;
        let names: Vec<String> = info.parameters.iter().map(|parameter| parameter.name.to_string()).collect();
        let program =
            Program::new(text, names, lags.is_empty()).map_err(|(line, message)| fail(line, message))?;
        Ok(ScriptEffect { info, lags, program: Arc::new(program) })
    }
}

impl Effect for ScriptEffect {
    fn info(&self) -> &EffectInfo {
        &self.info
    }

    fn prepare(&self, values: &NamedValues<'_>, rig: &mut Rig) -> Result<(), EffectError> {
        // With neutral values the effect is absent, regardless of rounding in the script.
        if values.is_neutral() {
            return Ok(());
        }
        for (channel, name) in &self.lags {
            rig.instruments.path_mut(*channel).lag_s += values.get(name)?;
        }
        if self.program.has_no_hook() {
            return Ok(());
        }
        Ok(rig.hook(ScriptHooks::new(self.program.clone(), self.program.numbers(values)?))?)
    }
}
