//! `cargo xtask performance`: measures, with peers for comparison if they can be built, and writes docs/validation/performance.md.

use crate::error::Error;
use crate::step::{self, command, output, run, say};
use crate::{files, workspace};
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Number of repetitions of each measurement; the page states the median.
const ROUNDS: usize = 5;
/// Integrations of the twelve transients in one round.
const REPEATS: &str = "100";
const STEADY_TABLE: &str = "crates/physics/tests/reference/steady.csv";
const CAMPAIGN: &str = "campaigns/turbo_a.yaml";

/// Measures everything and writes the page.
pub fn performance() -> Result<(), Error> {
    run(cargo(&["build", "--release", "--locked", "-p", "mapper-cli"]))?;
    run(cargo(&["build", "--release", "--locked", "-p", "mapper-physics", "--example", "transients"]))?;
    let release = workspace::target_dir().join("release");
    // Writing to a String cannot fail, here and below.
    let mut page = String::from(HEAD);
    let _ = writeln!(page, "Machine: {}. {}.\n", machine(), output(command("rustc", &["--version"]))?);
    transients(&mut page, &release.join("examples/transients"))?;
    whole_run(&mut page, &release.join("mapper"))?;
    identification(&mut page)?;
    // Measured manually, because a clean release build takes minutes.
    page.push_str(include_str!("../build_time.md"));
    let path = workspace::root().join("docs/validation/performance.md");
    files::write(&path, &page)?;
    say(&page);
    Ok(())
}

const HEAD: &str = "\
# Performance

Generated; do not edit. The command that measures and makes this page:

```
cargo xtask performance
```

Medians of five rounds; where there is a peer, the two take turns in one run on one machine, and the ratio is what counts.

";

fn cargo(arguments: &[&str]) -> Command {
    command(workspace::cargo(), arguments)
}

fn machine() -> String {
    let cores = std::thread::available_parallelism().map_or(0, usize::from);
    let processor = fs::read_to_string("/proc/cpuinfo").ok().and_then(|text| {
        let line = text.lines().find(|line| line.starts_with("model name"))?;
        Some(line.split(':').nth(1)?.trim().to_owned())
    });
    format!("{}, {cores} cores", processor.unwrap_or_else(|| std::env::consts::ARCH.to_owned()))
}

/// One reference transient: 110 s, outputs at 10 Hz, rtol 1e-6.
fn transients(page: &mut String, ours: &Path) -> Result<(), Error> {
    let peer = peer()?;
    let (mut our_ms, mut peer_ms) = (Vec::new(), Vec::new());
    for _ in 0..ROUNDS {
        our_ms.push(leading_number(&output(command(ours, &[REPEATS]))?));
        if let Some(peer) = &peer {
            peer_ms.push(leading_number(&output(command(peer, &[REPEATS, "1e-6", STEADY_TABLE]))?));
        }
    }
    page.push_str("## One reference transient: 110 s, all outputs at 10 Hz, relative tolerance 1e-6\n\n");
    page.push_str("| | ms |\n|---|---:|\n");
    let ours = median(&mut our_ms);
    let _ = writeln!(page, "| `transients` (Rodas5P, Rust) | {ours:.3} |");
    if peer.is_some() {
        let peer = median(&mut peer_ms);
        let _ = writeln!(page, "| `lab_cvode` (CVODE BDF, C, -O3 -march=native) | {peer:.3} |");
        let _ = writeln!(page, "| ratio | {:.2} |", ours / peer);
    } else {
        page.push_str("| `lab_cvode` (CVODE BDF, C) | not measured: gcc or libsundials-dev is missing |\n");
    }
    let _ = writeln!(
        page,
        "\n`cargo run --release --locked -p mapper-physics --example transients -- {REPEATS}`; the peer is in `benches/peers`.\n"
    );
    Ok(())
}

/// Compiles the peer; `None` if its tools are missing.
fn peer() -> Result<Option<PathBuf>, Error> {
    let folder = workspace::target_dir().join("peers");
    fs::create_dir_all(&folder).map_err(files::at(&folder))?;
    let binary = folder.join("lab_cvode");
    let binary_text = binary.to_string_lossy().into_owned();
    let libraries = [
        "-lsundials_cvode",
        "-lsundials_nvecserial",
        "-lsundials_sunmatrixdense",
        "-lsundials_sunlinsoldense",
        "-lm",
    ];
    let source = ["-O3", "-march=native", "benches/peers/lab_cvode.c", "-o", &binary_text];
    let built = step::succeeds("gcc", &[&source[..], &libraries[..]].concat());
    Ok(built.then_some(binary))
}

/// The whole job on the shipped campaign.
fn whole_run(page: &mut String, mapper: &Path) -> Result<(), Error> {
    let out = workspace::target_dir().join("performance-runs");
    let (mut seconds, mut megabytes) = (Vec::new(), Vec::new());
    for _ in 0..ROUNDS {
        let mut run = command(mapper, &["run", CAMPAIGN, "--out", &out.to_string_lossy()]);
        run.stdout(Stdio::null()).stderr(Stdio::null());
        let (took, peak_kib) = watched(run)?;
        seconds.push(took.as_secs_f64());
        megabytes.push(peak_kib as f64 * 1024.0 / 1e6);
    }
    files::remove(&out)?;
    let _ = writeln!(
        page,
        "## The whole job: `mapper run {CAMPAIGN}`\n\n48 points, 9 repeats and the first point again, 1 h 25 min of the rig's time at 10 Hz, soak \
         included: plan, run, record, zero, identify (`joint`), map, report.\n\n| | |\n|---|---:|\n| wall | {:.2} s |\n| peak memory | {:.0} MB |\n",
        median(&mut seconds),
        median(&mut megabytes),
    );
    Ok(())
}

/// Wall time and peak resident memory (KiB; 0 if the system does not report it) of a command.
fn watched(mut command: Command) -> Result<(Duration, u64), Error> {
    let text = step::line(&command);
    let started = Instant::now();
    let fail = |source| Error::Start { command: text.clone(), source };
    let mut child = command.spawn().map_err(fail)?;
    let status_file = format!("/proc/{}/status", child.id());
    let mut peak_kib = 0;
    let status = loop {
        if let Some(status) = child.try_wait().map_err(fail)? {
            break status;
        }
        let status = fs::read_to_string(&status_file).unwrap_or_default();
        let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kib = line.and_then(|line| line.split_whitespace().next()?.parse().ok()).unwrap_or(0);
        peak_kib = peak_kib.max(kib);
        std::thread::sleep(Duration::from_millis(1));
    };
    let took = started.elapsed();
    if status.success() { Ok((took, peak_kib)) } else { Err(Error::Failed { command: text }) }
}

/// Identification of one step, from divan's own table.
fn identification(page: &mut String) -> Result<(), Error> {
    let table = output(cargo(&["bench", "--quiet", "-p", "mapper-identify", "--bench", "identify"]))?;
    let _ = writeln!(
        page,
        "## Identification of one step of 1000 samples\n\nFit, standard errors, checks and verdict. \
         `cargo bench --locked -p mapper-identify --bench identify`:\n\n```\n{table}\n```"
    );
    Ok(())
}

/// The number that a program's line starts with; NaN if there is none.
fn leading_number(text: &str) -> f64 {
    text.split_whitespace().next().and_then(|word| word.parse().ok()).unwrap_or(f64::NAN)
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
