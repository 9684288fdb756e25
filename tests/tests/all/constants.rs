//! Each number that decides a result is a constant with a comment that states its kind: source, bound, calibration or judgement.

use xtask::constants::violations;

#[test]
fn numbers_that_decide_results_are_constants_that_say_where_they_come_from() {
    let violations = violations(&mapper_tests::repository()).unwrap();
    assert!(
        violations.is_empty(),
        "give each literal a named constant, and each constant its kind (CONTRIBUTING.md, Numbers):\n{}",
        violations.join("\n")
    );
}
