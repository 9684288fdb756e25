//! `mapper gap blind`: the check of the diagnosis on withheld data.

use crate::exit_code::Code;
use crate::failure::Failure;
use crate::gap_arguments::{
    BlindCalibrateArguments, BlindKind, BlindMakeArguments, BlindRunArguments, BlindScoreArguments,
};
use crate::{output, registry};
use indicatif::{ProgressBar, ProgressDrawTarget};
use mapper_blind::calibrate::{Observed, Plan};
use mapper_blind::{BlindError, CaseKind, Draw, MANIFEST_NAME, Manifest, OutsideUse};
use serde_json::json;
use std::io::IsTerminal;
use std::path::Path;
use std::process::{Command, Stdio};

/// Draws, records and seals cases.
pub fn make(arguments: &BlindMakeArguments) -> Result<(), Failure> {
    let campaign = mapper_campaign::load(&arguments.campaign).map_err(Failure::of_campaign)?;
    let outside = if arguments.calibration { OutsideUse::Calibration } else { OutsideUse::Check };
    let draw = Draw {
        kinds: arguments.kinds.iter().map(|kind| kind_of(*kind)).collect(),
        sigma_range: [arguments.least_sigma, arguments.most_sigma],
        ..Draw::new(arguments.seed, arguments.cases, outside)
    };
    let bar = bar(arguments.cases);
    let made = mapper_blind::make(&campaign, &registry::effects(), &draw, &arguments.out, &|done| {
        bar.set_position(done as u64)
    });
    bar.finish_and_clear();
    let made = made.map_err(|error| of_blind(&error))?;
    if arguments.json {
        return output::print_json(&json!({
            "directory": arguments.out,
            "cases": made.manifest.cases,
            "answers_sha256": made.manifest.answers_sha256,
        }));
    }
    output::print(&format!(
        "{} cases in {}\nSHA-256 of the answers: {}\n",
        made.manifest.cases.len(),
        arguments.out.display(),
        made.manifest.answers_sha256,
    ))
}

fn kind_of(kind: BlindKind) -> CaseKind {
    match kind {
        BlindKind::None => CaseKind::None,
        BlindKind::Single => CaseKind::Single,
        BlindKind::Pair => CaseKind::Pair,
        BlindKind::Outside => CaseKind::Outside,
    }
}

/// Diagnoses each recording in a process of its own, as anybody would: `mapper gap diagnose ... --json`.
pub fn run(arguments: &BlindRunArguments) -> Result<(), Failure> {
    let failure = |message: String| Failure::new(Code::Failure, message);
    let manifest = manifest(&arguments.directory)?;
    let program = std::env::current_exe().map_err(|error| failure(error.to_string()))?;
    let bar = bar(manifest.cases.len());
    let mut failed = Vec::new();
    for name in manifest.cases.iter().filter(|name| !name.contains(['/', '\\'])) {
        let of_case = |ending: &str| arguments.directory.join(format!("{name}.{ending}"));
        let diagnosis = of_case("diagnosis.json");
        if !diagnosis.exists() {
            let finished = Command::new(&program)
                .args(["gap", "diagnose"])
                .arg(&arguments.campaign)
                .arg("--recording")
                .arg(of_case("mcap"))
                .arg("--json")
                .stdin(Stdio::null())
                .output()
                .map_err(|error| failure(format!("failed to start {}: {error}", program.display())))?;
            if finished.status.success() {
                output::write_new(&diagnosis, &finished.stdout)?;
            } else {
                let said = String::from_utf8_lossy(&finished.stderr);
                failed.push(format!("{name}: {}", said.lines().last().unwrap_or_default()));
            }
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    if failed.is_empty() {
        return output::print(&format!(
            "{} diagnoses in {}\n",
            manifest.cases.len(),
            arguments.directory.display()
        ));
    }
    Err(failure(format!("{} recordings were not diagnosed:\n{}", failed.len(), failed.join("\n"))))
}

/// Opens the seal and prints the table.
pub fn score(arguments: &BlindScoreArguments) -> Result<(), Failure> {
    let score = mapper_blind::score::score(&arguments.directory).map_err(|error| of_blind(&error))?;
    if arguments.open {
        mapper_blind::score::open_answers(&arguments.directory).map_err(|error| of_blind(&error))?;
    }
    if arguments.json {
        return output::print_json(&score);
    }
    let mut text = String::new();
    for case in &score.cases {
        let list = |ids: &std::collections::BTreeSet<String>| {
            if ids.is_empty() { "-".to_owned() } else { ids.iter().cloned().collect::<Vec<_>>().join(" + ") }
        };
        text += &format!(
            "{}: {} {}{} -> {} {} {}\n",
            case.name,
            case.kind.name(),
            list(&case.causes),
            case.sigma.map_or_else(String::new, |sigma| format!(" ({sigma:.0} sigma)")),
            case.verdict.as_deref().unwrap_or("no diagnosis"),
            list(&case.named),
            if case.right { "ok" } else { "WRONG" },
        );
    }
    text += "\n";
    for (label, value) in score.rows() {
        text += &format!("{label:28}{value}\n");
    }
    text += "\n";
    for row in score.class_rows() {
        for cell in row {
            text += &format!("{cell:>20}");
        }
        text += "\n";
    }
    text += "Brackets are exact 95 % intervals of the share.\n";
    output::print(&text)
}

/// Draws, records and diagnoses cases of its own, and writes the calibration that fits them.
pub fn calibrate(arguments: &BlindCalibrateArguments) -> Result<(), Failure> {
    let campaign = mapper_campaign::load(&arguments.campaign).map_err(Failure::of_campaign)?;
    let plan = Plan { seed: arguments.seed, nulls: arguments.nulls, others: arguments.cases };
    let made_by = format!(
        "mapper gap blind calibrate --campaign {} --seed {} --nulls {} --cases {}",
        arguments.campaign.display(),
        plan.seed,
        plan.nulls,
        plan.others
    );
    let bar = bar(plan.nulls + plan.others);
    let found = mapper_blind::calibrate::calibrate(
        &campaign,
        &registry::effects(),
        &plan,
        made_by,
        &|_: &Observed| bar.inc(1),
    );
    bar.finish_and_clear();
    let (calibration, observed) = found.map_err(|error| of_blind(&error))?;
    let json = |value: serde_json::Result<Vec<u8>>| {
        value.map_err(|error| Failure::new(Code::Failure, error)).map(|mut bytes| {
            bytes.push(b'\n');
            bytes
        })
    };
    output::write_new(&arguments.out, &json(serde_json::to_vec_pretty(&calibration))?)?;
    if let Some(file) = &arguments.observed {
        output::write_new(file, &json(serde_json::to_vec_pretty(&observed))?)?;
    }
    output::print(&format!("calibration from {} diagnoses in {}\n", observed.len(), arguments.out.display()))
}

fn manifest(directory: &Path) -> Result<Manifest, Failure> {
    Manifest::read(&directory.join(MANIFEST_NAME)).map_err(|error| of_blind(&error))
}

fn of_blind(error: &BlindError) -> Failure {
    let code = match error {
        BlindError::Content { .. }
        | BlindError::TooLarge { .. }
        | BlindError::Seal { .. }
        | BlindError::Cases { .. } => Code::BadInput,
        _ => Code::Failure,
    };
    Failure::new(code, error)
}

/// A bar that draws on a terminal alone.
fn bar(length: usize) -> ProgressBar {
    let terminal = std::io::stderr().is_terminal();
    let target = if terminal { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
    ProgressBar::with_draw_target(Some(length as u64), target)
}
