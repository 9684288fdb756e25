//! When output is coloured.

/// As written on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ColourChoice {
    /// On a terminal only, unless `NO_COLOR` is set (no-color.org).
    #[default]
    Auto,
    /// Always.
    Always,
    /// Never.
    Never,
}

/// Whether a terminal understands escape sequences, by the environment variable `TERM`: `dumb` is a printer, or an editor's shell.
pub fn understands_escapes(term: Option<&std::ffi::OsStr>) -> bool {
    term.is_none_or(|term| term != "dumb")
}

/// Whether the output is coloured. `no_color`: the environment variable of that name.
pub fn is_coloured(choice: ColourChoice, to_terminal: bool, no_color: Option<&std::ffi::OsStr>) -> bool {
    match choice {
        ColourChoice::Always => true,
        ColourChoice::Never => false,
        ColourChoice::Auto => to_terminal && no_color.is_none_or(std::ffi::OsStr::is_empty),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dumb_terminal_gets_no_escapes() {
        assert!(!understands_escapes(Some(std::ffi::OsStr::new("dumb"))));
        assert!(understands_escapes(Some(std::ffi::OsStr::new("xterm-256color"))));
        assert!(understands_escapes(None));
    }

    #[test]
    fn what_was_asked_for_outranks_the_environment_and_an_empty_no_color_is_none() {
        let set = Some(std::ffi::OsStr::new("1"));
        assert!(is_coloured(ColourChoice::Always, false, set));
        assert!(!is_coloured(ColourChoice::Never, true, None));
        assert!(is_coloured(ColourChoice::Auto, true, None));
        assert!(!is_coloured(ColourChoice::Auto, true, set));
        assert!(is_coloured(ColourChoice::Auto, true, Some(std::ffi::OsStr::new(""))));
        assert!(!is_coloured(ColourChoice::Auto, false, None));
    }
}
