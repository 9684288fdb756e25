//! A candidate effect in rhai: a header with its name and parameters, and functions for its hooks.
//!
//! A script computes with numbers only: arithmetic, comparison and mathematics, but no arrays, maps, files or clock. Its work
//! is limited, so that it ends, with the same result on every machine.

mod engine;
mod error;
mod header;
mod hooks;

pub use crate::script::engine::HOOK_NAMES;
pub use error::ScriptEffectError;

use engine::Program;
use header::Header;
use hooks::ScriptHooks;
use mapper_core::Channel;
use mapper_physics::rig::effect::{Effect, EffectError, EffectInfo, NamedValues, Rig};
use std::path::Path;
use std::sync::Arc;

/// Maximum length of a script, bytes.
const MAX_SCRIPT_BYTES: usize = 64 << 10;

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
