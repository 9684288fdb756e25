//! What a driver says to people who start it by hand.

use crate::Open;
use std::io::{IsTerminal, Write};
use std::process::ExitCode;

/// Who a driver is.
#[derive(Debug, Clone, Copy)]
pub struct About {
    /// Name in campaigns; the file name of the program is `mapper-backend-NAME`.
    pub name: &'static str,
    /// Version of the driver.
    pub version: &'static str,
    /// What it is, in a sentence.
    pub summary: &'static str,
    /// Where its settings are documented.
    pub settings: &'static str,
}

/// Where a driver listens that somebody has started, docs/protocol.md.
pub const SOCKET: &str = "--socket";
/// Wrong arguments, as everywhere.
const WRONG_ARGUMENTS: u8 = 2;

impl About {
    /// Serves a host as [`serve`](crate::serve), with `--socket PATH` those that come there, or says to people what this is: `mapper` starts
    /// drivers without arguments, with pipes.
    pub fn serve(self, open: impl Open + 'static) -> ExitCode {
        let Some(argument) = std::env::args_os().nth(1) else {
            if std::io::stdin().is_terminal() {
                // A terminal speaks no protocol: this would wait in silence.
                say(&mut std::io::stderr(), &self.help());
                return ExitCode::from(WRONG_ARGUMENTS);
            }
            return crate::serve(self.name, self.version, open);
        };
        #[cfg(unix)]
        if argument == SOCKET {
            let mut more = std::env::args_os().skip(2);
            if let (Some(path), None) = (more.next(), more.next()) {
                return crate::serve_at(path.as_ref(), self.name, self.version, open);
            }
        }
        match argument.to_str() {
            Some("--help" | "-h" | "help") => say(&mut std::io::stdout(), &self.help()),
            Some("--version" | "-V") => say(&mut std::io::stdout(), &self.title()),
            _ => {
                let words = format!(
                    "error: mapper-backend-{} takes no argument `{}`\n\n{}",
                    self.name,
                    argument.display(),
                    self.help()
                );
                say(&mut std::io::stderr(), &words);
                return ExitCode::from(WRONG_ARGUMENTS);
            }
        }
        ExitCode::SUCCESS
    }

    fn title(self) -> String {
        format!("mapper-backend-{} {}", self.name, self.version)
    }

    fn help(self) -> String {
        let About { name, summary, settings, .. } = self;
        format!(
            "{}\n{summary}\n\n\
             This is a driver: `mapper` starts it by itself where a campaign says `backend: {{{name}: ...}}`, and talks to it over\n\
             standard input and output. There is nothing to start by hand. It has to stand beside `mapper` or on PATH:\n\
             `mapper backend list` shows whether it is found.\n\n\
             With --socket it is there before a run and after it: another user, or a service, has started it. `mapper` looks for it at\n\
             `drivers/{name}.socket` below $MAPPER_STATE_DIR or ~/.local/state/mapper.\n\n\
             Settings: {settings}\n\
             To look at those of a campaign: mapper check CAMPAIGN\n\n\
             Options:\n  --socket PATH  Serve the hosts that come to this socket, one after the other, until a signal ends it\n  \
             -h, --help     Print this\n  -V, --version  Print the version",
            self.title()
        )
    }
}

/// Where nobody reads, nobody is told.
fn say(out: &mut impl Write, words: &str) {
    let _ = writeln!(out, "{words}");
}
