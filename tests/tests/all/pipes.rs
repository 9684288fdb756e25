//! Output into a pipe: its reader may close it, and it is not a terminal.

use mapper_tests::{CampaignFile, SHORT_GRID, SINGLE_STEP_METHOD, mapper, mapper_command};
use std::io::{BufRead, BufReader};
use std::process::Stdio;

/// Four points: what is printed matters here, not what is searched for.
fn campaign() -> CampaignFile {
    CampaignFile::shipped_with(&[SHORT_GRID, SINGLE_STEP_METHOD].concat())
}

#[test]
fn a_closed_pipe_is_not_an_error() {
    let campaign = campaign();
    let file = campaign.path.to_str().unwrap();
    let commands: [&[&str]; 4] = [&["plan", file], &["plan", file, "--json"], &["schema"], &["check", file]];
    for arguments in commands {
        let mut child =
            mapper_command(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        // Closed before anything is written: a program that fills the pipe meets the same later.
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        let stderr = String::from_utf8_lossy(&output.stderr);
        assert_eq!(stderr, "", "{arguments:?}");
        assert_eq!(output.status.code(), Some(0), "{arguments:?}");
    }
}

#[test]
fn the_first_line_can_be_read_and_the_rest_left() {
    let campaign = campaign();
    // More than a pipe holds, and a page of text.
    let commands: [(&[&str], &str); 2] =
        [(&["schema"], "{"), (&["plan", campaign.path.to_str().unwrap()], "step")];
    for (arguments, word) in commands {
        let mut child =
            mapper_command(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut first = String::new();
        let mut reader = BufReader::with_capacity(16, child.stdout.take().unwrap());
        reader.read_line(&mut first).unwrap();
        drop(reader);
        assert!(first.contains(word), "{first}");
        let output = child.wait_with_output().unwrap();
        assert_eq!((output.status.code(), output.stderr), (Some(0), Vec::new()));
    }
}

#[test]
fn a_pipe_gets_no_colours_and_no_progress() {
    let campaign = campaign();
    let finished = mapper(["plan".as_ref(), campaign.path.as_os_str()]).exits(0);
    assert!(!finished.stdout.contains('\u{1b}') && !finished.stdout.contains('\r'), "{}", finished.stdout);
    assert_eq!(finished.stderr, "");
}
