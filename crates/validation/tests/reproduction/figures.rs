//! The page as a whole. `cargo xtask docs --check` makes it again and compares its bytes with those of the documentation.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_validation::reproduction::{FIGURES, reproduce};

#[test]
fn every_figure_has_statements_a_table_and_a_picture() {
    let mut numbers = Vec::new();
    let results = reproduce(|number| numbers.push(number.to_owned())).unwrap();
    assert_eq!(numbers, FIGURES);
    for result in &results {
        assert!(!result.statements.is_empty() && !result.table.rows.is_empty(), "figure {}", result.number);
        assert!(result.table.rows.iter().all(|row| row.len() == result.table.head.len()));
        let document = roxmltree::Document::parse(&result.svg).unwrap();
        assert_eq!(document.root_element().tag_name().name(), "svg");
        let cells = result.table.rows.iter().flatten();
        let texts = result.statements.iter().map(|statement| &statement.here);
        assert!(cells.chain(texts).all(|text| !text.contains("NaN") && !text.contains("inf")));
    }
}
