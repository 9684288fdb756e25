//! A script on its own thread, met at each step.

use crate::error::{ScriptError, SequenceError};
use crate::names::Unknown;
use crate::request::SequenceRequest;
use crate::result::StepResult;
use crate::sandbox::{SCRIPT_LIMIT, STACK_BYTES, engine};
use crate::session::{Session, lock};
use crate::step::{FromScript, SequenceStep};
use crate::{api, names};
use rhai::{AST, Engine, EvalAltResult, Scope};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

/// A script's text, and the name it has in messages.
#[derive(Debug, Clone, PartialEq)]
pub struct Script {
    /// Its file.
    pub path: PathBuf,
    /// Its text.
    pub text: String,
}

/// A running script. Dropping it ends the script where it stands.
#[derive(Debug)]
pub struct SequenceRunner {
    /// `None` once the script has ended.
    to_script: Option<SyncSender<Option<StepResult>>>,
    from_script: Option<Receiver<FromScript>>,
    notes: Vec<String>,
    thread: Option<JoinHandle<()>>,
}

impl SequenceRunner {
    /// Makes the script ready; nothing of it is run before the first [`next_step`](Self::next_step).
    ///
    /// # Errors
    /// [`SequenceError::Thread`] where no thread can be started.
    pub fn start(script: Script, request: SequenceRequest) -> Result<Self, SequenceError> {
        let (to_script, from_caller) = sync_channel(0);
        let (to_caller, from_script) = sync_channel(0);
        let thread = std::thread::Builder::new()
            .name("sequence".to_owned())
            .stack_size(STACK_BYTES)
            .spawn(move || run(&script, Session::new(request, to_caller, from_caller)))
            .map_err(SequenceError::Thread)?;
        Ok(SequenceRunner {
            to_script: Some(to_script),
            from_script: Some(from_script),
            notes: Vec::new(),
            thread: Some(thread),
        })
    }

    /// Hands over what the last step has given (`None` before the first), and lets the script go on to its next step.
    /// `Ok(None)` when the script has ended.
    ///
    /// # Errors
    /// [`SequenceError::Script`] with the script's line; the script has ended then.
    pub fn next_step(&mut self, finished: Option<StepResult>) -> Result<Option<SequenceStep>, SequenceError> {
        let (Some(to_script), Some(from_script)) = (&self.to_script, &self.from_script) else {
            return Ok(None);
        };
        let answer = to_script.send(finished).ok().and_then(|()| from_script.recv().ok());
        if !matches!(answer, Some(FromScript::Step(..))) {
            self.to_script = None;
        }
        let (outcome, notes) = match answer {
            Some(FromScript::Step(step, notes)) => (Ok(Some(*step)), notes),
            Some(FromScript::Done(notes)) => (Ok(None), notes),
            Some(FromScript::Failed(error, notes)) => (Err(SequenceError::Script(error)), notes),
            None => (Err(SequenceError::Lost), Vec::new()),
        };
        self.notes.extend(notes);
        outcome
    }

    /// The script's notes since the last call.
    pub fn take_notes(&mut self) -> Vec<String> {
        std::mem::take(&mut self.notes)
    }
}

impl Drop for SequenceRunner {
    fn drop(&mut self) {
        // Both ends go before the thread is waited for: it may stand at either.
        self.to_script = None;
        self.from_script = None;
        if let Some(thread) = self.thread.take() {
            // The script is waiting for its step or about to end; a panic of its thread has been told as `Lost`.
            let _ = thread.join();
        }
    }
}

fn compile(engine: &Engine, script: &Script) -> Result<AST, Box<ScriptError>> {
    let fail =
        |error: &rhai::ParseError| Box::new(ScriptError::parsing(script.path.clone(), &script.text, error));
    if script.text.len() > SCRIPT_LIMIT {
        let message = format!("the script has {} bytes, more than {SCRIPT_LIMIT}", script.text.len());
        let thrown = EvalAltResult::ErrorRuntime(message.into(), rhai::Position::NONE);
        return Err(Box::new(ScriptError::running(script.path.clone(), "", thrown)));
    }
    engine.compile(&script.text).map_err(|error| fail(&error))
}

/// The life of a script's thread.
fn run(script: &Script, session: Session) {
    let mut engine = engine(session.request.points.len());
    let session = Arc::new(Mutex::new(session));
    api::register(&mut engine, &session);
    let compiled = compile(&engine, script).and_then(|ast| match names::check(&engine, &ast) {
        Ok(()) => Ok(ast),
        Err(Unknown { at, message, remedy }) => {
            Err(Box::new(ScriptError::at(script.path.clone(), &script.text, at, message, remedy)))
        }
    });
    let begun = lock(&session).wait();
    if begun.is_err() {
        return;
    }
    let outcome = compiled.and_then(|ast| {
        engine
            .run_ast_with_scope(&mut Scope::new(), &ast)
            .map_err(|error| Box::new(ScriptError::running(script.path.clone(), &script.text, *error)))
    });
    lock(&session).end(|notes| match outcome {
        Ok(()) => FromScript::Done(notes),
        Err(error) => FromScript::Failed(error, notes),
    });
}
