//! The source tree for the rules of the repository: packages, production files, and dependencies between modules.

mod files;
mod modules;
mod parsed;

pub use files::{Package, packages, production_lines};
pub use modules::{Circle, circles, circles_below};
