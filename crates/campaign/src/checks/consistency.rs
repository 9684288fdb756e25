//! Calls the checks of all elements that go beyond the schema, in the order of the report.

use crate::checking::{Check, Files};
use crate::elements;
use mapper_yaml::{Notes, Tree};

/// Checks everything that needs more than one value.
pub(crate) fn check(tree: &Tree, files: Files<'_>, notes: &mut Notes) {
    let mut check = Check { tree, files, notes };
    elements::rig::readers::check(&mut check);
    elements::rig::limits::check(&mut check);
    elements::rig::guards::check(&mut check);
    elements::evaluation::window::check(&mut check);
    elements::points::timing::check(&mut check);
    elements::points::repeats::check(&mut check);
    elements::rig::sensors::check(&mut check);
    elements::output::report::check(&mut check);
    elements::turbocharger::machine::check(&mut check);
    elements::turbocharger::gas::check(&mut check);
    elements::points::sequence::check(&mut check);
    elements::points::grid::check(&mut check);
}
