//! `mapper reproduce`: the paper's figures on the nominal model.

use crate::arguments::ReproduceArguments;
use crate::exit_code::Code;
use crate::failure::Failure;
use crate::output;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use mapper_reproduce::{FIGURES, FigureResult, picture_path};
use serde_json::json;
use std::io::IsTerminal;
use std::path::Path;

/// Makes the page and its pictures, and says in a line per statement what came out.
pub fn reproduce(arguments: &ReproduceArguments) -> Result<(), Failure> {
    let bar = ProgressBar::with_draw_target(
        Some(FIGURES.len() as u64),
        if std::io::stderr().is_terminal() {
            ProgressDrawTarget::stderr()
        } else {
            ProgressDrawTarget::hidden()
        },
    );
    if let Ok(style) = ProgressStyle::with_template("{msg:12} [{wide_bar}] {pos}/{len} figures") {
        bar.set_style(style.progress_chars("=> "));
    }
    let results = mapper_reproduce::reproduce(|number| {
        bar.set_message(format!("figure {number}"));
        bar.inc(1);
    })
    .map_err(|error| Failure::new(Code::Failure, error))?;
    bar.finish_and_clear();
    for result in &results {
        write(&arguments.out.join(picture_path(result)), result.svg.as_bytes())?;
    }
    let page = arguments.out.join("reproduction.md");
    write(&page, mapper_reproduce::markdown(&results).as_bytes())?;
    if arguments.json {
        return output::print_json(&json!({
            "page": page,
            "figures": results.iter().map(figure_json).collect::<Vec<_>>(),
        }));
    }
    let mut text = String::new();
    for result in &results {
        text.push_str(&format!("Figure {}: {}\n", result.number, result.title));
        for statement in &result.statements {
            text.push_str(&format!(
                "  {:8} {}\n           {}\n",
                statement.verdict.to_string(),
                statement.paper,
                statement.here
            ));
        }
    }
    output::print(&format!("{text}\n{}\n", page.display()))
}

fn figure_json(result: &FigureResult) -> serde_json::Value {
    json!({
        "figure": result.number,
        "title": result.title,
        "picture": picture_path(result),
        "statements": result.statements.iter().map(|statement| json!({
            "paper": statement.paper,
            "here": statement.here,
            "verdict": statement.verdict.to_string(),
        })).collect::<Vec<_>>(),
        "head": result.table.head,
        "rows": result.table.rows,
    })
}

/// Writes a file of the reproduction; one of the same name is replaced, it is made of nothing but this program.
fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    path.parent()
        .map_or(Ok(()), std::fs::create_dir_all)
        .and_then(|()| std::fs::write(path, bytes))
        .map_err(|error| Failure::new(Code::Failure, format!("failed to write {}: {error}", path.display())))
}
