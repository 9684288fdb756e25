//! `order:` and what goes with it: `required_sigma_eta:`, by which the dwell of each step is chosen, and `gradient_share:`. The
//! orders themselves stand in [`mapper_core::VisitOrder`].

use crate::checking::Check;
use mapper_core::VisitOrder;
use mapper_yaml::FindingKind;
use mapper_yaml::steps;

/// An order that counts on the method needs one, and the shortest campaign an error to reach.
pub(crate) fn check(check: &mut Check<'_>) {
    let path = steps!["order"];
    let Some(order) = check.text(&path) else { return };
    if order == VisitOrder::Time.name() && check.get(&steps!["required_sigma_eta"]).is_none() {
        let message = "`order: time` needs the error that it has to reach".to_owned();
        check.note(FindingKind::MissingKey, &path, message, "add e.g. `required_sigma_eta: 1 %`");
    }
    let share = steps!["gradient_share"];
    if order != VisitOrder::Information.name() && check.get(&share).is_some() {
        let message = format!("`gradient_share` holds for `order: information`, and the order is `{order}`");
        check.note(
            FindingKind::Conflict,
            &share,
            message,
            "write `order: information`, or leave the share out",
        );
    }
    let steady = check.text(&steps!["identification", "method"]) == Some("steady");
    let counts_on_method = [VisitOrder::Information, VisitOrder::Time, VisitOrder::Best]
        .into_iter()
        .any(|needs| needs.name() == order);
    if steady && counts_on_method {
        let message = format!(
            "`{order}` orders by the predicted result of the method, and `steady` has none for a step that still moves"
        );
        let remedy = "write `identification.method: joint`, or another order";
        check.note(FindingKind::Conflict, &path, message, remedy);
    }
}
