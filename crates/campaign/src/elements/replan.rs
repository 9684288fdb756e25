//! `replan:`

use crate::checking::Check;
use mapper_core::VisitOrder;
use mapper_yaml::FindingKind;
use mapper_yaml::steps;

/// What is planned again needs a plan, and a method that says what is known so far.
pub(crate) fn check(check: &mut Check<'_>) {
    let path = steps!["replan"];
    if check.text(&path) != Some("after_each_step") {
        return;
    }
    let method = check.text(&steps!["identification", "method"]);
    if let Some(other) = method.filter(|method| *method != "joint") {
        let message =
            format!("what the steps so far have told is what `joint` knows, and the method is `{other}`");
        let remedy = "write `identification.method: joint`, or `replan: off`";
        check.note(FindingKind::Conflict, &path, message, remedy);
    } else if check.get(&steps!["sequence"]).is_some() {
        let message = "a sequence script says itself which step comes next".to_owned();
        check.note(FindingKind::Conflict, &path, message, "leave `replan` or `sequence` out");
    } else if check.text(&steps!["order"]) == Some(VisitOrder::Listed.name()) {
        let message = "`order: listed` keeps the order of the grid, and `replan` would change it".to_owned();
        check.note(FindingKind::Conflict, &path, message, "write another order, or `replan: off`");
    }
}
