//! Checks beyond the schema: consistency between values of one file, and the files it names. Each element has its
//! own check; here they are called, in the order in which findings are reported.

use crate::checking::{Check, Files};
use crate::elements;
use mapper_yaml::{Notes, Tree};

/// Checks everything that needs more than one value.
pub(crate) fn check(tree: &Tree, files: Files<'_>, notes: &mut Notes) {
    let mut check = Check { tree, files, notes };
    elements::readers::check(&mut check);
    elements::limits::check(&mut check);
    elements::guards::check(&mut check);
    elements::window::check(&mut check);
    elements::timing::check(&mut check);
    elements::repeats::check(&mut check);
    elements::sensors::check(&mut check);
    elements::report::check(&mut check);
    elements::machine::check(&mut check);
    elements::sequence::check(&mut check);
    elements::grid::check(&mut check);
}
