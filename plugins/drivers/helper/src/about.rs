//! Messages for users who start a driver by hand.

use crate::Open;
use std::io::{IsTerminal, Write};
use std::process::ExitCode;

/// Identity of a driver.
#[derive(Debug, Clone, Copy)]
pub struct About {
    /// Name in campaigns; the file name of the program is `mapper-backend-NAME`.
    pub name: &'static str,
    /// Version of the driver.
    pub version: &'static str,
    /// One sentence that describes the driver.
    pub summary: &'static str,
    /// Location of the documentation of its settings.
    pub settings: &'static str,
}

/// The option for the socket of a driver that was started in advance, docs/reference/protocol.md.
pub const SOCKET: &str = "--socket";
/// Exit code of wrong arguments, as usual.
const WRONG_ARGUMENTS: u8 = 2;

impl About {
    /// Serves a host as [`serve`](crate::serve), or with `--socket PATH` the hosts that connect there, or prints help. `mapper` starts
    /// drivers without arguments, with pipes.
    pub fn serve(self, open: impl Open + 'static) -> ExitCode {
        let Some(argument) = std::env::args_os().nth(1) else {
            if std::io::stdin().is_terminal() {
                // A terminal does not send frames, so serving would wait forever.
                print(&mut std::io::stderr(), &self.help());
                return ExitCode::from(WRONG_ARGUMENTS);
            }
            return crate::serve(self.name, self.version, open);
        };
        #[cfg(unix)]
        if argument == SOCKET {
            let mut arguments = std::env::args_os().skip(2);
            if let (Some(path), None) = (arguments.next(), arguments.next()) {
                return crate::serve_at(path.as_ref(), self.name, self.version, open);
            }
        }
        match argument.to_str() {
            Some("--help" | "-h" | "help") => print(&mut std::io::stdout(), &self.help()),
            Some("--version" | "-V") => print(&mut std::io::stdout(), &self.title()),
            _ => {
                let text = format!(
                    "error: mapper-backend-{} takes no argument `{}`\n\n{}",
                    self.name,
                    argument.display(),
                    self.help()
                );
                print(&mut std::io::stderr(), &text);
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
             This is a driver: `mapper` starts it for a campaign with `backend: {{{name}: ...}}` and communicates with it over standard\n\
             input and output; do not start it by hand. It must be in the directory of `mapper` or on PATH: `mapper backend list` shows\n\
             whether it is found.\n\n\
             With --socket it runs before and after a run, started by another user or by a service. `mapper` expects the socket at\n\
             `drivers/{name}.socket` below $MAPPER_STATE_DIR or ~/.local/state/mapper.\n\n\
             Settings: {settings}\n\
             To show those of a campaign: mapper check CAMPAIGN\n\n\
             Options:\n  --socket PATH  Serve the hosts that connect to this socket, one after the other, until a signal ends it\n  \
             -h, --help     Print this\n  -V, --version  Print the version",
            self.title()
        )
    }
}

/// Prints the text; if the stream is closed, it is lost.
fn print(out: &mut impl Write, text: &str) {
    let _ = writeln!(out, "{text}");
}
