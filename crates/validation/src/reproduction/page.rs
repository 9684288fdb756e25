//! The reproduction of the paper's figures as a page.

use crate::reproduction::{FigureResult, picture_path};
use mapper_report::{Table, markdown_table};

/// The page, Markdown; it links pictures by [`picture_path`], relative to the page. The same results give the same bytes.
pub fn reproduction_page(results: &[FigureResult]) -> String {
    let figures = results.iter().map(|result| {
        let statements = result.statements.iter();
        let rows = statements.map(|one| [one.paper.clone(), one.here.clone(), one.verdict.to_string()]);
        format!(
            "\n## Figure {}: {}\n\n{}\n\n{}\n![Figure {}]({})\n\n{}",
            result.number,
            result.title,
            result.method,
            markdown_table(&Table::new(["the paper states", "here", ""]).all_texts().rows(rows)),
            result.number,
            picture_path(result),
            markdown_table(
                &Table::new(&result.table.head).all_numbers().rows(result.table.rows.iter().cloned())
            ),
        )
    });
    std::iter::once(HEAD.to_owned()).chain(figures).collect()
}

const HEAD: &str = "# The paper's figures, redone

Generated; do not edit. The command that makes this page and its pictures:

```
mapper reproduce --out docs/validation
```

R. D. Burke and others, dynamic identification of thermodynamic parameters for turbocharger compressor models: the
figures made in simulation (5 to 10), and figures 11 (b) and 12, redone on the virtual laboratory's nominal model. Its
map and air tables are not printed in the paper and are closed forms here, so numbers agree in kind, not in digits. Each
statement of the paper is next to the result here: *holds*, *partly* or *differs*. An efficiency error is identified
minus model value, in points (1 point = 0.01); ranges run over the valve openings.

Errata of the paper followed here: in eq. 2, T1' is missing on the right side; the nRMSE of the heat-transfer coefficient is 3.2 %
(section 5.1, conclusion 2), not the abstract's 1 %; table 1's \"110000 to 50000\" means target 50 krpm from 110 krpm; section 3 exchanges
the changes of c_p and mu: over 26 K, mu changes by 4 to 7 % and c_p by less than 0.5 %. That h then changes by less than 1 % holds with the
exponent 1.13 of Appendix A (-0.2 to +0.3 %), not with the 0.8 of eq. 9 (1.6 to 1.9 %).

Deviations: eq. 11 without its ratio of viscosities; k_bh constant at 47.5 W/(m K), the middle of Appendix A's 45 to 50.
";

/// One figure as JSON.
pub fn figure_json(result: &FigureResult) -> serde_json::Value {
    serde_json::json!({
        "figure": result.number,
        "title": result.title,
        "picture": picture_path(result),
        "statements": result.statements.iter().map(|statement| serde_json::json!({
            "paper": statement.paper,
            "here": statement.here,
            "verdict": statement.verdict.to_string(),
        })).collect::<Vec<_>>(),
        "head": result.table.head,
        "rows": result.table.rows,
    })
}
