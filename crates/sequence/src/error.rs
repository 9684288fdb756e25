//! Errors of a script, with their position in it.

use crate::request::Refusal;
use rhai::{Dynamic, EvalAltResult, ParseError, Position};
use std::fmt;
use std::path::PathBuf;

/// Maximum number of characters of a source line in a message.
const LINE_LIMIT: usize = 200;
/// Maximum number of characters of a message: a script may throw anything.
const MESSAGE_LIMIT: usize = 1000;

/// Failure of a sequence.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum SequenceError {
    /// The script has an error, or one of its steps was refused.
    #[error("{0}")]
    Script(Box<ScriptError>),
    #[error("the thread of the sequence script could not be started: {0}")]
    Thread(#[source] std::io::Error),
    #[error(
        "the sequence script computed for {limit_s} s without a new step and was ended; reduce its work between two steps"
    )]
    TooSlow { limit_s: u64 },
    #[error("the sequence script ended without a result: this is a fault of the program")]
    Lost,
}

/// An error of a script; [`Display`](fmt::Display) shows the line with a caret.
#[derive(Debug, Clone, PartialEq)]
pub struct ScriptError {
    /// The script's file.
    pub path: PathBuf,
    /// Line, from 1; `None` if the error concerns the whole script.
    pub line: Option<usize>,
    /// Column, from 1, in characters.
    pub column: Option<usize>,
    /// The line itself, without control characters.
    pub source_line: String,
    /// The error, with values and units.
    pub message: String,
    /// The remedy; empty if the message contains it.
    pub remedy: String,
    /// Lines from which the function with the error was called, innermost first.
    pub called_from: Vec<usize>,
}

impl std::error::Error for ScriptError {}

impl fmt::Display for ScriptError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.message)?;
        let path = self.path.display();
        let Some(line) = self.line else {
            write!(f, "  --> {path}")?;
            return self.write_tail(f, 2);
        };
        let column = self.column.unwrap_or(1);
        let number = line.to_string();
        let margin = " ".repeat(number.len());
        writeln!(f, "{margin}--> {path}:{line}:{column}")?;
        writeln!(f, "{margin} |")?;
        writeln!(f, "{number} | {}", self.source_line)?;
        write!(f, "{margin} | {}^", " ".repeat(column.saturating_sub(1).min(LINE_LIMIT)))?;
        self.write_tail(f, number.len())
    }
}

impl ScriptError {
    fn write_tail(&self, f: &mut fmt::Formatter<'_>, margin: usize) -> fmt::Result {
        let margin = " ".repeat(margin);
        for line in &self.called_from {
            write!(f, "\n{margin} = called from line {line}")?;
        }
        if !self.remedy.is_empty() {
            write!(f, "\n{margin} = help: {}", self.remedy)?;
        }
        Ok(())
    }

    pub(crate) fn new(path: PathBuf, text: &str, at: Position, message: String, remedy: String) -> Self {
        // Replace control characters, which terminals would interpret, one by one, so that the column remains correct.
        let harmless = |c: char| match c {
            '\t' => ' ',
            c if c.is_control() => '?',
            c => c,
        };
        let line = at.line();
        let source_line = line.and_then(|line| text.lines().nth(line.saturating_sub(1))).unwrap_or_default();
        ScriptError {
            path,
            line,
            column: at.position(),
            source_line: source_line.chars().take(LINE_LIMIT).map(harmless).collect(),
            message: mapper_core::shorten_numbers(&message)
                .chars()
                .take(MESSAGE_LIMIT)
                .map(|c| if c == '\n' { c } else { harmless(c) })
                .collect(),
            remedy,
            called_from: Vec::new(),
        }
    }

    pub(crate) fn from_parse_error(path: PathBuf, text: &str, error: &ParseError) -> Self {
        let message = format!("the sequence script cannot be read: {}", error.err_type());
        Self::new(path, text, error.position(), message, String::new())
    }

    pub(crate) fn from_run_error(path: PathBuf, text: &str, error: EvalAltResult) -> Self {
        let mut called_from = Vec::new();
        let mut error = error;
        while let EvalAltResult::ErrorInFunctionCall(_, _, inner, at) = error {
            called_from.extend(at.line());
            error = *inner;
        }
        called_from.reverse();
        let at = error.position();
        let (message, remedy) = message_and_remedy(error);
        let mut script_error = Self::new(path, text, at, message, remedy);
        // For a deep recursion, show the innermost calls only.
        called_from.truncate(5);
        script_error.called_from = called_from;
        script_error
    }
}

/// The error of a refused call. A script may catch it and choose another step.
pub(crate) fn throw(message: String, remedy: &str) -> Box<EvalAltResult> {
    let refusal = Refusal { message, remedy: remedy.to_owned() };
    Box::new(EvalAltResult::ErrorRuntime(Dynamic::from(refusal), Position::NONE))
}

fn message_and_remedy(error: EvalAltResult) -> (String, String) {
    use crate::sandbox::{CALL_DEPTH_LIMIT, OPERATION_LIMIT, ScriptEnd};
    match error {
        EvalAltResult::ErrorRuntime(thrown, _) => thrown_message_and_remedy(thrown),
        EvalAltResult::ErrorTerminated(why, _)
            if why.clone().try_cast() == Some(ScriptEnd::OutOfOperations) =>
        {
            (
                format!("the sequence script took more than {OPERATION_LIMIT} operations and was stopped"),
                "look for an endless loop, or for a loop over all points inside another one".to_owned(),
            )
        }
        EvalAltResult::ErrorTerminated(..) => {
            ("the program ended the sequence script".to_owned(), String::new())
        }
        EvalAltResult::ErrorStackOverflow(_) => (
            format!("functions of the sequence script call each other more than {CALL_DEPTH_LIMIT} deep"),
            "use a loop instead of a function that calls itself".to_owned(),
        ),
        EvalAltResult::ErrorTooManyVariables(_) => (
            "the sequence script has too many variables at once".to_owned(),
            "keep values in an array or a map".to_owned(),
        ),
        EvalAltResult::ErrorDataTooLarge(what, _) => {
            (format!("a value of the sequence script grew too large ({what})"), String::new())
        }
        EvalAltResult::ErrorFunctionNotFound(signature, _) => (
            format!("no function `{signature}` exists for sequence scripts"),
            crate::sandbox::SEE_REFERENCE.to_owned(),
        ),
        other => {
            let mut other = other;
            other.set_position(Position::NONE);
            (other.to_string(), String::new())
        }
    }
}

/// A script may throw any value, or rethrow a refusal.
fn thrown_message_and_remedy(thrown: Dynamic) -> (String, String) {
    match thrown.try_cast_result::<Refusal>() {
        Ok(Refusal { message, remedy }) => (message, remedy),
        Err(thrown) => match thrown.to_string() {
            text if text.is_empty() => ("the sequence script stopped itself".to_owned(), String::new()),
            text => (text, String::new()),
        },
    }
}
