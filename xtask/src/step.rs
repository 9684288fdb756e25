//! Runs programs as named steps and measures their time.

use crate::error::Error;
use crate::workspace;
use std::ffi::OsStr;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// A finished step: its name, its time, and whether it succeeded.
type Done = (&'static str, Duration, bool);

/// Work of a step.
pub type Work<'a> = Box<dyn FnOnce() -> Result<(), Error> + Send + 'a>;

/// The finished steps, for the summary.
pub struct Steps {
    begun: Instant,
    done: Vec<Done>,
}

impl Default for Steps {
    fn default() -> Self {
        Steps { begun: Instant::now(), done: Vec::new() }
    }
}

/// Runs one step and prints its result.
fn run_step(name: &'static str, work: impl FnOnce() -> Result<(), Error>) -> Done {
    say(&format!("\n==> {name}\n"));
    let started = Instant::now();
    let result = work();
    let took = started.elapsed();
    match &result {
        Ok(()) => say(&format!("==> {name}: ok, {:.1} s\n", took.as_secs_f64())),
        Err(error) => say(&format!("==> {name}: FAILED, {:.1} s: {error}\n", took.as_secs_f64())),
    }
    (name, took, result.is_ok())
}

impl Steps {
    /// Runs one step. Failures are reported at the end, so that one run shows all of them.
    pub fn run(&mut self, name: &'static str, work: impl FnOnce() -> Result<(), Error>) {
        self.done.push(run_step(name, work));
    }

    /// Runs one step that often waits, and other steps in sequence at the same time. Their output is mixed.
    pub fn run_with(
        &mut self,
        name: &'static str,
        work: impl FnOnce() -> Result<(), Error>,
        others: Vec<(&'static str, Work<'_>)>,
    ) {
        let (done, of_others) = std::thread::scope(|scope| {
            let others = scope
                .spawn(|| others.into_iter().map(|(name, work)| run_step(name, work)).collect::<Vec<Done>>());
            (run_step(name, work), others.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
        });
        self.done.push(done);
        self.done.extend(of_others);
    }

    /// Whether every step so far succeeded.
    pub fn all_well(&self) -> bool {
        self.done.iter().all(|(.., well)| *well)
    }

    /// Prints times and results; an error if a step failed.
    pub fn finish(self) -> Result<(), Error> {
        say("\n");
        for (name, took, well) in &self.done {
            let verdict = if *well { "ok" } else { "FAILED" };
            say(&format!("{:>8.1} s  {verdict:6}  {name}\n", took.as_secs_f64()));
        }
        say(&format!("{:>8.1} s  in total\n", self.begun.elapsed().as_secs_f64()));
        let failed: Vec<_> =
            self.done.into_iter().filter(|(.., well)| !well).map(|(name, ..)| name).collect();
        if failed.is_empty() { Ok(()) } else { Err(Error::Steps { failed }) }
    }
}

/// A command in the root of the repository, without the variables that `cargo run` sets for this program: a build script that looks at them
/// would make its library again where a test or the shell builds, and once more in the next step.
pub fn command(program: impl AsRef<OsStr>, arguments: &[&str]) -> Command {
    let mut command = Command::new(program);
    command.args(arguments).current_dir(workspace::root());
    for (name, _) in std::env::vars_os() {
        let text = name.to_string_lossy();
        if ["CARGO_PKG_", "CARGO_MANIFEST_"].iter().any(|start| text.starts_with(start)) {
            command.env_remove(&name);
        }
    }
    command
}

/// Runs a command with its output shown.
pub fn run(mut command: Command) -> Result<(), Error> {
    let text = line(&command);
    say(&format!("$ {text}\n"));
    match command.status() {
        Err(source) => Err(Error::Start { command: text, source }),
        Ok(status) if status.success() => Ok(()),
        Ok(_) => Err(Error::Failed { command: text }),
    }
}

/// Whether a command succeeds; its output is discarded.
pub fn succeeds(program: &str, arguments: &[&str]) -> bool {
    let mut command = command(program, arguments);
    command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command.status().is_ok_and(|status| status.success())
}

/// The output of a command, trimmed.
pub fn output(mut command: Command) -> Result<String, Error> {
    let text = line(&command);
    let output = command.stderr(Stdio::inherit()).output();
    let output = output.map_err(|source| Error::Start { command: text.clone(), source })?;
    if !output.status.success() {
        return Err(Error::Failed { command: text });
    }
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// A command as typed in a shell.
pub fn line(command: &Command) -> String {
    let words = std::iter::once(command.get_program()).chain(command.get_args());
    let words: Vec<_> = words
        .map(|word| word.to_string_lossy())
        .map(
            |word| if word.contains([' ', '(', '"', '\'']) { format!("'{word}'") } else { word.into_owned() },
        )
        .collect();
    words.join(" ")
}

/// Writes to standard output; a closed pipe causes no panic.
pub fn say(text: &str) {
    use std::io::Write;
    let mut out = std::io::stdout().lock();
    let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
}
