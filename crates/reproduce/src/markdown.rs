//! The reproduction as a page.

use crate::{FigureResult, Table};
use std::fmt::Write as _;

/// The page, Markdown; pictures are linked as `reproduction/figure_N.svg` beside it. The same results give the same
/// bytes.
pub fn markdown(results: &[FigureResult]) -> String {
    let mut page = String::from(HEAD);
    for result in results {
        // Writing to a string cannot fail.
        let _ = write!(page, "\n## Figure {}: {}\n\n{}\n\n", result.number, result.title, result.method);
        page.push_str("| the paper states | here | |\n|---|---|---|\n");
        for statement in &result.statements {
            let _ = writeln!(page, "| {} | {} | {} |", statement.paper, statement.here, statement.verdict);
        }
        let _ = write!(page, "\n![Figure {}]({})\n\n", result.number, picture_path(result));
        table(&mut page, &result.table);
    }
    page
}

/// Where the page expects a figure's picture, relative to the page.
pub fn picture_path(result: &FigureResult) -> String {
    format!("reproduction/figure_{}.svg", result.number)
}

fn table(page: &mut String, table: &Table) {
    let _ = writeln!(page, "| {} |", table.head.join(" | "));
    let _ = writeln!(page, "|{}", "---:|".repeat(table.head.len()));
    for row in &table.rows {
        let _ = writeln!(page, "| {} |", row.join(" | "));
    }
}

const HEAD: &str = "# The paper's figures, redone

Generated; do not edit. The command that makes this page and its pictures:

```
mapper reproduce --out docs
```

R. D. Burke and others, dynamic identification of thermodynamic parameters for turbocharger compressor models: the
figures made in simulation (5 to 10), and figure 12, redone on the virtual laboratory's nominal model. Its map and air
tables are not printed in the paper and are closed forms here, so numbers agree in kind, not in digits. Each statement
of the paper stands beside what came out: *holds*, *partly* or *differs*. An efficiency error is identified minus model
value, in points (1 point = 0.01); ranges run over the valve openings.

Errata of the paper followed here: eq. 2 lacks T1' on its right side; the nRMSE of the heat-transfer coefficient is 3.2 %
(section 5.1, conclusion 2), not the abstract's 1 %; table 1's \"110000 to 50000\" means target 50 krpm from 110 krpm.
";
