//! Runs a script on its own thread and synchronises with it at each step.

use crate::api;
use crate::error::{ScriptError, SequenceError};
use crate::request::SequenceRequest;
use crate::sandbox::{
    Budget, SCRIPT_LIMIT, STACK_BYTES, UnknownName, build_engine, check, find_unclosed_comment,
};
use crate::session::{Session, lock};
use crate::settle::{ScriptMessage, SequenceStep, StepResult};
use rhai::{AST, Dynamic, Engine, EvalAltResult, Position, Scope};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

/// Duration of one wait for a script's next step; a stop is noticed within this time.
const WAIT: Duration = Duration::from_millis(20);
/// Maximum number of waits for one step: one minute is enough to plan the whole grid several times.
const MAX_WAITS: u32 = 3_000;

/// A script's text, and its name in messages.
#[derive(Debug, Clone, PartialEq)]
pub struct Script {
    /// Path of its file.
    pub path: PathBuf,
    /// Text.
    pub text: String,
}

/// A running script. Dropping it ends the script at its current operation.
#[derive(Debug)]
pub struct SequenceRunner {
    /// `None` once the script has ended.
    to_script: Option<SyncSender<Option<StepResult>>>,
    messages: Option<Receiver<ScriptMessage>>,
    is_requested: bool,
    waits: u32,
    /// The script's answer, until it is fetched.
    answer: Option<Result<ScriptMessage, SequenceError>>,
    budget: Arc<Budget>,
    notes: Vec<String>,
    thread: Option<JoinHandle<()>>,
}

impl SequenceRunner {
    /// Prepares the script; it starts to run at the first [`next_step`](Self::next_step).
    pub fn start(script: Script, request: SequenceRequest) -> Result<Self, SequenceError> {
        // A buffer of one, so that a request does not wait while the script is parsed.
        let (to_script, from_caller) = sync_channel(1);
        let (to_caller, messages) = sync_channel(0);
        let budget = Arc::new(Budget::default());
        let shared = Arc::clone(&budget);
        let thread = std::thread::Builder::new()
            .name("sequence".to_owned())
            .stack_size(STACK_BYTES)
            .spawn(move || run(&script, &shared, Session::new(request, to_caller, from_caller)))
            .map_err(SequenceError::Thread)?;
        Ok(SequenceRunner {
            to_script: Some(to_script),
            messages: Some(messages),
            is_requested: false,
            waits: 0,
            answer: None,
            budget,
            notes: Vec::new(),
            thread: Some(thread),
        })
    }

    /// Passes the result of the last step (`None` before the first) to the script and requests its next step, without waiting
    /// for it. Does nothing if a request is pending.
    pub fn request_step(&mut self, finished: Option<StepResult>) {
        if std::mem::replace(&mut self.is_requested, true) {
            return;
        }
        self.waits = 0;
        if self.to_script.as_ref().is_some_and(|to_script| to_script.send(finished).is_err()) {
            self.answer = Some(Err(SequenceError::Lost));
        }
    }

    /// Whether [`next_step`](Self::next_step) will return at once; waits up to 20 ms for the script.
    pub fn is_ready(&mut self) -> bool {
        let Some(messages) = self.messages.as_ref().filter(|_| self.to_script.is_some()) else {
            return true;
        };
        if self.answer.is_some() || !self.is_requested {
            return true;
        }
        self.answer = match messages.recv_timeout(WAIT) {
            Ok(answer) => Some(Ok(answer)),
            Err(RecvTimeoutError::Disconnected) => Some(Err(SequenceError::Lost)),
            Err(RecvTimeoutError::Timeout) if self.waits >= MAX_WAITS => {
                self.budget.cancel();
                Some(Err(SequenceError::TooSlow {
                    limit_s: u64::from(MAX_WAITS) * WAIT.as_millis() as u64 / 1000,
                }))
            }
            Err(RecvTimeoutError::Timeout) => {
                self.waits += 1;
                None
            }
        };
        self.answer.is_some()
    }

    /// The script's next step; `Ok(None)` when the script has ended. If the step was not [requested](Self::request_step) before, `finished`
    /// passes the result of the last step (`None` before the first).
    ///
    /// # Errors
    /// [`SequenceError::Script`] with the script's line, [`SequenceError::TooSlow`] if it computes too long; the script has then
    /// ended.
    pub fn next_step(&mut self, finished: Option<StepResult>) -> Result<Option<SequenceStep>, SequenceError> {
        if self.to_script.is_none() {
            return Ok(None);
        }
        self.request_step(finished);
        while !self.is_ready() {}
        self.is_requested = false;
        let answer = self.answer.take().unwrap_or(Err(SequenceError::Lost));
        if !matches!(answer, Ok(ScriptMessage::Step(..))) {
            self.to_script = None;
        }
        let (outcome, notes) = match answer {
            Ok(ScriptMessage::Step(step, notes)) => (Ok(Some(*step)), notes),
            Ok(ScriptMessage::Done(notes)) => (Ok(None), notes),
            Ok(ScriptMessage::Failed(error, notes)) => (Err(SequenceError::Script(error)), notes),
            Err(error) => (Err(error), Vec::new()),
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
        // The script ends at its next operation. Close both channels before the join, because the thread may wait at either.
        self.budget.cancel();
        self.to_script = None;
        self.messages = None;
        if let Some(thread) = self.thread.take() {
            // A panic of the thread has been reported as `Lost`.
            let _ = thread.join();
        }
    }
}

fn compile(engine: &Engine, script: &Script) -> Result<AST, Box<ScriptError>> {
    if script.text.len() > SCRIPT_LIMIT {
        let message = format!("the script has {} bytes, more than {SCRIPT_LIMIT}", script.text.len());
        let thrown = EvalAltResult::ErrorRuntime(message.into(), Position::NONE);
        return Err(Box::new(ScriptError::from_run_error(script.path.clone(), "", thrown)));
    }
    if let Some(at) = find_unclosed_comment(&script.text) {
        let message = "this comment is never closed, so the rest of the script is part of it".to_owned();
        let remedy = "write `*/` at its end".to_owned();
        return Err(Box::new(ScriptError::new(script.path.clone(), &script.text, at, message, remedy)));
    }
    engine
        .compile(&script.text)
        .map_err(|error| Box::new(ScriptError::from_parse_error(script.path.clone(), &script.text, &error)))
}

/// Main function of a script's thread.
fn run(script: &Script, budget: &Arc<Budget>, session: Session) {
    let mut engine = build_engine(session.request.points.len(), budget);
    let session = Arc::new(Mutex::new(session));
    api::register(&mut engine, &session);
    let compiled = compile(&engine, script).and_then(|ast| match check(&engine, &ast) {
        Ok(()) => Ok(ast),
        Err(UnknownName { at, message, remedy }) => {
            Err(Box::new(ScriptError::new(script.path.clone(), &script.text, at, message, remedy)))
        }
    });
    if lock(&session).wait().is_err() {
        return;
    }
    let outcome = compiled.and_then(|ast| {
        // A native function, such as `sort`, swallows the error of its callback.
        let unspent = |()| {
            budget.count_operation().map_or(Ok(()), |end| {
                Err(EvalAltResult::ErrorTerminated(Dynamic::from(end), Position::NONE).into())
            })
        };
        engine
            .run_ast_with_scope(&mut Scope::new(), &ast)
            .and_then(unspent)
            .map_err(|error| Box::new(ScriptError::from_run_error(script.path.clone(), &script.text, *error)))
    });
    lock(&session).end(|notes| match outcome {
        Ok(()) => ScriptMessage::Done(notes),
        Err(error) => ScriptMessage::Failed(error, notes),
    });
}
