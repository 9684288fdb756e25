//! The documentation of the functions of a script, from the same table that registers them.

use mapper_report::{Table, markdown_table};
use mapper_sequence::functions;

/// The page, Markdown.
pub fn sequence_page() -> String {
    let mut text = HEAD.to_owned();
    for functions in functions().chunk_by(|one, next| one.group == next.group) {
        let Some(first) = functions.first() else { continue };
        let rows = functions.iter().map(|entry| [format!("`{}`", entry.signature), entry.doc.to_owned()]);
        let table = Table::new(["", ""]).all_texts().rows(rows);
        text.push_str(&format!("\n## {}\n\n{}", first.group, markdown_table(&table)));
    }
    text
}

const HEAD: &str = "\
# Sequences

<!-- Generated from the functions themselves by `cargo xtask docs`; do not edit. -->

`sequence: name.rhai` in a campaign hands the order of the steps to a script in [rhai](https://rhai.rs/book). The path
starts from the campaign's directory. The script sees the campaign's grid and the results of the steps so far, and
yields steps; `order(grid())` asks the planner.

    for p in order(grid()) {
        let r = jump(p);
        let tries = 0;
        while r.step > 1 && r.sigma_eta > 0.005 && tries < 3 {
            r = repeat(r.step);
            tries += 1;
        }
    }

`mapper plan` rehearses the script on the virtual lab of the nominal machine and prints the forecast plan: an adaptive
script may take another path on the rig. `mapper run` rehearses it first and then runs it; a script that fails in the
rehearsal never touches the rig.

- Every step is checked before it leaves the script: shaft speed, valve range, P3, T2, T3 and surge margin within the
  campaign's limits. A refused step is an error at the script's line; `try { .. } catch { .. }` may choose another. The
  guards of the run watch as they do for any plan.
- Speeds, times and rates are texts with units, as in the campaign: `\"110 krpm\"`, `\"120 s\"`, `\"0.02 K/s\"`.
  Computed ones are written `` `${1.1 * p.speed_rpm} rpm` ``.
- A number that is not there is `()`; ask `r.has_eta` before using `r.eta`.
- There are no files, no network, no clock, no modules, no `eval`, `this` or `curry`, and functions do not
  capture variables. Operations
  (5 million), depth of calls (32), length of strings (4096 bytes), arrays (4096 elements, or twice the grid) and maps
  (1024 entries), variables (128), steps (2 000), points that the planner orders (100 at once, or the grid; twice as
  many in total) and time (four hours a step, a day in total) are bounded.
- An error ends the run in its safe state; what was recorded is kept, identified and reported. The steps that were run
  stand in `executed_plan.json` of the run directory.

Examples with their campaigns are in `examples/sequences`.
";
